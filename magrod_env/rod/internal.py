"""Forces, moments and strains inside rods, and what static equilibria do as the field changes."""

from magrod_env._jit import inline_jit, jit
from magrod_env._simd import load, store
from magrod_env.rod.access import load3, load_pose, node_row, store3
from magrod_env.rod.damping import damping_loads, world_motion
from magrod_env.rod.elements import element_loads
from magrod_env.rod.helical import helical_strain
from magrod_env.rod.layout import DAMPING, ELEMENT_ROWS, INVERSE_LENGTH
from magrod_env.rod.loads.hub import static_loads
from magrod_env.rod.so3 import add, cross, matrix, rotate_back, scale, subtract
from magrod_env.rod.statics import make_room
from magrod_env.rod.tangent import assemble, factorise, solve_factored

PARTS = 15  # rows of an element: force on a (world), torques on a and b (body), gamma, phi
CLAMPED = 6  # rows after them: force (world) and torque (body) of the listed loads on the clamped node


@inline_jit
def viscous_loads(block, layout, element, pose_a, pose_b, lanes):
    """Loads of an element's internal damping: world force on a, body torques on a and on b."""
    row = layout.elements + ELEMENT_ROWS * element
    motion_a = world_motion(block, node_row(layout, None, element), pose_a[1], lanes)
    motion_b = world_motion(block, node_row(layout, None, element + 1), pose_b[1], lanes)
    time = load(block, DAMPING, lanes)
    _, _, (force, moment, lever) = damping_loads(block, row, pose_a, pose_b, motion_a, motion_b, time, lanes)
    torque_a = rotate_back(matrix(pose_a[1], 2.0), subtract(moment, lever))
    torque_b = rotate_back(matrix(pose_b[1], 2.0), scale(-1.0, add(moment, lever)))
    return force, torque_a, torque_b


@inline_jit
def store_clamped(block, layout, terms, loads, pose, out):
    """Write what the listed loads do to the clamped node."""
    if len(loads) > 0:
        force, torque = static_loads(block, layout, terms, 0, pose)
        store3(out, PARTS * layout.num_elements, force, terms.lanes)
        store3(out, PARTS * layout.num_elements + 3, torque, terms.lanes)


@jit
def inner_loads(blocks, layout, terms, nodal, damped, out):
    """Loads and strains of every element of every rod: ``out`` (num_blocks, (PARTS * N + CLAMPED) * L)."""
    lanes = terms.lanes
    for b in range(len(blocks)):
        block = blocks[b]
        pose_a = load_pose(block, layout.nodes, lanes, None)
        store_clamped(block, layout, terms, terms.loads, pose_a, out[b])
        for element in range(layout.num_elements):
            pose_b = load_pose(block, node_row(layout, None, element + 1), lanes, None)
            inverse_length = load(block, layout.elements + ELEMENT_ROWS * element + INVERSE_LENGTH, lanes)
            force, torque_a, torque_b = element_loads(block, layout, element, pose_a, pose_b, lanes, None, nodal)
            if damped is not None:
                push, turn_a, turn_b = viscous_loads(block, layout, element, pose_a, pose_b, lanes)
                force, torque_a, torque_b = add(force, push), add(torque_a, turn_a), add(torque_b, turn_b)
            gamma, phi, geometry = helical_strain(pose_a, pose_b, inverse_length)
            row = PARTS * element
            store3(out[b], row, force, lanes)
            store3(out[b], row + 3, torque_a, lanes)
            store3(out[b], row + 6, torque_b, lanes)
            store3(out[b], row + 9, gamma, lanes)
            store3(out[b], row + 12, phi, lanes)
            pose_a = pose_b


@jit
def field_sensitivity(blocks, first, last, layout, terms, shares, nodes, out):
    """Derivatives of nodes' positions by the field at equilibria, m/T: ``out`` (num_blocks, 9 * len(nodes) * L), row
    9 k + 3 i + j that of coordinate i of node k by component j of the field.

    The poses and loads in ``blocks`` are those of equilibria; ``shares`` (2 * L,) ones.
    """
    room, lanes, size = make_room(layout, terms), terms.lanes, 6 * layout.num_elements
    system, loads, least, _ = room
    for b in range(first, last):
        block = blocks[b]
        assemble(block, layout, terms, terms.nodal, terms.gradient, shares, system, loads, 2)
        factorise(system, terms, size, least)
        for axis in range(3):
            for i in range(size * len(lanes)):
                system[i] = 0.0
            for magnet in range(len(layout.magnet_nodes)):
                node = layout.magnet_nodes[magnet]
                frame = matrix(load_pose(block, node_row(layout, None, node), lanes, None)[1], 2.0)
                moment = load3(block, layout.magnets + 3 * magnet, lanes)
                unit = (
                    (1.0 if axis == 0 else 0.0),
                    (1.0 if axis == 1 else 0.0),
                    (1.0 if axis == 2 else 0.0),
                )
                row = 6 * (node - 1) + 3
                torque = add(load3(system, row, lanes), cross(moment, rotate_back(frame, unit)))
                store3(system, row, torque, lanes)
            solve_factored(system, terms, size)
            for k in range(len(nodes)):
                for i in range(3):
                    store(out[b], 9 * k + 3 * i + axis, load(system, 6 * (nodes[k] - 1) + i, lanes), lanes)
