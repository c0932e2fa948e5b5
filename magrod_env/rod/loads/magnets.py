"""Magnets: dipoles fixed to sections, in a field that may have a constant gradient.

Torque m x B and force grad(m.B); energy -m.B. The force is zero without a gradient, and its code is then absent.
"""

from magrod_env._jit import inline_jit
from magrod_env._simd import load
from magrod_env.rod.access import load2, load3
from magrod_env.rod.layout import FIELD, GRADIENT
from magrod_env.rod.planar import planar_cross, planar_matrix, planar_rotate, planar_rotate_back
from magrod_env.rod.so3 import cross, dot, matrix, rotate, rotate_back


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


@inline_jit
def magnet_energy(block, layout, magnet, pose, lanes, planar, gradient):
    """``-m.B`` of one magnet, J."""
    field = local_field(block, pose[0], lanes, planar, gradient)
    if planar is None:
        moment = rotate(matrix(pose[1], 2.0), load3(block, layout.magnets + 3 * magnet, lanes))
        return -dot(moment, field)
    flat = planar_rotate(planar_matrix(pose[1], 2.0), load2(block, layout.magnets + 3 * magnet, lanes))
    return -(flat[0] * field[0] + flat[1] * field[1])
