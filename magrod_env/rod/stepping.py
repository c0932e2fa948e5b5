"""One loop nest that steps rods: drift, kick, drift, for spatial or planar rods, either element, one rod or many lanes.

A step of length dt is a drift of dt/2, a kick with the loads at the middle, a drift of dt/2; inside a run neighbouring
drifts merge. It is the Lie group variational integrator of Tariverdi et al. 2020 (eq. 10-16, with the corrections in
docs/audit.md) in its symmetric form, so positions and velocities belong to the same time at every call's start and end.
Drag enters as forcing, internal damping as a flow of its own between steps (``damping.py``). Branches on ``terms`` are
decided when the kernel is compiled.
"""

from magrod_env._jit import inline_jit, jit
from magrod_env._simd import load, maximum, minimum, store, where_above
from magrod_env.rod.access import load2, load3, load_motion, load_pose, node_row, store3, store_motion, store_pose
from magrod_env.rod.damping import damp_if_due, damping_scratch, share_due
from magrod_env.rod.elements import bend_cosine, element_loads
from magrod_env.rod.layout import DRAG, FIELD, LEAST_COSINE, PLANAR, REFERENCE, SPATIAL, SPIN_DRAG, TARGET
from magrod_env.rod.loads.gravity import add_gravity
from magrod_env.rod.loads.hub import add_loads, add_resistance, count_power, settle_work
from magrod_env.rod.loads.linear_drag import braking
from magrod_env.rod.loads.magnets import magnet_loads
from magrod_env.rod.loads.node_damping import damped_velocity
from magrod_env.rod.planar import planar_free_rotation
from magrod_env.rod.rotation import free_rotation
from magrod_env.rod.so3 import add_scaled, rotate, scale
from magrod_env.rod.vectors import (
    add_scaled_vector,
    add_torques,
    add_vectors,
    no_load,
    scaled_vector,
    subtract_vectors,
)


@inline_jit
def drift_node(block, row, pose, motion, time_step, lanes, planar):
    """Move a node freely for ``time_step`` and store it."""
    velocity, momentum = motion
    if planar is None:
        compliance = load2(block, row + SPATIAL.compliance, lanes)
        rotation, momentum = free_rotation(pose[1], momentum, time_step, compliance)
        position = add_scaled(pose[0], time_step, velocity)
    else:
        rotation = planar_free_rotation(pose[1], momentum, time_step, load(block, row + PLANAR.compliance, lanes))
        position = (pose[0][0] + time_step * velocity[0], pose[0][1] + time_step * velocity[1])
    store_pose(block, row, (position, rotation), lanes, planar)
    store_motion(block, row, (velocity, momentum), lanes, planar)


@jit
def drift(block, layout, terms, planar, time_step):
    """Move every free node for ``time_step`` without loads."""
    for node in range(1, layout.num_elements + 1):
        row = node_row(layout, planar, node)
        pose = load_pose(block, row, terms.lanes, planar)
        drift_node(block, row, pose, load_motion(block, row, terms.lanes, planar), time_step, terms.lanes, planar)


@inline_jit
def kicked(motion, block, layout, node, force, torque, brakes, terms, planar):
    """Motion of a node after a kick; drag semi-implicit: v <- keep v + gain (f/m + g), and so for the spin."""
    row = node_row(layout, planar, node)
    keep, gain, keep_spin, gain_spin = brakes
    velocity, momentum = motion
    if planar is None:
        inverse_mass = load(block, row + SPATIAL.inverse_mass, terms.lanes)
        acceleration = scale(inverse_mass, force)
        if terms.gravity is not None:
            acceleration = add_gravity(acceleration, block, terms.lanes, planar)
        if terms.spin_drag is not None:
            momentum = scale(keep_spin, momentum)
        momentum = add_scaled(momentum, gain_spin, torque)
    else:
        inverse_mass = load(block, row + PLANAR.inverse_mass, terms.lanes)
        acceleration = (inverse_mass * force[0], inverse_mass * force[1])
        if terms.gravity is not None:
            acceleration = add_gravity(acceleration, block, terms.lanes, planar)
        if terms.spin_drag is not None:
            momentum = keep_spin * momentum
        momentum = momentum + gain_spin * torque
    if terms.node_damping is not None:
        velocity = damped_velocity(
            block, layout, node, velocity, acceleration, inverse_mass, keep, gain, terms.lanes, planar
        )
        return velocity, momentum
    if terms.drag is not None:
        velocity = scaled_vector(keep, velocity, planar)
    return add_scaled_vector(velocity, gain, acceleration, planar), momentum


@inline_jit
def move_node(block, layout, node, pose, force, torque, drift_step, brakes, terms, planar, gradient):
    """Kick one node with its complete loads, magnets included, and let it drift."""
    if terms.magnets is not None:
        for magnet in range(len(layout.magnet_nodes)):
            if layout.magnet_nodes[magnet] == node:
                pull = magnet_loads(block, layout, magnet, pose, terms.lanes, planar, gradient)
                torque = add_torques(torque, pull[0], planar)
                if gradient is not None:
                    force = add_vectors(force, pull[1], planar)
    force, torque = add_loads(block, layout, terms, terms.loads, node, pose, force, torque, planar)
    row = node_row(layout, planar, node)
    before = load_motion(block, row, terms.lanes, planar)
    motion = kicked(before, block, layout, node, force, torque, brakes, terms, planar)
    motion = add_resistance(block, layout, terms, terms.loads, node, pose, before, motion, brakes[1], planar)
    count_power(block, layout, terms, terms.loads, node, pose, before, motion, planar)
    drift_node(block, row, pose, motion, drift_step, terms.lanes, planar)


@jit
def kick_and_drift(block, layout, terms, planar, nodal, gradient, drift_step, brakes):
    """One sweep along the rod: loads of element e complete node e, which is kicked and drifts while e + 1 is looked
    at.
    """
    lanes = terms.lanes
    last = layout.num_elements
    pose = load_pose(block, layout.nodes, lanes, planar)
    before, torque = no_load(block, lanes, planar)
    cosine = load(block, LEAST_COSINE, lanes)
    for element in range(last):
        next_pose = load_pose(block, node_row(layout, planar, element + 1), lanes, planar)
        bend = bend_cosine(pose, next_pose, planar)
        cosine = where_above(cosine, bend, bend, cosine)
        pull, torque_a, torque_b = element_loads(block, layout, element, pose, next_pose, lanes, planar, nodal)
        if element > 0:
            force, twist = subtract_vectors(pull, before, planar), add_torques(torque, torque_a, planar)
            move_node(block, layout, element, pose, force, twist, drift_step, brakes, terms, planar, gradient)
        before, torque, pose = pull, torque_b, next_pose
    force = subtract_vectors(no_load(block, lanes, planar)[0], before, planar)
    move_node(block, layout, last, pose, force, torque, drift_step, brakes, terms, planar, gradient)
    store(block, LEAST_COSINE, cosine, lanes)


@inline_jit
def approach_target(block, axis, terms, largest_change):
    """What the drive asks of one axis after half a step: the target, or the slew-limited reference on its way there."""
    goal = load(block, TARGET + axis, terms.lanes)
    if terms.slew is not None:
        reference = load(block, REFERENCE + axis, terms.lanes)
        goal = reference + minimum(maximum(goal - reference, -largest_change), largest_change)
        store(block, REFERENCE + axis, goal, terms.lanes)
    return goal


@inline_jit
def approach_field(block, layout, terms, blend, largest_change):
    """Coils over half a step: the slew limit acts on each coil, then the field follows with a lag."""
    lanes = terms.lanes
    goal = (
        approach_target(block, 0, terms, largest_change),
        approach_target(block, 1, terms, largest_change),
        approach_target(block, 2, terms, largest_change),
    )
    if terms.turned is not None:
        row = layout.mixing
        goal = rotate((load3(block, row, lanes), load3(block, row + 3, lanes), load3(block, row + 6, lanes)), goal)
    if terms.lag is not None:
        field = load3(block, FIELD, lanes)
        goal = add_scaled(field, blend, add_scaled(goal, -1.0, field))
    store3(block, FIELD, goal, lanes)


@jit
def run_block(
    block, layout, terms, planar, nodal, gradient, num_steps, time_step, blend, largest_change, fields, scratch
):
    """Step one lane block ``num_steps`` times; ``fields`` (num_steps, 3 * L) T or None, ``scratch`` for ``damp``."""
    keep, gain = braking(block, DRAG, terms.drag, time_step, terms.lanes)
    keep_spin, gain_spin = braking(block, SPIN_DRAG, terms.spin_drag, time_step, terms.lanes)
    brakes = (keep, gain, keep_spin, gain_spin)
    half = 0.5 * time_step
    if scratch is not None:
        damp_if_due(block, scratch, layout, terms, planar, 0, num_steps, time_step)
    drift(block, layout, terms, planar, half)
    for step in range(num_steps):
        if fields is not None:
            store3(block, FIELD, load3(fields[step], 0, terms.lanes), terms.lanes)
        if terms.slew is not None or terms.lag is not None:
            approach_field(block, layout, terms, blend, largest_change)
        stop = step + 1 == num_steps
        if scratch is not None:
            stop = stop or share_due(step + 1, num_steps) > 0.0
        kick_and_drift(block, layout, terms, planar, nodal, gradient, half if stop else time_step, brakes)
        if terms.slew is not None or terms.lag is not None:
            approach_field(block, layout, terms, blend, largest_change)
        if scratch is not None:
            damp_if_due(block, scratch, layout, terms, planar, step + 1, num_steps, time_step)
            if stop and step + 1 < num_steps:
                drift(block, layout, terms, planar, half)
    settle_work(block, layout, terms, terms.loads, time_step)


@jit
def run_blocks(blocks, first, last, layout, terms, num_steps, time_step, blend, largest_change, fields):
    """Step lane blocks ``first`` to ``last`` (exclusive) of ``blocks`` (num_blocks, rows * L) ``num_steps`` times.

    ``time_step`` s; ``blend`` = 1 - exp(-dt/(2 lag)) and ``largest_change`` (T, over half a step) act only with coils
    that have a lag or a slew limit. ``fields`` (num_blocks, num_steps, 3 * L) T is the field in the middle of every
    step; None leaves the field as it is.
    """
    scratch = damping_scratch(blocks, layout, terms.planar, terms.internal_damping, terms.lanes)
    for b in range(first, last):
        run_block(
            blocks[b],
            layout,
            terms,
            terms.planar,
            terms.nodal,
            terms.gradient,
            num_steps,
            time_step,
            blend,
            largest_change,
            None if fields is None else fields[b],
            scratch,
        )
