"""Residual and tangent stiffness of one rod, element by element, from the loads that the stepping kernel uses.

Degrees of freedom of node a = 1..N: displacement (world, m) and rotation (body, rad), 6 a node. The tangent is the
derivative of the loads by central differences, eight perturbations at a time in the lanes of one block; tests compare
it with the second derivative of the energy. It is stored by its lower band, 12 wide. Slow vibrations of slender rods
are small differences of large stiffnesses: for these, differences are extrapolated to order four.
"""

import numpy as np

from magrod_env._jit import jit
from magrod_env.rod.access import load_pose, store3
from magrod_env.rod.elements import element_loads
from magrod_env.rod.general_band import HALF, WIDE, factorise_general, mirror, solve_general
from magrod_env.rod.layout import ELEMENT_ROWS, GRAVITY, SPATIAL
from magrod_env.rod.loads.hub import any_circulatory, static_loads
from magrod_env.rod.loads.magnets import magnet_loads

LANES = (0,) * 8
BAND = 12
STEP = 2e-6  # of the perturbation: rad, and of an element's length
LONG_STEP = 2e-5  # the same where differences over this step and twice as much are extrapolated


@jit
def band_width(terms):
    """Numbers a row of the tangent's band: the lower triangle's, or all where it is not symmetric."""
    return WIDE if any_circulatory(terms, terms.loads) else BAND


@jit
def write_pose(rows, row, position, rotation, direction, lane, step, length):
    """Put a pose, moved by ``step`` along degree of freedom ``direction`` (0-5; -1 none), into one lane."""
    for k in range(3):
        rows[row + k, lane] = position[k]
    w, x, y, z = rotation[0], rotation[1], rotation[2], rotation[3]
    if 0 <= direction < 3:
        rows[row + direction, lane] += step * length
    elif direction >= 3:
        half = 0.5 * step
        a = half if direction == 3 else 0.0
        b = half if direction == 4 else 0.0
        c = half if direction == 5 else 0.0
        w, x, y, z = (
            w - x * a - y * b - z * c,
            x + w * a + y * c - z * b,
            y + w * b + z * a - x * c,
            z + w * c + x * b - y * a,
        )
        norm = np.sqrt(w * w + x * x + y * y + z * z)
        w, x, y, z = w / norm, x / norm, y / norm, z / norm
    rows[row + 3, lane] = w
    rows[row + 4, lane] = x
    rows[row + 5, lane] = y
    rows[row + 6, lane] = z


@jit
def element_lanes(block, layout, element, terms, nodal, scratch, out):
    """Loads of an element for the eight pose pairs in ``scratch``: rows of ``out`` are force, torque on a, torque on
    b.
    """
    pose_a, pose_b = load_pose(scratch, 0, terms.lanes, None), load_pose(scratch, 7, terms.lanes, None)
    force, torque_a, torque_b = element_loads(block, layout, element, pose_a, pose_b, terms.lanes, None, nodal)
    store3(out, 0, force, terms.lanes)
    store3(out, 3, torque_a, terms.lanes)
    store3(out, 6, torque_b, terms.lanes)


@jit
def magnet_lanes(block, layout, magnet, terms, gradient, scratch, out):
    """Loads on a magnet for the eight poses in ``scratch``: rows of ``out`` are force and torque."""
    torque, force = magnet_loads(
        block, layout, magnet, load_pose(scratch, 0, terms.lanes, None), terms.lanes, None, gradient
    )
    store3(out, 3, torque, terms.lanes)
    if gradient is not None:
        store3(out, 0, force, terms.lanes)


@jit
def add_entry(band, i, j, value):
    """Add to the symmetric band matrix: half of each of the entries (i, j) and (j, i) reaches the lower triangle."""
    if i == j:
        band[i, BAND - 1] += value
    elif i > j:
        band[i, BAND - 1 - (i - j)] += 0.5 * value
    else:
        band[j, BAND - 1 - (j - i)] += 0.5 * value


@jit
def difference(order, pair):
    """Step and weight of one of the ``order / 2`` pairs of a central difference of order two or four."""
    if order == 2:
        return STEP, 1.0
    return (LONG_STEP, 4.0 / 3.0) if pair == 0 else (2.0 * LONG_STEP, -1.0 / 3.0)


@jit
def assemble(block, layout, terms, nodal, gradient, positions, rotations, residual, band, order):
    """Residual loads (6 N,) and the tangent (6 N, ``band_width``) at a configuration, by central differences
    of ``order`` 2 or 4; where loads have no potential, all of it, else its symmetric part.

    ``block`` holds the rod's constants in all eight lanes. Row 6 (a - 1) + k of the residual is force k (world, N) or
    torque k - 3 (body, N m) on node a.
    """
    rows = block.reshape(-1, len(terms.lanes))
    scratch, out = np.zeros(14 * 8), np.zeros(9 * 8)
    view, loads = scratch.reshape(14, 8), out.reshape(9, 8)
    residual[:] = 0.0
    band[:] = 0.0
    for element in range(layout.num_elements):
        a, b = 6 * (element - 1), 6 * element
        length = rows[layout.elements + ELEMENT_ROWS * element, 0]
        write_pose(view, 0, positions[element], rotations[element], -1, 0, 0.0, length)
        write_pose(view, 7, positions[element + 1], rotations[element + 1], -1, 0, 0.0, length)
        element_lanes(block, layout, element, terms, nodal, scratch, out)
        for k in range(3):
            residual[b + k] -= loads[k, 0]
            residual[b + 3 + k] += loads[6 + k, 0]
            if element > 0:
                residual[a + k] += loads[k, 0]
                residual[a + 3 + k] += loads[3 + k, 0]
        for group in range(3 * (order // 2)):
            step, weight = difference(order, group // 3)
            for lane in range(8):
                direction, side = 4 * (group % 3) + lane // 2, step if lane % 2 == 0 else -step
                on_b = direction - 6 if direction >= 6 else -1
                on_a = direction if direction < 6 else -1
                write_pose(view, 0, positions[element], rotations[element], on_a, lane, side, length)
                write_pose(view, 7, positions[element + 1], rotations[element + 1], on_b, lane, side, length)
            element_lanes(block, layout, element, terms, nodal, scratch, out)
            for pair in range(4):
                direction = 4 * (group % 3) + pair
                column = a + direction if direction < 6 else b + direction - 6
                if direction < 6 and element == 0:
                    continue
                factor = weight / (2.0 * step * (length if direction % 6 < 3 else 1.0))
                for k in range(9):
                    slope = -factor * (loads[k, 2 * pair] - loads[k, 2 * pair + 1])
                    if k < 6 and element > 0:
                        add_entry(band, a + k, column, slope)
                    if k < 3:
                        add_entry(band, b + k, column, -slope)
                    elif k >= 6:
                        add_entry(band, b + k - 3, column, slope)
    if terms.gravity is not None:
        for node in range(1, layout.num_elements + 1):
            mass = 1.0 / rows[layout.nodes + SPATIAL.size * node + SPATIAL.inverse_mass, 0]
            for k in range(3):
                residual[6 * (node - 1) + k] += mass * rows[GRAVITY + k, 0]
    if terms.magnets is not None:
        add_magnets(block, layout, terms, gradient, positions, rotations, residual, band)
    add_listed_loads(block, layout, terms, terms.loads, positions, rotations, residual, band)


@jit
def add_magnets(block, layout, terms, gradient, positions, rotations, residual, band):
    """Add the magnets' loads and stiffness."""
    scratch, out = np.zeros(14 * 8), np.zeros(9 * 8)
    view, loads = scratch.reshape(14, 8), out.reshape(9, 8)
    length = block[len(terms.lanes) * layout.elements]
    for magnet in range(len(layout.magnet_nodes)):
        node = layout.magnet_nodes[magnet]
        first = 6 * (node - 1)
        for group in range(3):
            for lane in range(8):
                direction = 4 * (group - 1) + lane // 2 if group > 0 else -1
                direction = direction if direction < 6 else -1
                step = STEP if lane % 2 == 0 else -STEP
                write_pose(view, 0, positions[node], rotations[node], direction, lane, step, length)
            magnet_lanes(block, layout, magnet, terms, gradient, scratch, out)
            for k in range(6):
                if group == 0:
                    residual[first + k] += loads[k, 0]
                    continue
                for pair in range(4):
                    direction = 4 * (group - 1) + pair
                    if direction < 6:
                        size = 2.0 * STEP * (length if direction < 3 else 1.0)
                        slope = -(loads[k, 2 * pair] - loads[k, 2 * pair + 1]) / size
                        add_entry(band, first + k, first + direction, slope)


@jit
def static_load_lanes(block, layout, node, terms, scratch, out):
    """Loads on a node for the eight poses in ``scratch``: rows of ``out`` are force and torque."""
    pose = load_pose(scratch, 0, terms.lanes, None)
    force, torque = static_loads(block, layout, terms, node, pose)
    store3(out, 0, force, terms.lanes)
    store3(out, 3, torque, terms.lanes)


@jit
def add_listed_loads(block, layout, terms, loads, positions, rotations, residual, band):
    """Add the loads that the scene lists and, where they have no potential, what these add to the tangent.

    They depend on the rotation of their node alone. The symmetrised rest of the tangent lacks half of the cross product
    with their torque, which balances that of the rest (docs/physics.md).
    """
    if len(loads) == 0:
        return
    scratch, out = np.zeros(14 * 8), np.zeros(9 * 8)
    view, on_node = scratch.reshape(14, 8), out.reshape(9, 8)
    if band.shape[1] > BAND:
        mirror(band.reshape(-1), 0, band.shape[0], (0,))
    for node in range(1, layout.num_elements + 1):
        first = 6 * (node - 1)
        for lane in range(8):
            step = STEP if lane % 2 == 0 else -STEP
            direction = 3 + lane // 2 if lane < 6 else -1
            write_pose(view, 0, positions[node], rotations[node], direction, lane, step, 1.0)
        static_load_lanes(block, layout, node, terms, scratch, out)
        for k in range(6):
            residual[first + k] += on_node[k, 6]
            for axis in range(3):
                if band.shape[1] > BAND:
                    slope = (on_node[k, 2 * axis] - on_node[k, 2 * axis + 1]) / (2.0 * STEP)
                    band[first + k, HALF + 3 + axis - k] -= slope
        if band.shape[1] > BAND:
            for axis in range(3):
                i, j, half = first + 3 + axis, first + 3 + (axis + 1) % 3, 0.5 * on_node[3 + (axis + 2) % 3, 6]
                band[i, HALF + j - i] -= half
                band[j, HALF + i - j] += half


@jit
def factorise(band):
    """LDL^T of a symmetric band matrix in place; returns the number of negative pivots, -1 if one is zero or not
    finite. LU of one that is not symmetric: 0 where its determinant is positive, else -1.
    """
    n = band.shape[0]
    if band.shape[1] > BAND:
        sign = np.zeros(1)
        factorise_general(band.reshape(-1), 0, n, sign, (0,))
        return 0 if sign[0] > 0.0 else -1
    negative = 0
    for i in range(n):
        first = max(0, i - BAND + 1)
        for j in range(first, i):
            total = band[i, BAND - 1 - (i - j)]
            for k in range(max(first, j - BAND + 1), j):
                total -= band[i, BAND - 1 - (i - k)] * band[j, BAND - 1 - (j - k)]
            band[i, BAND - 1 - (i - j)] = total
        pivot = band[i, BAND - 1]
        for j in range(first, i):
            scaled = band[i, BAND - 1 - (i - j)] / band[j, BAND - 1]
            pivot -= band[i, BAND - 1 - (i - j)] * scaled
            band[i, BAND - 1 - (i - j)] = scaled
        band[i, BAND - 1] = pivot
        if not np.isfinite(pivot) or pivot == 0.0:
            return -1
        if pivot < 0.0:
            negative += 1
    return negative


@jit
def solve_factored(band, vector):
    """Solve in place with a matrix that ``factorise`` has factored."""
    n = band.shape[0]
    if band.shape[1] > BAND:
        solve_general(band.reshape(-1), 0, n, vector, (0,))
        return
    for i in range(n):
        for j in range(max(0, i - BAND + 1), i):
            vector[i] -= band[i, BAND - 1 - (i - j)] * vector[j]
    for i in range(n):
        vector[i] /= band[i, BAND - 1]
    for i in range(n - 1, -1, -1):
        for j in range(max(0, i - BAND + 1), i):
            vector[j] -= band[i, BAND - 1 - (i - j)] * vector[i]
