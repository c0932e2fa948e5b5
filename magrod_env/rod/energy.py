"""Energies and momenta of lane blocks, and the watchdog that looks for finite but wrong states."""

import numpy as np

from magrod_env._jit import inline_jit, jit
from magrod_env._simd import constant, load, maximum, square_root, store
from magrod_env.rod.access import load2, load_motion, load_pose, node_row
from magrod_env.rod.elements import section_stiffness
from magrod_env.rod.helical import helical_energy, helical_strain
from magrod_env.rod.layout import (
    AXIAL,
    BENDING,
    ELEMENT_ROWS,
    ENERGY,
    INVERSE_LENGTH,
    LEAST_COSINE,
    LENGTH,
    PLANAR,
    SHEAR,
    SPATIAL,
    TORSION,
)
from magrod_env.rod.loads.gravity import gravity_energy
from magrod_env.rod.loads.hub import store_potential, take_work
from magrod_env.rod.loads.magnets import magnet_energy
from magrod_env.rod.nodal import nodal_strain
from magrod_env.rod.planar import planar_helical_energy, planar_helical_strain, planar_nodal_strain
from magrod_env.rod.so3 import dot

KINETIC, ELASTIC, GRAVITATIONAL, MAGNETIC, STRAIN, LOADED = range(6)  # rows of what ``measure_blocks`` returns
MEASURES = 6
OK, NOT_FINITE, BENT, STRETCHED, ENERGETIC = range(5)  # status of a rod
LARGEST_STRAIN = 0.5
SHEAR_SHARE = LARGEST_STRAIN / 0.8  # sudden loads shear coarse elements by more than half


@inline_jit
def stretch_energy(gamma, axial, shear, planar):
    """``(gamma - E)^T C1 (gamma - E)``."""
    across = gamma[1] * gamma[1]
    if planar is None:
        across = across + gamma[2] * gamma[2]
    return axial * (gamma[0] - 1.0) * (gamma[0] - 1.0) + shear * across


@inline_jit
def element_energy(block, layout, element, pose_a, pose_b, lanes, planar, nodal):
    """Elastic energy (J) of one element and the square of its strain.

    That is the stretch of its chord or, of the helical element, SHEAR_SHARE of the shear if that is larger; the nodal
    element's shear holds half of its bend.
    """
    row = layout.elements + ELEMENT_ROWS * element
    length, inverse_length = load(block, row + LENGTH, lanes), load(block, row + INVERSE_LENGTH, lanes)
    if nodal is None:
        stiffness = section_stiffness(block, row, lanes, planar)
        if planar is None:
            gamma, phi, geometry = helical_strain(pose_a, pose_b, inverse_length)
            energy = helical_energy(gamma, phi, length, inverse_length, stiffness)
            across = gamma[1] * gamma[1] + gamma[2] * gamma[2]
        else:
            gamma, phi, geometry = planar_helical_strain(pose_a, pose_b, inverse_length)
            energy = planar_helical_energy(gamma, phi, length, stiffness)
            across = gamma[1] * gamma[1]
        along = square_root(gamma[0] * gamma[0] + across) - 1.0
        return energy, maximum(along * along, SHEAR_SHARE * SHEAR_SHARE * across)
    axial, shear = load(block, row + AXIAL, lanes), load(block, row + SHEAR, lanes)
    bending = load(block, row + BENDING, lanes)
    if planar is None:
        gamma_a, gamma_b, g, frames = nodal_strain(pose_a, pose_b, inverse_length)
        torsion = load(block, row + TORSION, lanes)
        bend = 4.0 * (torsion * g[0] * g[0] + bending * (g[1] * g[1] + g[2] * g[2]))
    else:
        gamma_a, gamma_b, g, frames = planar_nodal_strain(pose_a, pose_b, inverse_length)
        bend = 4.0 * bending * g * g
    stretch = stretch_energy(gamma_a, axial, shear, planar) + stretch_energy(gamma_b, axial, shear, planar)
    square = gamma_a[0] * gamma_a[0] + gamma_a[1] * gamma_a[1]
    if planar is None:
        square = square + gamma_a[2] * gamma_a[2]
    along = square_root(square) - 1.0
    return 0.5 * (0.5 * length * stretch + bend), along * along


@inline_jit
def node_energy(block, layout, node, pose, lanes, planar):
    """Kinetic energy and potential energy in gravity of a node, J."""
    row = node_row(layout, planar, node)
    velocity, momentum = load_motion(block, row, lanes, planar)
    if planar is None:
        mass = 1.0 / load(block, row + SPATIAL.inverse_mass, lanes)
        axial, transverse = load2(block, row + SPATIAL.compliance, lanes)
        spin = axial * momentum[0] * momentum[0] + transverse * (momentum[1] * momentum[1] + momentum[2] * momentum[2])
        return 0.5 * mass * dot(velocity, velocity) + spin, gravity_energy(block, mass, pose[0], lanes, planar)
    mass = 1.0 / load(block, row + PLANAR.inverse_mass, lanes)
    spin = load(block, row + PLANAR.compliance, lanes) * momentum * momentum
    kinetic = 0.5 * mass * (velocity[0] * velocity[0] + velocity[1] * velocity[1]) + spin
    return kinetic, gravity_energy(block, mass, pose[0], lanes, planar)


@jit
def measure_block(block, layout, terms, planar, nodal, gradient, out):
    """Rows KINETIC .. LOADED of one lane block into ``out`` (MEASURES * L,)."""
    lanes = terms.lanes
    zero = constant(0.0, load(block, 0, lanes))
    kinetic, elastic, gravitational, magnetic, worst = zero, zero, zero, zero, zero
    pose = load_pose(block, layout.nodes, lanes, planar)
    for element in range(layout.num_elements):
        next_pose = load_pose(block, node_row(layout, planar, element + 1), lanes, planar)
        energy, strain = element_energy(block, layout, element, pose, next_pose, lanes, planar, nodal)
        elastic, worst = elastic + energy, maximum(worst, strain)
        motion, potential = node_energy(block, layout, element + 1, next_pose, lanes, planar)
        kinetic, gravitational = kinetic + motion, gravitational + potential
        pose = next_pose
    if terms.magnets is not None:
        for magnet in range(len(layout.magnet_nodes)):
            pose = load_pose(block, node_row(layout, planar, layout.magnet_nodes[magnet]), lanes, planar)
            magnetic = magnetic + magnet_energy(block, layout, magnet, pose, lanes, planar, gradient)
    store(out, KINETIC, kinetic, lanes)
    store(out, ELASTIC, elastic, lanes)
    store(out, GRAVITATIONAL, gravitational, lanes)
    store(out, MAGNETIC, magnetic, lanes)
    store(out, STRAIN, worst, lanes)
    store_potential(block, layout, terms, terms.loads, planar, out, LOADED)


@jit
def measure_blocks(blocks, first, last, layout, terms, out):
    """Energies (J) and the largest squared strain of every rod of some blocks: ``out`` (num_blocks,
    MEASURES * L)."""
    for b in range(first, last):
        measure_block(blocks[b], layout, terms, terms.planar, terms.nodal, terms.gradient, out[b])


@jit
def watch_blocks(blocks, first, last, layout, terms, measures, travel, status):
    """Look at every rod of some blocks: status codes into ``status`` (num_rods,), 0 where all is well.

    NOT_FINITE: a NaN or an infinity. BENT: one element has turned by pi or more. STRETCHED: an element's stretch or
    squeeze passed one half, or its shear 0.8. ENERGETIC: the energy rose by more than was put in, plus a tenth of
    itself: the mark of a finite but unstable run. Fields put in at most |m| times the sum of their changes ``travel``
    (num_rods,) T, loads without a potential the work that they did. It is counted from the least energy so far, so that
    many small rises add up. Once set, a status stays. ``measures`` (num_blocks, MEASURES * L) is filled by
    ``measure_blocks``.
    """
    lanes = len(terms.lanes)
    measure_blocks(blocks, first, last, layout, terms, measures)
    for b in range(first, last):
        rows, seen = blocks[b].reshape(-1, lanes), measures[b].reshape(-1, lanes)
        for lane in range(lanes):
            rod = b * lanes + lane
            if rod >= len(status):
                break
            kinetic, elastic = seen[KINETIC, lane], seen[ELASTIC, lane]
            energy = kinetic + elastic + seen[GRAVITATIONAL, lane] + seen[MAGNETIC, lane]
            energy += seen[LOADED, lane]
            work = take_work(rows, layout, layout.loads, lane)
            if status[rod] == OK:
                moment = 0.0
                for magnet in range(len(layout.magnet_nodes)):
                    row = layout.magnets + 3 * magnet
                    moment += np.sqrt(rows[row, lane] ** 2 + rows[row + 1, lane] ** 2 + rows[row + 2, lane] ** 2)
                floor = 0.01 * rows[layout.elements + BENDING, lane]
                least = rows[ENERGY, lane] + moment * travel[rod] + work
                allowance = 0.1 * (kinetic + elastic) + floor
                cosine = rows[LEAST_COSINE, lane]
                status[rod] = rod_status(kinetic + elastic, energy, seen[STRAIN, lane], cosine, least, allowance)
                rows[ENERGY, lane] = min(least, energy)
            travel[rod] = 0.0


@jit
def rod_status(inner, energy, strain, cosine, before, allowance):
    """Status of one rod (see ``watch_blocks``)."""
    if not np.isfinite(inner + energy + strain):
        return NOT_FINITE
    if cosine <= 0.0:
        return BENT
    if strain > LARGEST_STRAIN * LARGEST_STRAIN:
        return STRETCHED
    if energy > before + allowance:
        return ENERGETIC
    return OK
