"""Loads of one element and of one magnet of a lane block, for spatial or planar rods.

Branches on ``planar``, ``gradient`` and so on are decided when a kernel is compiled: ``None`` is absent.
"""

from magrod_env._jit import inline_jit
from magrod_env._simd import load, store
from magrod_env.rod.helical import helical_loads, helical_strain, helical_stress
from magrod_env.rod.layout import (
    AXIAL,
    BENDING,
    ELEMENT_ROWS,
    FIELD,
    GRADIENT,
    INVERSE_LENGTH,
    LENGTH,
    PLANAR,
    SHEAR,
    SPATIAL,
    TILT,
    TORSION,
)
from magrod_env.rod.nodal import nodal_loads, nodal_strain
from magrod_env.rod.planar import (
    planar_cross,
    planar_helical_loads,
    planar_helical_strain,
    planar_helical_stress,
    planar_matrix,
    planar_nodal_loads,
    planar_nodal_strain,
    planar_relative_rotation,
    planar_rotate,
    planar_rotate_back,
)
from magrod_env.rod.so3 import cross, dot, matrix, relative_rotation, rotate, rotate_back


@inline_jit
def load2(block, row, lanes):
    """Two neighbouring rows."""
    return load(block, row, lanes), load(block, row + 1, lanes)


@inline_jit
def load3(block, row, lanes):
    """Three neighbouring rows, as a vector."""
    return load(block, row, lanes), load(block, row + 1, lanes), load(block, row + 2, lanes)


@inline_jit
def store2(block, row, v, lanes):
    """Write two neighbouring rows."""
    store(block, row, v[0], lanes)
    store(block, row + 1, v[1], lanes)


@inline_jit
def store3(block, row, v, lanes):
    """Write three neighbouring rows."""
    store2(block, row, v, lanes)
    store(block, row + 2, v[2], lanes)


@inline_jit
def node_row(layout, planar, node):
    """First row of a node."""
    if planar is None:
        return layout.nodes + SPATIAL.size * node
    return layout.nodes + PLANAR.size * node


@inline_jit
def load_pose(block, row, lanes, planar):
    """Position and rotation of the node at ``row``."""
    if planar is None:
        rotation = load2(block, row + SPATIAL.rotation, lanes) + load2(block, row + SPATIAL.rotation + 2, lanes)
        return load3(block, row + SPATIAL.position, lanes), rotation
    return load2(block, row + PLANAR.position, lanes), load2(block, row + PLANAR.rotation, lanes)


@inline_jit
def store_pose(block, row, pose, lanes, planar):
    """Write position and rotation of the node at ``row``."""
    if planar is None:
        store3(block, row + SPATIAL.position, pose[0], lanes)
        store2(block, row + SPATIAL.rotation, (pose[1][0], pose[1][1]), lanes)
        store2(block, row + SPATIAL.rotation + 2, (pose[1][2], pose[1][3]), lanes)
    else:
        store2(block, row + PLANAR.position, pose[0], lanes)
        store2(block, row + PLANAR.rotation, pose[1], lanes)


@inline_jit
def load_motion(block, row, lanes, planar):
    """Velocity and angular momentum of the node at ``row``."""
    if planar is None:
        return load3(block, row + SPATIAL.velocity, lanes), load3(block, row + SPATIAL.momentum, lanes)
    return load2(block, row + PLANAR.velocity, lanes), load(block, row + PLANAR.momentum, lanes)


@inline_jit
def store_motion(block, row, motion, lanes, planar):
    """Write velocity and angular momentum of the node at ``row``."""
    if planar is None:
        store3(block, row + SPATIAL.velocity, motion[0], lanes)
        store3(block, row + SPATIAL.momentum, motion[1], lanes)
    else:
        store2(block, row + PLANAR.velocity, motion[0], lanes)
        store(block, row + PLANAR.momentum, motion[1], lanes)


@inline_jit
def bend_cosine(pose_a, pose_b, planar):
    """cos(theta/2) of the rotation across an element."""
    if planar is None:
        return relative_rotation(pose_a[1], pose_b[1])[0]
    return planar_relative_rotation(pose_a[1], pose_b[1])[0]


@inline_jit
def section_stiffness(block, row, lanes, planar):
    """Stiffness of the element at ``row`` as ``helical_stress`` (planar: ``planar_helical_stress``) takes it."""
    first = load2(block, row + AXIAL, lanes) + (load(block, row + BENDING, lanes),)
    last = load2(block, row + TILT, lanes)
    if planar is None:
        return first + (load(block, row + TORSION, lanes),) + last
    return first + last


@inline_jit
def helical_element(block, layout, element, pose_a, pose_b, lanes, planar):
    """Loads of helical element ``element``: world force on a, body torques on a and b."""
    row = layout.elements + ELEMENT_ROWS * element
    length, inverse_length = load(block, row + LENGTH, lanes), load(block, row + INVERSE_LENGTH, lanes)
    stiffness = section_stiffness(block, row, lanes, planar)
    if planar is None:
        gamma, phi, geometry = helical_strain(pose_a, pose_b, inverse_length)
        stress, moment = helical_stress(gamma, phi, length, inverse_length, stiffness)
        return helical_loads(gamma, phi, geometry, stress, moment, length)
    gamma, phi, geometry = planar_helical_strain(pose_a, pose_b, inverse_length)
    stress, moment = planar_helical_stress(gamma, phi, length, stiffness)
    return planar_helical_loads(phi, geometry, stress, moment)


@inline_jit
def nodal_element(block, layout, element, pose_a, pose_b, lanes, planar):
    """Loads of the paper's element ``element``: world force on a, body torques on a and b."""
    row = layout.elements + ELEMENT_ROWS * element
    length, inverse_length = load(block, row + LENGTH, lanes), load(block, row + INVERSE_LENGTH, lanes)
    axial, shear = load(block, row + AXIAL, lanes), load(block, row + SHEAR, lanes)
    bending = load(block, row + BENDING, lanes)
    if planar is None:
        torsion = load(block, row + TORSION, lanes)
        gamma_a, gamma_b, g, frames = nodal_strain(pose_a, pose_b, inverse_length)
        stress_a = (axial * (gamma_a[0] - 1.0), shear * gamma_a[1], shear * gamma_a[2])
        stress_b = (axial * (gamma_b[0] - 1.0), shear * gamma_b[1], shear * gamma_b[2])
        moment = (2.0 * torsion * g[0], 2.0 * bending * g[1], 2.0 * bending * g[2])
        return nodal_loads(gamma_a, gamma_b, g, frames, stress_a, stress_b, moment, length)
    gamma_a, gamma_b, g, frames = planar_nodal_strain(pose_a, pose_b, inverse_length)
    stress_a = (axial * (gamma_a[0] - 1.0), shear * gamma_a[1])
    stress_b = (axial * (gamma_b[0] - 1.0), shear * gamma_b[1])
    return planar_nodal_loads(gamma_a, gamma_b, g, frames, stress_a, stress_b, 2.0 * bending * g, length)


@inline_jit
def element_loads(block, layout, element, pose_a, pose_b, lanes, planar, nodal):
    """Loads of one element of the scene's kind."""
    if nodal is None:
        return helical_element(block, layout, element, pose_a, pose_b, lanes, planar)
    return nodal_element(block, layout, element, pose_a, pose_b, lanes, planar)


@inline_jit
def local_field(block, position, lanes, planar, gradient):
    """Field at a position (spatial: world; planar: the plane's two axes), T."""
    if planar is None:
        field = load3(block, FIELD, lanes)
        if gradient is not None:
            field = (
                field[0] + dot(load3(block, GRADIENT, lanes), position),
                field[1] + dot(load3(block, GRADIENT + 3, lanes), position),
                field[2] + dot(load3(block, GRADIENT + 6, lanes), position),
            )
        return field
    field = load2(block, FIELD, lanes)
    if gradient is not None:
        a, b = load2(block, GRADIENT, lanes), load2(block, GRADIENT + 3, lanes)
        field = (field[0] + a[0] * position[0] + a[1] * position[1], field[1] + b[0] * position[0] + b[1] * position[1])
    return field


@inline_jit
def magnet_loads(block, layout, magnet, pose, lanes, planar, gradient):
    """Torque (body) and force (world) on magnet number ``magnet``: m x B and grad(m.B), the force zero without
    gradient.
    """
    field = local_field(block, pose[0], lanes, planar, gradient)
    if planar is None:
        moment = load3(block, layout.magnets + 3 * magnet, lanes)
        frame = matrix(pose[1], 2.0)
        torque = cross(moment, rotate_back(frame, field))
        if gradient is None:
            return torque, None
        m = rotate(frame, moment)
        return torque, (
            m[0] * load(block, GRADIENT, lanes)
            + m[1] * load(block, GRADIENT + 3, lanes)
            + m[2] * load(block, GRADIENT + 6, lanes),
            m[0] * load(block, GRADIENT + 1, lanes)
            + m[1] * load(block, GRADIENT + 4, lanes)
            + m[2] * load(block, GRADIENT + 7, lanes),
            m[0] * load(block, GRADIENT + 2, lanes)
            + m[1] * load(block, GRADIENT + 5, lanes)
            + m[2] * load(block, GRADIENT + 8, lanes),
        )
    planar_moment = load2(block, layout.magnets + 3 * magnet, lanes)
    planar_frame = planar_matrix(pose[1], 2.0)
    planar_torque = planar_cross(planar_moment, planar_rotate_back(planar_frame, field))
    if gradient is None:
        return planar_torque, None
    n = planar_rotate(planar_frame, planar_moment)
    return planar_torque, (
        n[0] * load(block, GRADIENT, lanes) + n[1] * load(block, GRADIENT + 3, lanes),
        n[0] * load(block, GRADIENT + 1, lanes) + n[1] * load(block, GRADIENT + 4, lanes),
    )
