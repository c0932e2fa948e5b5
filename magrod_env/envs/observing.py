"""Compiled camera, observation and reward of every environment, between physics steps."""

from typing import NamedTuple

import numpy as np

from magrod_env._jit import inline_jit, jit
from magrod_env.envs.streams import normal
from magrod_env.envs.targets import Targets
from magrod_env.rod.layout import FIELD, PLANAR, SPATIAL, Layout

TRACKING, PRECISION, EFFORT, SMOOTHNESS = range(4)  # reward terms


class Places(NamedTuple):
    """Where each entry of an observation begins; see `magrod_env.envs.observation` for what they are."""

    position: int
    velocity: int
    field: int
    target: int
    preview: int
    state: int


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


class View(NamedTuple):
    """What the observing kernels need of an environment and never change."""

    layout: Layout
    axes: tuple  # world axes of the motion
    nodes: tuple  # tracked nodes
    targets: Targets
    scales: Scales
    optics: Optics
    preview: np.ndarray  # s ahead
    control_time: float  # s
    places: Places  # of the entries in an observation


class Outcome(NamedTuple):
    """What one step of every environment gives; first axis num_envs."""

    observations: np.ndarray  # (size,) float32
    rewards: np.ndarray  # () float64
    terms: np.ndarray  # (4,) reward terms
    errors: np.ndarray  # (num_tracked,) m, distance of each tracked point from its target
    goals: np.ndarray  # (num_tracked, 3) m
    positions: np.ndarray  # (num_tracked, 3) m, true positions
    fields: np.ndarray  # (3,) T, the field that acts, world


@inline_jit
def target_at(targets, place, time, out):
    """Target (num_tracked, 3) m at ``time`` s of an episode, by linear interpolation in the task's table."""
    table, tracked = targets.table, out.shape[0]
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


@inline_jit
def node_position(rows, view, planar, node, i, out):
    """World position of a node of rod ``i``, m, into ``out`` (3,)."""
    width = rows.shape[2]
    row = view.layout.nodes + (SPATIAL.size if planar is None else PLANAR.size) * node
    for k in range(3):
        out[k] = 0.0
    for k in range(len(view.axes)):
        out[view.axes[k]] = rows[i // width, row + k, i % width]


@inline_jit
def take_frame(positions, episodes, optics, i, first):
    """The camera sees ``positions`` (num_tracked, 3): into the ring of frames; ``seen`` gets the one that has
    arrived.
    """
    depth, step = episodes.frames.shape[1], episodes.steps[i]
    newest, arrived = step % depth, (step - optics.delay) % depth
    new_frame, new_arrival = step % optics.every == 0, (step - optics.delay) % optics.every == 0
    for p in range(positions.shape[0]):
        for k in range(3):
            if first or new_frame:
                value = positions[p, k]
                if optics.noise > 0.0:
                    value += optics.noise * normal(episodes.streams, i)
            else:
                value = episodes.frames[i, (step - 1) % depth, p, k]
            episodes.frames[i, newest, p, k] = value
            if first:
                for d in range(depth):
                    episodes.frames[i, d, p, k] = value
                episodes.seen[i, 0, p, k] = value
                episodes.seen[i, 1, p, k] = value
            elif new_arrival:
                episodes.seen[i, 1, p, k] = episodes.seen[i, 0, p, k]
                episodes.seen[i, 0, p, k] = episodes.frames[i, arrived, p, k]


@inline_jit
def bounded(value):
    """An entry of an observation: a diverged rod must not put a NaN or an infinity into a policy."""
    if not np.isfinite(value):
        return 0.0
    return min(max(value, -100.0), 100.0)


@inline_jit
def coil_fraction(field, episodes, scales, i, a):
    """Field of coil pair ``a`` as a share of its limit, as the coils' own sensors see it."""
    nominal = 0.0
    for k in range(3):
        nominal += episodes.unmixing[i, scales.coils[a], k] * field[k]
    return nominal / scales.limits[a]


@inline_jit
def write_observation(rows, view, planar, full, episodes, i, obs, goal, field, ahead):
    """One observation into ``obs`` (size,), each entry at its place.

    ``goal`` (num_tracked, 3) m is the target now, ``field`` (3,) T the field that acts, ``ahead`` room for targets.
    """
    write_positions(view, episodes, i, obs)
    write_coils(view, episodes, i, obs, field)
    write_targets(view, episodes, i, obs, goal, ahead)
    if full is not None:
        write_state(rows, view, planar, i, obs)


@inline_jit
def write_positions(view, episodes, i, obs):
    """What the camera saw of the tracked points: position / L, and velocity / L of the last two frames."""
    length = view.scales.length
    for p in range(len(view.nodes)):
        for axis in range(3):
            at, now = 3 * p + axis, episodes.seen[i, 0, p, axis]
            speed = (now - episodes.seen[i, 1, p, axis]) / view.optics.frame_time
            obs[view.places.position + at] = bounded(now / length)
            obs[view.places.velocity + at] = bounded(speed / length)


@inline_jit
def write_coils(view, episodes, i, obs, field):
    """Field of every coil pair as a share of its limit."""
    for a in range(len(view.scales.limits)):
        obs[view.places.field + a] = bounded(coil_fraction(field, episodes, view.scales, i, a))


@inline_jit
def write_targets(view, episodes, i, obs, goal, ahead):
    """Targets: now from the positions seen, and later ones from now, each / (L / 10)."""
    tracked, length = len(view.nodes), view.scales.length
    for p in range(tracked):
        for axis in range(3):
            gap = goal[p, axis] - episodes.seen[i, 0, p, axis]
            obs[view.places.target + 3 * p + axis] = bounded(10.0 * gap / length)
    time = view.control_time * episodes.steps[i]
    for q in range(len(view.preview)):
        target_at(view.targets, episodes.place[i], time + view.preview[q], ahead)
        for p in range(tracked):
            for axis in range(3):
                change = ahead[p, axis] - goal[p, axis]
                obs[view.places.preview + 3 * (tracked * q + p) + axis] = bounded(10.0 * change / length)


@inline_jit
def write_state(rows, view, planar, i, obs):
    """The full state of a rod: position / L, rotation, velocity / L, spin of every free node."""
    layout, length, k = view.layout, view.scales.length, view.places.state
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


@inline_jit
def reward_of(distance, actions, before, i, scales, terms):
    """Reward terms of one step of environment ``i`` into ``terms`` (num_envs, 4), and their sum; its action is kept.

    tracking: -distance/scale; precision: a bonus up to 1 near the target; effort: -weight |a|^2; smoothness: -weight
    |da|^2.
    """
    effort, change = 0.0, 0.0
    for a in range(actions.shape[1]):
        action = actions[i, a]
        effort += action * action
        change += (action - before[i, a]) * (action - before[i, a])
        before[i, a] = action
    terms[i, TRACKING] = -min(distance / scales.tracking, 10.0)
    terms[i, PRECISION] = np.exp(-distance / scales.precision)
    terms[i, EFFORT] = -scales.effort * effort
    terms[i, SMOOTHNESS] = -scales.smoothness * change
    return terms[i, 0] + terms[i, 1] + terms[i, 2] + terms[i, 3]


@jit
def observe_blocks(blocks, first, last, terms, view, full, episodes, actions, status, out):
    """After the physics of one control step: camera, observation, reward of the environments of some blocks.

    ``actions`` (num_envs, num_axes) in [-1, 1]. A rod that has diverged pays the largest tracking cost.
    """
    width, tracked = len(terms.lanes), len(view.nodes)
    rows, ahead = blocks.reshape(len(blocks), -1, width), np.empty((tracked, 3))
    for i in range(first * width, min(last * width, len(out.rewards))):
        episodes.steps[i] += 1
        write_outcome(rows, view, terms.planar, full, episodes, i, out, ahead, False, status[i] != 0)
        distance = 0.0
        for p in range(tracked):
            distance += out.errors[i, p] / tracked
        if status[i] != 0:
            distance = np.inf
        out.rewards[i] = reward_of(distance, actions, episodes.action, i, view.scales, out.terms)


@jit
def observe_some(rows, view, planar, full, episodes, which, out):
    """First observation of the environments ``which`` after their reset; their last action is what holds the start."""
    ahead = np.empty((len(view.nodes), 3))
    for i in which:
        out.rewards[i] = 0.0
        out.terms[i] = 0.0
        write_outcome(rows, view, planar, full, episodes, i, out, ahead, True, False)
        for a in range(len(view.scales.limits)):
            episodes.action[i, a] = coil_fraction(out.fields[i], episodes, view.scales, i, a)


@jit
def observe_estimate(rows, view, planar, episodes, positions, before, which, out):
    """Write the observations of the environments ``which`` again, from an estimate in place of the camera's frames.

    ``positions`` (num_envs, num_tracked, 3) m now and ``before``, one control step ago; ``episodes.seen`` is the
    caller's own.
    """
    ahead = np.empty((len(view.nodes), 3))
    steps = view.optics.frame_time / view.control_time
    for i in which:
        for p in range(len(view.nodes)):
            for k in range(3):
                episodes.seen[i, 0, p, k] = positions[i, p, k]
                episodes.seen[i, 1, p, k] = positions[i, p, k] - steps * (positions[i, p, k] - before[i, p, k])
        write_observation(
            rows, view, planar, None, episodes, i, out.observations[i], out.goals[i], out.fields[i], ahead
        )


@inline_jit
def write_outcome(rows, view, planar, full, episodes, i, out, ahead, first, lost):
    """Everything but the reward of environment ``i``; a ``lost`` rod is nowhere, and counts as lying at the clamp."""
    width = rows.shape[2]
    for p in range(len(view.nodes)):
        node_position(rows, view, planar, view.nodes[p], i, out.positions[i, p])
        if lost:
            out.positions[i, p] = 0.0
    target_at(view.targets, episodes.place[i], view.control_time * episodes.steps[i], out.goals[i])
    for p in range(len(view.nodes)):
        square = 0.0
        for k in range(3):
            square += (out.positions[i, p, k] - out.goals[i, p, k]) ** 2
        out.errors[i, p] = np.sqrt(square)
    for k in range(3):
        out.fields[i, k] = 0.0
    for k in range(len(view.axes)):
        out.fields[i, view.axes[k]] = rows[i // width, FIELD + k, i % width]
    take_frame(out.positions[i], episodes, view.optics, i, first)
    write_observation(rows, view, planar, full, episodes, i, out.observations[i], out.goals[i], out.fields[i], ahead)
