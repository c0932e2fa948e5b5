"""Lane numbers do what numpy does to each entry: one IEEE operation at a time, whatever the lane count."""

import numpy as np
import pytest

from magrod_env._jit import jit
from magrod_env._simd import constant, load, maximum, minimum, square_root, store, where_above

LANE_COUNTS = {np.float64: (1, 8, 16), np.float32: (1, 16, 32)}
CASES = [(dtype, lanes) for dtype, counts in LANE_COUNTS.items() for lanes in counts]


@jit
def arithmetic(block, out, lanes):
    """One row of ``out`` for each operation on rows 0 and 1 of ``block``; no two are joined, so none can be fused."""
    a, b = load(block, 0, lanes), load(block, 1, lanes)
    store(out, 0, a + b, lanes)
    store(out, 1, a - b, lanes)
    store(out, 2, a * b, lanes)
    store(out, 3, a / b, lanes)
    store(out, 4, -a, lanes)
    store(out, 5, square_root(a), lanes)
    store(out, 6, minimum(a, b), lanes)
    store(out, 7, maximum(a, b), lanes)
    store(out, 8, where_above(a, b, a, b), lanes)


@jit
def mixed(block, out, scalar, lanes):
    """Lane numbers with a literal, an integer and an argument on either side."""
    a = load(block, 0, lanes)
    store(out, 0, 0.1 + a, lanes)
    store(out, 1, a - 0.1, lanes)
    store(out, 2, 3 * a, lanes)
    store(out, 3, a / 3, lanes)
    store(out, 4, scalar * a, lanes)
    store(out, 5, scalar / a, lanes)
    store(out, 6, minimum(a, scalar), lanes)
    store(out, 7, maximum(scalar, a), lanes)
    store(out, 8, constant(0.1, a), lanes)


@jit
def fusable(block, out, lanes):
    """Sums of products and a polynomial, where a compiler may fuse multiplications with additions."""
    a, b, c = load(block, 0, lanes), load(block, 1, lanes), load(block, 2, lanes)
    dot = a * b + b * c + c * a
    store(out, 0, dot, lanes)
    store(out, 1, ((0.3 * a + 0.7) * a - 1.1) * a + b * c - a * b, lanes)
    store(out, 2, dot / square_root(a * a + b * b + c * c) - (a * b - b * c), lanes)


@jit
def scalars(a, b):
    """The functions that kernels share, on plain floats."""
    return square_root(a), minimum(a, b), maximum(a, b), where_above(a, b, b, a), constant(3, a)


def numbers(rows, lanes, dtype, seed=0):
    """Positive numbers over several decades, shape (rows, lanes)."""
    rng = np.random.default_rng(seed)
    return (10.0 ** rng.uniform(-6, 6, (rows, lanes))).astype(dtype)


def run(kernel, rows, values, *arguments):
    out = np.zeros(rows * values.shape[1], values.dtype)
    kernel(values.ravel(), out, *arguments, (0,) * values.shape[1])
    return out.reshape(rows, -1)


@pytest.mark.parametrize(("dtype", "lanes"), CASES)
def test_every_operation_equals_numpy_bit_for_bit(dtype, lanes):
    a, b = values = numbers(2, lanes, dtype)
    expected = [a + b, a - b, a * b, a / b, -a, np.sqrt(a), np.minimum(a, b), np.maximum(a, b), np.where(a > b, a, b)]
    np.testing.assert_array_equal(run(arithmetic, 9, values), expected)


@pytest.mark.parametrize(("dtype", "lanes"), CASES)
def test_scalars_take_the_precision_of_the_lanes(dtype, lanes):
    values = numbers(1, lanes, dtype, seed=1)
    a, tenth, three, s = values[0], dtype(0.1), dtype(3), dtype(1.7)
    got = run(mixed, 9, values, 1.7)  # a float64 scalar does not widen float32 lanes
    expected = [
        tenth + a,
        a - tenth,
        three * a,
        a / three,
        s * a,
        s / a,
        np.minimum(a, s),
        np.maximum(a, s),
        np.full(lanes, tenth),
    ]
    np.testing.assert_array_equal(got, expected)


@pytest.mark.parametrize("dtype", LANE_COUNTS)
def test_any_lane_count_gives_the_same_bits(dtype):
    widest = max(LANE_COUNTS[dtype])
    values = numbers(3, 16 * widest, dtype, seed=2)
    alone = np.concatenate([run(fusable, 3, values[:, [k]]) for k in range(values.shape[1])], axis=1)
    together = [run(fusable, 3, np.ascontiguousarray(part)) for part in np.split(values, 16, axis=1)]
    np.testing.assert_array_equal(np.concatenate(together, axis=1), alone)


def test_an_invalid_lane_leaves_its_neighbours_alone():
    values = numbers(2, 8, np.float64, seed=3)
    spoilt = values.copy()
    spoilt[:, 2], spoilt[0, 5] = np.nan, -1.0  # NaN everywhere; the square root of a negative number
    others = [0, 1, 3, 4, 6, 7]
    got, expected = run(arithmetic, 9, spoilt), run(arithmetic, 9, values)
    np.testing.assert_array_equal(got[:, others], expected[:, others])
    assert np.isnan(got[:, 2]).all()
    assert np.isnan(got[5, 5])


def test_minimum_and_maximum_pass_over_a_nan():
    values = np.full((2, 8), 2.0)
    values[0, 3], values[1, 4] = np.nan, np.nan
    np.testing.assert_array_equal(run(arithmetic, 9, values)[6:8], np.full((2, 8), 2.0))


def test_division_by_zero_follows_ieee_and_does_not_raise():
    values = np.array([[1.0, -1.0, 0.0, 5.0] * 2, [0.0, 0.0, 0.0, np.inf] * 2])
    with np.errstate(all="ignore"):
        expected = values[0] / values[1]
    np.testing.assert_array_equal(run(arithmetic, 9, values)[3], expected)


def test_shared_functions_accept_plain_floats():
    assert scalars(2.0, 0.5) == (np.sqrt(2.0), 0.5, 2.0, 0.5, 3.0)


def test_a_number_of_the_wrong_width_cannot_be_stored():
    @jit
    def widen(block, out, lanes, wide):
        store(out, 0, load(block, 0, lanes), wide)
        return load(block, 0, lanes) + load(block, 0, wide)

    with pytest.raises(Exception, match=r"[Nn]o implementation of function|[Ii]nvalid use"):
        widen(np.zeros(16), np.zeros(16), (0,) * 8, (0,) * 16)
