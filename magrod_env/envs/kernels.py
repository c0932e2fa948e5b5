"""Compiled per-environment work between physics steps: commands, camera, observation, reward, resets."""

from typing import NamedTuple

import numpy as np

from magrod_env._jit import jit
from magrod_env.envs.streams import normal, uniform
from magrod_env.rod.layout import DRAG, ENERGY, FIELD, GRAVITY, LEAST_COSINE, PLANAR, REFERENCE, SPATIAL, TARGET
from magrod_env.rod.mesh import RodValues, write_rod
from magrod_env.rod.statics import find_equilibrium

TRACKING, PRECISION, EFFORT, SMOOTHNESS = range(4)  # reward terms


class Episodes(NamedTuple):
    """Per-environment arrays that change during an episode; first axis num_envs."""

    streams: np.ndarray  # () uint64, random numbers
    steps: np.ndarray  # () int64, control steps since the reset
    place: np.ndarray  # (2,) where on the path the episode began, or where in the grid its target lies
    frames: np.ndarray  # (depth, num_tracked, 3) m, the camera's last frames, newest at steps % depth
    seen: np.ndarray  # (2, num_tracked, 3) m, the frame an observation shows and the one before
    action: np.ndarray  # (num_axes,) last action
    mixing: np.ndarray  # (3, 3) from the commanded to the acting field: gain and misalignment
    unmixing: np.ndarray  # (3, 3) its inverse: what the coils' own sensors say of the acting field


class Optics(NamedTuple):
    """The camera in control steps."""

    noise: float  # m
    every: int  # control steps a frame
    delay: int  # control steps
    frame_time: float  # s between frames


class Scales(NamedTuple):
    """What makes observations and rewards of order one."""

    length: float  # m, of the rod
    limits: np.ndarray  # (num_axes,) T
    coils: np.ndarray  # (num_axes,) world axis of each coil pair
    tracking: float  # m, error that costs one
    precision: float  # m, width of the precision bonus
    effort: float
    smoothness: float


@jit
def write_commands(rows, commands, mixing, axes, num_envs, lagging):
    """Put the commanded fields (num_envs, 3) T, as misaligned coils make them, into the blocks (num_blocks, rows, L)."""
    width = rows.shape[2]
    for i in range(num_envs):
        block, lane = i // width, i % width
        for k in range(len(axes)):
            field = 0.0
            for j in range(3):
                field += mixing[i, axes[k], j] * commands[i, j]
            rows[block, TARGET + k, lane] = field
            if not lagging:
                rows[block, FIELD + k, lane] = field


@jit
def add_travel(rows, travel, axes, before):
    """Count the change of every rod's field since ``before`` (num_envs, 3) for the watchdog, and note the field there."""
    width = rows.shape[2]
    for i in range(len(travel)):
        for k in range(len(axes)):
            field = rows[i // width, FIELD + k, i % width]
            travel[i] += abs(field - before[i, k])
            before[i, k] = field


@jit
def target_at(targets, place, time, tracked, out):
    """Target (num_tracked, 3) m at ``time`` s of an episode, by linear interpolation in the task's table."""
    table = targets.table
    if targets.rate > 0.0:
        at = (place[0] + targets.rate * time) % table.shape[0]
        first = int(at) % table.shape[0]
        second, share = (first + 1) % table.shape[0], at - int(at)
        for p in range(tracked):
            for k in range(3):
                out[p, k] = (1.0 - share) * table[first, 0, p, k] + share * table[second, 0, p, k]
        return
    a, b = int(place[0]), int(place[1])
    u, v = place[0] - a, place[1] - b
    for p in range(tracked):
        for k in range(3):
            low = (1.0 - v) * table[a, b, p, k] + v * table[a, b + 1, p, k]
            high = (1.0 - v) * table[a + 1, b, p, k] + v * table[a + 1, b + 1, p, k]
            out[p, k] = (1.0 - u) * low + u * high


@jit
def node_position(rows, layout, planar, axes, node, i, out):
    """World position of a node of rod ``i``, m, into ``out`` (3,)."""
    width = rows.shape[2]
    row = layout.nodes + (SPATIAL.size if planar is None else PLANAR.size) * node
    out[:] = 0.0
    for k in range(len(axes)):
        out[axes[k]] = rows[i // width, row + k, i % width]


@jit
def take_frame(positions, episodes, optics, i, first):
    """The camera sees ``positions`` (num_tracked, 3): into the ring of frames; ``seen`` gets the one that has arrived."""
    depth, step = episodes.frames.shape[1], episodes.steps[i]
    if first or step % optics.every == 0:
        frame = episodes.frames[i, step % depth]
        for p in range(positions.shape[0]):
            for k in range(3):
                frame[p, k] = positions[p, k]
                if optics.noise > 0.0:
                    frame[p, k] += optics.noise * normal(episodes.streams, i)
    else:
        episodes.frames[i, step % depth] = episodes.frames[i, (step - 1) % depth]
    if first:
        for d in range(depth):
            episodes.frames[i, d] = episodes.frames[i, step % depth]
        episodes.seen[i, 0] = episodes.frames[i, step % depth]
        episodes.seen[i, 1] = episodes.frames[i, step % depth]
    elif (step - optics.delay) % optics.every == 0:
        episodes.seen[i, 1] = episodes.seen[i, 0]
        episodes.seen[i, 0] = episodes.frames[i, (step - optics.delay) % depth]


@jit
def bounded(value):
    """An entry of an observation: a diverged rod must not put a NaN or an infinity into a policy."""
    if not np.isfinite(value):
        return 0.0
    return min(max(value, -10.0), 10.0)


@jit
def write_observation(rows, layout, planar, axes, episodes, targets, scales, optics, preview, time, full, i, obs, goal, field):
    """One observation (see the environments' tables) into ``obs`` (size,).

    ``goal`` (num_tracked, 3) m is the target now, ``field`` (3,) T the field that acts.
    """
    tracked, k = episodes.seen.shape[2], 0
    length = scales.length
    for p in range(tracked):
        for axis in range(3):
            obs[k] = bounded(episodes.seen[i, 0, p, axis] / length)
            speed = (episodes.seen[i, 0, p, axis] - episodes.seen[i, 1, p, axis]) / optics.frame_time
            obs[k + 3 * tracked] = bounded(speed / length)
            k += 1
    k += 3 * tracked
    for a in range(len(scales.limits)):
        obs[k] = bounded(coil_fraction(field, episodes, scales, i, a))
        k += 1
    for p in range(tracked):
        for axis in range(3):
            obs[k] = bounded(10.0 * (goal[p, axis] - episodes.seen[i, 0, p, axis]) / length)
            k += 1
    ahead = np.empty((tracked, 3))
    for q in range(len(preview)):
        target_at(targets, episodes.place[i], time + preview[q], tracked, ahead)
        for p in range(tracked):
            for axis in range(3):
                obs[k] = bounded(10.0 * (ahead[p, axis] - goal[p, axis]) / length)
                k += 1
    if full is not None:
        k = write_state(rows, layout, planar, axes, length, i, obs, k)
    return k


@jit
def coil_fraction(field, episodes, scales, i, a):
    """Field of coil pair ``a`` as a share of its limit, as the coils' own sensors see it."""
    nominal = 0.0
    for k in range(3):
        nominal += episodes.unmixing[i, scales.coils[a], k] * field[k]
    return nominal / scales.limits[a]


@jit
def write_state(rows, layout, planar, axes, length, i, obs, k):
    """The full state of a rod: position / L, rotation, velocity / L, spin of every free node."""
    block, lane = i // rows.shape[2], i % rows.shape[2]
    for node in range(1, layout.num_elements + 1):
        row = layout.nodes + (SPATIAL.size if planar is None else PLANAR.size) * node
        if planar is None:
            for j in range(3):
                obs[k + j] = bounded(rows[block, row + SPATIAL.position + j, lane] / length)
                obs[k + 7 + j] = bounded(rows[block, row + SPATIAL.velocity + j, lane] / length)
                compliance = rows[block, row + SPATIAL.compliance + min(j, 1), lane]
                spin = 2.0 * compliance * rows[block, row + SPATIAL.momentum + j, lane]
                obs[k + 10 + j] = bounded(0.1 * spin)
            for j in range(4):
                obs[k + 3 + j] = bounded(rows[block, row + SPATIAL.rotation + j, lane])
            k += 13
        else:
            for j in range(2):
                obs[k + j] = bounded(rows[block, row + PLANAR.position + j, lane] / length)
                obs[k + 2 + j] = bounded(rows[block, row + PLANAR.rotation + j, lane])
                obs[k + 4 + j] = bounded(rows[block, row + PLANAR.velocity + j, lane] / length)
            spin = 2.0 * rows[block, row + PLANAR.compliance, lane] * rows[block, row + PLANAR.momentum, lane]
            obs[k + 6] = bounded(0.1 * spin)
            k += 7
    return k


@jit
def reward_of(distance, action, before, scales, terms):
    """Reward terms of one step into ``terms`` (4,), and their sum.

    tracking: -distance/scale; precision: a bonus up to 1 near the target; effort: -weight |a|^2; smoothness: -weight |da|^2.
    """
    effort, change = 0.0, 0.0
    for a in range(len(action)):
        effort += action[a] * action[a]
        change += (action[a] - before[a]) * (action[a] - before[a])
    terms[TRACKING] = -min(distance / scales.tracking, 10.0)
    terms[PRECISION] = np.exp(-distance / scales.precision)
    terms[EFFORT] = -scales.effort * effort
    terms[SMOOTHNESS] = -scales.smoothness * change
    return terms[0] + terms[1] + terms[2] + terms[3]


class Outcome(NamedTuple):
    """What one step of every environment gives; first axis num_envs."""

    observations: np.ndarray  # (size,) float32
    rewards: np.ndarray  # () float64
    terms: np.ndarray  # (4,) reward terms
    errors: np.ndarray  # (num_tracked,) m, distance of each tracked point from its target
    goals: np.ndarray  # (num_tracked, 3) m
    positions: np.ndarray  # (num_tracked, 3) m, true positions
    fields: np.ndarray  # (3,) T, the field that acts, world


@jit
def observe_all(
    rows, layout, planar, axes, episodes, targets, scales, optics, preview, nodes, control_time, full, actions, status, out
):
    """After the physics of one control step: camera, observation, reward of every environment.

    ``actions`` (num_envs, num_axes) in [-1, 1]. A rod that has diverged pays the largest tracking cost.
    """
    tracked = len(nodes)
    for i in range(len(out.rewards)):
        episodes.steps[i] += 1
        write_outcome(
            rows, layout, planar, axes, episodes, targets, scales, optics, preview, nodes, control_time, full, i, out, False
        )
        distance = 0.0
        for p in range(tracked):
            distance += out.errors[i, p] / tracked
        if status[i] != 0:
            distance = np.inf
        out.rewards[i] = reward_of(distance, actions[i], episodes.action[i], scales, out.terms[i])
        episodes.action[i] = actions[i]


@jit
def observe_some(
    rows, layout, planar, axes, episodes, targets, scales, optics, preview, nodes, control_time, full, which, out
):
    """First observation of the environments ``which`` after their reset; their last action is what holds the start."""
    for i in which:
        out.rewards[i] = 0.0
        out.terms[i] = 0.0
        write_outcome(
            rows, layout, planar, axes, episodes, targets, scales, optics, preview, nodes, control_time, full, i, out, True
        )
        for a in range(len(scales.limits)):
            episodes.action[i, a] = coil_fraction(out.fields[i], episodes, scales, i, a)


@jit
def write_outcome(
    rows, layout, planar, axes, episodes, targets, scales, optics, preview, nodes, control_time, full, i, out, first
):
    """Everything but the reward of environment ``i``."""
    tracked, width = len(nodes), rows.shape[2]
    time = control_time * episodes.steps[i]
    for p in range(tracked):
        node_position(rows, layout, planar, axes, nodes[p], i, out.positions[i, p])
    target_at(targets, episodes.place[i], time, tracked, out.goals[i])
    for p in range(tracked):
        square = 0.0
        for k in range(3):
            square += (out.positions[i, p, k] - out.goals[i, p, k]) ** 2
        out.errors[i, p] = np.sqrt(square)
    out.fields[i] = 0.0
    for k in range(len(axes)):
        out.fields[i, axes[k]] = rows[i // width, FIELD + k, i % width]
    take_frame(out.positions[i], episodes, optics, i, first)
    write_observation(
        rows, layout, planar, axes, episodes, targets, scales, optics, preview, time, full, i, out.observations[i],
        out.goals[i], out.fields[i],
    )  # fmt: skip


@jit
def begin_episodes(episodes, targets, which, starts, draws, spread):
    """Draw where the episodes of ``which`` begin or reach to, and how their rods differ.

    ``starts`` (num_envs,) gets the start table's entry; ``draws`` (num_envs, 14) factors and offsets from ``spread`` (9,): modulus,
    density, drag, remanence (factors), magnet shift (m), gain (factor), misalignment (3, rotation vector), gravity tilt (2: angle and
    heading), initial field (3, T).
    """
    table = targets.table
    for i in which:
        episodes.steps[i] = 0
        episodes.action[i] = 0.0
        starts[i] = 0
        if targets.rate > 0.0:
            if targets.starts > 1:
                starts[i] = min(int(uniform(episodes.streams, i, 0.0, targets.starts)), targets.starts - 1)
            episodes.place[i, 0] = starts[i] * (table.shape[0] / targets.starts) if targets.starts > 1 else 0.0
            episodes.place[i, 1] = 0.0
        else:
            episodes.place[i, 0] = uniform(episodes.streams, i, 0.0, table.shape[0] - 1.000001)
            episodes.place[i, 1] = uniform(episodes.streams, i, 0.0, table.shape[1] - 1.000001)
        if spread is None:
            continue
        for k in range(4):
            draws[i, k] = 1.0 + uniform(episodes.streams, i, -spread[k], spread[k])
        draws[i, 4] = uniform(episodes.streams, i, -spread[4], spread[4])
        draws[i, 5] = 1.0 + uniform(episodes.streams, i, -spread[5], spread[5])
        norm = 0.0
        for k in range(3):
            draws[i, 6 + k] = normal(episodes.streams, i)
            norm += draws[i, 6 + k] ** 2
        angle = uniform(episodes.streams, i, 0.0, spread[6])
        for k in range(3):
            draws[i, 6 + k] *= angle / np.sqrt(norm)
        draws[i, 9] = uniform(episodes.streams, i, 0.0, spread[7])
        draws[i, 10] = uniform(episodes.streams, i, 0.0, 2.0 * np.pi)
        for k in range(3):
            draws[i, 11 + k] = uniform(episodes.streams, i, -spread[8], spread[8])


@jit
def rotation_of(vector):
    """Rotation matrix of a rotation vector (Rodrigues)."""
    angle = np.sqrt(vector[0] ** 2 + vector[1] ** 2 + vector[2] ** 2)
    out = np.eye(3)
    if angle == 0.0:
        return out
    x, y, z = vector[0] / angle, vector[1] / angle, vector[2] / angle
    hat = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    return out + np.sin(angle) * hat + (1.0 - np.cos(angle)) * (hat @ hat)


@jit
def copy_starts(rows, columns, which, starts, status):
    """Put the nominal rod, at rest in the start's equilibrium, into the lanes of ``which``; ``columns`` (num_starts, rows)."""
    width = rows.shape[2]
    for i in which:
        for row in range(rows.shape[1]):
            rows[i // width, row, i % width] = columns[starts[i], row]
        status[i] = 0


@jit
def varied(values, draw):
    """Values of a rod that differs from the nominal one."""
    ends = values.ends.copy()
    for segment in range(len(ends) - 1):
        ends[segment] += draw[4]
    return RodValues(
        ends,
        values.axial * draw[0],
        values.shear * draw[0],
        values.bending * draw[0],
        values.torsion * draw[0],
        values.mass_per_length * draw[1],
        values.rotary * draw[1],
        values.magnet_masses,
        values.magnet_moments * draw[3],
    )


@jit
def tilted(gravity, draw):
    """Gravity tilted by the angle draw[9] about an axis across it, at the heading draw[10]."""
    size = np.sqrt((gravity**2).sum())
    if size == 0.0 or draw[9] == 0.0:
        return gravity.copy()
    along = gravity / size
    helper = np.array([1.0, 0.0, 0.0]) if abs(along[0]) < 0.9 else np.array([0.0, 1.0, 0.0])
    first = np.cross(along, helper)
    first /= np.sqrt((first**2).sum())
    second = np.cross(along, first)
    return rotation_of(draw[9] * (np.cos(draw[10]) * first + np.sin(draw[10]) * second)) @ gravity


@jit
def make_rods(
    rows, layout, planar, plane, counts, values, gravity, drag, scratch, still_layout, still_terms, fields, which, starts,
    draws, episodes, status,
):  # fmt: skip
    """Write rods that differ from the nominal one into the lanes of ``which``, each at rest in its own equilibrium.

    ``scratch`` (1, rows, 8) is a spatial block for the statics; ``fields`` (num_starts, 3) T are commanded at the starts. Where the
    rod loses stability on the way it starts from the last stable shape. ``plane``: the in-plane axis beside x, 2 for "xz", 1 for "xy".
    """
    width, num_nodes = rows.shape[2], layout.num_elements + 1
    positions, rotations = np.zeros((num_nodes, 3)), np.zeros((num_nodes, 4))
    flat_moments = np.zeros_like(values.magnet_moments)
    for i in which:
        draw = draws[i]
        rod, pull = varied(values, draw), tilted(gravity, draw)
        if planar is not None:
            for axis in range(1, 3):
                if axis != plane:
                    pull[axis] = 0.0
        turn = rotation_of(draw[6:9])
        episodes.mixing[i] = draw[5] * turn
        episodes.unmixing[i] = turn.T / draw[5]
        field = episodes.mixing[i] @ (fields[starts[i]] + draw[11:14])
        if planar is not None:
            field[3 - plane] = 0.0
        for lane in range(8):
            write_rod(scratch[0], lane, still_layout, counts, rod, None, None)
            for k in range(3):
                scratch[0, GRAVITY + k, lane] = pull[k]
        find_equilibrium(
            scratch.reshape(-1), still_layout, still_terms, None, None, field, np.zeros(9), positions, rotations
        )
        block, lane = i // width, i % width
        rows[block, LEAST_COSINE, lane] = 1.0
        rows[block, ENERGY, lane] = np.inf  # the watchdog takes what it sees first
        rows[block, DRAG, lane] = drag * draw[2]
        axes = (0, 1, 2)
        here = rod
        if planar is not None:
            axes = (0, plane, 3 - plane)
            flat_moments[:, 0], flat_moments[:, 1] = rod.magnet_moments[:, 0], rod.magnet_moments[:, plane]
            here = RodValues(
                rod.ends, rod.axial, rod.shear, rod.bending, rod.torsion, rod.mass_per_length, rod.rotary,
                rod.magnet_masses, flat_moments,
            )  # fmt: skip
        write_rod(rows[block], lane, layout, counts, here, planar, None)
        for k in range(3):
            rows[block, GRAVITY + k, lane] = pull[axes[k]]
            rows[block, FIELD + k, lane] = field[axes[k]]
            rows[block, TARGET + k, lane] = field[axes[k]]
            rows[block, REFERENCE + k, lane] = field[axes[k]]
        for node in range(num_nodes):
            if planar is None:
                row = layout.nodes + SPATIAL.size * node
                for k in range(3):
                    rows[block, row + k, lane] = positions[node, k]
                for k in range(4):
                    rows[block, row + SPATIAL.rotation + k, lane] = rotations[node, k]
            else:
                row = layout.nodes + PLANAR.size * node
                rows[block, row, lane] = positions[node, 0]
                rows[block, row + 1, lane] = positions[node, plane]
                rows[block, row + PLANAR.rotation, lane] = rotations[node, 0]
                sign = 1.0 if plane == 1 else -1.0
                rows[block, row + PLANAR.rotation + 1, lane] = sign * rotations[node, 3 if plane == 1 else 2]
        status[i] = 0
