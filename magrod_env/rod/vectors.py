"""Vectors and torques: three numbers each in space, two and one in a plane; ``planar`` is decided when compiled."""

from magrod_env._jit import inline_jit
from magrod_env._simd import constant, load
from magrod_env.rod.planar import planar_matrix, planar_rotate
from magrod_env.rod.so3 import add, add_scaled, dot, matrix, rotate, rotate_back, scale


@inline_jit
def add_vectors(a, b, planar):
    """Sum of two vectors."""
    if planar is None:
        return add(a, b)
    return a[0] + b[0], a[1] + b[1]


@inline_jit
def subtract_vectors(a, b, planar):
    """Difference of two vectors."""
    if planar is None:
        return a[0] - b[0], a[1] - b[1], a[2] - b[2]
    return a[0] - b[0], a[1] - b[1]


@inline_jit
def scaled_vector(factor, a, planar):
    """``factor * a``."""
    if planar is None:
        return scale(factor, a)
    return factor * a[0], factor * a[1]


@inline_jit
def add_scaled_vector(a, factor, b, planar):
    """``a + factor * b``."""
    if planar is None:
        return add_scaled(a, factor, b)
    return a[0] + factor * b[0], a[1] + factor * b[1]


@inline_jit
def inner(a, b, planar):
    """Scalar product."""
    if planar is None:
        return dot(a, b)
    return a[0] * b[0] + a[1] * b[1]


@inline_jit
def add_torques(a, b, planar):
    """Sum of two torques."""
    if planar is None:
        return add(a, b)
    return a + b


@inline_jit
def to_world(rotation, v, planar):
    """A vector of the body frame in the world."""
    if planar is None:
        return rotate(matrix(rotation, 2.0), v)
    return planar_rotate(planar_matrix(rotation, 2.0), v)


@inline_jit
def torque_to_body(rotation, torque, planar):
    """A torque of the world in the body frame."""
    if planar is None:
        return rotate_back(matrix(rotation, 2.0), torque)
    return torque


@inline_jit
def tangent(rotation, planar):
    """First body axis in the world."""
    if planar is None:
        frame = matrix(rotation, 2.0)
        return frame[0][0], frame[1][0], frame[2][0]
    return planar_matrix(rotation, 2.0)


@inline_jit
def no_load(block, lanes, planar):
    """A zero force and a zero torque."""
    zero = constant(0.0, load(block, 0, lanes))
    if planar is None:
        return (zero, zero, zero), (zero, zero, zero)
    return (zero, zero), zero
