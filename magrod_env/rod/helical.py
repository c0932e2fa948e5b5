"""The helical element: constant strain between two nodes on SE(3), so bending, twist and stretch are exact where
uniform.

Notation of the kernels: node a and node b, ``phi`` rotation vector from a to b (mid-frame = both end frames), ``chord``
the chord over the length in the mid frame, ``gamma`` the stretch-and-shear strain (1, 0, 0 at rest), E = (1, 0, 0).
Derived in docs/physics.md; every force is checked against the gradient of the energy in the tests.
"""

from magrod_env._jit import inline_jit
from magrod_env.rod.so3 import (
    add,
    add_scaled,
    cross,
    dot,
    half_angle_series,
    matrix,
    relative_rotation,
    rotate,
    rotate_back,
    scale,
    subtract,
)


@inline_jit
def strain_slope(y):
    """``2 da/dy`` of ``a(y) = (1 - sinc(sqrt(y)/2))/y``: minimax polynomial for angles up to pi, error 6e-19."""
    value = -5.835011061375404e-19 * y + 5.598641266488608e-16
    value = value * y - 3.920649497286838e-13
    value = value * y + 1.9571959141284352e-10
    value = value * y - 6.458746692242521e-08
    value = value * y + 1.240079365078823e-05
    return value * y - 0.0010416666666666662


@inline_jit
def helical_strain(pose_a, pose_b, inverse_length):
    """Strains of one element and the geometry its forces need.

    Returns ``gamma`` (3,), ``phi`` (3,) rad, and ``(chord, u, mid, (q, w, r, x))``: chord in the mid frame,
    quarter-angle vector u = tan(theta/4) n, rows of the mid-frame matrix, and the scalar functions of theta that
    ``helical_loads`` shares.
    """
    position_a, rotation_a = pose_a
    position_b, rotation_b = pose_b
    cosine, vector = relative_rotation(rotation_a, rotation_b)
    inverse = 1.0 / (1.0 + cosine)
    u = scale(inverse, vector)
    x = dot(u, u)
    w = half_angle_series(x)
    q = 1.0 - x * w  # atan(|u|)/|u|
    phi = scale(4.0 * q, u)
    middle = (
        rotation_a[0] + rotation_b[0],
        rotation_a[1] + rotation_b[1],
        rotation_a[2] + rotation_b[2],
        rotation_a[3] + rotation_b[3],
    )
    mid = matrix(middle, inverse)  # |q_a + q_b|^2 = 2 (1 + cosine)
    chord = rotate_back(mid, scale(inverse_length, subtract(position_b, position_a)))
    sinc_inverse = (1.0 + x) * q  # 1/sinc(theta/2)
    r = 1.0 / (sinc_inverse * q * q)
    a = 0.0625 * (q - w) * r  # (1 - sinc(theta/2))/theta^2
    gamma = unwind(chord, phi, a, sinc_inverse)
    return gamma, phi, (chord, u, mid, q, w, r, x, a, sinc_inverse)


@inline_jit
def unwind(v, phi, a, sinc_inverse):
    """``S^-1 v`` with ``S = I + a phi^ phi^``: from the chord to the strain of the helix (S is symmetric)."""
    return scale(sinc_inverse, add_scaled(v, -a * dot(phi, v), phi))


@inline_jit
def helical_loads(gamma, phi, geometry, stress, moment, length):
    """Nodal loads of an element from its stress (mid-frame force, N) and moment (N m), conjugate to ``gamma`` and
    ``phi``.

    Returns the world force on node a (node b gets its negative) and the body torques on a and on b.
    """
    chord, u, mid, q, w, r, x, a, sinc_inverse = geometry
    n = unwind(stress, phi, a, sinc_inverse)
    s = scale(0.5 * length, cross(chord, n))
    u_s = cross(u, s)
    slope = strain_slope(16.0 * x * q * q)
    phi_gamma, n_phi = cross(phi, gamma), cross(n, phi)
    bracket = add(scale(a, add(cross(phi_gamma, n), cross(gamma, n_phi))), scale(slope * dot(phi_gamma, n_phi), phi))
    m = add_scaled(moment, -length, bracket)
    beta = 0.0625 * (w + q) * sinc_inverse * r
    phi_m = cross(phi, m)
    symmetric = add_scaled(m, beta, cross(phi, phi_m))
    torque_a = add(add(symmetric, scale(0.5, phi_m)), add(s, u_s))
    torque_b = subtract(subtract(s, u_s), subtract(symmetric, scale(0.5, phi_m)))
    return rotate(mid, n), torque_a, torque_b


@inline_jit
def helical_strain_rates(gamma, phi, geometry, velocity_a, spin_a, velocity_b, spin_b, inverse_length):
    """Rates of ``gamma`` (1/s) and ``phi`` (rad/s) from nodal velocities (world, m/s) and angular velocities (body,
    rad/s).

    The transpose of the map in ``helical_loads``: stress times rate is the power of the nodal loads, so Kelvin-Voigt
    damping takes energy out, and no momentum.
    """
    chord, u, mid, q, w, r, x, a, sinc_inverse = geometry
    beta = 0.0625 * (w + q) * sinc_inverse * r
    difference, total = subtract(spin_b, spin_a), add(spin_b, spin_a)
    phi_rate = add_scaled(difference, 0.5, cross(phi, total))
    phi_rate = add_scaled(phi_rate, beta, cross(phi, cross(phi, difference)))
    mid_spin = scale(0.5, add(total, cross(u, difference)))
    chord_rate = scale(inverse_length, rotate_back(mid, subtract(velocity_b, velocity_a)))
    chord_rate = add(chord_rate, cross(chord, mid_spin))
    phi_gamma = cross(phi, gamma)
    twist = add(cross(phi_rate, phi_gamma), cross(phi, cross(phi_rate, gamma)))
    slope = strain_slope(16.0 * x * q * q) * dot(phi, phi_rate)
    chord_rate = add_scaled(chord_rate, -a, twist)
    chord_rate = add_scaled(chord_rate, -slope, cross(phi, phi_gamma))
    return unwind(chord_rate, phi, a, sinc_inverse), phi_rate
