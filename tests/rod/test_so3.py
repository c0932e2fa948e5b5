"""Group laws of rotations, and the angle series against mpmath."""

from functools import cache

import mpmath
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from magrod_env._jit import jit
from magrod_env._simd import load, store
from magrod_env.rod.batch import LANES
from magrod_env.rod.so3 import (
    chord_slope,
    compose_cayley,
    cross,
    half_angle_series,
    matrix,
    normalise,
    relative_rotation,
    rotate,
    rotate_back,
    strain_slope,
)

ANGLES = st.sampled_from([0.0, 1e-8, 1e-3, np.pi - 1e-9, np.pi]) | st.floats(0.0, np.pi)  # rad
NUMBERS = st.floats(-1.0, 1.0)


@st.composite
def vectors(draw):
    """A vector (3,) of numbers from -1 to 1."""
    return np.array(draw(st.tuples(NUMBERS, NUMBERS, NUMBERS)))


@st.composite
def rotations(draw):
    """A scipy rotation by any angle, zero, tiny and pi among them, about any axis."""
    axis = draw(vectors())
    size = np.linalg.norm(axis)
    return Rotation.from_rotvec(draw(ANGLES) * (axis / size if size > 1e-3 else np.eye(3)[2]))


def quaternion(rotation):
    """(w, x, y, z) of a scipy rotation."""
    x, y, z, w = rotation.as_quat()
    return w, x, y, z


@given(rotations(), st.sampled_from([1.0, 3.0]))
def test_matrix_is_that_of_scipy_for_a_quaternion_of_any_length(rotation, length):
    rows = matrix(tuple(length * np.array(quaternion(rotation))), 2.0 / length**2)
    np.testing.assert_allclose(rows, rotation.as_matrix(), atol=4e-16)


@given(rotations(), vectors())
def test_rotations_are_orthogonal_and_inverted_by_the_transpose(rotation, vector):
    rows, v = matrix(quaternion(rotation), 2.0), tuple(2.0 * vector)
    np.testing.assert_allclose(np.array(rows) @ np.array(rows).T, np.eye(3), atol=1e-15)
    np.testing.assert_allclose(rotate(rows, v), rotation.apply(v), atol=2e-15)
    np.testing.assert_allclose(rotate_back(rows, rotate(rows, v)), v, atol=2e-15)


@given(rotations(), rotations())
def test_relative_rotation_is_the_inverse_of_one_times_the_other(a, b):
    w, vector = relative_rotation(quaternion(a), quaternion(b))
    np.testing.assert_allclose(w**2 + np.dot(vector, vector), 1.0, atol=1e-15)
    # the product of matrices, as two signs stand for one rotation
    np.testing.assert_allclose(matrix((w, *vector), 2.0), (a.inv() * b).as_matrix(), atol=2e-15)


@given(rotations(), rotations(), rotations())
def test_relative_rotation_is_invariant_under_a_common_rotation(a, b, common):
    turned = [tuple(multiply(quaternion(common), quaternion(r))) for r in (a, b)]
    before, after = relative_rotation(quaternion(a), quaternion(b)), relative_rotation(*turned)
    np.testing.assert_allclose(after[0], before[0], atol=1e-15)
    np.testing.assert_allclose(after[1], before[1], atol=1e-15)


def multiply(p, q):
    """Hamilton product, from the definition i j = k."""
    p, q = np.array(p), np.array(q)
    scalar = p[0] * q[0] - p[1:] @ q[1:]
    return np.concatenate([[scalar], p[0] * q[1:] + q[0] * p[1:] + np.cross(p[1:], q[1:])])


@given(rotations(), vectors(), st.sampled_from([0.0, 1e-8, 0.2, 3.0]))
def test_cayley_vector_turns_by_twice_the_arc_tangent_of_its_length(start, direction, scale):
    f = scale * direction
    size = np.linalg.norm(f)
    step = Rotation.from_rotvec(2 * np.arctan(size) * f / size if size else f)
    q = normalise(compose_cayley(quaternion(start), tuple(f)))
    np.testing.assert_allclose(np.linalg.norm(q), 1.0, atol=3e-16)
    np.testing.assert_allclose(matrix(q, 2.0), (start * step).as_matrix(), atol=2e-15)


def test_cross_product_is_right_handed():
    assert cross((1.0, 0.0, 0.0), (0.0, 1.0, 0.0)) == (0.0, 0.0, 1.0)
    a, b = np.random.default_rng(11).normal(size=(2, 3))
    np.testing.assert_allclose(cross(tuple(a), tuple(b)), np.cross(a, b), rtol=1e-15)


def half_angle_exactly(x):
    """(1 - atan(sqrt(x))/sqrt(x))/x; at zero its limit 1/3."""
    root = mpmath.sqrt(x)
    return (1 - mpmath.atan(root) / root) / x if x else mpmath.mpf(1) / 3


def chord_slope_exactly(y):
    """-2 d sinc(sqrt(y)/2)/dy, by the derivative of sin(r)/r at r = sqrt(y)/2; at zero its limit 1/12."""
    r = mpmath.sqrt(y) / 2
    return (mpmath.sin(r) - r * mpmath.cos(r)) / (4 * r**3) if y else mpmath.mpf(1) / 12


def strain_slope_exactly(y):
    """2 da/dy of a = (1 - sinc(sqrt(y)/2))/y = (1 - sinc)/y; at zero its limit -1/960."""
    r = mpmath.sqrt(y) / 2
    return chord_slope_exactly(y) / y - 2 * (1 - mpmath.sin(r) / r) / y**2 if y else -mpmath.mpf(1) / 960


SERIES = {  # largest argument, exact values, largest relative error in units of the last place, double and single
    "half_angle": (half_angle_series, 1.0, half_angle_exactly, (6, 3)),
    "strain_slope": (strain_slope, np.pi**2, strain_slope_exactly, (8, 3)),
    "chord_slope": (chord_slope, np.pi**2, chord_slope_exactly, (6, 3)),
}


def series_of_float(series):
    return jit(lambda x: series(x))


@cache
def series_of_lanes(name):
    series = SERIES[name][0]
    return jit(lambda values, out, lanes: store(out, 0, series(load(values, 0, lanes)), lanes))


def run_lanes(name, x):
    """The series of all numbers (a multiple of the lanes), one block of lanes after the other."""
    lanes = (0,) * LANES[x.dtype.name]
    blocks, out = x.reshape(-1, len(lanes)), np.zeros((x.size // len(lanes), len(lanes)), x.dtype)
    for values, results in zip(blocks, out, strict=True):
        series_of_lanes(name)(values, results, lanes)
    return out.ravel()


@pytest.mark.parametrize("dtype", [np.float64, np.float32])
@pytest.mark.parametrize("name", SERIES)
def test_series_are_exact_to_rounding_for_rotations_up_to_pi(name, dtype):
    _, largest, exactly, units = SERIES[name]
    x = np.concatenate([[0.0, 1e-30, 1e-16, 1e-8, 1e-5, 0.0625], np.linspace(1e-3, largest, 506)]).astype(dtype)
    x = np.minimum(x, dtype(largest))
    with mpmath.workdps(100):  # of which the differences lose 60 at x = 1e-30
        exact = [exactly(mpmath.mpf(float(at))) for at in x]
        out = run_lanes(name, x)
        errors = [abs(float(mpmath.mpf(float(value)) / true - 1)) for value, true in zip(out, exact, strict=True)]
    assert max(errors) < units[dtype is np.float32] * np.finfo(dtype).eps


@pytest.mark.parametrize("name", SERIES)
def test_series_of_a_float_is_that_of_a_double_lane(name):
    x = np.linspace(0.0, SERIES[name][1], 8)
    alone = series_of_float(SERIES[name][0])
    np.testing.assert_array_equal([alone(value) for value in x], run_lanes(name, x))
