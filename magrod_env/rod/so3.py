"""Vectors and rotations as tuples of numbers, for kernels.

A vector is ``(x, y, z)``; a rotation is a unit quaternion ``(w, x, y, z)`` that maps body to world. The numbers are
floats or SIMD lanes (:mod:`magrod_env._simd`); nothing here allocates or branches. Quaternions have four numbers
instead of a matrix's nine, stay on the group by one normalisation, and keep track of relative rotations up to 2 pi.
"""

import numba
from numba.extending import overload

from magrod_env._jit import inline_jit, jit
from magrod_env._simd import LaneType, square_root


@inline_jit
def dot(a, b):
    """Scalar product."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@inline_jit
def cross(a, b):
    """Vector product ``a x b``."""
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


@inline_jit
def add(a, b):
    """Sum of two vectors."""
    return a[0] + b[0], a[1] + b[1], a[2] + b[2]


@inline_jit
def subtract(a, b):
    """Difference of two vectors."""
    return a[0] - b[0], a[1] - b[1], a[2] - b[2]


@inline_jit
def scale(factor, a):
    """``factor * a``."""
    return factor * a[0], factor * a[1], factor * a[2]


@inline_jit
def add_scaled(a, factor, b):
    """``a + factor * b``."""
    return a[0] + factor * b[0], a[1] + factor * b[1], a[2] + factor * b[2]


@inline_jit
def relative_rotation(a, b):
    """Quaternion of ``A^T B``, the rotation from frame a to frame b: scalar part and vector part."""
    w = a[0] * b[0] + a[1] * b[1] + a[2] * b[2] + a[3] * b[3]
    x = a[0] * b[1] - a[1] * b[0] - a[2] * b[3] + a[3] * b[2]
    y = a[0] * b[2] - a[2] * b[0] - a[3] * b[1] + a[1] * b[3]
    z = a[0] * b[3] - a[3] * b[0] - a[1] * b[2] + a[2] * b[1]
    return w, (x, y, z)


@inline_jit
def compose_cayley(q, f):
    """Quaternion of ``Q Cay(f)``, not normalised: the product with (1, f)."""
    w = q[0] - q[1] * f[0] - q[2] * f[1] - q[3] * f[2]
    x = q[1] + q[0] * f[0] + q[2] * f[2] - q[3] * f[1]
    y = q[2] + q[0] * f[1] + q[3] * f[0] - q[1] * f[2]
    z = q[3] + q[0] * f[2] + q[1] * f[1] - q[2] * f[0]
    return w, x, y, z


@inline_jit
def normalise(q):
    """The quaternion on the unit sphere."""
    factor = 1.0 / square_root(q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3])
    return factor * q[0], factor * q[1], factor * q[2], factor * q[3]


@inline_jit
def matrix(q, two_over_norm):
    """Rotation matrix, row by row, of a quaternion ``q`` of any length; ``two_over_norm = 2 / |q|^2``."""
    x, y, z = two_over_norm * q[1], two_over_norm * q[2], two_over_norm * q[3]
    xx, yy, zz = q[1] * x, q[2] * y, q[3] * z
    xy, xz, yz = q[1] * y, q[1] * z, q[2] * z
    wx, wy, wz = q[0] * x, q[0] * y, q[0] * z
    return (1.0 - yy - zz, xy - wz, xz + wy), (xy + wz, 1.0 - xx - zz, yz - wx), (xz - wy, yz + wx, 1.0 - xx - yy)


@inline_jit
def rotate(rows, v):
    """``R v``: body to world."""
    return dot(rows[0], v), dot(rows[1], v), dot(rows[2], v)


@inline_jit
def rotate_back(rows, v):
    """``R^T v``: world to body."""
    return (
        rows[0][0] * v[0] + rows[1][0] * v[1] + rows[2][0] * v[2],
        rows[0][1] * v[0] + rows[1][1] * v[1] + rows[2][1] * v[2],
        rows[0][2] * v[0] + rows[1][2] * v[1] + rows[2][2] * v[2],
    )


# (1 - atan(sqrt(x))/sqrt(x))/x on 0 <= x <= 1: minimax polynomials, error 1.9e-16 and 1.6e-8
_HALF_ANGLE_DOUBLE = (
    2.76337933133095989e-05, -2.92217393080849593e-04, 1.46273030826453949e-03, -4.64216393802594754e-03,
    1.05953460436954558e-02, -1.88052240436418601e-02, 2.75908328958556517e-02, -3.53606610726334883e-02,
    4.16521180235054121e-02, -4.70520915307125793e-02, 5.24951858433766049e-02, -5.87986548980298061e-02,
    6.66633250921101907e-02, -7.69227590501477156e-02, 9.09090706749639008e-02, -1.11111110320458848e-01,
    1.42857142840728678e-01, -1.99999999999864102e-01, 3.33333333333333145e-01,
)  # fmt: skip
_HALF_ANGLE_SINGLE = (
    2.3869973167240337e-03, -1.35077714270201943e-02, 3.58715389820427548e-02, -6.25016944474950644e-02,
    8.65688043015449104e-02, -1.1033764115313446e-01, 1.42785687482106004e-01, -1.99997393298355796e-01,
    3.33333317330635198e-01,
)  # fmt: skip


def half_angle_series(x):
    """``(1 - atan(sqrt(x))/sqrt(x))/x`` for ``x = tan(theta/4)^2`` in [0, 1], that is rotations up to pi."""
    raise NotImplementedError("only inside compiled code")


@overload(half_angle_series)
def _half_angle_overload(x):
    single = isinstance(x, LaneType) and x.scalar == numba.float32
    table = _HALF_ANGLE_SINGLE if single else _HALF_ANGLE_DOUBLE
    first, rest = table[0], table[1:]

    def horner(x):
        value = first * x + rest[0]
        for k in range(1, len(rest)):
            value = value * x + rest[k]
        return value

    return horner


@jit
def quaternion_from_matrix(rotation):
    """Unit quaternion (w, x, y, z) of a 3x3 rotation matrix, by its largest component (safe at every angle)."""
    trace = rotation[0, 0] + rotation[1, 1] + rotation[2, 2]
    largest = max(trace, rotation[0, 0], rotation[1, 1], rotation[2, 2])
    if trace == largest:
        q = (
            1.0 + trace,
            rotation[2, 1] - rotation[1, 2],
            rotation[0, 2] - rotation[2, 0],
            rotation[1, 0] - rotation[0, 1],
        )
    else:
        i = 0 if rotation[0, 0] == largest else (1 if rotation[1, 1] == largest else 2)
        j, k = (i + 1) % 3, (i + 2) % 3
        part = (
            1.0 + rotation[i, i] - rotation[j, j] - rotation[k, k],
            rotation[j, i] + rotation[i, j],
            rotation[k, i] + rotation[i, k],
        )
        w = rotation[k, j] - rotation[j, k]
        if i == 0:
            q = (w, part[0], part[1], part[2])
        elif i == 1:
            q = (w, part[2], part[0], part[1])
        else:
            q = (w, part[1], part[2], part[0])
    return normalise(q)
