"""A damping of every node's own, along each world axis: closed forms, uniform drag, energy, batches and the plane."""

import numpy as np
import pytest
from term_sets import damped as all_terms
from term_sets import dragged

from magrod_env import Simulation, load_scene
from magrod_env.rod.layout import AXIAL, BENDING, ELEMENT_ROWS, SHEAR, SWAY, TORSION

SOFT = dragged(load_scene("paper4_pdms_tip_magnet"))
WEIGHTLESS = SOFT.replace(gravity=(0.0, 0.0, 0.0))
FIELD = np.array([2e-3, 0.0, 8e-3])


def damped(scene, damping, **options):
    """A simulation whose nodes have the damping (num_rods or 1, num_nodes, 3), kg/s."""
    simulation = Simulation(scene, **{"num_elements": 4, "time_step": 1e-4, **options})
    simulation.rods.batch.use_node_damping()
    shape = (simulation.num_rods, simulation.num_elements + 1, 3)
    simulation.rods.batch.set_node_damping(np.broadcast_to(damping, shape))
    return simulation


def shaken(simulation, across=None):
    rng = np.random.default_rng(3)
    velocities = 0.05 * rng.normal(size=(1, simulation.num_elements + 1, 3))
    if across is not None:
        velocities[..., across] = 0.0
    simulation.set_motion(np.repeat(velocities, simulation.num_rods, axis=0))
    return simulation


@pytest.mark.parametrize("drag_rate", [0.0, 3.0])
def test_a_free_mass_slows_exponentially_along_each_axis(drag_rate):
    """One node without elasticity: v_n = r^n v_0 and p_n = p_0 + dt v_0 (1/2 + r + ... + r^(n-1) + r^n/2)."""
    rates = np.array([2.0, -1.0, 40.0])  # 1/s
    simulation = damped(WEIGHTLESS.replace(drag_rate=drag_rate), 0.0, num_elements=1)
    simulation.on_failure = "report"  # without elasticity it stretches
    for stiffness in (AXIAL, SHEAR, BENDING, TORSION, SWAY):
        simulation.rods.batch.rows[:, simulation.rods.batch.layout.elements + stiffness] = 0.0
    simulation.rods.batch.set_node_damping(simulation.node_masses[..., None] * rates)
    simulation.set_motion(np.full((1, 2, 3), 0.1))
    start, steps, dt = simulation.tip_position[0], 700, simulation.time_step
    simulation.advance(steps * dt)
    half = 0.5 * dt * (rates + drag_rate)
    ratio = (1 - half) / (1 + half)
    np.testing.assert_allclose(simulation.velocities[0, 1], 0.1 * ratio**steps, rtol=1e-11)
    powers = ratio ** np.arange(steps + 1)[:, None]
    travel = 0.1 * dt * (powers.sum(axis=0) - 0.5 * powers[0] - 0.5 * powers[-1])
    np.testing.assert_allclose(simulation.tip_position[0] - start, travel, rtol=1e-10)
    np.testing.assert_allclose(ratio**steps, np.exp(-(rates + drag_rate) * steps * dt), rtol=1e-3)


@pytest.mark.parametrize("plane", [None, "xz"])
def test_damping_in_proportion_to_the_masses_is_uniform_drag(plane):
    dragged = shaken(Simulation(SOFT.replace(drag_rate=5.0), num_elements=4, time_step=1e-4, plane=plane), 1)
    simulation = damped(SOFT, 0.0, plane=plane)
    simulation.rods.batch.set_node_damping(5.0 * np.repeat(simulation.node_masses[..., None], 3, axis=-1))
    shaken(simulation, 1)
    for each in (dragged, simulation):
        each.advance(0.2, field=FIELD)
    np.testing.assert_allclose(simulation.positions, dragged.positions, atol=1e-12)
    np.testing.assert_allclose(simulation.velocities, dragged.velocities, atol=1e-9)


def test_energy_falls_at_the_rate_of_the_damping_forces():
    """dE/dt = -sum of K v^2, by a central difference over a hundredth of the stiffest period."""
    damping = 1e-4 * np.random.default_rng(0).uniform(0.5, 2.0, size=(5, 3))
    simulation = shaken(damped(WEIGHTLESS, damping, time_step=1e-7))
    before = simulation.energy()[0]
    simulation.advance(5e-6)
    velocities = simulation.velocities[0]
    simulation.advance(5e-6)
    rate = (simulation.energy()[0] - before) / 1e-5
    np.testing.assert_allclose(rate, -np.sum(damping[1:] * velocities[1:] ** 2), rtol=1e-3)


def test_zero_damping_is_no_damping_and_absent_damping_has_no_rows():
    plain = shaken(Simulation(SOFT, num_elements=4, time_step=1e-4))
    zero = shaken(damped(SOFT, 0.0))
    assert plain.rods.batch.layout.size == zero.rods.batch.layout.size - 3 * 5
    assert plain.rods.batch.layout.size == plain.rods.batch.layout.elements + 4 * ELEMENT_ROWS
    for each in (plain, zero):
        each.advance(0.1, field=FIELD)
    np.testing.assert_allclose(zero.positions, plain.positions, atol=1e-12)


def test_turning_it_on_keeps_the_state():
    simulation = shaken(Simulation(all_terms(SOFT.replace(drag_rate=2.0, internal_damping=1e-4)), num_elements=4))
    simulation.advance(0.02, field=FIELD)
    twin = Simulation(simulation.scene, num_elements=4)
    twin.set_state(simulation.state())
    twin.rods.batch.use_node_damping()
    for each in (simulation, twin):
        each.advance(0.05, field=FIELD)
    np.testing.assert_allclose(twin.positions, simulation.positions, atol=1e-12)


@pytest.mark.parametrize(
    ("plane", "scene"),
    [(None, all_terms(SOFT.replace(drag_rate=1.0, internal_damping=1e-4))), ("xz", SOFT.replace(drag_rate=1.0))],
    ids=["space", "plane"],
)
def test_batch_equals_singles_bitwise(plane, scene):
    damping = 1e-3 * np.random.default_rng(1).normal(size=(3, 5, 3))
    together = shaken(damped(scene, damping, num_rods=3, plane=plane), 1)
    together.advance(0.03, field=FIELD)
    for rod in range(3):
        single = shaken(damped(scene, damping[rod], plane=plane), 1)
        single.advance(0.03, field=FIELD)
        np.testing.assert_array_equal(single.positions[0], together.positions[rod])
        np.testing.assert_array_equal(single.velocities[0], together.velocities[rod])


def test_planar_motion_equals_spatial_motion():
    damping = 1e-4 * np.random.default_rng(2).uniform(0.0, 3.0, size=(5, 3))
    flat, space = (shaken(damped(SOFT, damping, plane=plane), 1) for plane in ("xz", None))
    for each in (flat, space):
        each.advance(0.1, field=FIELD)
    np.testing.assert_allclose(flat.positions, space.positions, atol=1e-12)
    np.testing.assert_allclose(flat.velocities, space.velocities, atol=1e-9)
