"""Group laws of rotations, the angle series against mpmath, quaternions of matrices against scipy."""

import mpmath
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from magrod_env._jit import jit
from magrod_env._simd import load, store
from magrod_env.rod.so3 import (
    compose_cayley,
    cross,
    half_angle_series,
    matrix,
    normalise,
    quaternion_from_matrix,
    relative_rotation,
    rotate,
    rotate_back,
)

ANGLES = {"identity": 0.0, "tiny": 1e-8, "small": 1e-3, "near_pi": np.pi - 1e-9, "pi": np.pi}
RNG = np.random.default_rng(11)


def samples():
    """Rotation vectors: the angles above about three axes, and random ones."""
    axes = np.vstack([np.eye(3), RNG.normal(size=(3, 3))])
    axes /= np.linalg.norm(axes, axis=1)[:, None]
    fixed = [angle * axis for angle in ANGLES.values() for axis in axes]
    return np.array(fixed + list(RNG.uniform(-1.8, 1.8, (20, 3))))


def quaternion(rotation):
    """(w, x, y, z) of a scipy rotation."""
    x, y, z, w = rotation.as_quat()
    return w, x, y, z


ROTATIONS = [Rotation.from_rotvec(vector) for vector in samples()]


@pytest.mark.parametrize("rotation", ROTATIONS)
def test_matrix_is_that_of_scipy_for_a_quaternion_of_any_length(rotation):
    q = np.array(quaternion(rotation))
    for length in (1.0, 3.0):
        rows = matrix(tuple(length * q), 2.0 / length**2)
        np.testing.assert_allclose(rows, rotation.as_matrix(), atol=4e-16)


def test_rotations_are_orthogonal_and_inverted_by_the_transpose():
    v = (0.3, -1.2, 2.0)
    for rotation in ROTATIONS:
        rows = matrix(quaternion(rotation), 2.0)
        np.testing.assert_allclose(np.array(rows) @ np.array(rows).T, np.eye(3), atol=1e-15)
        np.testing.assert_allclose(rotate(rows, v), rotation.apply(v), atol=2e-15)
        np.testing.assert_allclose(rotate_back(rows, rotate(rows, v)), v, atol=2e-15)


def test_relative_rotation_is_the_inverse_of_one_times_the_other():
    for a in ROTATIONS:
        for b in ROTATIONS[::5]:
            w, vector = relative_rotation(quaternion(a), quaternion(b))
            np.testing.assert_allclose(w**2 + np.dot(vector, vector), 1.0, atol=1e-15)
            # the product of matrices, as two signs stand for one rotation
            np.testing.assert_allclose(matrix((w, *vector), 2.0), (a.inv() * b).as_matrix(), atol=2e-15)


def test_relative_rotation_is_invariant_under_a_common_rotation():
    a, b, common = ROTATIONS[-1], ROTATIONS[-2], ROTATIONS[-3]
    turned = [tuple(multiply(quaternion(common), quaternion(r))) for r in (a, b)]
    before, after = relative_rotation(quaternion(a), quaternion(b)), relative_rotation(*turned)
    np.testing.assert_allclose(after[0], before[0], atol=1e-15)
    np.testing.assert_allclose(after[1], before[1], atol=1e-15)


def multiply(p, q):
    """Hamilton product, from the definition i j = k."""
    p, q = np.array(p), np.array(q)
    scalar = p[0] * q[0] - p[1:] @ q[1:]
    return np.concatenate([[scalar], p[0] * q[1:] + q[0] * p[1:] + np.cross(p[1:], q[1:])])


def test_cayley_vector_turns_by_twice_the_arc_tangent_of_its_length():
    for f in ([0, 0, 0], [1e-8, 0, 0], [0.2, -0.1, 0.05], [3.0, 1.0, -2.0]):
        f = np.array(f, float)
        size = np.linalg.norm(f)
        step = Rotation.from_rotvec(2 * np.arctan(size) * f / size if size else f)
        for start in ROTATIONS[::4]:
            q = normalise(compose_cayley(quaternion(start), tuple(f)))
            np.testing.assert_allclose(np.linalg.norm(q), 1.0, atol=3e-16)
            np.testing.assert_allclose(matrix(q, 2.0), (start * step).as_matrix(), atol=2e-15)


def test_cross_product_is_right_handed():
    assert cross((1.0, 0.0, 0.0), (0.0, 1.0, 0.0)) == (0.0, 0.0, 1.0)
    a, b = RNG.normal(size=(2, 3))
    np.testing.assert_allclose(cross(tuple(a), tuple(b)), np.cross(a, b), rtol=1e-15)


@pytest.mark.parametrize("rotation", ROTATIONS)
def test_quaternion_of_a_matrix_at_every_angle(rotation):
    q = np.array(quaternion_from_matrix(rotation.as_matrix()))
    expected = np.array(quaternion(rotation))
    np.testing.assert_allclose(q * np.sign(q @ expected), expected, atol=1e-15)


def test_quaternion_of_a_matrix_by_each_of_its_components():
    """Half turns about the axes and diagonals, where one component or two are zero."""
    for axis in ([1, 0, 0], [0, 1, 0], [0, 0, 1], [1, 1, 0], [0, 1, 1], [1, 0, 1], [1, 1, 1], [-1, 1, 1]):
        rotation = Rotation.from_rotvec(np.pi * np.array(axis) / np.linalg.norm(axis))
        rows = matrix(quaternion_from_matrix(rotation.as_matrix()), 2.0)
        np.testing.assert_allclose(rows, rotation.as_matrix(), atol=1e-15)


@jit
def series_of_float(x):
    return half_angle_series(x)


@jit
def series_of_lanes(values, out, lanes):
    store(out, 0, half_angle_series(load(values, 0, lanes)), lanes)


def exact_series(x):
    """(1 - atan(sqrt(x))/sqrt(x))/x to 40 digits; at zero its limit 1/3."""
    with mpmath.workdps(80):  # of which the difference loses 30 at x = 1e-30
        if x == 0:
            return mpmath.mpf(1) / 3
        root = mpmath.sqrt(mpmath.mpf(float(x)))
        return (1 - mpmath.atan(root) / root) / mpmath.mpf(float(x))


@pytest.mark.parametrize(("dtype", "lanes", "units"), [(np.float64, 8, 5), (np.float32, 16, 2)])
def test_half_angle_series_is_exact_to_rounding(dtype, lanes, units):
    """On [0, 1], that is relative rotations up to pi; the error in units of the last place of 1/3."""
    x = np.concatenate([[0.0, 1e-30, 1e-16, 1e-8, 1e-5, 0.0625], np.linspace(1e-3, 1.0, 506)]).astype(dtype)
    out = np.concatenate([run_lanes(part, dtype) for part in np.split(x, len(x) // lanes)])
    errors = [abs(float(mpmath.mpf(float(value)) - exact_series(at))) for value, at in zip(out, x, strict=True)]
    assert max(errors) < units * np.spacing(dtype(1 / 3))


def run_lanes(x, dtype):
    out = np.zeros(len(x), dtype)
    series_of_lanes(x, out, (0,) * len(x))
    return out


def test_half_angle_series_of_a_float_is_that_of_a_double_lane():
    x = np.linspace(0.0, 1.0, 8)
    np.testing.assert_array_equal([series_of_float(value) for value in x], run_lanes(x, np.float64))
