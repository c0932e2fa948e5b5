"""Strains and rates as coordinates of a rod: there and back, rates as derivatives, and means that do not stretch."""

import dataclasses

import numpy as np
import pytest
from term_sets import damped

from magrod_env import Simulation, load_scene
from magrod_env.estimation.coordinates import nodes_of, strains_of
from magrod_env.estimation.modes import slow_modes

SCENE = damped(load_scene("paper4_pdms_tip_magnet").replace(drag_rate=1.0, spin_drag_rate=100.0))


@pytest.fixture(scope="module")
def moving():
    simulation = Simulation(SCENE, num_rods=8, num_elements=4)
    simulation.advance(0.05, np.random.default_rng(0).normal(scale=5e-3, size=(8, 3)))
    return simulation


def state_of(simulation):
    return (
        simulation.positions,
        simulation.rods.motion.quaternions,
        simulation.velocities,
        simulation.angular_velocities,
    )


def random_strains(size, count=20, elements=4):
    generator = np.random.default_rng(1)
    strains = np.zeros((count, elements, 12))
    strains[..., :3] = size * generator.normal(size=(count, elements, 3))
    strains[..., 3:6] = [1.0, 0.0, 0.0] + 0.05 * generator.normal(size=(count, elements, 3))
    strains[..., 6:] = generator.normal(size=(count, elements, 6))
    return strains


def test_a_simulated_rod_is_rebuilt_from_its_strains(moving):
    lengths = np.diff(moving.arc_lengths)
    rebuilt = nodes_of(strains_of(*state_of(moving), lengths), lengths)
    for found, expected, scale in zip(rebuilt, state_of(moving), (0.06, 1.0, 1.0, 100.0)):
        np.testing.assert_allclose(found, expected, atol=1e-12 * scale)


@pytest.mark.parametrize("size", [1e-9, 0.03, 0.058, 0.3, 0.8])  # both sides of the series' end at 0.1 rad
def test_strains_are_read_back_from_the_rods_they_place(size):
    strains, lengths = random_strains(size), np.array([0.01, 0.02, 0.01, 0.015])
    np.testing.assert_allclose(strains_of(*nodes_of(strains, lengths), lengths), strains, atol=1e-12)


def test_rates_are_derivatives_of_the_placed_rods():
    strains, lengths, step = random_strains(0.5), np.full(4, 0.015), 1e-6
    ahead, behind = strains.copy(), strains.copy()
    ahead[..., :6] += step * strains[..., 6:]
    behind[..., :6] -= step * strains[..., 6:]
    _, _, velocities, _ = nodes_of(strains, lengths)
    found = (nodes_of(ahead, lengths)[0] - nodes_of(behind, lengths)[0]) / (2.0 * step)
    np.testing.assert_allclose(found, velocities, atol=1e-9)


def test_the_mean_of_bent_rods_is_short_but_the_rod_of_mean_strain_is_not():
    lengths = np.full(4, 0.015)
    strains = np.zeros((2, 4, 12))
    strains[..., 3] = 1.0
    strains[0, :, 1], strains[1, :, 1] = 0.2, -0.2  # two arcs, up and down; their mean is straight
    straight = nodes_of(strains.mean(axis=0, keepdims=True), lengths)[0][0, -1, 0]
    averaged = nodes_of(strains, lengths)[0].mean(axis=0)[-1, 0]
    assert straight == pytest.approx(0.06, abs=1e-15)
    assert averaged == pytest.approx(0.06 * np.sin(0.8) / 0.8, rel=1e-9)  # the chord of an arc, along its tangent


def test_slow_modes_hold_what_a_field_bends_and_little_of_a_ringing_section():
    simulation = Simulation(SCENE, num_elements=4)
    slow, lengths = slow_modes(simulation, 4), np.diff(simulation.arc_lengths)
    simulation.reset((0.0, 3e-3, 6e-3))
    strains = strains_of(*state_of(simulation), lengths)[..., :6]
    straight = np.tile(np.eye(6)[3], 4)
    change = strains.ravel() - straight
    kept = change @ slow.dual.T @ slow.shapes
    bends = np.ravel(np.arange(4)[:, None] * 6 + [1, 2])
    assert np.linalg.norm((kept - change)[bends]) < 0.03 * np.linalg.norm(change[bends])
    spinning = np.zeros((1, 4, 6))
    spinning[0, -1, 4] = 100.0  # rad/s, of the tip's section alone
    rates = slow.amplitudes(slow.motions(strains, lengths), spinning)
    moved = np.einsum("kmnc,km->knc", slow.motions(strains, lengths), rates)
    energy = 0.5 * (slow.inertia * moved[0] ** 2).sum()
    assert energy < 0.05 * 0.5 * (slow.inertia * spinning[0] ** 2).sum()


def test_the_slowest_mode_has_the_frequency_of_the_rod():
    """Rayleigh's quotient of the first shape, in the energies of elements and nodes, is the first frequency squared."""
    scene = SCENE.replace(rod=dataclasses.replace(SCENE.rod), gravity=None, magnets=())
    simulation = Simulation(scene, num_elements=4, plane="xz")
    slow, rod = slow_modes(simulation, 1), scene.rod
    lengths = np.diff(simulation.arc_lengths)
    straight = np.tile(np.eye(6)[3], 4).reshape(1, 4, 6)
    motion = slow.motions(straight, lengths)[0, 0]
    kinetic = 0.5 * (slow.inertia * motion**2).sum()
    rates = slow.rates[0]
    shear = 1.0 / (1.0 / rod.shear_stiffness + lengths**2 / (12.0 * rod.bending_stiffness))
    elastic = 0.5 * (rod.bending_stiffness / lengths * rates[:, 1] ** 2 + shear * lengths * rates[:, 5] ** 2).sum()
    assert np.sqrt(elastic / kinetic) / (2.0 * np.pi) == pytest.approx(simulation.natural_frequencies()[0], rel=1e-6)
