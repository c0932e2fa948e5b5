"""The helical element: the strain of a helix between two nodes on SE(3), and what varies along it condensed out.

Uniform bending, twist and stretch are exact. Where equilibrium makes the strain vary along the element, the section in
its middle tilts against the helix by ``tilt``, two angles that minimise the element's energy and that no node carries:
this gives bending its exact flexibility under end forces (MacNeal 1978), order four to rods that twist while they bend,
and stability under any tension.

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
def section_tilt(gamma, phi, inverse_length, stiffness):
    """Tilt of the middle section against the helix, two angles, and what drives it: ``K tilt = drive`` (N).

    ``stiffness`` is (EA, GA, EI/h, GJ/h, 12 EI/h^2). The drive is the transverse part of ``n x gamma + m x kappa``,
    the slope of the moment along the element, which only a tilt can bring about; K is 12 EI/h^2 of the bending that the
    tilt costs, and the stiffness of the strains that it changes. Returns the tilt, the drive and its two factors:
    drive = ``push`` gamma + ``turn`` phi/h, transverse parts.
    """
    axial, shear, bending, torsion, tilting = stiffness
    push = shear * gamma[0] - axial * (gamma[0] - 1.0)
    turn = (bending - torsion) * phi[0]
    share = inverse_length * turn
    drive_y, drive_z = push * gamma[1] + share * phi[1], push * gamma[2] + share * phi[2]
    twisting, curving = inverse_length * torsion, inverse_length * bending
    common = tilting + shear * gamma[0] * gamma[0] + curving * phi[0] * phi[0]
    k_yy = common + axial * gamma[1] * gamma[1] + twisting * phi[1] * phi[1]
    k_zz = common + axial * gamma[2] * gamma[2] + twisting * phi[2] * phi[2]
    k_yz = axial * gamma[1] * gamma[2] + twisting * phi[1] * phi[2]
    inverse = 1.0 / (k_yy * k_zz - k_yz * k_yz)
    tilt = inverse * (k_zz * drive_y - k_yz * drive_z), inverse * (k_yy * drive_z - k_yz * drive_y)
    return tilt, (drive_y, drive_z), push, turn


@inline_jit
def helical_stress(gamma, phi, inverse_length, stiffness):
    """Stress (mid-frame force, N) and moment (N m) conjugate to ``gamma`` and ``phi``: derivatives of
    ``helical_energy``.
    """
    axial, shear, bending, torsion, tilting = stiffness
    (y, z), drive, push, turn = section_tilt(gamma, phi, inverse_length, stiffness)
    along_gamma, along_phi, square = y * gamma[1] + z * gamma[2], y * phi[1] + z * phi[2], y * y + z * z
    pushed, turned = push - axial * along_gamma, turn - torsion * along_phi
    stress = (
        axial * (gamma[0] - 1.0) + (axial - shear) * along_gamma + shear * gamma[0] * square,
        shear * gamma[1] - pushed * y,
        shear * gamma[2] - pushed * z,
    )
    moment = (
        torsion * phi[0] + (torsion - bending) * along_phi + bending * phi[0] * square,
        bending * phi[1] - turned * y,
        bending * phi[2] - turned * z,
    )
    return stress, moment


@inline_jit
def helical_energy(gamma, phi, length, inverse_length, stiffness):
    """Elastic energy of an element, J."""
    axial, shear, bending, torsion, tilting = stiffness
    tilt, drive, push, turn = section_tilt(gamma, phi, inverse_length, stiffness)
    across = shear * (gamma[1] * gamma[1] + gamma[2] * gamma[2]) - (tilt[0] * drive[0] + tilt[1] * drive[1])
    stretch = axial * (gamma[0] - 1.0) * (gamma[0] - 1.0) + across
    bend = torsion * phi[0] * phi[0] + bending * (phi[1] * phi[1] + phi[2] * phi[2])
    return 0.5 * (length * stretch + bend)


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
