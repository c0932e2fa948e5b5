"""Parts of the implicit step: derivatives of the strains against differences, elimination against dense solution."""

import numpy as np
from scipy.spatial.transform import Rotation

from magrod_env.rod.elimination import (
    COUPLING,
    RIGHT,
    SPATIAL_FREEDOMS,
    SYSTEM,
    eliminate_node,
    factor_node,
    forward_node,
    substitute_node,
    triangle,
)
from magrod_env.rod.helical import helical_strain
from magrod_env.rod.jacobian import strain_jacobian
from rod.test_elements import LENGTH, all_poses

STEP = 1e-5  # of differences: rad, and of an element's length


def strains(poses):
    gamma, phi, geometry = helical_strain(*poses, 1.0 / LENGTH)
    return np.array(gamma), np.array(phi)


def moved(pose, k, step):
    """A pose moved by a step (of an element's length, or rad in its own frame) along degree of freedom k."""
    position, (w, x, y, z) = pose
    unit = step * np.eye(3)[k % 3]
    if k < 3:
        return tuple(np.array(position) + LENGTH * unit), (w, x, y, z)
    x, y, z, w = (Rotation.from_quat([x, y, z, w]) * Rotation.from_rotvec(unit)).as_quat()
    return position, (w, x, y, z)


@all_poses
def test_derivatives_of_the_strains_are_those_of_differences(poses):
    gamma, phi, geometry = helical_strain(*poses, 1.0 / LENGTH)
    position, turn_a, turn_b, bend_a, bend_b = strain_jacobian(gamma, phi, geometry, 1.0 / LENGTH)
    zero = np.zeros(3)
    for end, k in [(end, k) for end in (0, 1) for k in range(6)]:
        ends = list(poses), list(poses)
        for side, step in zip(ends, (STEP, -STEP), strict=True):
            side[end] = moved(poses[end], k, step)
        ahead, behind = strains(ends[0]), strains(ends[1])
        if k < 3:
            known = (np.array(position[k]) * (1.0 if end else -1.0), zero)
        else:
            known = (np.array((turn_a, turn_b)[end][k - 3]), np.array((bend_a, bend_b)[end][k - 3]))
        for column, after, before in zip(known, ahead, behind, strict=True):
            unit = LENGTH if k < 3 else 1.0
            np.testing.assert_allclose(unit * column, (after - before) / (2.0 * STEP), atol=2e-8)


def test_elimination_solves_a_block_tridiagonal_system():
    nodes, lanes = 5, (0, 0)
    rng = np.random.default_rng(3)
    rows = np.zeros(((nodes + 1) * SYSTEM, 2))
    dense, right = np.zeros((2, 6 * nodes, 6 * nodes)), rng.normal(size=(2, 6 * nodes))
    for lane in range(2):
        for node in range(nodes):
            part, own = slice(6 * node, 6 * node + 6), SYSTEM * (node + 1)
            root, coupling = rng.normal(size=(6, 6)), rng.normal(size=(6, 6))
            dense[lane, part, part] = root @ root.T + 20.0 * np.eye(6)
            for i in range(6):
                for j in range(i + 1):
                    rows[own + triangle(i, j), lane] = dense[lane, part, part][i, j]
            if node > 0:
                before = slice(6 * node - 6, 6 * node)
                dense[lane, part, before], dense[lane, before, part] = coupling, coupling.T
                rows[own + COUPLING : own + COUPLING + 36, lane] = coupling.ravel()
            rows[own + RIGHT : own + RIGHT + 6, lane] = right[lane, part]
    scratch = rows.ravel()
    for node in range(1, nodes + 1):
        factor_node(scratch, SYSTEM * node, lanes, SPATIAL_FREEDOMS)
        if node < nodes:
            eliminate_node(scratch, SYSTEM * node, SYSTEM * (node + 1), lanes, SPATIAL_FREEDOMS)
    solved = substituted(rows, nodes, lanes)
    for lane in range(2):
        np.testing.assert_allclose(solved[..., lane].ravel(), np.linalg.solve(dense[lane], right[lane]), rtol=1e-11)
    again = rng.normal(size=(2, 6 * nodes))
    solved[:] = np.moveaxis(again.reshape(2, nodes, 6), 0, -1)
    for node in range(1, nodes + 1):
        forward_node(scratch, SYSTEM * node, SYSTEM * (node - 1) if node > 1 else None, lanes, SPATIAL_FREEDOMS)
    solved = substituted(rows, nodes, lanes)
    for lane in range(2):
        np.testing.assert_allclose(solved[..., lane].ravel(), np.linalg.solve(dense[lane], again[lane]), rtol=1e-11)


def substituted(rows, nodes, lanes):
    """The solution, a view of the right-hand sides (nodes, 6, lanes)."""
    scratch = rows.ravel()
    substitute_node(scratch, SYSTEM * nodes, None, lanes, SPATIAL_FREEDOMS)
    for node in range(nodes - 1, 0, -1):
        substitute_node(scratch, SYSTEM * node, SYSTEM * (node + 1), lanes, SPATIAL_FREEDOMS)
    return rows.reshape(nodes + 1, SYSTEM, 2)[1:, RIGHT : RIGHT + 6]
