"""Vectors and rotations as tuples of numbers, for kernels.

A vector is ``(x, y, z)``; a rotation is a unit quaternion ``(w, x, y, z)`` that maps body to world. The numbers are
floats or SIMD lanes (:mod:`magrod_env._simd`); nothing here allocates or branches. Quaternions have four numbers
instead of a matrix's nine, stay on the group by one normalisation, and keep track of relative rotations up to 2 pi.
"""

from magrod_env._jit import inline_jit
from magrod_env._simd import polynomial, square_root


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


# (1 - atan(sqrt(x))/sqrt(x))/x for x = tan(theta/4)^2 in [0, 1], rotations up to pi: errors 1.9e-16 and 1.6e-8
half_angle_series = polynomial(
    double=(
        0.333333333333333145, -0.199999999999864102, 0.142857142840728678, -0.111111110320458848,
        0.0909090706749639008, -0.0769227590501477156, 0.0666633250921101907, -0.0587986548980298061,
        0.0524951858433766049, -0.0470520915307125793, 0.0416521180235054121, -0.0353606610726334883,
        0.0275908328958556517, -0.0188052240436418601, 0.0105953460436954558, -0.00464216393802594754,
        0.00146273030826453949, -0.000292217393080849593, 2.76337933133095989e-05,
    ),
    single=(
        0.333333317330635198, -0.199997393298355796, 0.142785687482106004, -0.11033764115313446,
        0.0865688043015449104, -0.0625016944474950644, 0.0358715389820427548, -0.0135077714270201943,
        0.0023869973167240337,
    ),
)  # fmt: skip
# 2 da/dy of a(y) = (1 - sinc(sqrt(y)/2))/y on 0 <= y <= pi^2: relative errors 7e-16 and 3e-8
strain_slope = polynomial(
    double=(
        -0.0010416666666666662, 1.240079365078823e-05, -6.458746692242521e-08, 1.9571959141284352e-10,
        -3.920649497286838e-13, 5.598641266488608e-16, -5.835011061375404e-19,
    ),
    single=(-0.0010416666384108595, 1.2400701996964708e-05, -6.454092330899976e-08, 1.8812868995136357e-10),
)  # fmt: skip
# -2 d sinc(sqrt(y)/2)/dy on 0 <= y <= pi^2: relative errors 8e-17 and 1.3e-9
chord_slope = polynomial(
    double=(
        0.08333333333333333, -0.002083333333333314, 1.860119047614877e-05, -8.611662254113238e-08,
        2.446494824767667e-10, -4.704768832074362e-13, 6.530940463891705e-16, -6.64448777514577e-19,
    ),
    single=(
        0.08333333325017947, -0.0020833329119544592, 1.860084842361486e-05, -8.601927105053692e-08,
        2.332958825507414e-10,
    ),
)  # fmt: skip
