"""Warnings of too few elements, and what a rising field costs."""

import warnings

import numpy as np
import pytest
from term_sets import damped, dragged

from magrod_env import CoarseWarning, Simulation, load_scene
from magrod_env.magnetics import FieldCourse

CIRCLE = dragged(load_scene("paper5_circle").replace(gravity=None))
SUDDEN = (0.0, 0.0, 10e-3)


def swing(num_elements, expect_warning):
    """Tip over 0.4 s in a sudden field, m, (40, 3)."""
    simulation = Simulation(CIRCLE, num_elements=num_elements)
    tips = []
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        for _ in range(40):
            simulation.advance(0.01, SUDDEN)
            tips.append(simulation.tip_position[0])
    assert [warning.category for warning in caught] == [CoarseWarning] * expect_warning
    assert simulation.coarse is expect_warning
    return np.array(tips)


def test_the_warning_comes_once_and_where_the_tip_is_off_by_more_than_a_twentieth_of_its_swing():
    truth = swing(16, False)
    size = np.linalg.norm(truth - truth[0], axis=1).max()
    errors = {n: np.sqrt(np.mean(np.sum((swing(n, n < 3) - truth) ** 2, axis=1))) / size for n in (1, 8)}
    assert errors[1] > 0.05 > errors[8]


def test_the_warning_says_how_many_elements_are_enough():
    simulation = Simulation(CIRCLE, num_elements=2, expected_field=40e-3)
    with pytest.warns(
        CoarseWarning, match=r"2 elements may be too few for weight and a field of 0\.04 T: use (\d+)"
    ) as caught:
        simulation.advance(1e-3, field=(0.0, 0.0, 40e-3))
    enough = int(str(caught[0].message).split("use ")[1].split()[0])
    better = Simulation(CIRCLE, num_elements=enough, expected_field=40e-3)
    better.advance(1e-3, field=(0.0, 0.0, 40e-3))
    assert not better.coarse


def test_a_stronger_field_makes_a_rod_coarse_until_the_reset():
    simulation = Simulation(CIRCLE, num_elements=4, on_failure="report")
    simulation.advance(1e-3, field=(0.0, 0.0, 1e-3))
    assert not simulation.coarse
    with warnings.catch_warnings():
        warnings.simplefilter("error")  # who asks for reports reads them
        simulation.advance(1e-3, field=(0.0, 0.0, 45e-3))
    assert simulation.coarse
    simulation.reset()
    assert not simulation.coarse


def test_elements_that_a_tolerance_chose_are_doubted_in_stronger_fields_only():
    scene = dragged(load_scene("paper4_pdms_tip_magnet"))
    simulation = Simulation(scene, tolerance=3e-3, expected_field=5e-3, on_failure="report")
    by_hand = Simulation(scene, num_elements=simulation.num_elements, on_failure="report")
    for each in (simulation, by_hand):
        each.advance(1e-3, field=(0.0, 0.0, 5e-3))
    assert by_hand.coarse and not simulation.coarse
    simulation.advance(1e-3, field=(0.0, 0.0, 40e-3))
    assert simulation.coarse


def test_the_papers_element_is_told_to_lock_by_the_factor_of_the_closed_form():
    simulation = Simulation(dragged(load_scene("paper4_pdms_tip_magnet")), num_elements=10, element="nodal")
    rod = simulation.scene.rod
    shear = rod.youngs_modulus / 3.0 * np.pi * rod.width**2 / 4.0
    bending = rod.youngs_modulus * np.pi * rod.width**4 / 64.0
    factor = 1.0 + shear * (rod.length / 10) ** 2 / (4.0 * bending)  # 4.06 at the settings of Table 6
    with pytest.warns(CoarseWarning, match=f"lock: the rod bends as if EI were {factor:.3g} times"):
        simulation.advance(1e-3)
    shaped = Simulation(simulation.scene, num_elements=10, element="nodal", frequency_shaping=True)
    shaped.advance(1e-3)
    assert not shaped.coarse


@pytest.mark.parametrize("share", [None, 0.9])
def test_a_rising_field_costs_few_bounds(share, monkeypatch):
    course = FieldCourse(times=[0.0, 0.2], fields=[[0.0, 0.0, 0.0], [0.0, 0.0, 14e-3]])
    simulation = Simulation(CIRCLE, num_elements=6)
    if share is not None:
        simulation.time_step = share * simulation.stable_time_step_in(14e-3)
    asked = []
    bound = simulation.stable_time_step_in
    monkeypatch.setattr(simulation, "stable_time_step_in", lambda field: asked.append(field) or bound(field))
    for _ in range(40):
        simulation.advance(5e-3, course)
    assert 0 < len(asked) <= 24


def test_a_longer_step_is_checked_again():
    simulation = Simulation(CIRCLE, num_elements=6)
    simulation.advance(1e-3, field=SUDDEN)
    simulation.time_step = simulation.stable_time_step  # of the rod without field
    with pytest.raises(ValueError, match="time_step must be at most"):
        simulation.advance(1e-3, field=SUDDEN)


@pytest.mark.parametrize(("num_elements", "damping"), [(2, 1e-3), (3, 3e-3)])
def test_a_thin_damped_rod_that_float32_holds_up_is_told_of(num_elements, damping):
    """It stops millimetres from where float64 has it: 8.9 mm of deflection, 10 to 20 % of it off."""
    wire = damped(load_scene("niti_guidewire").replace(internal_damping=damping))
    tips = []
    for precision in ("float64", "float32"):
        simulation = Simulation(wire, num_elements=num_elements, precision=precision, on_failure="report")
        simulation.advance(0.1, field=(0.0, 0.0, 5e-3))
        tips.append(simulation.tip_position[0])
    swing = np.linalg.norm(tips[0] - (wire.rod.length, 0.0, 0.0))
    assert np.linalg.norm(tips[1] - tips[0]) > 0.05 * swing
    with pytest.warns(CoarseWarning, match="float32 rounds away slow motion"):
        Simulation(wire, num_elements=num_elements, precision="float32").advance(1e-4, field=(0.0, 0.0, 5e-3))


def test_a_soft_damped_rod_of_an_environment_is_well_in_float32():
    soft = damped(load_scene("paper5_circle", modulus="effective").replace(drag_rate=5.0, internal_damping=3e-3))
    tips = []
    for precision in ("float64", "float32"):
        simulation = Simulation(soft, precision=precision)
        simulation.advance(0.2, field=(0.0, 5e-3, 0.0))
        tips.append(simulation.tip_position[0])
    np.testing.assert_allclose(tips[1], tips[0], atol=1e-5)
    assert not simulation.coarse


def test_implicit_steps_that_are_too_long_for_a_sudden_field_are_told_of():
    """Against explicit steps of the same rod: the default step loses the second vibration, a short one does not."""
    rod, samples = CIRCLE.replace(drag_rate=1.0), 40
    tips = {}
    for integrator, time_step in (("explicit", None), ("implicit", None), ("implicit", 4e-4)):
        simulation = Simulation(rod, num_elements=8, integrator=integrator, time_step=time_step, on_failure="report")
        tips[integrator, time_step] = path = []
        for _ in range(samples):
            simulation.advance(0.02, field=SUDDEN)
            path.append(simulation.tip_position[0])
        assert simulation.coarse == (integrator == "implicit" and time_step is None)
    exact = np.array(tips["explicit", None])
    swing = np.linalg.norm(exact - (rod.rod.length, 0.0, 0.0), axis=1).max()
    errors = [np.sqrt(np.mean(np.sum((np.array(tips["implicit", dt]) - exact) ** 2, axis=1))) for dt in (None, 4e-4)]
    assert errors[0] > 0.03 * swing and errors[1] < 0.3 * errors[0]


def test_implicit_steps_are_not_doubted_in_a_field_that_rises_slowly():
    simulation = Simulation(CIRCLE.replace(drag_rate=5.0), num_elements=8, integrator="implicit")
    course = FieldCourse(times=np.linspace(0.0, 2.0, 41), fields=np.outer(np.linspace(0.0, 1.0, 41), SUDDEN))
    simulation.advance(2.0, field=course)
    assert not simulation.coarse
