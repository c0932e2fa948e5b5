"""Residual and tangent stiffness of rods at rest, several rods in the lanes of a block, from the loads that the
stepping kernel uses.

Degrees of freedom of node a = 1..N: displacement (world, m) and rotation (body, rad), 6 a node. The tangent is the
derivative of the loads by central differences; tests compare it with the second derivative of the energy. It is stored
by its lower band, 12 wide. Slow vibrations of slender rods are small differences of large stiffnesses: for these,
differences are extrapolated to order four.
"""

from magrod_env._jit import inline_jit, jit
from magrod_env._simd import constant, load, store, where_above
from magrod_env.rod.access import load3, load_pose, node_row, store3
from magrod_env.rod.elements import element_loads
from magrod_env.rod.elimination import add1, add3
from magrod_env.rod.general_band import WIDE, factorise_general, mirror, solve_general, wide_row
from magrod_env.rod.layout import ELEMENT_ROWS, GRAVITY, LENGTH, SPATIAL
from magrod_env.rod.loads.hub import any_circulatory, static_loads
from magrod_env.rod.loads.magnets import magnet_loads
from magrod_env.rod.so3 import compose_cayley, normalise, scale

LANES = (0,) * 8
BAND = 12
STEP = 2e-6  # of the perturbation: rad, and of an element's length
LONG_STEP = 2e-5  # the same where differences over this step and twice as much are extrapolated


@inline_jit
def band_width(terms):
    """Rows of memory that a row of the tangent takes: the lower triangle's, or all where it is not symmetric."""
    return WIDE if any_circulatory(terms, terms.loads) else BAND


@inline_jit
def band_row(width, size, i, j):
    """Row of entry (i, j), j <= i, of the band, which follows the residual of ``size`` rows."""
    return size + width * i + BAND - 1 - (i - j)


@inline_jit
def moved(pose, direction, step, length):
    """A pose displaced by ``step * length`` along world axis ``direction`` (0-2) or turned by ``step`` rad about body
    axis ``direction - 3`` (3-5); any other direction leaves it where it is.
    """
    shift, half = step * length, 0.5 * step
    position = (
        pose[0][0] + (1.0 if direction == 0 else 0.0) * shift,
        pose[0][1] + (1.0 if direction == 1 else 0.0) * shift,
        pose[0][2] + (1.0 if direction == 2 else 0.0) * shift,
    )
    turn = (
        constant(half if direction == 3 else 0.0, length),
        constant(half if direction == 4 else 0.0, length),
        constant(half if direction == 5 else 0.0, length),
    )
    return position, normalise(compose_cayley(pose[1], turn))


@jit
def moved_element_loads(block, layout, element, terms, nodal, direction, step, out):
    """Loads of an element with one degree of freedom moved, 0-5 at node a, 6-11 at node b, -1 none: rows of ``out`` are
    the force on a (world), the torques on a and on b (body).
    """
    lanes = terms.lanes
    length = load(block, layout.elements + ELEMENT_ROWS * element + LENGTH, lanes)
    pose_a = moved(load_pose(block, node_row(layout, None, element), lanes, None), direction, step, length)
    pose_b = moved(load_pose(block, node_row(layout, None, element + 1), lanes, None), direction - 6, step, length)
    force, torque_a, torque_b = element_loads(block, layout, element, pose_a, pose_b, lanes, None, nodal)
    store3(out, 0, force, lanes)
    store3(out, 3, torque_a, lanes)
    store3(out, 6, torque_b, lanes)


@jit
def moved_magnet_loads(block, layout, magnet, terms, gradient, direction, step, out):
    """Loads on a magnet with one degree of freedom of its node moved: rows of ``out`` are force and torque."""
    lanes = terms.lanes
    length = load(block, layout.elements + LENGTH, lanes)
    pose = load_pose(block, node_row(layout, None, layout.magnet_nodes[magnet]), lanes, None)
    torque, force = magnet_loads(block, layout, magnet, moved(pose, direction, step, length), lanes, None, gradient)
    zero = constant(0.0, length)
    store3(out, 0, (zero, zero, zero), lanes)
    if gradient is not None:
        store3(out, 0, force, lanes)
    store3(out, 3, torque, lanes)


@jit
def add_entry(system, width, size, i, j, value, lanes):
    """Add to the symmetric band matrix: half of each of the entries (i, j) and (j, i) reaches the lower triangle."""
    if i == j:
        add1(system, band_row(width, size, i, j), value, lanes)
    elif i > j:
        add1(system, band_row(width, size, i, j), 0.5 * value, lanes)
    else:
        add1(system, band_row(width, size, j, i), 0.5 * value, lanes)


@jit
def difference(order, pair):
    """Step and weight of one of the ``order / 2`` pairs of a central difference of order two or four."""
    if order == 2:
        return STEP, 1.0
    return (LONG_STEP, 4.0 / 3.0) if pair == 0 else (2.0 * LONG_STEP, -1.0 / 3.0)


@jit
def add_element(block, layout, element, terms, nodal, system, out, order):
    """Add an element's loads to the residual and its stiffness to the band.

    Moving both ends together changes nothing, so that displacements of node a follow from those of node b.
    """
    lanes, size, width = terms.lanes, 6 * layout.num_elements, band_width(terms)
    a, b = 6 * (element - 1), 6 * element
    moved_element_loads(block, layout, element, terms, nodal, -1, 0.0, out)
    add3(system, b, scale(-1.0, load3(out, 0, lanes)), lanes)
    add3(system, b + 3, load3(out, 6, lanes), lanes)
    if element > 0:
        add3(system, a, load3(out, 0, lanes), lanes)
        add3(system, a + 3, load3(out, 3, lanes), lanes)
    length = load(block, layout.elements + ELEMENT_ROWS * element + LENGTH, lanes)
    one = constant(1.0, length)
    for direction in range(6 if element == 0 else 3, 12):
        for pair in range(order // 2):
            step, weight = difference(order, pair)
            moved_element_loads(block, layout, element, terms, nodal, direction, step, out)
            for k in range(9):
                store(out, 9 + k, load(out, k, lanes), lanes)
            moved_element_loads(block, layout, element, terms, nodal, direction, -step, out)
            shared = 6 <= direction < 9
            factor = -weight / (2.0 * step) / (length if shared else one)
            column = a + direction if direction < 6 else b + direction - 6
            for k in range(9):
                slope = factor * (load(out, 9 + k, lanes) - load(out, k, lanes))
                if k < 6 and element > 0:
                    add_entry(system, width, size, a + k, column, slope, lanes)
                    if shared:
                        add_entry(system, width, size, a + k, a + direction - 6, -slope, lanes)
                if k < 3:
                    add_entry(system, width, size, b + k, column, -slope, lanes)
                elif k >= 6:
                    add_entry(system, width, size, b + k - 3, column, slope, lanes)
                if shared and element > 0:
                    if k < 3:
                        add_entry(system, width, size, b + k, a + direction - 6, slope, lanes)
                    elif k >= 6:
                        add_entry(system, width, size, b + k - 3, a + direction - 6, -slope, lanes)


@jit
def add_magnet(block, layout, magnet, terms, gradient, share, system, out):
    """Add a magnet's loads, times its lane's ``share`` (row 1 of it), and their stiffness."""
    lanes, size, width = terms.lanes, 6 * layout.num_elements, band_width(terms)
    first, part = 6 * (layout.magnet_nodes[magnet] - 1), load(share, 1, lanes)
    moved_magnet_loads(block, layout, magnet, terms, gradient, -1, 0.0, out)
    add3(system, first, scale(part, load3(out, 0, lanes)), lanes)
    add3(system, first + 3, scale(part, load3(out, 3, lanes)), lanes)
    length = load(block, layout.elements + LENGTH, lanes)
    one = constant(1.0, length)
    for direction in range(6):
        moved_magnet_loads(block, layout, magnet, terms, gradient, direction, STEP, out)
        for k in range(6):
            store(out, 9 + k, load(out, k, lanes), lanes)
        moved_magnet_loads(block, layout, magnet, terms, gradient, direction, -STEP, out)
        factor = -0.5 / STEP * part / (length if direction < 3 else one)
        for k in range(6):
            slope = factor * (load(out, 9 + k, lanes) - load(out, k, lanes))
            add_entry(system, width, size, first + k, first + direction, slope, lanes)


@jit
def moved_listed_loads(block, layout, node, terms, direction, step, out):
    """Loads that the scene lists on a node that is turned: rows of ``out`` are force and torque."""
    lanes = terms.lanes
    length = load(block, layout.elements + LENGTH, lanes)
    pose = moved(load_pose(block, node_row(layout, None, node), lanes, None), direction, step, length)
    force, torque = static_loads(block, layout, terms, node, pose)
    store3(out, 0, force, lanes)
    store3(out, 3, torque, lanes)


@inline_jit
def add_listed_loads(block, layout, terms, loads, system, out):
    """Add the loads that the scene lists and, where they have no potential, what these add to the tangent.

    They depend on the rotation of their node alone. The symmetrised rest of the tangent lacks half of the cross product
    with their torque, which balances that of the rest (docs/physics.md).
    """
    if len(loads) > 0:
        lanes, size = terms.lanes, 6 * layout.num_elements
        if terms.loads.circulatory is not None:
            mirror(system, size, size, lanes)
        for node in range(1, layout.num_elements + 1):
            first = 6 * (node - 1)
            moved_listed_loads(block, layout, node, terms, -1, 0.0, out)
            add3(system, first, load3(out, 0, lanes), lanes)
            add3(system, first + 3, load3(out, 3, lanes), lanes)
            if terms.loads.circulatory is not None:
                for axis in range(3):
                    half = 0.5 * load(out, 3 + (axis + 2) % 3, lanes)
                    i, j = first + 3 + axis, first + 3 + (axis + 1) % 3
                    add1(system, wide_row(size, i, j), -half, lanes)
                    add1(system, wide_row(size, j, i), half, lanes)
                for direction in range(3, 6):
                    moved_listed_loads(block, layout, node, terms, direction, STEP, out)
                    for k in range(6):
                        store(out, 9 + k, load(out, k, lanes), lanes)
                    moved_listed_loads(block, layout, node, terms, direction, -STEP, out)
                    for k in range(6):
                        slope = -0.5 / STEP * (load(out, 9 + k, lanes) - load(out, k, lanes))
                        add1(system, wide_row(size, first + k, first + direction), slope, lanes)


@jit
def assemble(block, layout, terms, nodal, gradient, share, system, out, order):
    """Residual loads (6 N rows) and tangent (``band_width`` * 6 N rows) of every rod of a block: the symmetric part of
    it or, where loads have no potential, all.

    The poses are those in ``block``; ``share`` (2 * L,) is the part of the scene's loads and of the field that acts on
    each. Row 6 (a - 1) + k of the residual is force k (world, N) or torque k - 3 (body, N m) on node a. ``out`` (18 *
    L,) is scratch memory; differences are of ``order`` 2 or 4.
    """
    lanes = terms.lanes
    system[:] = 0.0
    for element in range(layout.num_elements):
        add_element(block, layout, element, terms, nodal, system, out, order)
    if terms.gravity is not None:
        pull = scale(load(share, 0, lanes), load3(block, GRAVITY, lanes))
        for node in range(1, layout.num_elements + 1):
            mass = 1.0 / load(block, node_row(layout, None, node) + SPATIAL.inverse_mass, lanes)
            add3(system, 6 * (node - 1), scale(mass, pull), lanes)
    if terms.magnets is not None:
        for magnet in range(len(layout.magnet_nodes)):
            add_magnet(block, layout, magnet, terms, gradient, share, system, out)
    add_listed_loads(block, layout, terms, terms.loads, system, out)


@jit
def factorise(system, terms, size, least):
    """Factorise the tangents in place: LDL^T, or LU where they are not symmetric. What goes to ``least`` (L,), the
    least pivot or the sign of the determinant, is above 0 where a rod is stable.
    """
    factorise_band(system, terms, terms.loads, size, least)


@inline_jit
def factorise_band(system, terms, loads, size, least):
    """``factorise``, with the branch that the scene's terms need."""
    if len(loads) > 0:
        if terms.loads.circulatory is not None:
            factorise_general(system, size, size, least, terms.lanes)
        else:
            factorise_symmetric(system, size, least, terms.lanes)
    else:
        factorise_symmetric(system, size, least, terms.lanes)


@jit
def solve_factored(system, terms, size):
    """Solve for the right-hand sides in the first ``size`` rows, in place, with what ``factorise`` left."""
    solve_band(system, terms, terms.loads, size)


@inline_jit
def solve_band(system, terms, loads, size):
    """``solve_factored``, with the branch that the scene's terms need."""
    if len(loads) > 0:
        if terms.loads.circulatory is not None:
            solve_general(system, size, size, system, terms.lanes)
        else:
            solve_symmetric(system, size, terms.lanes)
    else:
        solve_symmetric(system, size, terms.lanes)


@jit
def factorise_symmetric(system, size, least, lanes):
    """LDL^T of the symmetric band matrices in place, 1/D on their diagonals; the least pivot of each lane goes to
    ``least`` (L,): a matrix is positive definite where it is above 0.
    """
    smallest = constant(1e300, load(system, 0, lanes))
    for i in range(size):
        first = max(0, i - BAND + 1)
        for j in range(first, i):
            total = load(system, band_row(BAND, size, i, j), lanes)
            for k in range(max(first, j - BAND + 1), j):
                product = load(system, band_row(BAND, size, i, k), lanes) * load(
                    system, band_row(BAND, size, j, k), lanes
                )
                total = total - product
            store(system, band_row(BAND, size, i, j), total, lanes)
        pivot = load(system, band_row(BAND, size, i, i), lanes)
        for j in range(first, i):
            entry = load(system, band_row(BAND, size, i, j), lanes)
            scaled = entry * load(system, band_row(BAND, size, j, j), lanes)
            pivot = pivot - entry * scaled
            store(system, band_row(BAND, size, i, j), scaled, lanes)
        smallest = where_above(pivot, smallest, smallest, pivot)  # not a number where a pivot is none
        store(system, band_row(BAND, size, i, i), 1.0 / pivot, lanes)
    store(least, 0, smallest, lanes)


@jit
def solve_symmetric(system, size, lanes):
    """Solve for the right-hand sides in the first rows, in place, with what ``factorise_symmetric`` left."""
    for i in range(size):
        value = load(system, i, lanes)
        for j in range(max(0, i - BAND + 1), i):
            value = value - load(system, band_row(BAND, size, i, j), lanes) * load(system, j, lanes)
        store(system, i, value, lanes)
    for i in range(size):
        store(system, i, load(system, i, lanes) * load(system, band_row(BAND, size, i, i), lanes), lanes)
    for i in range(size - 1, -1, -1):
        value = load(system, i, lanes)
        for j in range(max(0, i - BAND + 1), i):
            entry = load(system, band_row(BAND, size, i, j), lanes)
            store(system, j, load(system, j, lanes) - entry * value, lanes)
