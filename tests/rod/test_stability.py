"""The stability bound against the step at which a straight rod's smallest vibrations begin to grow."""

import numpy as np
import pytest
from scipy.linalg import eigh
from term_sets import damped

from magrod_env import Simulation, SimulationDiverged, load_scene, paper_scene

SOFT = load_scene("paper4_pdms_tip_magnet").replace(drag_rate=0.0)
WEIGHTLESS = SOFT.replace(gravity=(0.0, 0.0, 0.0))


def grows(simulation, time_step, num_steps=3000):
    """Whether a vibration of 1e-9 m/s grows by 1000 or more in a run at ``time_step``, whatever the bound says."""
    rng = np.random.default_rng(0)
    snapshot = simulation.state()
    shape = (1, simulation.num_elements + 1, 3)
    velocities, spins = 1e-9 * rng.normal(size=shape), 1e-7 * rng.normal(size=shape)
    if simulation.plane == "xz":
        velocities[..., 1] = spins[..., 0] = spins[..., 2] = 0.0
    simulation.set_motion(velocities, spins)
    simulation.rods.batch.run(num_steps, time_step)
    largest = np.abs(simulation.velocities).max()
    simulation.set_state(snapshot)
    return not largest < 1e-5


def assert_limit_between(simulation, low, high):
    assert not grows(simulation, low)
    assert grows(simulation, high)


@pytest.mark.parametrize("element", ["helical", "nodal"])
@pytest.mark.parametrize("num_elements", [1, 2, 3, 4, 6, 10, 20])
def test_the_bound_is_the_limit_of_the_straight_rod(element, num_elements):
    simulation = Simulation(WEIGHTLESS, num_elements=num_elements, element=element)
    bound = simulation.stable_time_step
    assert_limit_between(simulation, 0.999 * bound, 1.001 * bound)


@pytest.mark.parametrize("name", ["niti_guidewire", "paper6_two_magnets"])
def test_the_bound_is_the_limit_of_other_rods(name):
    scene = load_scene(name).replace(gravity=(0.0, 0.0, 0.0), drag_rate=0.0)
    simulation = Simulation(scene, num_elements=8)
    bound = simulation.stable_time_step
    assert_limit_between(simulation, 0.999 * bound, 1.001 * bound)


def test_the_bound_is_that_of_the_plane_where_motion_stays_in_it():
    simulation = Simulation(WEIGHTLESS, num_elements=6, plane="xz")
    bound = simulation.stable_time_step
    assert_limit_between(simulation, 0.999 * bound, 1.001 * bound)


@pytest.mark.parametrize("damping", [0.0, 1e-6, 1e-3, 1.0])
def test_internal_damping_does_not_shorten_the_step(damping):
    """The bound stays that of the undamped rod, and holds: just below it, nothing grows."""
    simulation = Simulation(damped(WEIGHTLESS.replace(internal_damping=damping)), num_elements=6)
    bound = simulation.stable_time_step
    assert bound == Simulation(WEIGHTLESS, num_elements=6).stable_time_step
    assert not grows(simulation, 0.999 * bound)


@pytest.mark.parametrize("field", [0.1, 1.0, 5.0])
def test_the_bound_in_a_field_holds_and_is_close(field):
    """Along the rod a field stiffens it most; the bound adds its stiffness to the highest mode as a whole."""
    simulation = Simulation(WEIGHTLESS, num_elements=6)
    simulation.rods.batch.set_field(np.array([[field, 0.0, 0.0]]))
    bound = simulation.stable_time_step_in(field)
    assert bound < simulation.stable_time_step
    assert_limit_between(simulation, 0.999 * bound, 1.1 * bound)


def highest_frequency(simulation):
    """Largest angular frequency (rad/s) of straight elements, from their stiffness matrices: axial, torsional, bending.

    Corrected shear stiffness 1/GA* = 1/GA + h^2/(12 EI), lumped masses; degrees of freedom (u), (phi), (w, theta).
    """
    rod, n, h = simulation.scene.rod, simulation.num_elements, simulation.scene.rod.length / simulation.num_elements
    mass, inertia = simulation.node_masses[0, 1:], 0.5 / simulation.rods.motion.compliance[0, 1:]
    pull, flex = np.array([1.0, -1.0]), np.array([0.0, 1.0, 0.0, -1.0])
    slide = np.array([-1.0 / h, -0.5, 1.0 / h, -0.5])
    sheared = 1.0 / (1.0 / rod.shear_stiffness + h**2 / (12.0 * rod.bending_stiffness))
    bent = h * sheared * np.outer(slide, slide) + rod.bending_stiffness / h * np.outer(flex, flex)
    chains = [
        (1, rod.axial_stiffness / h * np.outer(pull, pull), mass),
        (1, rod.torsional_stiffness / h * np.outer(pull, pull), inertia[:, 0]),
        (2, bent, np.column_stack([mass, inertia[:, 1]]).ravel()),
    ]
    squares = []
    for size, element, masses in chains:
        stiffness = np.zeros((size * (n + 1), size * (n + 1)))
        for e in range(n):
            stiffness[size * e : size * (e + 2), size * e : size * (e + 2)] += element
        squares.append(eigh(stiffness[size:, size:], np.diag(masses), eigvals_only=True).max())
    return np.sqrt(max(squares))


@pytest.mark.parametrize("num_elements", [4, 5, 6, 10, 20])
def test_the_step_is_that_of_the_highest_frequency_of_straight_elements(num_elements):
    simulation = Simulation(SOFT, num_elements=num_elements)
    np.testing.assert_allclose(simulation.stable_time_step, 2.0 / highest_frequency(simulation), rtol=1e-7)


@pytest.mark.parametrize(
    ("name", "limit"),
    [("paper1_aluminium_in_plane", 3.07e-7), ("paper2_aluminium_out_of_plane", 1.54e-7)],
)
def test_steps_of_the_paper_lie_beyond_the_limit_of_its_own_element(name, limit):
    record = paper_scene(name)
    simulation = Simulation(record.scene, num_elements=record.num_elements, element="nodal")
    np.testing.assert_allclose(simulation.stable_time_step, limit, rtol=0.02)
    assert record.paper_time_step > simulation.stable_time_step


def test_a_step_beyond_the_bound_is_refused_with_the_bound():
    bound = Simulation(SOFT, num_elements=6).stable_time_step
    Simulation(SOFT, num_elements=6, time_step=bound)
    with pytest.raises(ValueError, match=rf"time_step must be at most {bound:.3g} s.*6 elements") as error:
        Simulation(SOFT, num_elements=6, time_step=1.01 * bound)
    assert "lower it" in str(error.value)


@pytest.mark.parametrize("num_elements", [4, 6, 12])
def test_the_default_step_survives_fields_that_turn_round(num_elements):
    """45 mT, suddenly from a new direction every 0.1 s: the rod whips, bends far and snaps over; numbers stay true."""
    rng = np.random.default_rng(num_elements)
    scene = SOFT.replace(drag_rate=5.0)
    simulation = Simulation(scene, num_elements=num_elements)
    for _ in range(30):
        direction = rng.normal(size=3)
        simulation.advance(0.1, field=45e-3 * direction / np.linalg.norm(direction))
    assert np.isfinite(simulation.positions).all()
    reach = np.linalg.norm(simulation.positions[0], axis=1).max()
    assert reach < 1.02 * scene.rod.length


# ---- the watchdog


def test_an_unstable_run_is_recognised_while_its_numbers_are_finite():
    simulation = Simulation(SOFT, num_elements=6)
    simulation._time_step = 1.3 * simulation.stable_time_step  # past the check
    with pytest.raises(SimulationDiverged, match=r"rod 0 left the stable range by t = .* lower time_step"):
        simulation.advance(2.0)
    assert simulation.time < 2.0
    assert simulation.status[0] > 0


@pytest.mark.parametrize("factor", [1.01, 1.05, 1.2, 2.0])
@pytest.mark.parametrize("element", ["helical", "nodal"])
def test_every_step_beyond_the_bound_is_recognised(factor, element):
    simulation = Simulation(SOFT, num_elements=6, element=element)
    simulation._time_step = factor * simulation.stable_time_step
    with pytest.raises(SimulationDiverged):
        simulation.advance(5.0)


def test_a_strained_step_in_a_field_is_refused_before_it_runs():
    simulation = Simulation(SOFT, num_elements=6)
    simulation.advance(0.01, field=(0.0, 0.0, 80e-3))
    before = simulation.positions
    with pytest.raises(ValueError, match=r"time_step must be at most .* s in a field of 10 T"):
        simulation.advance(0.01, field=(10.0, 0.0, 0.0))
    np.testing.assert_array_equal(simulation.positions, before)
    np.testing.assert_array_equal(simulation.field[0], [0.0, 0.0, 80e-3])  # nor is it the field now
    simulation.advance(0.01)


def test_a_strained_step_after_a_reset_in_a_strong_field_is_refused():
    simulation = Simulation(SOFT.replace(gravity=(0.0, 0.0, 0.0)), num_elements=6)
    with pytest.raises(ValueError, match="time_step must be at most"):
        simulation.reset(field=(100.0, 0.0, 0.0))
        simulation.advance(0.01)


def test_a_strong_field_is_no_matter_without_magnets():
    simulation = Simulation(SOFT.replace(magnets=(), drag_rate=None), num_elements=3)
    simulation.advance(0.01, field=(1e3, 0.0, 0.0))
