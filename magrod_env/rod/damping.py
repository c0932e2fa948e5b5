"""Internal (Kelvin-Voigt) damping of a rod over a span of time, implicit along the chain: stable at any step.

The shape stands still meanwhile and the nodes' motion v decays as ``M dv/dt = -D v``, with D the Kelvin-Voigt time
times the material stiffness of the elements. With c = (1 - 1/sqrt(2)) times the span and G = (M + c D)^-1 c D,
``v <- (1 - G)(1 - (1 + sqrt(2)) G) v`` is a second-order, L-stable approximation to the exponential (the diagonally
implicit Runge-Kutta method of Alexander 1977): no motion grows, stiff ones die at once, momenta stay.

Spins are solved for in the world frame, where an element's strain rates are

    stretch and shear  (v_b - v_a)/h + chord x (w_a + w_b)/2        (chord over the length)
    twist and bend     w_b - w_a                                    (times h)

They vanish in rigid motion, and are those of the helical element but for a share theta^2/12 of its bend theta. The
stiffness is U = GA* + (EA - GA*) t t^T and V = EI/h + (GJ/h - EI/h) t t^T with t the tangent of the mid-frame and GA*
that of the straight element. Derived in docs/physics.md.
"""

import numpy as np

from magrod_env._jit import inline_jit, jit
from magrod_env._simd import constant, load, store
from magrod_env.rod.access import load2, load3, load_motion, load_pose, node_row, store3, store_motion
from magrod_env.rod.elimination import (
    PLANAR_FREEDOMS,
    SPATIAL_FREEDOMS,
    add1,
    add3,
    coupling_row,
    eliminate_node,
    factor_node,
    forward_node,
    right_row,
    substitute_node,
    system_rows,
    triangle,
)
from magrod_env.rod.layout import (
    AXIAL,
    BENDING,
    DAMPING,
    ELEMENT_ROWS,
    INVERSE_LENGTH,
    LENGTH,
    PLANAR,
    SHEAR,
    SPATIAL,
    TILT,
    TORSION,
)
from magrod_env.rod.planar import planar_matrix
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

STAGE = 1.0 - 0.5**0.5  # of a span: the implicit share of each of the two stages
DAMPED_STEPS = 8  # for each solution of the chain: it costs as much as two to three steps
SECOND = 1.0 + 2.0**0.5  # weight of the second stage


@inline_jit
def freedoms_of(planar):
    """Degrees of freedom of a node."""
    if planar is None:
        return SPATIAL_FREEDOMS
    return PLANAR_FREEDOMS


@inline_jit
def damping_rows(freedoms):
    """Rows of a node in the scratch: its part of the system, then its first stage."""
    return system_rows(freedoms) + len(freedoms)


@inline_jit
def tangent_of(rotation, two_over_norm):
    """First column of the matrix of a quaternion of any length; ``two_over_norm = 2 / |q|^2``."""
    w, x, y, z = rotation
    return (
        1.0 - two_over_norm * (y * y + z * z),
        two_over_norm * (x * y + w * z),
        two_over_norm * (x * z - w * y),
    )


@inline_jit
def tensor(diagonal, factor, v):
    """``diagonal I + factor v v^T``: the lower triangle row by row."""
    x, y, z = scale(factor, v)
    return diagonal + x * v[0], y * v[0], diagonal + y * v[1], z * v[0], z * v[1], diagonal + z * v[2]


@inline_jit
def add_tensor(scratch, own, first, m, lanes):
    """Add a symmetric 3x3 matrix to a diagonal block, from degree of freedom ``first`` on."""
    add1(scratch, own + triangle(first, first), m[0], lanes)
    add1(scratch, own + triangle(first + 1, first), m[1], lanes)
    add1(scratch, own + triangle(first + 1, first + 1), m[2], lanes)
    add3(scratch, own + triangle(first + 2, first), (m[3], m[4], m[5]), lanes)


@inline_jit
def store_tensor(scratch, row, factor, m, lanes):
    """Write ``factor`` times a symmetric 3x3 matrix into a coupling, whose rows are six apart."""
    store3(scratch, row, scale(factor, (m[0], m[1], m[3])), lanes)
    store3(scratch, row + 6, scale(factor, (m[1], m[2], m[4])), lanes)
    store3(scratch, row + 12, scale(factor, (m[3], m[4], m[5])), lanes)


@inline_jit
def inertia_of(block, row, rotation, lanes):
    """Inertia of a node's section in the world frame."""
    axial, transverse = load2(block, row + SPATIAL.compliance, lanes)
    inertia = 0.5 / transverse
    return tensor(inertia, 0.5 / axial - inertia, tangent_of(rotation, 2.0))


@inline_jit
def world_motion(block, row, rotation, lanes):
    """Velocity and angular velocity of a node in space, both in the world frame."""
    velocity, momentum = load_motion(block, row, lanes, None)
    axial, transverse = load2(block, row + SPATIAL.compliance, lanes)
    spin = 2.0 * axial * momentum[0], 2.0 * transverse * momentum[1], 2.0 * transverse * momentum[2]
    return velocity, rotate(matrix(rotation, 2.0), spin)


@inline_jit
def open_node(scratch, own, blocks, loads, lanes):
    """Write a node's diagonal block, of ``blocks`` (of velocities, its columns mixed with spins, of spins), and its
    right-hand side.
    """
    of_velocities, mixed, of_spins = blocks
    store3(scratch, own, of_velocities[:3], lanes)
    store3(scratch, own + 3, of_velocities[3:], lanes)
    for k in range(3):
        store3(scratch, own + triangle(3 + k, 0), mixed[k], lanes)
    store(scratch, own + triangle(3, 3), of_spins[0], lanes)
    store(scratch, own + triangle(4, 3), of_spins[1], lanes)
    store(scratch, own + triangle(4, 4), of_spins[2], lanes)
    store3(scratch, own + triangle(5, 3), of_spins[3:], lanes)
    right = own + right_row(SPATIAL_FREEDOMS)
    store3(scratch, right, loads[0], lanes)
    store3(scratch, right + 3, loads[1], lanes)


@inline_jit
def add_tensors(a, b):
    """Sum of two symmetric 3x3 matrices."""
    return a[0] + b[0], a[1] + b[1], a[2] + b[2], a[3] + b[3], a[4] + b[4], a[5] + b[5]


@inline_jit
def damping_loads(block, row, pose_a, pose_b, motion_a, motion_b, share, lanes):
    """Resistance of the element at ``row`` to motions in the world frame, for a Kelvin-Voigt time of ``share``.

    Returns (tangent, chord over length); stiffness across and along, against bending and twisting; and force on a
    (b gets its negative), moment and lever in the world frame: the torques are moment - lever on a, -moment - lever
    on b.
    """
    length, inverse_length = load(block, row + LENGTH, lanes), load(block, row + INVERSE_LENGTH, lanes)
    shear, tilting = load(block, row + SHEAR, lanes), load(block, row + TILT, lanes)
    across = share * (shear * tilting / (shear + tilting))
    along = share * load(block, row + AXIAL, lanes) - across
    bending = share * load(block, row + BENDING, lanes)
    twisting = share * load(block, row + TORSION, lanes) - bending
    (position_a, q_a), (position_b, q_b) = pose_a, pose_b
    cosine, unused = relative_rotation(q_a, q_b)
    t = tangent_of((q_a[0] + q_b[0], q_a[1] + q_b[1], q_a[2] + q_b[2], q_a[3] + q_b[3]), 1.0 / (1.0 + cosine))
    chord = scale(inverse_length, subtract(position_b, position_a))
    rate = scale(inverse_length, subtract(motion_b[0], motion_a[0]))
    rate = add_scaled(rate, 0.5, cross(chord, add(motion_a[1], motion_b[1])))
    bend = subtract(motion_b[1], motion_a[1])
    force = add_scaled(scale(across, rate), along * dot(t, rate), t)
    moment = add_scaled(scale(bending, bend), twisting * dot(t, bend), t)
    lever = scale(0.5 * length, cross(force, chord))
    return (t, chord), (across, along, bending, twisting), (force, moment, lever)


@inline_jit
def add_element(block, scratch, layout, element, pose_a, pose_b, motion_a, motion_b, share, lanes):
    """Add the damping of an element, ``share`` = c times the Kelvin-Voigt time, and its loads in the present motion."""
    row, a, b = (
        layout.elements + ELEMENT_ROWS * element,
        damping_rows(SPATIAL_FREEDOMS) * (element - 1),
        damping_rows(SPATIAL_FREEDOMS) * element,
    )
    length, inverse_length = load(block, row + LENGTH, lanes), load(block, row + INVERSE_LENGTH, lanes)
    (t, chord), (across, along, bending, twisting), (force, moment, lever) = damping_loads(
        block, row, pose_a, pose_b, motion_a, motion_b, share, lanes
    )
    q = cross(t, chord)
    s, e = scale(0.5 * across, chord), scale(0.5 * along, t)
    column_0 = add_scaled((0.0 * length, s[2], -s[1]), q[0], e)  # of U chord^ / 2
    column_1 = add_scaled((-s[2], 0.0 * length, s[0]), q[1], e)
    column_2 = add_scaled((s[1], -s[0], 0.0 * length), q[2], e)
    positions = tensor(inverse_length * across, inverse_length * along, t)
    lean = tensor(0.25 * length * across * dot(chord, chord), -0.25 * length * across, chord)
    turns = add_tensors(lean, tensor(0.0 * length, 0.25 * length * along, q))
    bends = tensor(bending, twisting, t)
    spins = add_tensors(turns, bends)
    mass = 1.0 / load(block, node_row(layout, None, element + 1) + SPATIAL.inverse_mass, lanes)
    heavy = add_tensors(positions, (mass, 0.0 * mass, mass, 0.0 * mass, 0.0 * mass, mass))
    inertia = inertia_of(block, node_row(layout, None, element + 1), pose_b[1], lanes)
    columns, loads = (column_0, column_1, column_2), (force, add(lever, moment))
    open_node(scratch, b, (heavy, columns, add_tensors(spins, inertia)), loads, lanes)
    if element > 0:
        add_tensor(scratch, a, 0, positions, lanes)
        add_tensor(scratch, a, 3, spins, lanes)
        right = a + right_row(SPATIAL_FREEDOMS)
        add3(scratch, a + triangle(3, 0), scale(-1.0, column_0), lanes)
        add3(scratch, a + triangle(4, 0), scale(-1.0, column_1), lanes)
        add3(scratch, a + triangle(5, 0), scale(-1.0, column_2), lanes)
        add3(scratch, right, scale(-1.0, force), lanes)
        add3(scratch, right + 3, subtract(lever, moment), lanes)
        coupling = b + coupling_row(SPATIAL_FREEDOMS)
        store_tensor(scratch, coupling, -1.0, positions, lanes)
        store3(scratch, coupling + 3, (column_0[0], column_1[0], column_2[0]), lanes)
        store3(scratch, coupling + 9, (column_0[1], column_1[1], column_2[1]), lanes)
        store3(scratch, coupling + 15, (column_0[2], column_1[2], column_2[2]), lanes)
        store3(scratch, coupling + 18, scale(-1.0, column_0), lanes)
        store3(scratch, coupling + 24, scale(-1.0, column_1), lanes)
        store3(scratch, coupling + 30, scale(-1.0, column_2), lanes)
        store_tensor(
            scratch,
            coupling + 21,
            1.0,
            (
                turns[0] - bends[0],
                turns[1] - bends[1],
                turns[2] - bends[2],
                turns[3] - bends[3],
                turns[4] - bends[4],
                turns[5] - bends[5],
            ),
            lanes,
        )


@inline_jit
def begin_second_stage(block, scratch, row, own, rotation, lanes):
    """Keep a node's first stage, and make its inertia times that the new right-hand side."""
    right = own + right_row(SPATIAL_FREEDOMS)
    change, turn = load3(scratch, right, lanes), load3(scratch, right + 3, lanes)
    kept = own + system_rows(SPATIAL_FREEDOMS)
    store3(scratch, kept, change, lanes)
    store3(scratch, kept + 3, turn, lanes)
    j = inertia_of(block, row, rotation, lanes)
    store3(scratch, right, scale(1.0 / load(block, row + SPATIAL.inverse_mass, lanes), change), lanes)
    torque = (
        j[0] * turn[0] + j[1] * turn[1] + j[3] * turn[2],
        j[1] * turn[0] + j[2] * turn[1] + j[4] * turn[2],
        j[3] * turn[0] + j[4] * turn[1] + j[5] * turn[2],
    )
    store3(scratch, right + 3, torque, lanes)


@inline_jit
def finish_node(block, scratch, row, own, rotation, lanes):
    """Take both stages from a node's motion."""
    right, kept = own + right_row(SPATIAL_FREEDOMS), own + system_rows(SPATIAL_FREEDOMS)
    change = add_scaled(load3(scratch, kept, lanes), SECOND, load3(scratch, right, lanes))
    turn = add_scaled(load3(scratch, kept + 3, lanes), SECOND, load3(scratch, right + 3, lanes))
    velocity, momentum = load_motion(block, row, lanes, None)
    axial, transverse = load2(block, row + SPATIAL.compliance, lanes)
    spin = rotate_back(matrix(rotation, 2.0), turn)
    momentum = (
        momentum[0] - 0.5 * spin[0] / axial,
        momentum[1] - 0.5 * spin[1] / transverse,
        momentum[2] - 0.5 * spin[2] / transverse,
    )
    store_motion(block, row, (subtract(velocity, change), momentum), lanes, None)


@inline_jit
def begin_planar_node(block, scratch, row, own, lanes):
    """Open a node's part of the system in a plane."""
    mass = 1.0 / load(block, row + PLANAR.inverse_mass, lanes)
    zero = constant(0.0, mass)
    for k in range(system_rows(PLANAR_FREEDOMS)):
        store(scratch, own + k, zero, lanes)
    store(scratch, own + triangle(0, 0), mass, lanes)
    store(scratch, own + triangle(1, 1), mass, lanes)
    store(scratch, own + triangle(2, 2), 0.5 / load(block, row + PLANAR.compliance, lanes), lanes)


@inline_jit
def add_planar_element(block, scratch, layout, element, pose_a, pose_b, motion_a, motion_b, share, lanes):
    """Damping of an element in a plane (see ``add_element``)."""
    row, n = layout.elements + ELEMENT_ROWS * element, damping_rows(PLANAR_FREEDOMS)
    a, b = n * (element - 1), n * element
    length, inverse_length = load(block, row + LENGTH, lanes), load(block, row + INVERSE_LENGTH, lanes)
    shear, tilting = load(block, row + SHEAR, lanes), load(block, row + TILT, lanes)
    across = share * (shear * tilting / (shear + tilting))
    along = share * load(block, row + AXIAL, lanes) - across
    bending = share * load(block, row + BENDING, lanes)
    (position_a, q_a), (position_b, q_b) = pose_a, pose_b
    cosine = q_a[0] * q_b[0] + q_a[1] * q_b[1]
    t = planar_matrix((q_a[0] + q_b[0], q_a[1] + q_b[1]), 1.0 / (1.0 + cosine))
    x = inverse_length * (position_b[1] - position_a[1])  # what a turn of one does to the chord, x and y
    y = inverse_length * (position_a[0] - position_b[0])
    (velocity_a, spin_a), (velocity_b, spin_b) = motion_a, motion_b
    half = 0.5 * (spin_a + spin_b)
    rate_x = inverse_length * (velocity_b[0] - velocity_a[0]) + half * x
    rate_y = inverse_length * (velocity_b[1] - velocity_a[1]) + half * y
    stretched = along * (t[0] * rate_x + t[1] * rate_y)
    force_x, force_y = across * rate_x + stretched * t[0], across * rate_y + stretched * t[1]
    moment, lever = bending * (spin_b - spin_a), 0.5 * length * (x * force_x + y * force_y)
    leant = along * (t[0] * x + t[1] * y)
    mixed_x, mixed_y = 0.5 * (across * x + leant * t[0]), 0.5 * (across * y + leant * t[1])
    turns = 0.5 * length * (x * mixed_x + y * mixed_y)
    p, s = inverse_length * across, inverse_length * along
    xx, yx, yy = p + s * t[0] * t[0], s * t[0] * t[1], p + s * t[1] * t[1]
    right = right_row(PLANAR_FREEDOMS)
    add3(scratch, b, (xx, yx, yy), lanes)
    add3(scratch, b + triangle(2, 0), (mixed_x, mixed_y, turns + bending), lanes)
    add3(scratch, b + right, (force_x, force_y, lever + moment), lanes)
    if element > 0:
        add3(scratch, a, (xx, yx, yy), lanes)
        add3(scratch, a + triangle(2, 0), (-mixed_x, -mixed_y, turns + bending), lanes)
        add3(scratch, a + right, (-force_x, -force_y, lever - moment), lanes)
        coupling = b + coupling_row(PLANAR_FREEDOMS)
        store3(scratch, coupling, (-xx, -yx, mixed_x), lanes)
        store3(scratch, coupling + 3, (-yx, -yy, mixed_y), lanes)
        store3(scratch, coupling + 6, (-mixed_x, -mixed_y, turns - bending), lanes)


@inline_jit
def begin_planar_second_stage(block, scratch, row, own, lanes):
    """Keep a node's first stage, and make its inertia times that the new right-hand side."""
    right, kept = own + right_row(PLANAR_FREEDOMS), own + system_rows(PLANAR_FREEDOMS)
    x, y, turn = load3(scratch, right, lanes)
    store3(scratch, kept, (x, y, turn), lanes)
    mass = 1.0 / load(block, row + PLANAR.inverse_mass, lanes)
    store3(scratch, right, (mass * x, mass * y, 0.5 * turn / load(block, row + PLANAR.compliance, lanes)), lanes)


@inline_jit
def finish_planar_node(block, scratch, row, own, lanes, planar):
    """Take both stages from a node's motion."""
    right, kept = own + right_row(PLANAR_FREEDOMS), own + system_rows(PLANAR_FREEDOMS)
    x, y, turn = add_scaled(load3(scratch, kept, lanes), SECOND, load3(scratch, right, lanes))
    velocity, momentum = load_motion(block, row, lanes, planar)
    momentum = momentum - 0.5 * turn / load(block, row + PLANAR.compliance, lanes)
    store_motion(block, row, ((velocity[0] - x, velocity[1] - y), momentum), lanes, planar)


@inline_jit
def node_motion(block, row, pose, lanes, planar):
    """Velocity and angular velocity of a node, world frame."""
    if planar is None:
        return world_motion(block, row, pose[1], lanes)
    velocity, momentum = load_motion(block, row, lanes, planar)
    return velocity, 2.0 * load(block, row + PLANAR.compliance, lanes) * momentum


@inline_jit
def assemble_damping(block, scratch, layout, terms, planar, share):
    """Open the system of all nodes, add every element and eliminate node by node."""
    lanes, last, freedoms = terms.lanes, layout.num_elements, freedoms_of(planar)
    n = damping_rows(freedoms)
    pose = load_pose(block, layout.nodes, lanes, planar)
    motion = node_motion(block, layout.nodes, pose, lanes, planar)  # the clamp's is zero
    for element in range(last):
        row, own = node_row(layout, planar, element + 1), n * element
        next_pose = load_pose(block, row, lanes, planar)
        next_motion = node_motion(block, row, next_pose, lanes, planar)
        if planar is None:
            add_element(block, scratch, layout, element, pose, next_pose, motion, next_motion, share, lanes)
        else:
            begin_planar_node(block, scratch, row, own, lanes)
            add_planar_element(block, scratch, layout, element, pose, next_pose, motion, next_motion, share, lanes)
        if element > 0:
            factor_node(scratch, own - n, lanes, freedoms)
            eliminate_node(scratch, own - n, own, lanes, freedoms)
        pose, motion = next_pose, next_motion
    factor_node(scratch, n * (last - 1), lanes, freedoms)


@inline_jit
def substitute(scratch, layout, lanes, planar):
    """Solve for all nodes, from the last."""
    freedoms, last = freedoms_of(planar), layout.num_elements - 1
    n = damping_rows(freedoms)
    substitute_node(scratch, n * last, None, lanes, freedoms)
    for node in range(last - 1, -1, -1):
        substitute_node(scratch, n * node, n * (node + 1), lanes, freedoms)


@jit
def damp(block, scratch, layout, terms, planar, span):
    """Damp the motion of a lane block over ``span`` s; ``scratch`` has ``damping_rows`` rows a free node."""
    lanes, freedoms = terms.lanes, freedoms_of(planar)
    n = damping_rows(freedoms)
    assemble_damping(block, scratch, layout, terms, planar, STAGE * span * load(block, DAMPING, lanes))
    substitute(scratch, layout, lanes, planar)
    for node in range(layout.num_elements):
        row, own = node_row(layout, planar, node + 1), n * node
        if planar is None:
            begin_second_stage(block, scratch, row, own, load_pose(block, row, lanes, planar)[1], lanes)
        else:
            begin_planar_second_stage(block, scratch, row, own, lanes)
        if node == 0:
            forward_node(scratch, own, None, lanes, freedoms)
        else:
            forward_node(scratch, own, own - n, lanes, freedoms)
    substitute(scratch, layout, lanes, planar)
    for node in range(layout.num_elements):
        row, own = node_row(layout, planar, node + 1), n * node
        if planar is None:
            finish_node(block, scratch, row, own, load_pose(block, row, lanes, planar)[1], lanes)
        else:
            finish_planar_node(block, scratch, row, own, lanes, planar)


@inline_jit
def share_due(boundary, num_steps):
    """Steps' worth of damping due before step ``boundary`` (0 to num_steps), that is between two steps.

    Steps go in groups of DAMPED_STEPS, the last maybe shorter, each damped once in its middle: where that is inside a
    step, half before it and half after. So the scheme is symmetric, of second order.
    """
    due = 0.0
    for step in range(max(boundary - 1, 0), min(boundary + 1, num_steps)):
        first = (step // DAMPED_STEPS) * DAMPED_STEPS
        size, place = min(DAMPED_STEPS, num_steps - first), step - first
        if 2 * place == size and step == boundary:
            due += size
        if 2 * place + 1 == size:
            due += 0.5 * size
    return due


@inline_jit
def damp_if_present(block, scratch, layout, terms, planar, span):
    """Damp the motion over ``span`` s where there is internal damping: where ``scratch`` is not None."""
    if scratch is not None:
        damp(block, scratch, layout, terms, planar, span)


@inline_jit
def damp_if_due(block, scratch, layout, terms, planar, boundary, num_steps, time_step):
    """Damp what is due between two steps (see ``share_due``)."""
    due = share_due(boundary, num_steps)
    if due > 0.0:
        damp(block, scratch, layout, terms, planar, due * time_step)


@jit
def damping_scratch(blocks, layout, planar, internal_damping, lanes):
    """Scratch memory for ``damp``, or None without internal damping."""
    if internal_damping is None:
        return None
    return np.zeros(layout.num_elements * damping_rows(freedoms_of(planar)) * len(lanes), blocks.dtype)
