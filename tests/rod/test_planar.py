"""Motion in a plane is the spatial motion of loads in that plane, without the numbers that stay zero."""

import numpy as np
import pytest

from magrod_env import Simulation, load_scene

SOFT = load_scene("paper4_pdms_tip_magnet")
TURN = {"xz": (0.0, 0.0, -9.81), "xy": (0.0, 6.0, 0.0)}  # gravity in each plane
FIELD = {"xz": np.array([3e-3, 0.0, 11e-3]), "xy": np.array([-2e-3, -9e-3, 0.0])}
SLOPE = {
    "xz": np.array([[0.2, 0.0, -0.3], [0.0, -0.5, 0.0], [-0.3, 0.0, 0.3]]),
    "xy": np.array([[0.2, 0.1, 0.0], [0.1, -0.5, 0.0], [0.0, 0.0, 0.3]]),
}
CASES = {
    "drag": dict(drag_rate=5.0),
    "every_term": dict(drag_rate=5.0, spin_drag_rate=20.0, internal_damping=1e-4, gradient=True),
    "nodal": dict(drag_rate=5.0, element="nodal"),
}


def run(plane, motion, element="helical", gradient=False, **terms):
    """The simulation after a start in equilibrium, a push and two fields, planar or not."""
    scene = SOFT.replace(gravity=TURN[plane], **terms)
    simulation = Simulation(scene, num_elements=4, element=element, plane=motion, time_step=5e-5)
    simulation.reset(field=0.3 * FIELD[plane])
    rng, shape = np.random.default_rng(2), (1, 5, 3)
    velocities, spins = 0.02 * rng.normal(size=shape), 2.0 * rng.normal(size=shape)
    across = 1 if plane == "xz" else 2
    velocities[..., across] = 0.0
    spins[..., [k for k in range(3) if k != across]] = 0.0
    simulation.set_motion(velocities, spins)
    simulation.advance(0.1, field=FIELD[plane], gradient=SLOPE[plane] if gradient else None)
    simulation.advance(0.1, field=-0.5 * FIELD[plane])
    return simulation


@pytest.mark.parametrize("plane", ["xz", "xy"])
@pytest.mark.parametrize("case", CASES)
def test_planar_motion_equals_spatial_motion(plane, case):
    flat, space = run(plane, plane, **CASES[case]), run(plane, None, **CASES[case])
    assert np.abs(space.tip_position - [SOFT.rod.length, 0, 0]).max() > 1e-3  # it has moved
    np.testing.assert_allclose(flat.positions, space.positions, atol=1e-12)
    np.testing.assert_allclose(flat.velocities, space.velocities, atol=1e-9)
    np.testing.assert_allclose(flat.rotations, space.rotations, atol=1e-10)
    np.testing.assert_allclose(flat.angular_velocities, space.angular_velocities, atol=1e-6)
    np.testing.assert_allclose(flat.linear_momentum(), space.linear_momentum(), atol=1e-12)
    np.testing.assert_allclose(flat.angular_momentum(), space.angular_momentum(), atol=1e-13)
    for part, energy in flat.energies().items():
        np.testing.assert_allclose(energy, space.energies()[part], atol=1e-12, err_msg=part)


@pytest.mark.parametrize("plane", ["xz", "xy"])
def test_numbers_across_the_plane_are_zero(plane):
    flat = run(plane, plane, **CASES["drag"])
    across = 1 if plane == "xz" else 2
    assert np.all(flat.positions[..., across] == 0.0)
    assert np.all(flat.velocities[..., across] == 0.0)
    assert np.all(np.delete(flat.angular_velocities, across, axis=-1) == 0.0)
    np.testing.assert_array_equal(flat.rotations[..., across, across], 1.0)


def test_both_planes_bend_alike():
    """The same loads in either plane, y for z."""
    tips = {}
    for plane, axis in (("xz", 2), ("xy", 1)):
        field, gravity = np.zeros(3), np.zeros(3)
        field[[0, axis]], gravity[axis] = (4e-3, 9e-3), -9.81
        simulation = Simulation(SOFT.replace(drag_rate=5.0, gravity=tuple(gravity)), num_elements=4, plane=plane)
        simulation.advance(0.3, field=field)
        tips[plane] = simulation.tip_position[0][[0, axis]]
    np.testing.assert_array_equal(tips["xz"], tips["xy"])
