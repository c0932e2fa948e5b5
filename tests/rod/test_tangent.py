"""The tangent stiffness is the second derivative of the energy; it is factored as a symmetric band matrix."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from magrod_env import Simulation, load_scene
from magrod_env.rod.layout import Terms
from magrod_env.rod.tangent import BAND, LANES, factorise, solve_factored
from rod.truth import exact_loads, helical_energy, nodal_energy

FIELD = np.array([2e-3, -4e-3, 9e-3])


def bent_poses(simulation, seed=1):
    """A smooth random shape of the rod: positions (N + 1, 3), quaternions (N + 1, 4)."""
    rng = np.random.default_rng(seed)
    positions, frames = [np.zeros(3)], [Rotation.identity()]
    for h in np.diff(simulation.arc_lengths):
        turn = Rotation.from_rotvec(rng.normal(size=3) * 0.3)
        middle = frames[-1] * Rotation.from_rotvec(0.5 * turn.as_rotvec())
        positions.append(positions[-1] + middle.apply(h * (np.array([1.0, 0.0, 0.0]) + 0.02 * rng.normal(size=3))))
        frames.append(frames[-1] * turn)
    return np.array(positions), np.array([np.roll(frame.as_quat(), 1) for frame in frames])


def residual(simulation, element, positions, quaternions):
    """Loads on nodes 1..N (N, 6) by 50-digit differences of the energy; dipole and weight by their own formulas."""
    rod, scene = simulation.scene.rod, simulation.scene
    out = np.zeros((len(positions), 6))
    for e, h in enumerate(np.diff(simulation.arc_lengths)):
        stiffness = (rod.axial_stiffness, rod.shear_stiffness, rod.torsional_stiffness, rod.bending_stiffness)
        poses = [(positions[n], quaternions[n]) for n in (e, e + 1)]
        energy = helical_energy if element == "helical" else nodal_energy
        force, torque_a, torque_b = exact_loads(energy, *poses, h, stiffness)
        out[e] += [*force, *torque_a]
        out[e + 1] += [*-force, *torque_b]
    out[:, :3] += simulation.node_masses[0][:, None] * np.array(scene.gravity)
    for magnet, node in zip(scene.magnets, simulation.magnet_nodes, strict=True):
        frame = Rotation.from_quat(np.roll(quaternions[node], -1))
        out[node, 3:] += np.cross(magnet.dipole_moment, frame.inv().apply(FIELD))
    return out[1:]


@pytest.mark.parametrize("element", ["helical", "nodal"])
def test_tangent_is_the_second_derivative_of_the_energy(element):
    """Its symmetric part, at any shape: differences of exact loads by 1e-6 give nine digits."""
    simulation = Simulation(load_scene("paper4_pdms_tip_magnet"), num_elements=3, element=element)
    positions, quaternions = bent_poses(simulation)
    case = simulation.rods.model.static.equilibrium(np.zeros(3))  # any load case: only its field and shape are used
    case = type(case)(positions, quaternions, True, 2.0, FIELD, np.zeros(9))
    stiffness, inertia = simulation.rods.model.static.linearise(case)

    step, expected = 1e-6, np.zeros((18, 18))
    for node in (1, 2, 3):
        for k in range(6):
            sides = []
            for sign in (1, -1):
                moved, turned = positions.copy(), quaternions.copy()
                if k < 3:
                    moved[node, k] += sign * step * 0.02
                else:
                    frame = Rotation.from_quat(np.roll(turned[node], -1))
                    frame = frame * Rotation.from_rotvec(sign * step * np.eye(3)[k - 3])
                    turned[node] = np.roll(frame.as_quat(), 1)
                sides.append(residual(simulation, element, moved, turned).ravel())
            expected[:, 6 * (node - 1) + k] = -(sides[0] - sides[1]) / (2 * step * (0.02 if k < 3 else 1.0))
    expected = 0.5 * (expected + expected.T)
    size = np.sqrt(np.abs(np.diag(expected)))
    np.testing.assert_allclose(stiffness / np.outer(size, size), expected / np.outer(size, size), atol=2e-8)
    masses = simulation.node_masses[0, 1:]
    np.testing.assert_allclose(inertia.reshape(3, 6)[:, :3], np.repeat(masses[:, None], 3, axis=1), rtol=1e-14)


def band_matrix(size, seed, shift):
    """A random symmetric band matrix, dense and by its band, (size * BAND,)."""
    rng = np.random.default_rng(seed)
    dense = rng.normal(size=(size, size))
    dense = np.where(np.abs(np.subtract.outer(np.arange(size), np.arange(size))) < BAND, dense + dense.T, 0.0)
    dense += shift * np.eye(size)
    band = np.zeros((size, BAND))
    for i in range(size):
        for j in range(max(0, i - BAND + 1), i + 1):
            band[i, BAND - 1 - (i - j)] = dense[i, j]
    return dense, band.ravel()


def factorised(size, columns):
    """Solutions for right-hand sides of ones, and least pivots, of systems whose bands are the lanes' ``columns``."""
    system, least = np.ones((size + size * BAND, len(LANES))), np.zeros(len(LANES))
    system[size:] = np.array(columns).T
    flat = system.ravel()
    factorise(flat, Terms(lanes=LANES), size, least)
    solve_factored(flat, Terms(lanes=LANES), size)
    return flat.reshape(system.shape)[:size].T, least


@pytest.mark.parametrize("size", [6, 12, 30])
def test_factorisation_solves_and_tells_which_lanes_are_positive_definite(size):
    shifts = [60.0, 30.0, 15.0, 8.0, 4.0, 2.0, 0.0, -60.0]
    matrices = [band_matrix(size, seed, shift) for seed, shift in enumerate(shifts)]
    solutions, least = factorised(size, [band for _, band in matrices])
    for (dense, _), solution, smallest in zip(matrices, solutions, least, strict=True):
        assert (smallest > 0.0) == (np.linalg.eigvalsh(dense)[0] > 0.0)
        np.testing.assert_allclose(dense @ solution, 1.0, atol=1e-9 * max(1.0, np.linalg.norm(solution)))


def test_a_singular_matrix_and_one_that_is_not_finite_are_recognised():
    columns = [band_matrix(6, 0, 60.0)[1] for _ in LANES]
    columns[2], columns[5] = np.zeros(6 * BAND), np.full(6 * BAND, np.nan)
    _, least = factorised(6, columns)
    assert (least > 0.0).tolist() == [lane not in (2, 5) for lane in range(len(LANES))]
