"""The helical element: the strain of a helix between two nodes on SE(3), and what varies along it condensed out.

Uniform bending, twist and stretch are exact. Where equilibrium makes the strain vary along the element, the section in
its middle tilts against the helix by two angles that minimise the element's energy and that no node carries: this gives
bending its exact flexibility under end forces (MacNeal 1978), order four to rods that twist while they bend, and
stability under any tension.

Notation of the kernels: node a and node b, ``phi`` rotation vector from a to b (mid-frame = both end frames), ``chord``
the chord over the length in the mid frame, ``gamma`` the stretch-and-shear strain (1, 0, 0 at rest), E = (1, 0, 0).
Derived in docs/physics.md; every force is checked against the gradient of the energy in the tests.
"""

from magrod_env._jit import inline_jit
from magrod_env._simd import square_root, where_above
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
    strain_slope,
    subtract,
)

LEAST_SHEAR = 0.1


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
def section_state(gamma, phi, inverse_length, stiffness):
    """Stretch, tilt and what follows from them, shared by ``helical_stress`` and ``helical_energy``.

    ``stiffness`` is (EA, GA, EI/h, GJ/h, 12 EI/h^2, sway), the last of ``mesh.write_rod``. A tilt z (two
    angles) costs T = 12 EI/h^2; the shear that it leaves, s = gamma - gamma_1 z, meets the section's stiffness
    S = GA - EA (1 - 1/L), with the stretch L = |gamma|; and q = (EI - GJ) phi_1 phi/h^2 drives it where the rod twists.
    The minimum of S s^2 + T z^2 - 2 q.z has (T + S gamma_1^2) z = S gamma_1 gamma + q.

    S L stays above LEAST_SHEAR GA, where a rod is stretched by almost half.

    Returns 1/L, S, the transverse parts of z and s, h q/kappa, the axial strain and -L^2 dS/dL.
    """
    axial, shear, bending, torsion, tilting, sway = stiffness
    stretch = square_root(dot(gamma, gamma))
    least = LEAST_SHEAR * shear
    firm = axial + (shear - axial) * stretch
    section, softens = (
        where_above(firm, least, firm, least),
        where_above(firm, least, axial, least),
    )  # S L and -L^2 dS/dL
    leaning = section * gamma[0]
    stiff = tilting * stretch + leaning * gamma[0]  # (T + S gamma_1^2) L
    both = 1.0 / (stretch * stiff)
    flexible, inverse_stretch = both * stretch, both * stiff
    turn = (bending - torsion) * phi[0]
    share = stretch * (inverse_length * turn)
    slope = share * phi[1], share * phi[2]
    bent = tilting * stretch
    tilt = flexible * (leaning * gamma[1] + slope[0]), flexible * (leaning * gamma[2] + slope[1])
    left = flexible * (bent * gamma[1] - gamma[0] * slope[0]), flexible * (bent * gamma[2] - gamma[0] * slope[1])
    return inverse_stretch, inverse_stretch * section, tilt, left, turn, (stretch - 1.0, softens)


@inline_jit
def helical_stress(gamma, phi, length, inverse_length, stiffness):
    """Stress (mid-frame force, N) and moment (N m) conjugate to ``gamma`` and ``phi``: derivatives of
    ``helical_energy``.
    """
    axial, shear, bending, torsion, tilting, sway = stiffness
    inverse_stretch, section, tilt, left, turn, extension = section_state(gamma, phi, inverse_length, stiffness)
    tension, softens = axial * extension[0], extension[1]
    square = inverse_stretch * inverse_stretch * (left[0] * left[0] + left[1] * left[1])
    pull = inverse_stretch * (tension - 0.5 * softens * square)
    across = section * left[0], section * left[1]
    curl = sway * (gamma[1] * phi[2] - gamma[2] * phi[1])
    stress = (
        pull * gamma[0] - (tilt[0] * across[0] + tilt[1] * across[1]),
        pull * gamma[1] + across[0] - curl * phi[2],
        pull * gamma[2] + across[1] + curl * phi[1],
    )
    twisted = length * curl
    moment = (
        torsion * phi[0] - (bending - torsion) * (tilt[0] * phi[1] + tilt[1] * phi[2]),
        bending * phi[1] - turn * tilt[0] + twisted * gamma[2],
        bending * phi[2] - turn * tilt[1] - twisted * gamma[1],
    )
    return stress, moment


@inline_jit
def helical_energy(gamma, phi, length, inverse_length, stiffness):
    """Elastic energy of an element, J."""
    axial, shear, bending, torsion, tilting, sway = stiffness
    inverse_stretch, section, tilt, left, turn, extension = section_state(gamma, phi, inverse_length, stiffness)
    across = section * (left[0] * left[0] + left[1] * left[1]) + tilting * (tilt[0] * tilt[0] + tilt[1] * tilt[1])
    curl = gamma[1] * phi[2] - gamma[2] * phi[1]
    bend = torsion * phi[0] * phi[0] + bending * (phi[1] * phi[1] + phi[2] * phi[2])
    twist = turn * (tilt[0] * phi[1] + tilt[1] * phi[2])
    return 0.5 * (length * (axial * extension[0] * extension[0] + across - sway * curl * curl) + bend) - twist


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

    The transpose of the map in ``helical_loads``: stress times rate is the power of the nodal loads.
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
