"""Memory access of the kernels: vectors, poses and motions of nodes in a lane block, for spatial or planar rods."""

from magrod_env._jit import inline_jit
from magrod_env._simd import load, store
from magrod_env.rod.layout import PLANAR, SPATIAL


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
def load_vector(block, row, lanes, planar):
    """A vector: three rows, of which a plane has two."""
    if planar is None:
        return load3(block, row, lanes)
    return load2(block, row, lanes)


@inline_jit
def load_torque(block, row, lanes, planar):
    """A torque: three rows, of which a plane has one."""
    if planar is None:
        return load3(block, row, lanes)
    return load(block, row, lanes)
