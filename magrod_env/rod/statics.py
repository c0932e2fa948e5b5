"""Static equilibrium of one rod under gravity and a field, on the branch that a real rod would reach.

Newton's method on the loads with their tangent, continued from the straight, unloaded rod: gravity is turned on first,
then the field from zero. Every accepted point must be stable (a positive definite tangent) and near the one before;
where no step, however short, finds such a point, the rod buckles or snaps through there, which is reported and never
jumped over.
"""

import numpy as np

from magrod_env._jit import jit
from magrod_env.rod.layout import ELEMENT_ROWS, FIELD, GRADIENT, GRAVITY, LENGTH
from magrod_env.rod.loads.hub import set_share
from magrod_env.rod.tangent import assemble, band_width, factorise, solve_factored

REACHED, LOST = 0, 1
LARGEST_TURN = 0.3  # rad, of any node between accepted points
SHORTEST_STEP = 2.0**-12  # of a load
MOST_ITERATIONS = 25


@jit
def turn(rotation, x, y, z):
    """Rotate a quaternion in place by the body rotation whose Cayley vector is half of (x, y, z)."""
    a, b, c = 0.5 * x, 0.5 * y, 0.5 * z
    w0, x0, y0, z0 = rotation[0], rotation[1], rotation[2], rotation[3]
    w = w0 - x0 * a - y0 * b - z0 * c
    x1 = x0 + w0 * a + y0 * c - z0 * b
    y1 = y0 + w0 * b + z0 * a - x0 * c
    z1 = z0 + w0 * c + x0 * b - y0 * a
    norm = np.sqrt(w * w + x1 * x1 + y1 * y1 + z1 * z1)
    rotation[0], rotation[1], rotation[2], rotation[3] = w / norm, x1 / norm, y1 / norm, z1 / norm


@jit
def relax(block, layout, terms, nodal, gradient, positions, rotations, residual, band):
    """Newton's method at fixed loads, in place; returns whether it converged without a node turning far."""
    length = positions.shape[0] * block[len(terms.lanes) * (layout.elements + LENGTH)]
    turned = 0.0
    for _ in range(MOST_ITERATIONS):
        assemble(block, layout, terms, nodal, gradient, positions, rotations, residual, band, 2)
        if factorise(band) != 0:
            return False
        solve_factored(band, residual)
        largest = 0.0
        for node in range(1, positions.shape[0]):
            k = 6 * (node - 1)
            for axis in range(3):
                positions[node, axis] += residual[k + axis]
                largest = max(largest, abs(residual[k + axis]) / length, abs(residual[k + 3 + axis]))
            turn(rotations[node], residual[k + 3], residual[k + 4], residual[k + 5])
        if not np.isfinite(largest):
            return False
        turned += largest
        if turned > LARGEST_TURN:
            return False
        if largest < 1e-11:
            assemble(block, layout, terms, nodal, gradient, positions, rotations, residual, band, 2)
            return factorise(band) == 0
    return False


@jit
def set_loads(block, terms, share, gravity, field, gradient):
    """Write the loads of a continuation parameter into every lane: gravity over 0-1, the field over 1-2."""
    lanes = len(terms.lanes)
    for lane in range(lanes):
        for k in range(3):
            block[(GRAVITY + k) * lanes + lane] = min(share, 1.0) * gravity[k]
            block[(FIELD + k) * lanes + lane] = max(share - 1.0, 0.0) * field[k]
        for k in range(9):
            block[(GRADIENT + k) * lanes + lane] = max(share - 1.0, 0.0) * gradient[k]


@jit
def find_equilibrium(block, layout, terms, nodal, with_gradient, field, gradient, positions, rotations):
    """Equilibrium reached from the straight rod, into ``positions`` (N + 1, 3) m and ``rotations`` (N + 1, 4).

    ``block``: constants of one rod in all eight lanes, its gravity included; ``field`` (3,) T and ``gradient`` (9,) T/m
    at the origin. Returns (REACHED or LOST, share): share is 2 when all loads act; where stability is lost it is the
    share of gravity (0-1) or 1 plus the share of the field, and the last stable shape is left behind.
    """
    lanes = len(terms.lanes)
    gravity = np.array([block[(GRAVITY + k) * lanes] for k in range(3)])
    positions[:] = 0.0
    rotations[:] = 0.0
    rotations[:, 0] = 1.0
    for element in range(layout.num_elements):
        h = block[lanes * (layout.elements + ELEMENT_ROWS * element + LENGTH)]
        positions[element + 1, 0] = positions[element, 0] + h
    residual = np.zeros(6 * layout.num_elements)
    band = np.zeros((6 * layout.num_elements, band_width(terms)))
    trial_positions, trial_rotations = positions.copy(), rotations.copy()
    share = 1.0 if terms.gravity is None and len(terms.loads) == 0 else 0.0
    step = 0.5
    while share < 2.0:
        end = 1.0 if share < 1.0 else 2.0
        goal = min(share + step, end)
        set_loads(block, terms, goal, gravity, field, gradient)
        set_share(block, layout, terms.loads, terms.lanes, min(goal, 1.0))
        trial_positions[:] = positions
        trial_rotations[:] = rotations
        if relax(block, layout, terms, nodal, with_gradient, trial_positions, trial_rotations, residual, band):
            positions[:] = trial_positions
            rotations[:] = trial_rotations
            share = goal
            step = min(2.0 * step, 1.0)
        else:
            step *= 0.5
            if step < SHORTEST_STEP:
                break
    set_loads(block, terms, 2.0, gravity, field, gradient)
    set_share(block, layout, terms.loads, terms.lanes, 1.0)
    return (REACHED if share >= 2.0 else LOST), share
