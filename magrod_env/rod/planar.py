"""Planar motion: position (x, y) and one angle a node; the exact restriction of the spatial scheme to a plane.

A pose is ``((x, y), (w, z))``: position in the plane's axes and the half-angle pair (cos(theta/2), sin(theta/2)), theta
positive from the first axis (along the straight rod) to the second. Formulas are those of helical.py, nodal.py and
rotation.py with every out-of-plane number left out.
"""

from magrod_env._jit import inline_jit
from magrod_env._simd import square_root, where_above
from magrod_env.rod.helical import LEAST_SHEAR
from magrod_env.rod.so3 import chord_slope, half_angle_series


@inline_jit
def planar_matrix(rotation, two_over_norm):
    """(cosine, sine) of the angle of a half-angle pair of any length; ``two_over_norm = 2 / |q|^2``."""
    z = two_over_norm * rotation[1]
    return 1.0 - rotation[1] * z, rotation[0] * z


@inline_jit
def planar_rotate(frame, v):
    """Body to world."""
    return frame[0] * v[0] - frame[1] * v[1], frame[1] * v[0] + frame[0] * v[1]


@inline_jit
def planar_rotate_back(frame, v):
    """World to body."""
    return frame[0] * v[0] + frame[1] * v[1], frame[0] * v[1] - frame[1] * v[0]


@inline_jit
def planar_cross(a, b):
    """Component of ``a x b`` across the plane."""
    return a[0] * b[1] - a[1] * b[0]


@inline_jit
def planar_relative_rotation(a, b):
    """Half-angle pair of the rotation from a to b."""
    return a[0] * b[0] + a[1] * b[1], a[0] * b[1] - a[1] * b[0]


@inline_jit
def planar_helical_strain(pose_a, pose_b, inverse_length):
    """Strain ``gamma`` (2,), relative angle ``phi`` and shared geometry of one helical element (see
    ``helical_strain``).
    """
    position_a, rotation_a = pose_a
    position_b, rotation_b = pose_b
    cosine, sine = planar_relative_rotation(rotation_a, rotation_b)
    inverse = 1.0 / (1.0 + cosine)
    u = inverse * sine
    x = u * u
    w = half_angle_series(x)
    q = 1.0 - x * w
    phi = 4.0 * q * u
    mid = planar_matrix((rotation_a[0] + rotation_b[0], rotation_a[1] + rotation_b[1]), inverse)
    chord = planar_rotate_back(mid, (position_b[0] - position_a[0], position_b[1] - position_a[1]))
    sinc_inverse = (1.0 + x) * q
    factor = inverse_length * sinc_inverse
    return (factor * chord[0], factor * chord[1]), phi, (chord, mid, sinc_inverse)


@inline_jit
def planar_section_state(gamma, stiffness):
    """1/L, S, tilt, the shear that it leaves, and axial strain (see ``section_state``)."""
    axial, shear, bending, tilting, sway = stiffness
    stretch = square_root(gamma[0] * gamma[0] + gamma[1] * gamma[1])
    least = LEAST_SHEAR * shear
    firm = axial + (shear - axial) * stretch
    section, softens = where_above(firm, least, firm, least), where_above(firm, least, axial, least)
    leaning, bent = section * gamma[0], tilting * stretch
    stiff = bent + leaning * gamma[0]
    both = 1.0 / (stretch * stiff)
    inverse_stretch, flexible = both * stiff, both * (stretch * gamma[1])
    return inverse_stretch, inverse_stretch * section, flexible * leaning, flexible * bent, (stretch - 1.0, softens)


@inline_jit
def planar_helical_stress(gamma, phi, length, stiffness):
    """Stress and moment conjugate to ``gamma`` and ``phi`` (see ``helical_stress``)."""
    axial, shear, bending, tilting, sway = stiffness
    inverse_stretch, section, tilt, left, extension = planar_section_state(gamma, stiffness)
    tension, softens = axial * extension[0], extension[1]
    leant = inverse_stretch * left
    pull = inverse_stretch * (tension - 0.5 * softens * (leant * leant))
    across, curl = section * left, sway * (gamma[1] * phi)
    along = pull * gamma[0] - tilt * across
    return (
        along,
        pull * gamma[1] + across - curl * phi,
    ), bending * phi - length * curl * gamma[1]


@inline_jit
def planar_helical_energy(gamma, phi, length, stiffness):
    """Elastic energy of an element, J."""
    axial, shear, bending, tilting, sway = stiffness
    inverse_stretch, section, tilt, left, extension = planar_section_state(gamma, stiffness)
    curl = gamma[1] * phi
    across = section * left * left + tilting * tilt * tilt - sway * curl * curl
    return 0.5 * (length * (axial * extension[0] * extension[0] + across) + bending * phi * phi)


@inline_jit
def planar_helical_loads(phi, geometry, stress, moment):
    """World force on node a and torques on a and b (see ``helical_loads``)."""
    chord, mid, sinc_inverse = geometry
    n = (sinc_inverse * stress[0], sinc_inverse * stress[1])
    s = 0.5 * planar_cross(chord, n)
    m = moment + chord_slope(phi * phi) * phi * (sinc_inverse * (chord[0] * n[0] + chord[1] * n[1]))
    return planar_rotate(mid, n), s + m, s - m


@inline_jit
def planar_nodal_strain(pose_a, pose_b, inverse_length):
    """Strains of the paper's element in the plane (see ``nodal_strain``)."""
    position_a, rotation_a = pose_a
    position_b, rotation_b = pose_b
    cosine, sine = planar_relative_rotation(rotation_a, rotation_b)
    frame_a, frame_b = planar_matrix(rotation_a, 2.0), planar_matrix(rotation_b, 2.0)
    chord = (inverse_length * (position_b[0] - position_a[0]), inverse_length * (position_b[1] - position_a[1]))
    gamma_a, gamma_b = planar_rotate_back(frame_a, chord), planar_rotate_back(frame_b, chord)
    return gamma_a, gamma_b, sine * (1.0 / cosine), (frame_a, frame_b)


@inline_jit
def planar_nodal_loads(gamma_a, gamma_b, g, frames, stress_a, stress_b, moment, length):
    """World force on node a and torques on a and b (see ``nodal_loads``)."""
    force_a, force_b = planar_rotate(frames[0], stress_a), planar_rotate(frames[1], stress_b)
    bending = moment + g * (g * moment)
    torque_a = bending + 0.5 * length * planar_cross(gamma_a, stress_a)
    torque_b = 0.5 * length * planar_cross(gamma_b, stress_b) - bending
    return (0.5 * (force_a[0] + force_b[0]), 0.5 * (force_a[1] + force_b[1])), torque_a, torque_b


@inline_jit
def planar_free_rotation(rotation, momentum, time_step, compliance):
    """Drift of a planar rotation over ``time_step`` (see ``free_rotation``); the angular momentum does not change."""
    p = time_step * momentum * compliance
    x = p * p
    f = p + p * (x * (1.0 + x * (2.0 + 5.0 * x)))  # f = p (1 + f^2)
    w, z = rotation[0] - rotation[1] * f, rotation[0] * f + rotation[1]
    factor = 1.0 / square_root(w * w + z * z)
    return factor * w, factor * z
