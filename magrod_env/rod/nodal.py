"""The paper's element ("nodal"): strain measured with each end's rotation and averaged, Cayley vector as bending
strain.

Tariverdi et al. 2020, eq. 6, with the bending term that the printed equation lacks. It locks in shear: an element in
pure bending is stiffer by 1 + GA h^2/(4 EI) (docs/physics.md). Kept to reproduce the paper and as a baseline.
"""

from magrod_env._jit import inline_jit
from magrod_env.rod.so3 import (
    add,
    add_scaled,
    cross,
    dot,
    matrix,
    relative_rotation,
    rotate,
    rotate_back,
    scale,
    subtract,
)


@inline_jit
def nodal_strain(pose_a, pose_b, inverse_length):
    """Strains of one element: ``gamma`` with the rotation of node a and of node b, half the Cayley vector g, both
    frames.
    """
    position_a, rotation_a = pose_a
    position_b, rotation_b = pose_b
    cosine, vector = relative_rotation(rotation_a, rotation_b)
    g = scale(1.0 / cosine, vector)
    frame_a, frame_b = matrix(rotation_a, 2.0), matrix(rotation_b, 2.0)
    chord = scale(inverse_length, subtract(position_b, position_a))
    return rotate_back(frame_a, chord), rotate_back(frame_b, chord), g, (frame_a, frame_b)


@inline_jit
def nodal_loads(gamma_a, gamma_b, g, frames, stress_a, stress_b, moment, length):
    """World force on node a (node b gets its negative) and body torques on a and on b.

    ``stress_a`` and ``stress_b`` are C1 (gamma - E) at the two ends, ``moment`` is C2 psi/h with psi = 2 g.
    """
    frame_a, frame_b = frames
    force = scale(0.5, add(rotate(frame_a, stress_a), rotate(frame_b, stress_b)))
    symmetric = add_scaled(moment, dot(g, moment), g)
    twist = cross(g, moment)
    torque_a = add_scaled(add(symmetric, twist), 0.5 * length, cross(gamma_a, stress_a))
    torque_b = add_scaled(subtract(twist, symmetric), 0.5 * length, cross(gamma_b, stress_b))
    return force, torque_a, torque_b
