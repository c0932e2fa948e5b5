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
from magrod_env._simd import maximum, square_root
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

PULLED = 120.0 / 7.0  # of ``arch`` EA = EA/(60 x 12 EI/h^2): 2/7 of EA/(12 EI/h^2)


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
    """Tilt of the middle section and what follows from it, shared by ``helical_stress`` and ``helical_energy``.

    ``stiffness`` is (EA, GA, EI/h, GJ/h, 12 EI/h^2, bow, skew, arch, sway), the last four of ``mesh.write_rod``.
    A tilt z (two angles) costs T = 12 EI/h^2; the shear that it leaves, s = gamma - gamma_1 z, meets the section's
    stiffness S = GA - EA (1 - 1/L), with the stretch L = |gamma|; and q = (EI - GJ) phi_1 phi/h^2 drives it where the
    rod twists. The minimum of S s^2 + T z^2 - 2 q.z has (T + S gamma_1^2) z = S gamma_1 gamma + q.

    Returns L, 1/L, S, the transverse parts of z and s, and h q/kappa.
    """
    axial, shear, bending, torsion, tilting, bow, skew, arch, sway = stiffness
    stretch = square_root(dot(gamma, gamma))
    softened = axial + (shear - axial) * stretch  # S L
    leaning = softened * gamma[0]
    stiff = tilting * stretch + leaning * gamma[0]
    both = 1.0 / (stretch * stiff)
    inverse_stretch, flexible = both * stiff, both * stretch * stretch
    turn = (bending - torsion) * phi[0]
    share = inverse_length * turn
    slope = share * phi[1], share * phi[2]
    sheared = inverse_stretch * leaning
    tilt = flexible * (sheared * gamma[1] + slope[0]), flexible * (sheared * gamma[2] + slope[1])
    left = flexible * (tilting * gamma[1] - gamma[0] * slope[0]), flexible * (tilting * gamma[2] - gamma[0] * slope[1])
    return stretch, inverse_stretch, inverse_stretch * softened, tilt, left, turn


@inline_jit
def arch_stiffness(square, extension, skew, arch):
    """Axial stiffness of an element bent by an angle whose square is ``square``, over EA, its derivative by the
    extension times the extension, and that by the square.

    1/(1 + skew phi^2 + arch phi^2/(1 + n)): its ends shear, and its arch flattens, the less the more tension
    n = (2/7) N/(12 EI/h^2) straightens it. N is here EA extension/(1 + (skew + arch) phi^2), none where negative.
    """
    whole, flattening = 1.0 + skew * square, arch * square
    both = whole + flattening
    pulling = PULLED * arch * maximum(extension, 0.0 * square)
    pulled = both + pulling
    inverse = 1.0 / (whole * pulled + flattening * both)
    share = pulled * inverse
    rest = flattening * both * inverse
    by_square = inverse * (rest * (skew + arch) - share * (pulled * skew + both * arch + flattening * (skew + arch)))
    return share, inverse * rest * pulling, by_square


@inline_jit
def helical_stress(gamma, phi, length, inverse_length, stiffness):
    """Stress (mid-frame force, N) and moment (N m) conjugate to ``gamma`` and ``phi``: derivatives of
    ``helical_energy``.
    """
    axial, shear, bending, torsion, tilting, bow, skew, arch, sway = stiffness
    stretch, inverse_stretch, section, tilt, left, turn = section_tilt(gamma, phi, inverse_length, stiffness)
    extension = stretch + bow * (gamma[1] * gamma[1] + gamma[2] * gamma[2]) - 1.0
    share, stiffening, by_square = arch_stiffness(phi[1] * phi[1] + phi[2] * phi[2], extension, skew, arch)
    force = axial * extension
    tension = force * share + 0.5 * force * stiffening
    square = inverse_stretch * inverse_stretch * (left[0] * left[0] + left[1] * left[1])
    pull = inverse_stretch * (tension - 0.5 * axial * square)
    across = section * left[0], section * left[1]
    sideways = pull + 2.0 * bow * tension
    curl = sway * (gamma[1] * phi[2] - gamma[2] * phi[1])
    stress = (
        pull * gamma[0] - (tilt[0] * across[0] + tilt[1] * across[1]),
        sideways * gamma[1] + across[0] - curl * phi[2],
        sideways * gamma[2] + across[1] + curl * phi[1],
    )
    bent = bending + length * by_square * force * extension
    moment = (
        torsion * phi[0] - (bending - torsion) * (tilt[0] * phi[1] + tilt[1] * phi[2]),
        bent * phi[1] - turn * tilt[0] + length * curl * gamma[2],
        bent * phi[2] - turn * tilt[1] - length * curl * gamma[1],
    )
    return stress, moment


@inline_jit
def helical_energy(gamma, phi, length, inverse_length, stiffness):
    """Elastic energy of an element, J."""
    axial, shear, bending, torsion, tilting, bow, skew, arch, sway = stiffness
    stretch, inverse_stretch, section, tilt, left, turn = section_tilt(gamma, phi, inverse_length, stiffness)
    square = phi[1] * phi[1] + phi[2] * phi[2]
    extension = stretch + bow * (gamma[1] * gamma[1] + gamma[2] * gamma[2]) - 1.0
    along = axial * extension * extension * arch_stiffness(square, extension, skew, arch)[0]
    across = section * (left[0] * left[0] + left[1] * left[1]) + tilting * (tilt[0] * tilt[0] + tilt[1] * tilt[1])
    curl = gamma[1] * phi[2] - gamma[2] * phi[1]
    bend = torsion * phi[0] * phi[0] + bending * square
    twist = turn * (tilt[0] * phi[1] + tilt[1] * phi[2])
    return 0.5 * (length * (along + across - sway * curl * curl) + bend) - twist


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
