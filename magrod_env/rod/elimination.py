"""LDL^T of a symmetric block tridiagonal matrix in scratch memory of a lane block: six degrees of freedom a node, three
in a plane.

A node at row ``own`` holds its diagonal block (the lower triangle row by row), its coupling to the node before (row by
row) and its right-hand side. ``freedoms`` is a tuple whose length, which the compiler knows, is their number. Nothing
is pivoted: each lane does the same operations.
"""

from magrod_env._jit import inline_jit
from magrod_env._simd import load, store

SPATIAL_FREEDOMS, PLANAR_FREEDOMS = (0,) * 6, (0,) * 3
DIAGONAL, COUPLING, RIGHT, SYSTEM = 0, 21, 57, 63  # rows of a spatial node; SYSTEM is their number


@inline_jit
def triangle(i, j):
    """Place of entry (i, j), j <= i, in the lower triangle."""
    return DIAGONAL + (i * (i + 1)) // 2 + j


@inline_jit
def coupling_row(freedoms):
    """First row of a node's coupling."""
    return triangle(len(freedoms), 0)


@inline_jit
def right_row(freedoms):
    """First row of a node's right-hand side."""
    return coupling_row(freedoms) + len(freedoms) * len(freedoms)


@inline_jit
def system_rows(freedoms):
    """Rows of a node's part of the system."""
    return right_row(freedoms) + len(freedoms)


@inline_jit
def add1(scratch, row, value, lanes):
    """Add to a row."""
    store(scratch, row, load(scratch, row, lanes) + value, lanes)


@inline_jit
def add3(scratch, row, v, lanes):
    """Add to three neighbouring rows."""
    add1(scratch, row, v[0], lanes)
    add1(scratch, row + 1, v[1], lanes)
    add1(scratch, row + 2, v[2], lanes)


@inline_jit
def factor_node(scratch, own, lanes, freedoms):
    """Replace a diagonal block by L (unit, below) and 1/D (on the diagonal), and the right-hand side r by L^-1 r."""
    n, first = len(freedoms), own + right_row(freedoms)
    for i in range(n):
        right = load(scratch, first + i, lanes)
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
            right = right - scaled * load(scratch, first + j, lanes)
            store(scratch, own + triangle(i, j), scaled, lanes)
        store(scratch, own + triangle(i, i), 1.0 / pivot, lanes)
        store(scratch, first + i, right, lanes)


@inline_jit
def eliminate_node(scratch, own_a, own_b, lanes, freedoms):
    """Eliminate a factored node a from the next node b: with W = C L^-T, b's block loses W D^-1 W^T, and C is replaced
    by W D^-1.
    """
    n = len(freedoms)
    coupling, right_a, right_b = (
        own_b + coupling_row(freedoms),
        own_a + right_row(freedoms),
        own_b + right_row(freedoms),
    )
    for i in range(n):
        row = coupling + n * i
        for j in range(n):
            total = load(scratch, row + j, lanes)
            for k in range(j):
                total = total - load(scratch, row + k, lanes) * load(scratch, own_a + triangle(j, k), lanes)
            store(scratch, row + j, total, lanes)
        for j in range(i):
            total = load(scratch, own_b + triangle(i, j), lanes)
            for k in range(n):
                total = total - load(scratch, row + k, lanes) * load(scratch, coupling + n * j + k, lanes)
            store(scratch, own_b + triangle(i, j), total, lanes)
        pivot = load(scratch, own_b + triangle(i, i), lanes)
        right = load(scratch, right_b + i, lanes)
        for k in range(n):
            total = load(scratch, row + k, lanes)
            scaled = total * load(scratch, own_a + triangle(k, k), lanes)
            pivot = pivot - total * scaled
            right = right - scaled * load(scratch, right_a + k, lanes)
            store(scratch, row + k, scaled, lanes)
        store(scratch, own_b + triangle(i, i), pivot, lanes)
        store(scratch, right_b + i, right, lanes)


@inline_jit
def forward_node(scratch, own, own_before, lanes, freedoms):
    """Replace a new right-hand side r of a factored node by L^-1 (r - C r_before); ``own_before`` is the node before,
    done already, or None at the first one.
    """
    n, first = len(freedoms), own + right_row(freedoms)
    for i in range(n):
        right = load(scratch, first + i, lanes)
        if own_before is not None:
            for k in range(n):
                known = load(scratch, own_before + right_row(freedoms) + k, lanes)
                right = right - load(scratch, own + coupling_row(freedoms) + n * i + k, lanes) * known
        for j in range(i):
            right = right - load(scratch, own + triangle(i, j), lanes) * load(scratch, first + j, lanes)
        store(scratch, first + i, right, lanes)


@inline_jit
def substitute_node(scratch, own, own_next, lanes, freedoms):
    """Replace the right-hand side of a factored node by its solution; ``own_next`` is the next node, solved already,
    or None at the last one.
    """
    n, first = len(freedoms), own + right_row(freedoms)
    for i in range(n):
        total = load(scratch, first + i, lanes) * load(scratch, own + triangle(i, i), lanes)
        if own_next is not None:
            for k in range(n):
                known = load(scratch, own_next + right_row(freedoms) + k, lanes)
                total = total - load(scratch, own_next + coupling_row(freedoms) + n * k + i, lanes) * known
        store(scratch, first + i, total, lanes)
    for back in range(n):
        i = n - 1 - back
        total = load(scratch, first + i, lanes)
        for k in range(i + 1, n):
            total = total - load(scratch, own + triangle(k, i), lanes) * load(scratch, first + k, lanes)
        store(scratch, first + i, total, lanes)
