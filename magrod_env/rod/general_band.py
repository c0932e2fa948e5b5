"""LU of band matrices that are not symmetric, in the lanes of a block: the tangents of loads without a potential.

Row i of a matrix lies in ``WIDE`` rows of memory from ``first + WIDE i`` on, entry (i, j) at ``HALF + j - i``, so that
the first ``HALF + 1`` of them are the lower band of ``tangent.py``. Nothing is pivoted: without loads the matrix is
positive definite, and a negative determinant tells that a real eigenvalue has passed zero since.
"""

from magrod_env._jit import inline_jit, jit
from magrod_env._simd import constant, load, store, where_above

HALF = 11  # two neighbouring nodes' degrees of freedom, less one
WIDE = 2 * HALF + 1


@inline_jit
def wide_row(first, i, j):
    """Row of entry (i, j)."""
    return first + WIDE * i + HALF + j - i


@jit
def mirror(system, first, size, lanes):
    """Complete matrices whose lower band alone has been written: the upper band becomes its mirror image."""
    for i in range(size):
        for j in range(max(0, i - HALF), i):
            store(system, wide_row(first, j, i), load(system, wide_row(first, i, j), lanes), lanes)


@jit
def factorise_general(system, first, size, sign, lanes):
    """LU in place, 1/U on the diagonal; the sign of each lane's determinant goes to ``sign`` (L,)."""
    zero = constant(0.0, load(system, first, lanes))
    even = zero + 1.0
    for i in range(size):
        begin = max(0, i - HALF)
        for j in range(begin, min(size, i + HALF + 1)):
            total = load(system, wide_row(first, i, j), lanes)
            for k in range(max(begin, j - HALF), min(i, j)):
                product = load(system, wide_row(first, i, k), lanes) * load(system, wide_row(first, k, j), lanes)
                total = total - product
            if j < i:
                total = total * load(system, wide_row(first, j, j), lanes)
            if j == i:
                even = where_above(total, zero, even, -even)
                total = 1.0 / total
            store(system, wide_row(first, i, j), total, lanes)
    store(sign, 0, even, lanes)


@jit
def solve_general(system, first, size, vector, lanes):
    """Solve for the right-hand sides in ``vector`` (size * L,), in place, with what ``factorise_general`` factored."""
    for i in range(size):
        value = load(vector, i, lanes)
        for j in range(max(0, i - HALF), i):
            value = value - load(system, wide_row(first, i, j), lanes) * load(vector, j, lanes)
        store(vector, i, value, lanes)
    for i in range(size - 1, -1, -1):
        value = load(vector, i, lanes)
        for j in range(i + 1, min(size, i + HALF + 1)):
            value = value - load(system, wide_row(first, i, j), lanes) * load(vector, j, lanes)
        store(vector, i, value * load(system, wide_row(first, i, i), lanes), lanes)
