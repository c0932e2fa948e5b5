"""Static equilibria of many rods at once under gravity and fields, each on the branch that a real rod would reach.

Newton's method on the loads with their tangent, continued from the straight, unloaded rod: gravity is turned on first,
then the field from zero. Every accepted point must be stable (a positive definite tangent) and near the one before;
where no step, however short, finds such a point, the rod buckles or snaps through there, which is reported and never
jumped over. Rods share the lanes of a block; each has its own loads and its own steps.
"""

import numpy as np

from magrod_env._jit import jit
from magrod_env.rod.layout import ELEMENT_ROWS, FIELD, GRADIENT, LENGTH, SPATIAL
from magrod_env.rod.loads.hub import set_share as set_load_share
from magrod_env.rod.tangent import assemble, band_row, band_width, factorise, solve_factored

LARGEST_TURN = 0.3  # rad, of any node between accepted points
SHORTEST_STEP = 2.0**-12  # of a load
MOST_ITERATIONS = 25
CONVERGED = 1e-11  # last step of Newton's method: rad, and of the rod's length
MOVING, SETTLED, FAILED = 0, 1, 2  # of a rod in Newton's method


@jit
def turn(rows, row, lane, x, y, z):
    """Rotate the quaternion at ``row`` of a lane by the body rotation whose Cayley vector is half of (x, y, z)."""
    a, b, c = 0.5 * x, 0.5 * y, 0.5 * z
    w0, x0, y0, z0 = rows[row, lane], rows[row + 1, lane], rows[row + 2, lane], rows[row + 3, lane]
    w = w0 - x0 * a - y0 * b - z0 * c
    x1 = x0 + w0 * a + y0 * c - z0 * b
    y1 = y0 + w0 * b + z0 * a - x0 * c
    z1 = z0 + w0 * c + x0 * b - y0 * a
    norm = np.sqrt(w * w + x1 * x1 + y1 * y1 + z1 * z1)
    rows[row, lane], rows[row + 1, lane] = w / norm, x1 / norm
    rows[row + 2, lane], rows[row + 3, lane] = y1 / norm, z1 / norm


@jit
def move(rows, layout, lane, change):
    """Move one rod by a change (6 N, L) of its degrees of freedom; returns the largest part: rad, and of its length."""
    length, largest = 0.0, 0.0
    for element in range(layout.num_elements):
        length += rows[layout.elements + ELEMENT_ROWS * element + LENGTH, lane]
    for node in range(1, layout.num_elements + 1):
        row, k = layout.nodes + SPATIAL.size * node, 6 * (node - 1)
        for axis in range(3):
            shift = change[k + axis, lane]
            rows[row + axis, lane] += shift
            largest = larger(largest, abs(shift) / length)
            largest = larger(largest, abs(change[k + 3 + axis, lane]))
        turn(rows, row + SPATIAL.rotation, lane, change[k + 3, lane], change[k + 4, lane], change[k + 5, lane])
    return largest


@jit
def larger(a, b):
    """The larger of two numbers, infinity where either is not finite."""
    if not (np.isfinite(a) and np.isfinite(b)):
        return np.inf
    return max(a, b)


@jit
def relax(block, layout, terms, nodal, gradient, share, room, found):
    """Newton's method at fixed loads for the rods whose ``found`` (L,) is MOVING, in place.

    It becomes SETTLED at a stable equilibrium reached without a node turning far, else FAILED. ``room`` is scratch
    memory (see ``make_room``).
    """
    system, out, least, turned = room
    lanes, size = terms.lanes, 6 * layout.num_elements
    rows, change = block.reshape(-1, len(lanes)), system[: size * len(lanes)].reshape(size, len(lanes))
    turned[:] = 0.0
    for _ in range(MOST_ITERATIONS + 1):
        assemble(block, layout, terms, nodal, gradient, share, system, out, 2)
        factorise(system, terms, size, least)
        solve_factored(system, terms, size)
        moving = 0
        for lane in range(len(lanes)):
            if found[lane] != MOVING:
                continue
            if not least[lane] > 0.0:
                found[lane] = FAILED
            elif turned[lane] < 0.0:  # the step before was the last: this one has only shown that it is stable
                found[lane] = SETTLED
            else:
                largest = move(rows, layout, lane, change)
                turned[lane] += largest
                if not turned[lane] <= LARGEST_TURN:
                    found[lane] = FAILED
                elif largest < CONVERGED:
                    turned[lane] = -1.0
                moving += 1 if found[lane] == MOVING else 0
        if moving == 0:
            return
    for lane in range(len(lanes)):
        if found[lane] == MOVING:
            found[lane] = FAILED


@jit
def make_room(layout, terms):
    """Scratch memory of ``relax``: residual and band, loads, least pivots, turns."""
    width, size = len(terms.lanes), 6 * layout.num_elements
    return np.zeros((size + band_width(terms) * size) * width), np.zeros(18 * width), np.zeros(width), np.zeros(width)


@jit
def flow_step(block, layout, terms, nodal, gradient, brake, room):
    """One implicit Euler step of the flow down the energy of the rod that fills all lanes, under all its loads.

    ``brake`` (6 N * L,) is added to the diagonal of the tangent. Returns the largest part of the step, as ``move``
    does; infinite, and the rod is left alone, where the step has no minimum or is longer than LARGEST_TURN.
    """
    system, out, least, _ = room
    lanes, size = terms.lanes, 6 * layout.num_elements
    width = len(lanes)
    rows, change = block.reshape(-1, width), system[: size * width].reshape(size, width)
    assemble(block, layout, terms, nodal, gradient, np.ones(2 * width), system, out, 2)
    for i in range(size):
        row = band_row(band_width(terms), size, i, i) * width
        system[row : row + width] += brake[i * width : (i + 1) * width]
    factorise(system, terms, size, least)
    solve_factored(system, terms, size)
    kept, largest = rows[layout.nodes : layout.elements].copy(), np.inf
    if least[0] > 0.0:
        largest = 0.0
        for lane in range(width):
            largest = larger(largest, move(rows, layout, lane, change))
    if not largest <= LARGEST_TURN:
        rows[layout.nodes : layout.elements] = kept
    return largest


@jit
def lay_straight_blocks(rows, layout):
    """Lay every rod of ``rows`` (num_blocks, rows, L) straight."""
    for b in range(rows.shape[0]):
        for lane in range(rows.shape[2]):
            lay_straight(rows[b], layout, lane)


@jit
def lay_straight(rows, layout, lane):
    """Lay one rod straight along +x."""
    arc = 0.0
    for node in range(layout.num_elements + 1):
        row = layout.nodes + SPATIAL.size * node
        for k in range(SPATIAL.velocity):
            rows[row + k, lane] = 0.0
        rows[row, lane], rows[row + SPATIAL.rotation, lane] = arc, 1.0
        if node < layout.num_elements:
            arc += rows[layout.elements + ELEMENT_ROWS * node + LENGTH, lane]


@jit
def set_share(rows, layout, terms, share, lane, at, begin, end):
    """Loads of one rod at the share ``at`` of their way: the scene's over 0-1, then field and gradient over 1-2."""
    way = max(at - 1.0, 0.0)
    set_load_share(rows, layout, terms.loads, lane, min(at, 1.0))
    share[lane], share[share.shape[0] // 2 + lane] = min(at, 1.0), 1.0
    for k in range(3):
        rows[FIELD + k, lane] = (1.0 - way) * begin[k] + way * end[k]
    for k in range(9):
        rows[GRADIENT + k, lane] = (1.0 - way) * begin[3 + k] + way * end[3 + k]


@jit
def follow(block, layout, terms, nodal, gradient, begin, end, shares, room):
    """Follow the equilibria of a block's rods while their loads grow, from the poses in ``block``.

    ``shares`` (L,) says where each begins, 0 unloaded or 1 under the scene's loads and the field ``begin``, and
    becomes 2 where all loads act; where stability is lost it is the share of the scene's loads (0-1) or 1 plus the
    share of the way from ``begin`` to ``end`` (L, 12): field, T, and gradient, T/m. The last stable pose is left.
    """
    width = len(terms.lanes)
    rows, share = block.reshape(-1, width), np.zeros(2 * width)
    first, last = layout.nodes, layout.elements
    kept, step, goal = rows[first:last].copy(), np.zeros(width), np.zeros(width)
    found = np.zeros(width, np.int64)
    for lane in range(width):
        step[lane] = 0.5 if shares[lane] < 1.0 else 1.0
        if shares[lane] < 1.0 and terms.gravity is None and len(terms.loads) == 0:
            shares[lane], step[lane] = 1.0, 0.5
        set_share(rows, layout, terms, share, lane, shares[lane], begin[lane], end[lane])
    while True:
        moving = 0
        for lane in range(width):
            found[lane] = SETTLED
            if shares[lane] < 2.0 and step[lane] >= SHORTEST_STEP:
                goal[lane] = min(shares[lane] + step[lane], 1.0 if shares[lane] < 1.0 else 2.0)
                set_share(rows, layout, terms, share, lane, goal[lane], begin[lane], end[lane])
                found[lane] = MOVING
                moving += 1
            else:
                goal[lane] = shares[lane]
        if moving == 0:
            return
        relax(block, layout, terms, nodal, gradient, share, room, found)
        for lane in range(width):
            if goal[lane] == shares[lane]:
                continue
            good = found[lane] == SETTLED
            for row in range(last - first):
                if good:
                    kept[row, lane] = rows[first + row, lane]
                else:
                    rows[first + row, lane] = kept[row, lane]
            if good:
                shares[lane], step[lane] = goal[lane], min(2.0 * step[lane], 1.0)
            else:
                step[lane] *= 0.5


@jit
def follow_blocks(blocks, first, last, layout, terms, begin, end, shares):
    """``follow`` for lane blocks ``first`` to ``last`` (exclusive); rod ``L b + l`` is lane l of block b.

    ``begin`` and ``end`` (num_blocks * L, 12), ``shares`` (num_blocks * L,).
    """
    room, width = make_room(layout, terms), len(terms.lanes)
    for b in range(first, last):
        lanes = slice(b * width, (b + 1) * width)
        follow(blocks[b], layout, terms, terms.nodal, terms.gradient, begin[lanes], end[lanes], shares[lanes], room)
