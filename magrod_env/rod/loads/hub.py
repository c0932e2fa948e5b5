"""Where the kernels meet the loads that a scene lists: a line or two for each, compiled only where it is present.

``terms.loads`` is ``()`` in a scene without such loads; then nothing of this module is in a kernel, nor are its
arguments. Functions therefore take ``terms.loads`` once more by itself: numba drops a branch on the length of an
argument before it types what the branch holds. Gravity, linear drags and magnets, which most scenes have, are terms of
their own (``gravity.py``, ``linear_drag.py``, ``node_damping.py``, ``magnets.py``).
"""

from typing import NamedTuple

import numpy as np

from magrod_env._jit import PRESENT, Present, inline_jit
from magrod_env._simd import load, store
from magrod_env.rod.access import load2, load_pose, node_row
from magrod_env.rod.layout import PLANAR, SPATIAL
from magrod_env.rod.loads.distributed_force import (
    DistributedForce,
    add_following_line_force,
    add_line_force,
    line_sizes,
)
from magrod_env.rod.loads.fluid_drag import FluidDrag, add_fluid_slope, fluid_force, resisted
from magrod_env.rod.loads.point_load import (
    POINT_ROWS,
    PointLoad,
    add_following_point_forces,
    add_point_forces,
    point_sizes,
)
from magrod_env.rod.loads.tip_wrench import TipWrench, add_tip_circulation, tip_force, tip_sizes
from magrod_env.rod.vectors import add_vectors, inner, no_load, scaled_vector

KINDS = (TipWrench, DistributedForce, PointLoad, FluidDrag)
SINGLE = (TipWrench, DistributedForce, FluidDrag)  # at most one of each in a scene
POWER, WORK, SHARE, OWN_ROWS = 0, 1, 2, 3  # W summed over steps; J since the last look; of the loads, in statics


class LoadTerms(NamedTuple):
    """Which loads a scene lists: ``PRESENT`` or ``None``."""

    tip_wrench: Present | None = None
    distributed_force: Present | None = None
    point_loads: Present | None = None
    fluid_drag: Present | None = None
    following: Present | None = None  # a load follows a section
    circulatory: Present | None = None  # a load depends on the shape and has no potential


class LoadRows(NamedTuple):
    """First rows of the loads in a block; they come last."""

    tip_wrench: int
    distributed_force: int
    point_loads: int
    fluid_drag: int
    carried: int  # m, one a node: length of rod that it carries
    own: int  # POWER, WORK, SHARE
    point_nodes: tuple  # node of each point load


# ---- set-up


def load_terms(loads):
    """Terms of the loads that a scene lists."""
    if not loads:
        return ()
    present = {load.TERM: PRESENT for load in loads}
    following = PRESENT if any(load.follows for load in loads) else None
    circulatory = None if all(load.conservative for load in loads) else PRESENT
    return LoadTerms(**present, following=following, circulatory=circulatory)


def place_loads(layout, terms, loads, ends, counts):
    """The layout with rows for the loads after its own; a node sits at each point load, at the end of a segment."""
    if not loads:
        return layout
    places, last = [float(end) for end in ends], np.cumsum(counts)
    nodes = tuple(int(last[places.index(load.position)]) for load in loads if isinstance(load, PointLoad))
    firsts, row = [], layout.size
    for kind in KINDS:
        firsts.append(row)
        row += sum(load.ROWS for load in loads if isinstance(load, kind))
    carried, own = row, row + layout.num_elements + 1
    rows = LoadRows(*firsts, carried, own, nodes or (0,))
    return layout._replace(loads=rows, size=own + OWN_ROWS)


def first_rows(layout, loads):
    """First row of each load, in their order."""
    first, rows = {kind: getattr(layout.loads, kind.TERM) for kind in KINDS}, []
    for each in loads:
        rows.append(first[type(each)])
        first[type(each)] += each.ROWS
    return rows


@inline_jit
def write_carried(rows, lane, layout, loads, carried):
    """Write the length of rod that each node carries, m, into one lane of a block's rows."""
    if len(loads) > 0:
        for node in range(len(carried)):
            rows[layout.loads.carried + node, lane] = carried[node]


# ---- forces


@inline_jit
def add_dead_forces(block, layout, terms, node, force, planar):
    """Force on a node with those that are fixed in the world added."""
    rows, lanes = layout.loads, terms.lanes
    if terms.loads.tip_wrench is not None and node == layout.num_elements:
        force = add_vectors(force, tip_force(block, rows.tip_wrench, lanes, planar), planar)
    if terms.loads.distributed_force is not None:
        carried = load(block, rows.carried + node, lanes)
        force = add_line_force(block, rows.distributed_force, carried, force, lanes, planar)
    if terms.loads.point_loads is not None:
        force = add_point_forces(block, rows.point_loads, rows.point_nodes, node, force, lanes, planar)
    return force


@inline_jit
def add_circulatory_loads(block, layout, terms, following, node, rotation, force, torque, planar):
    """Force (world) and torque (body) on a node with those added that turn with sections or turn sections."""
    rows, lanes = layout.loads, terms.lanes
    if terms.loads.tip_wrench is not None and node == layout.num_elements:
        force, torque = add_tip_circulation(block, rows.tip_wrench, following, rotation, force, torque, lanes, planar)
    if following is not None:
        if terms.loads.distributed_force is not None:
            carried = load(block, rows.carried + node, lanes)
            force = add_following_line_force(block, rows.distributed_force, carried, rotation, force, lanes, planar)
        if terms.loads.point_loads is not None:
            force = add_following_point_forces(
                block, rows.point_loads, rows.point_nodes, node, rotation, force, lanes, planar
            )
    return force, torque


@inline_jit
def add_loads(block, layout, terms, loads, node, pose, force, torque, planar):
    """Force (world) and torque (body) on a node with those of the loads that do not depend on its motion added."""
    if len(loads) > 0:
        force = add_dead_forces(block, layout, terms, node, force, planar)
        if terms.loads.circulatory is not None:
            force, torque = add_circulatory_loads(
                block, layout, terms, terms.loads.following, node, pose[1], force, torque, planar
            )
    return force, torque


@inline_jit
def inverse_mass_of(block, layout, node, lanes, planar):
    """1/m of a node, 1/kg."""
    if planar is None:
        return load(block, node_row(layout, planar, node) + SPATIAL.inverse_mass, lanes)
    return load(block, node_row(layout, planar, node) + PLANAR.inverse_mass, lanes)


@inline_jit
def add_resistance(block, layout, terms, loads, node, pose, before, after, gain, planar):
    """Motion of a node after a kick with what resists it added; ``gain`` is what a unit acceleration adds in it."""
    if len(loads) > 0:
        rows, lanes = layout.loads, terms.lanes
        velocity = after[0]
        if terms.loads.fluid_drag is not None:
            share = 0.5 * gain * inverse_mass_of(block, layout, node, lanes, planar)
            carried = load(block, rows.carried + node, lanes)
            velocity = resisted(block, rows.fluid_drag, carried, share, pose[1], before[0], velocity, lanes, planar)
        return velocity, after[1]
    return after


@inline_jit
def static_loads(block, layout, terms, node, pose):
    """Force (world) and torque (body) of the loads on a node at rest, times the share of them that statics lets act."""
    lanes, rows = terms.lanes, layout.loads
    force, torque = no_load(block, lanes, None)
    force, torque = add_loads(block, layout, terms, terms.loads, node, pose, force, torque, None)
    if terms.loads.fluid_drag is not None:
        carried, still = load(block, rows.carried + node, lanes), no_load(block, lanes, None)[0]
        drag = fluid_force(block, rows.fluid_drag, carried, pose[1], still, lanes, None)
        force = add_vectors(force, drag, None)
    share = load(block, rows.own + SHARE, lanes)
    return scaled_vector(share, force, None), scaled_vector(share, torque, None)


@inline_jit
def set_share(rows, layout, loads, lane, share):
    """Let a share of one rod's loads act in statics."""
    if len(loads) > 0:
        rows[layout.loads.own + SHARE, lane] = share


@inline_jit
def any_circulatory(terms, loads):
    """Whether a load has no potential, so that the tangent of statics is not symmetric."""
    if len(loads) > 0:
        return terms.loads.circulatory is not None
    return False


# ---- energy and work


@inline_jit
def power_on(block, layout, terms, node, pose, velocity, spin, planar):
    """Power, W, of the loads without a potential on a node with a velocity (world) and an angular velocity (body)."""
    lanes, rows = terms.lanes, layout.loads
    force, torque = no_load(block, lanes, planar)
    force, torque = add_circulatory_loads(
        block, layout, terms, terms.loads.following, node, pose[1], force, torque, planar
    )
    if terms.loads.fluid_drag is not None:
        carried = load(block, rows.carried + node, lanes)
        drag = fluid_force(block, rows.fluid_drag, carried, pose[1], velocity, lanes, planar)
        force = add_vectors(force, drag, planar)
    if planar is None:
        return inner(force, velocity, planar) + inner(torque, spin, planar)
    return inner(force, velocity, planar) + torque * spin


@inline_jit
def mean_spin(block, row, before, after, lanes, planar):
    """Mean angular velocity (body) of a node before and after a kick."""
    if planar is None:
        axial, transverse = load2(block, row + SPATIAL.compliance, lanes)
        return (
            axial * (before[0] + after[0]),
            transverse * (before[1] + after[1]),
            transverse * (before[2] + after[2]),
        )
    return load(block, row + PLANAR.compliance, lanes) * (before + after)


@inline_jit
def count_power(block, layout, terms, loads, node, pose, before, after, planar):
    """Add the power of the loads without a potential in a kick to the rod's sum."""
    if len(loads) > 0:
        if terms.loads.circulatory is not None:
            lanes, row = terms.lanes, layout.loads.own + POWER
            velocity = scaled_vector(0.5, add_vectors(before[0], after[0], planar), planar)
            spin = mean_spin(block, node_row(layout, planar, node), before[1], after[1], lanes, planar)
            power = power_on(block, layout, terms, node, pose, velocity, spin, planar)
            store(block, row, load(block, row, lanes) + power, lanes)


@inline_jit
def settle_work(block, layout, terms, loads, time_step):
    """Turn the power summed over steps of a length into work."""
    if len(loads) > 0:
        lanes, row = terms.lanes, layout.loads.own
        power = load(block, row + POWER, lanes)
        store(block, row + WORK, load(block, row + WORK, lanes) + time_step * power, lanes)
        store(block, row + POWER, 0.0 * power, lanes)


@inline_jit
def take_work(rows, layout, loads, lane):
    """Work, J, that the loads without a potential have put into one rod since the last look, at least 0."""
    work = 0.0
    if len(loads) > 0:
        row = layout.loads.own + WORK
        work = max(rows[row, lane], 0.0)
        rows[row, lane] = 0.0
    return work


@inline_jit
def store_potential(block, layout, terms, loads, planar, out, row):
    """Write the potential energy of the dead forces, J, to a row of ``out``."""
    if len(loads) > 0:
        lanes = terms.lanes
        total = 0.0 * load(block, 0, lanes)
        for node in range(1, layout.num_elements + 1):
            position = load_pose(block, node_row(layout, planar, node), lanes, planar)[0]
            force = add_dead_forces(block, layout, terms, node, no_load(block, lanes, planar)[0], planar)
            total = total - inner(force, position, planar)
        store(out, row, total, lanes)


# ---- implicit steps


@inline_jit
def half_step_loads(block, scratch, layout, terms, loads, node, own, middle, velocity, rate, force, torque):
    """Force (world) and torque (body) on a node in the middle of an implicit step, with those of the loads added.

    The derivative by the displacement, ``rate`` times that by the velocity, goes to the node's diagonal block at row
    ``own`` of the scratch.
    """
    if len(loads) > 0:
        rows, lanes = layout.loads, terms.lanes
        force, torque = add_loads(block, layout, terms, loads, node, middle, force, torque, None)
        if terms.loads.fluid_drag is not None:
            carried = load(block, rows.carried + node, lanes)
            drag = fluid_force(block, rows.fluid_drag, carried, middle[1], velocity, lanes, None)
            force = add_vectors(force, drag, None)
            add_fluid_slope(block, scratch, rows.fluid_drag, own, carried, middle[1], velocity, rate, lanes)
    return force, torque


@inline_jit
def count_half_step_work(block, layout, terms, loads, node, middle, velocity, spin, time_step):
    """Add the work of the loads without a potential in an implicit step to the rod's."""
    if len(loads) > 0:
        if terms.loads.circulatory is not None:
            lanes, row = terms.lanes, layout.loads.own + WORK
            power = power_on(block, layout, terms, node, middle, velocity, spin, None)
            store(block, row, load(block, row, lanes) + time_step * power, lanes)


# ---- bound on the step


def nodal_sizes(column, layout, terms):
    """Dead force (N), following force (N) and moment (N m) on every node of one rod's rows, (num_nodes, 3)."""
    sizes = np.zeros((layout.num_elements + 1, 3))
    if not terms.loads:
        return sizes
    rows = layout.loads
    carried = column[rows.carried : rows.carried + layout.num_elements + 1]
    if terms.loads.tip_wrench is not None:
        sizes[-1] += tip_sizes(column[rows.tip_wrench :][: TipWrench.ROWS])
    if terms.loads.distributed_force is not None:
        sizes[:, :2] += carried[:, None] * line_sizes(column[rows.distributed_force :][: DistributedForce.ROWS])
    if terms.loads.point_loads is not None:
        for number, node in enumerate(rows.point_nodes):
            sizes[node, :2] += point_sizes(column[rows.point_loads + POINT_ROWS * number :][:POINT_ROWS])
    return sizes
