"""LDL^T of a symmetric block tridiagonal matrix, six degrees of freedom a node, in scratch memory of a lane block.

A node at row ``own`` holds its diagonal block (21 numbers, the lower triangle row by row), its coupling to the node
before (36, row by row) and its right-hand side (6). Nothing is pivoted: each lane does the same operations.
"""

from magrod_env._jit import inline_jit
from magrod_env._simd import load, store

DIAGONAL, COUPLING, RIGHT, SYSTEM = 0, 21, 57, 63  # rows of a node; SYSTEM is their number


@inline_jit
def triangle(i, j):
    """Place of entry (i, j), j <= i, in the lower triangle."""
    return DIAGONAL + (i * (i + 1)) // 2 + j


@inline_jit
def factor_node(scratch, own, lanes):
    """Replace a diagonal block by L (unit, below) and 1/D (on the diagonal), and the right-hand side r by L^-1 r."""
    for i in range(6):
        right = load(scratch, own + RIGHT + i, lanes)
        pivot = load(scratch, own + triangle(i, i), lanes)
        for j in range(i):
            total = load(scratch, own + triangle(i, j), lanes)
            for k in range(j):
                total = total - load(scratch, own + triangle(i, k), lanes) * load(scratch, own + triangle(j, k), lanes)
            store(scratch, own + triangle(i, j), total, lanes)
        for j in range(i):
            total = load(scratch, own + triangle(i, j), lanes)
            scaled = total * load(scratch, own + triangle(j, j), lanes)
            pivot = pivot - total * scaled
            right = right - scaled * load(scratch, own + RIGHT + j, lanes)
            store(scratch, own + triangle(i, j), scaled, lanes)
        store(scratch, own + triangle(i, i), 1.0 / pivot, lanes)
        store(scratch, own + RIGHT + i, right, lanes)


@inline_jit
def eliminate_node(scratch, own_a, own_b, lanes):
    """Eliminate a factored node a from the next node b: with W = C L^-T, b's block loses W D^-1 W^T, and C is replaced
    by W D^-1.
    """
    for i in range(6):
        row = own_b + COUPLING + 6 * i
        for j in range(6):
            total = load(scratch, row + j, lanes)
            for k in range(j):
                total = total - load(scratch, row + k, lanes) * load(scratch, own_a + triangle(j, k), lanes)
            store(scratch, row + j, total, lanes)
        for j in range(i):
            total = load(scratch, own_b + triangle(i, j), lanes)
            for k in range(6):
                scaled = load(scratch, own_b + COUPLING + 6 * j + k, lanes)
                total = total - load(scratch, row + k, lanes) * scaled
            store(scratch, own_b + triangle(i, j), total, lanes)
        pivot = load(scratch, own_b + triangle(i, i), lanes)
        right = load(scratch, own_b + RIGHT + i, lanes)
        for k in range(6):
            total = load(scratch, row + k, lanes)
            scaled = total * load(scratch, own_a + triangle(k, k), lanes)
            pivot = pivot - total * scaled
            right = right - scaled * load(scratch, own_a + RIGHT + k, lanes)
            store(scratch, row + k, scaled, lanes)
        store(scratch, own_b + triangle(i, i), pivot, lanes)
        store(scratch, own_b + RIGHT + i, right, lanes)


@inline_jit
def substitute_node(scratch, own, own_next, lanes):
    """Replace the right-hand side of a factored node by its solution; ``own_next`` is the next node, solved already,
    or None at the last one.
    """
    for i in range(6):
        total = load(scratch, own + RIGHT + i, lanes) * load(scratch, own + triangle(i, i), lanes)
        if own_next is not None:
            for k in range(6):
                known = load(scratch, own_next + RIGHT + k, lanes)
                total = total - load(scratch, own_next + COUPLING + 6 * k + i, lanes) * known
        store(scratch, own + RIGHT + i, total, lanes)
    for back in range(6):
        i = 5 - back
        total = load(scratch, own + RIGHT + i, lanes)
        for k in range(i + 1, 6):
            total = total - load(scratch, own + triangle(k, i), lanes) * load(scratch, own + RIGHT + k, lanes)
        store(scratch, own + RIGHT + i, total, lanes)
