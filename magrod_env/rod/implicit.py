"""Implicit midpoint step of spatial rods of helical elements: steps of milliseconds, however stiff the rod.

Nodes move by half steps (see ``halfstep.py``). Loads act at the middle of the step, with the stress of the mean of the
strains at both ends. Newton's method solves for the half steps with the material stiffness and with the tension of the
step before, which leaves a small linear rate: before it has converged, a stiff rod's tension is far off. Derived in
docs/physics.md.
"""

import numpy as np

from magrod_env._jit import inline_jit, jit
from magrod_env._simd import constant, load, maximum, square_root, store
from magrod_env.rod.access import load3, load_pose, node_row, store3
from magrod_env.rod.damping import damp_if_present, damping_scratch
from magrod_env.rod.elements import section_stiffness
from magrod_env.rod.elimination import (
    COUPLING,
    RIGHT,
    SPATIAL_FREEDOMS,
    add1,
    add3,
    eliminate_node,
    factor_node,
    substitute_node,
    triangle,
)
from magrod_env.rod.energy import OK
from magrod_env.rod.halfstep import END, MIDDLE, NODE, PULL, STRAIN, begin_node, finish, move_half_step, predict
from magrod_env.rod.helical import helical_loads, helical_strain, helical_stress
from magrod_env.rod.jacobian import strain_jacobian, stretched, weighted
from magrod_env.rod.layout import (
    ELEMENT_ROWS,
    FIELD,
    INVERSE_LENGTH,
    LENGTH,
)
from magrod_env.rod.loads.magnets import local_field, magnet_loads
from magrod_env.rod.so3 import add, add_scaled, dot, matrix, rotate_back, scale

UNSOLVED = 5  # status of a rod, beside those of the watchdog
TOLERANCE = 1e-8  # of a half step: rad, and of the first element's length
MOST_ITERATIONS = 16
LEAST_SPAN = 0.3  # of a step: between middles, for a slope
MOST_PARTS = 64  # of a step that is not solved


@inline_jit
def product_row(column, others):
    """A row of ``M^T N`` from a column of M and the columns of N."""
    return dot(column, others[0]), dot(column, others[1]), dot(column, others[2])


@inline_jit
def add_symmetric(scratch, own, first, columns, others, lanes):
    """Add a symmetric ``M^T N`` to a diagonal block, at degrees of freedom ``first`` and after."""
    add1(scratch, own + triangle(first, first), dot(columns[0], others[0]), lanes)
    add1(scratch, own + triangle(first + 1, first), dot(columns[1], others[0]), lanes)
    add1(scratch, own + triangle(first + 1, first + 1), dot(columns[1], others[1]), lanes)
    add3(scratch, own + triangle(first + 2, first), product_row(columns[2], others), lanes)


@inline_jit
def add_mixed(scratch, own, sign, columns, others, lanes):
    """Add ``sign M^T N`` to the part of a diagonal block that couples rotation to position."""
    add3(scratch, own + triangle(3, 0), scale(sign, product_row(columns[0], others)), lanes)
    add3(scratch, own + triangle(4, 0), scale(sign, product_row(columns[1], others)), lanes)
    add3(scratch, own + triangle(5, 0), scale(sign, product_row(columns[2], others)), lanes)


@inline_jit
def couple(scratch, own, i, j, sign, columns, others, lanes):
    """Write ``sign M^T N`` into a node's coupling to the one before, from row i and column j on."""
    row = own + COUPLING + 6 * i + j
    store3(scratch, row, scale(sign, product_row(columns[0], others)), lanes)
    store3(scratch, row + 6, scale(sign, product_row(columns[1], others)), lanes)
    store3(scratch, row + 12, scale(sign, product_row(columns[2], others)), lanes)


@inline_jit
def add_magnet(block, scratch, layout, magnet, terms, gradient):
    """Loads of a magnet at the middle, and the rotational stiffness of its dipole: (m.B) I - (m B^T + B m^T)/2."""
    lanes = terms.lanes
    own = NODE * layout.magnet_nodes[magnet]
    pose = load_pose(scratch, own + MIDDLE, lanes, None)
    torque, force = magnet_loads(block, layout, magnet, pose, lanes, None, gradient)
    add3(scratch, own + RIGHT + 3, torque, lanes)
    if gradient is not None:
        add3(scratch, own + RIGHT, force, lanes)
    b = rotate_back(matrix(pose[1], 2.0), local_field(block, pose[0], lanes, None, gradient))
    m = load3(block, layout.magnets + 3 * magnet, lanes)
    aligned = dot(m, b)
    for i in range(3):
        add1(scratch, own + triangle(3 + i, 3 + i), aligned - m[i] * b[i], lanes)
        for j in range(i):
            add1(scratch, own + triangle(3 + i, 3 + j), -0.5 * (m[i] * b[j] + m[j] * b[i]), lanes)


@inline_jit
def add_element(block, scratch, layout, element, poses, terms):
    """Loads and material stiffness of an element; ``poses`` of a and b at the middle, then at the end of the step."""
    lanes = terms.lanes
    row = layout.elements + ELEMENT_ROWS * element
    a, b = NODE * element, NODE * (element + 1)
    length, inverse_length = load(block, row + LENGTH, lanes), load(block, row + INVERSE_LENGTH, lanes)
    stiffness = section_stiffness(block, row, lanes, None)
    axial, shear, bending, torsion, tilting, sway = stiffness
    gamma, phi, geometry = helical_strain(poses[0], poses[1], inverse_length)
    old_gamma, old_phi = load3(scratch, b + STRAIN, lanes), load3(scratch, b + STRAIN + 3, lanes)
    new_gamma, new_phi, unused = helical_strain(poses[2], poses[3], inverse_length)
    mean, bend = scale(0.5, add(old_gamma, new_gamma)), scale(0.5, add(old_phi, new_phi))
    stress, moment = helical_stress(mean, bend, length, inverse_length, stiffness)
    inverse_short = 1.0 / square_root(dot(mean, mean))
    stretch = 0.5 * (square_root(dot(old_gamma, old_gamma)) + square_root(dot(new_gamma, new_gamma)))
    missing = axial * (inverse_short - 1.0 / stretch)  # a mean of strains is shorter than a strain
    stress = add_scaled(stress, missing, mean)
    zero = constant(0.0, length)
    direction, tension = scale(inverse_short, mean), load(scratch, b + PULL, lanes)
    straight = shear * tilting / (shear + tilting)
    force, torque_a, torque_b = helical_loads(gamma, phi, geometry, stress, moment, length)
    add3(scratch, b + RIGHT, scale(-1.0, force), lanes)
    add3(scratch, b + RIGHT + 3, torque_b, lanes)
    position, turn_a, turn_b, bend_a, bend_b = strain_jacobian(gamma, phi, geometry, inverse_length)
    along, across = axial * length, straight * length
    straightened = bending + length / 12.0 * tension  # a helix is longer than its chord by phi^2/24
    held = stretched(position, direction, along, zero, across)
    tied = stretched(position, direction, along, tension * length, across)
    add_symmetric(scratch, b, 0, position, tied, lanes)
    add_mixed(scratch, b, 1.0, turn_b, held, lanes)
    add_symmetric(scratch, b, 3, turn_b, stretched(turn_b, direction, along, zero, across), lanes)
    add_symmetric(scratch, b, 3, bend_b, weighted(bend_b, torsion, straightened), lanes)
    if element > 0:
        add3(scratch, a + RIGHT, force, lanes)
        add3(scratch, a + RIGHT + 3, torque_a, lanes)
        twisted = stretched(turn_a, direction, along, zero, across)
        curved = weighted(bend_a, torsion, straightened)
        add_symmetric(scratch, a, 0, position, tied, lanes)
        add_mixed(scratch, a, -1.0, turn_a, held, lanes)
        add_symmetric(scratch, a, 3, turn_a, twisted, lanes)
        add_symmetric(scratch, a, 3, bend_a, curved, lanes)
        couple(scratch, b, 0, 0, -1.0, position, tied, lanes)
        couple(scratch, b, 0, 3, 1.0, position, twisted, lanes)
        couple(scratch, b, 3, 0, -1.0, turn_b, held, lanes)
        couple(scratch, b, 3, 3, 1.0, turn_b, twisted, lanes)
        corner = b + COUPLING + 21
        add3(scratch, corner, product_row(bend_b[0], curved), lanes)
        add3(scratch, corner + 6, product_row(bend_b[1], curved), lanes)
        add3(scratch, corner + 12, product_row(bend_b[2], curved), lanes)


@jit
def iterate(block, scratch, layout, terms, gradient, h):
    """One Newton iteration; the square of its largest increment goes to the first row of the scratch."""
    lanes, last = terms.lanes, layout.num_elements
    for node in range(1, last + 1):
        begin_node(block, scratch, layout, node, terms, h)
    if terms.magnets is not None:
        for magnet in range(len(layout.magnet_nodes)):
            add_magnet(block, scratch, layout, magnet, terms, gradient)
    clamp = load_pose(block, layout.nodes, lanes, None)
    middle, end = clamp, clamp
    for element in range(last):
        own = NODE * (element + 1)
        next_middle, next_end = (
            load_pose(scratch, own + MIDDLE, lanes, None),
            load_pose(scratch, own + END, lanes, None),
        )
        poses = (middle, next_middle, end, next_end)
        add_element(block, scratch, layout, element, poses, terms)
        middle, end = next_middle, next_end
        if element > 0:
            factor_node(scratch, NODE * element, lanes, SPATIAL_FREEDOMS)
            eliminate_node(scratch, NODE * element, own, lanes, SPATIAL_FREEDOMS)
    inverse_length = load(block, layout.elements + INVERSE_LENGTH, lanes)
    factor_node(scratch, NODE * last, lanes, SPATIAL_FREEDOMS)
    substitute_node(scratch, NODE * last, None, lanes, SPATIAL_FREEDOMS)
    largest = move_half_step(scratch, NODE * last, inverse_length, lanes)
    for node in range(last - 1, 0, -1):
        substitute_node(scratch, NODE * node, NODE * (node + 1), lanes, SPATIAL_FREEDOMS)
        largest = maximum(largest, move_half_step(scratch, NODE * node, inverse_length, lanes))
    store(scratch, 0, largest, lanes)


@jit
def largest_increment(block, scratch, layout, lanes, status, rod):
    """Square of the last iteration's largest increment among the lanes whose rods are well, ``rod`` the first of them;
    infinity where it is not finite.
    """
    largest = 0.0
    tip = node_row(layout, None, layout.num_elements) * lanes
    for lane in range(min(lanes, len(status) - rod)):
        if status[rod + lane] == OK and np.isfinite(block[tip + lane]):
            largest = max(largest, scratch[lane]) if np.isfinite(scratch[lane]) else np.inf
    return largest


@jit
def solve_step(block, scratch, layout, terms, h, ahead, status, rod):
    """Half steps of a step of length h (of either sign); returns whether they are solved in every rod that is well.

    Stops where the linear rate of the last two increments promises an error below the tolerance.
    """
    predict(block, scratch, layout, terms, h, ahead)
    before = 0.0
    for _ in range(MOST_ITERATIONS):
        iterate(block, scratch, layout, terms, terms.gradient, h)
        largest = largest_increment(block, scratch, layout, len(terms.lanes), status, rod)
        if largest == 0.0 or (largest / before if before > 0.0 else 1.0) * largest <= TOLERANCE * TOLERANCE:
            return True
        if not np.isfinite(largest):
            return False
        before = largest
    return False


@jit
def run_implicit(blocks, first, last, layout, terms, num_steps, time_step, shares, fields, status):
    """Step lane blocks ``first`` to ``last`` (exclusive) of ``blocks`` (num_blocks, rows * L) ``num_steps`` times.

    A step of ``time_step`` s is made of midpoint steps of ``shares`` of it; one that is not solved is cut in halves.
    Internal damping acts between steps, and for half a step before the first and after the last.
    ``fields`` (num_blocks, num_steps, 3 * L) T is the field during each step; None leaves it as it is. ``status``
    (num_rods,) of rods that stay unsolved becomes UNSOLVED.
    """
    lanes = len(terms.lanes)
    scratch = np.zeros((layout.num_elements + 1) * NODE * lanes)
    damped = damping_scratch(blocks, layout, None, terms.internal_damping, terms.lanes)
    for b in range(first, last):
        scratch[:] = 0.0
        before = 0.0
        for step in range(num_steps):
            damp_if_present(blocks[b], damped, layout, terms, None, time_step if step > 0 else 0.5 * time_step)
            if fields is not None:
                store3(blocks[b], FIELD, load3(fields[b][step], 0, terms.lanes), terms.lanes)
            for share in shares:
                parts, done = 1, 0
                while done < parts:
                    h = share * time_step / parts
                    ahead = 0.5 * (before + h) if before != 0.0 else 0.0
                    solved = solve_step(blocks[b], scratch, layout, terms, h, ahead, status, b * lanes)
                    if not solved and parts < MOST_PARTS:
                        parts, done = 2 * parts, 2 * done
                        continue
                    if not solved:
                        for rod in range(b * lanes, min((b + 1) * lanes, len(status))):
                            if status[rod] == OK and not scratch[rod - b * lanes] <= TOLERANCE * TOLERANCE:
                                status[rod] = UNSOLVED
                    finish(blocks[b], scratch, layout, terms, h, ahead if abs(ahead) > LEAST_SPAN * abs(h) else 0.0)
                    done, before = done + 1, h
        damp_if_present(blocks[b], damped, layout, terms, None, 0.5 * time_step)
