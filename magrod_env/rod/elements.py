"""Loads of one element of a lane block, for spatial or planar rods, from its pose and its rows.

Branches on ``planar`` and ``nodal`` are decided when a kernel is compiled: ``None`` is absent.
"""

from magrod_env._jit import inline_jit
from magrod_env._simd import load
from magrod_env.rod.access import load2
from magrod_env.rod.helical import helical_loads, helical_strain, helical_stress
from magrod_env.rod.layout import AXIAL, BENDING, ELEMENT_ROWS, INVERSE_LENGTH, LENGTH, SHEAR, TILT, TORSION
from magrod_env.rod.nodal import nodal_loads, nodal_strain
from magrod_env.rod.planar import (
    planar_helical_loads,
    planar_helical_strain,
    planar_helical_stress,
    planar_nodal_loads,
    planar_nodal_strain,
    planar_relative_rotation,
)
from magrod_env.rod.so3 import relative_rotation


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
