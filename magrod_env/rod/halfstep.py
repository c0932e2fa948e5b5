"""Motion of the nodes in an implicit step: a half step (d, f) to the middle and the same again to the end.

Position p + d and rotation O Cay(f) at the middle, p + 2 d and O Cay(f)^2 at the end. A node's scratch memory holds its
part of the linear system (``elimination.py``) and what is named here; derived in docs/physics.md.
"""

from magrod_env._jit import inline_jit, jit
from magrod_env._simd import constant, load, maximum, minimum, square_root, store
from magrod_env.rod.access import (
    load2,
    load3,
    load_motion,
    load_pose,
    node_row,
    store3,
    store_motion,
    store_pose,
)
from magrod_env.rod.elements import bend_cosine
from magrod_env.rod.elimination import COUPLING, RIGHT, SYSTEM, add3, triangle
from magrod_env.rod.helical import helical_strain
from magrod_env.rod.layout import AXIAL, DRAG, ELEMENT_ROWS, GRAVITY, INVERSE_LENGTH, LEAST_COSINE, SPATIAL, SPIN_DRAG
from magrod_env.rod.loads.hub import count_half_step_work, half_step_loads
from magrod_env.rod.so3 import add, add_scaled, compose_cayley, cross, dot, normalise, scale, subtract

# rows of a node in the scratch, after its part of the linear system
SHIFT, TURN = SYSTEM, SYSTEM + 3  # d (m, world) and f
MIDDLE, END = SYSTEM + 6, SYSTEM + 13  # poses
STRAIN = SYSTEM + 20  # gamma and phi, at the start of the step, of the element that ends here
PACE, RISE = SYSTEM + 26, SYSTEM + 32  # d/h and f/h of the step before and their slope in time, for the first guess
PULL = SYSTEM + 38  # tension (N) of the element that ends here, where it pulls, in the step before
NODE = SYSTEM + 39


@inline_jit
def turn_back(f, v):
    """``Cay(f)^T v``."""
    f_v = cross(f, v)
    return add_scaled(v, -2.0 / (1.0 + dot(f, f)), add_scaled(f_v, -1.0, cross(f, f_v)))


@inline_jit
def untwist(f, v):
    """``(I - f^)^-1 v``."""
    return scale(1.0 / (1.0 + dot(f, f)), add_scaled(add(v, cross(f, v)), dot(f, v), f))


@inline_jit
def middle_momentum(f, compliance, rate):
    """Angular momentum in the middle frame, ``rate (1 + f.f) J f`` with ``rate`` = 4/h, from 1/(2 J)."""
    factor = 0.5 * rate * (1.0 + dot(f, f))
    return factor * f[0] / compliance[0], factor * f[1] / compliance[1], factor * f[2] / compliance[1]


@jit
def predict(block, scratch, layout, terms, h, ahead):
    """First guess of the half steps, ``ahead`` s after the middle of the step before, and the strains at the start.

    From the motion at the middle of steps: at their ends stiff modes that the steps do not resolve alternate.
    """
    lanes = terms.lanes
    before = load_pose(block, layout.nodes, lanes, None)
    for node in range(1, layout.num_elements + 1):
        row, own = node_row(layout, None, node), NODE * node
        for k in range(0, 6, 3):
            pace = add_scaled(load3(scratch, own + PACE + k, lanes), ahead, load3(scratch, own + RISE + k, lanes))
            store3(scratch, own + SHIFT + k, scale(h, pace), lanes)
        pose = load_pose(block, row, lanes, None)
        inverse_length = load(block, layout.elements + ELEMENT_ROWS * (node - 1) + INVERSE_LENGTH, lanes)
        gamma, phi, geometry = helical_strain(before, pose, inverse_length)
        stretch = square_root(dot(gamma, gamma))
        if ahead != 0.0:
            old = load3(scratch, own + STRAIN, lanes)
            stretch = 0.5 * (stretch + square_root(dot(old, old)))
        axial = load(block, layout.elements + ELEMENT_ROWS * (node - 1) + AXIAL, lanes)
        store(scratch, own + PULL, maximum(axial * (stretch - 1.0), constant(0.0, axial)), lanes)
        store3(scratch, own + STRAIN, gamma, lanes)
        store3(scratch, own + STRAIN + 3, phi, lanes)
        before = pose


@inline_jit
def begin_node(block, scratch, layout, node, terms, h):
    """Poses of a node for its present half step; its inertia, drag and weight open its part of the linear system."""
    lanes = terms.lanes
    row, own = node_row(layout, None, node), NODE * node
    position, rotation = load_pose(block, row, lanes, None)
    velocity, momentum = load_motion(block, row, lanes, None)
    compliance = load2(block, row + SPATIAL.compliance, lanes)
    mass = 1.0 / load(block, row + SPATIAL.inverse_mass, lanes)
    d, f = load3(scratch, own + SHIFT, lanes), load3(scratch, own + TURN, lanes)
    middle = add(position, d), normalise(compose_cayley(rotation, f))
    store_pose(scratch, own + MIDDLE, middle, lanes, None)
    store_pose(scratch, own + END, (add(middle[0], d), normalise(compose_cayley(middle[1], f))), lanes, None)
    zero = constant(0.0, mass)
    heavy, inert = 4.0 / (h * h) * mass, constant(2.0 / (h * h), mass)
    change = subtract(turn_back(f, momentum), middle_momentum(f, compliance, 4.0 / h))
    torque = scale(2.0 / h, untwist(f, change))
    if terms.spin_drag is not None:
        rate = load(block, SPIN_DRAG, lanes)
        torque = add_scaled(torque, -1.0, middle_momentum(f, compliance, 4.0 / h * rate))
        inert = inert * (1.0 + 0.5 * h * rate)
    force = scale(2.0 / h * mass, velocity)
    if terms.gravity is not None:
        force = add_scaled(force, mass, load3(block, GRAVITY, lanes))
    if terms.drag is not None:
        heavy = heavy * (1.0 + 0.5 * h * load(block, DRAG, lanes))
    for k in range(COUPLING):
        store(scratch, own + k, zero, lanes)
    for k in range(3):
        store(scratch, own + triangle(k, k), heavy, lanes)
    store(scratch, own + triangle(3, 3), inert / compliance[0], lanes)
    store(scratch, own + triangle(4, 4), inert / compliance[1], lanes)
    store(scratch, own + triangle(5, 5), inert / compliance[1], lanes)
    mean = scale(2.0 / h, d)
    force, torque = half_step_loads(
        block, scratch, layout, terms, terms.loads, node, own, middle, mean, 2.0 / h, force, torque
    )
    store3(scratch, own + RIGHT, add_scaled(force, -heavy, d), lanes)
    store3(scratch, own + RIGHT + 3, torque, lanes)


@inline_jit
def move_half_step(scratch, own, inverse_length, lanes):
    """Add a solved increment to a node's half step; returns its square (rad^2, with lengths over an element's)."""
    change, twist = load3(scratch, own + RIGHT, lanes), load3(scratch, own + RIGHT + 3, lanes)
    f = load3(scratch, own + TURN, lanes)
    add3(scratch, own + SHIFT, change, lanes)
    turn = add_scaled(add(twist, cross(f, twist)), dot(f, twist), f)
    store3(scratch, own + TURN, add_scaled(f, 0.5, turn), lanes)
    return inverse_length * inverse_length * dot(change, change) + dot(twist, twist)


@jit
def finish(block, scratch, layout, terms, h, ahead):
    """Move the nodes to the end of the step, with the velocities and momenta that the half steps mean.

    ``ahead`` s lie between the middles of the last two steps; 0 leaves the first guess's slope as it is.
    """
    lanes = terms.lanes
    before = load_pose(block, layout.nodes, lanes, None)
    cosine = load(block, LEAST_COSINE, lanes)
    for node in range(1, layout.num_elements + 1):
        row, own = node_row(layout, None, node), NODE * node
        position, rotation = load_pose(block, row, lanes, None)
        velocity, momentum = load_motion(block, row, lanes, None)
        compliance = load2(block, row + SPATIAL.compliance, lanes)
        d, f = load3(scratch, own + SHIFT, lanes), load3(scratch, own + TURN, lanes)
        middle = middle_momentum(f, compliance, 4.0 / h)
        push = untwist(f, subtract(middle, turn_back(f, momentum)))
        new_momentum = turn_back(f, add(middle, add(push, cross(f, push))))
        new_velocity = add_scaled(scale(4.0 / h, d), -1.0, velocity)
        middle_pose = load_pose(scratch, own + MIDDLE, lanes, None)
        mean, spin = scale(2.0 / h, d), scale(4.0 / h, f)
        count_half_step_work(block, layout, terms, terms.loads, node, middle_pose, mean, spin, h)
        for k in range(0, 6, 3):
            pace = scale(1.0 / h, load3(scratch, own + SHIFT + k, lanes))
            if ahead != 0.0:
                rise = subtract(pace, load3(scratch, own + PACE + k, lanes))
                store3(scratch, own + RISE + k, scale(1.0 / ahead, rise), lanes)
            store3(scratch, own + PACE + k, pace, lanes)
        rotation = normalise(compose_cayley(normalise(compose_cayley(rotation, f)), f))
        pose = add_scaled(position, 2.0, d), rotation
        store_pose(block, row, pose, lanes, None)
        store_motion(block, row, (new_velocity, new_momentum), lanes, None)
        cosine = minimum(cosine, bend_cosine(before, pose, None))
        before = pose
    store(block, LEAST_COSINE, cosine, lanes)
