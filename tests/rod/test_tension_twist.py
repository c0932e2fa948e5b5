"""Rods that twist while they bend and rods under tension: against the spectral solution, closed forms and symmetry."""

from pathlib import Path

import numpy as np
import pytest
from term_sets import dragged

from magrod_env import Magnet, Scene, Simulation
from rod.beams import slender_rod
from scripts.accuracy import CASES, LOADED, LOADED_LIMITS, follow

REFERENCE = np.load(Path(__file__).parents[1] / "reference" / "reference.npz")
STATIC_ERRORS = {  # mm at the tip by elements, as measured
    "static_twist": {1: 0.0371, 2: 0.00226, 4: 1.4e-4, 8: 8.74e-6, 16: 5.46e-7},
    "static_tilted_magnet": {4: 0.00182, 6: 4.58e-4, 10: 1.02e-4, 20: 2.01e-5},
    "static_axial_magnet": {4: 0.00173, 6: 3.89e-4, 10: 8.63e-5, 20: 1.78e-5},
    "static_two_tilted_magnets": {4: 0.0342, 6: 0.00635, 10: 3.15e-4, 20: 7.58e-5},
    "static_pull_slight": {4: 1.91e-5, 6: 1.72e-5, 10: 9.63e-6},
    "static_pull_straight": {1: 0.0, 4: 0.0, 20: 0.0},
    "static_pull_aside": {4: 0.0468, 6: 0.0344, 10: 0.0344, 20: 0.0233},
    "static_sagging": {4: 3.01, 6: 1.36, 10: 0.387, 20: 0.0367},
    "static_hanging": {4: 0.0082, 6: 0.00364, 10: 0.00131, 20: 3.28e-4},
    "static_wire_with_weight": {4: 3.3e-4, 6: 3.3e-4, 10: 2.6e-4, 20: 1.4e-4},
}
MOVING_ERRORS = {  # mm, RMS of the tip by elements, as measured
    "tilted_rotating_field": {4: 5.91e-4, 6: 6.51e-5, 10: 4.04e-6},
    "tilted_swing": {4: 0.214, 6: 0.0622, 10: 0.0175},
}
ROUNDING = 2e-7  # mm
STEEL = slender_rod(youngs_modulus=1e7)


@pytest.mark.parametrize(("case", "elements"), [(case, n) for case, found in STATIC_ERRORS.items() for n in found])
def test_equilibria_under_twist_and_tension_follow_the_independent_reference(case, elements):
    """Within 1.2 of what was measured and rounding; the acceptance figures of `scripts.accuracy` lie above."""
    loaded = LOADED[case]
    found = Simulation(loaded.scene, num_elements=elements).equilibrium(loaded.field, loaded.gradient)
    assert found.reached
    gap = 1e3 * np.linalg.norm(found.tip_position - REFERENCE[f"{case}_tip"])
    assert gap <= min(1.2 * STATIC_ERRORS[case][elements] + ROUNDING, LOADED_LIMITS[case][elements])


@pytest.mark.parametrize(("case", "elements"), [(case, n) for case, found in MOVING_ERRORS.items() for n in found])
def test_moving_rods_with_a_tilted_magnet_follow_the_independent_reference(case, elements):
    """At the default step, whose error in time is the smaller one."""
    scene, field = CASES[case]
    found = follow(Simulation(dragged(scene), num_elements=elements), field, REFERENCE[f"{case}_time"])
    gap = 1e3 * np.linalg.norm(found[:, 0] - REFERENCE[f"{case}_tip"], axis=1)
    assert np.sqrt(np.mean(gap**2)) <= 1.3 * MOVING_ERRORS[case][elements]


@pytest.mark.parametrize("elements", [1, 3, 6])
@pytest.mark.parametrize("share", [0.1, 1.0, 10.0, 100.0])
def test_a_weight_stretches_a_hanging_rod_and_does_not_tilt_its_sections(share, elements):
    """Force up to a hundred times 12 EI / h^2, what an element's sections resist tilting with when nothing pulls."""
    force = share * 12 * STEEL.bending_stiffness * elements**2 / STEEL.length**2
    magnet = Magnet.dipole(position=STEEL.length, moment=1e-3, mass=force / 9.81)
    scene = Scene(rod=STEEL, magnets=(magnet,), gravity=(9.81, 0.0, 0.0))
    found = Simulation(scene, num_elements=elements).equilibrium()
    own = STEEL.mass * 9.81 / 2
    exact = STEEL.length * (1 + (force + own) / STEEL.axial_stiffness)
    assert found.reached
    np.testing.assert_allclose(found.tip_position[1:], 0.0, atol=1e-12)
    error = STEEL.length * own / STEEL.axial_stiffness / elements**2  # of masses at the nodes
    np.testing.assert_allclose(found.tip_position[0], exact, atol=error + 1e-12)


@pytest.mark.parametrize("angle", [0.5, 1.9, np.pi])
def test_a_rod_turned_about_its_axis_with_its_loads_bends_alike(angle):
    """A round section has no preferred direction; to what Newton leaves."""
    cos, sin = np.cos(angle), np.sin(angle)
    turn = np.array([[1.0, 0.0, 0.0], [0.0, cos, -sin], [0.0, sin, cos]])
    loaded = LOADED["static_twist"]
    (magnet,) = loaded.scene.magnets
    turned = Magnet.dipole(
        position=magnet.position, moment=magnet.moment, direction=tuple(turn @ np.array(magnet.direction))
    )
    before = Simulation(loaded.scene, num_elements=2).equilibrium(loaded.field)
    after = Simulation(loaded.scene.replace(magnets=(turned,)), num_elements=2).equilibrium(turn @ loaded.field)
    np.testing.assert_allclose(after.tip_position, turn @ before.tip_position, atol=1e-9 * loaded.scene.rod.length)
