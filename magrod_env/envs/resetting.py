"""Compiled resets: where episodes begin, what they reach for, and how their rods differ from the nominal one."""

from typing import NamedTuple

import numpy as np

from magrod_env._jit import jit
from magrod_env.envs.streams import normal, uniform
from magrod_env.rod.layout import FIELD, REFERENCE, TARGET, Layout


class Spread(NamedTuple):
    """The fields of a `Randomization`, as numbers."""

    modulus: float
    density: float
    drag: float
    remanence: float
    magnet_position: float  # m
    field_gain: float
    field_misalignment: float  # rad
    gravity_direction: float  # rad
    initial_field: float  # T


class Draws(NamedTuple):
    """How the rods of the present episodes differ from the nominal one; first axis num_envs."""

    modulus: np.ndarray  # () factor
    density: np.ndarray  # () factor
    drag: np.ndarray  # () factor
    remanence: np.ndarray  # () factor
    magnet_shift: np.ndarray  # () m, along the rod
    gain: np.ndarray  # () factor of the coils' field
    misalignment: np.ndarray  # (3,) rotation vector of the coils' frame, rad
    tilt: np.ndarray  # () angle of gravity from its nominal direction, rad
    heading: np.ndarray  # () direction of that tilt, rad
    initial_field: np.ndarray  # (3,) T, added to the field of the start


def new_draws(num_envs: int) -> Draws:
    """Room for the draws of ``num_envs`` environments."""
    vectors = ("misalignment", "initial_field")
    return Draws(*(np.zeros((num_envs, 3) if name in vectors else num_envs) for name in Draws._fields))


class Making(NamedTuple):
    """What making rods that differ from the nominal one needs."""

    layout: Layout
    axes: tuple  # world axes of the motion, then the one across
    across: int  # world axis across a plane; 3 in space
    gravity: np.ndarray  # (3,) m/s^2
    drag: float  # 1/s
    fields: np.ndarray  # (num_starts, 3) T commanded at the starts


@jit
def begin_episodes(episodes, targets, which, starts, draws, spread):
    """Draw where the episodes of ``which`` begin or reach to, and how their rods differ.

    ``starts`` (num_envs,) gets the start table's entry; ``spread`` is None where all rods are nominal.
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
        draw_rod(episodes.streams, i, spread, draws)


@jit
def draw_rod(streams, i, spread, draws):
    """Draw how the rod, the coils and gravity of environment ``i`` differ from the nominal ones."""
    draws.modulus[i] = 1.0 + uniform(streams, i, -spread.modulus, spread.modulus)
    draws.density[i] = 1.0 + uniform(streams, i, -spread.density, spread.density)
    draws.drag[i] = 1.0 + uniform(streams, i, -spread.drag, spread.drag)
    draws.remanence[i] = 1.0 + uniform(streams, i, -spread.remanence, spread.remanence)
    draws.magnet_shift[i] = uniform(streams, i, -spread.magnet_position, spread.magnet_position)
    draws.gain[i] = 1.0 + uniform(streams, i, -spread.field_gain, spread.field_gain)
    norm = 0.0
    for k in range(3):
        draws.misalignment[i, k] = normal(streams, i)
        norm += draws.misalignment[i, k] ** 2
    angle = uniform(streams, i, 0.0, spread.field_misalignment)
    for k in range(3):
        draws.misalignment[i, k] *= angle / np.sqrt(norm)
    draws.tilt[i] = uniform(streams, i, 0.0, spread.gravity_direction)
    draws.heading[i] = uniform(streams, i, 0.0, 2.0 * np.pi)
    for k in range(3):
        draws.initial_field[i, k] = uniform(streams, i, -spread.initial_field, spread.initial_field)


@jit
def rotation_of(vector):
    """Rotation matrix of a rotation vector (Rodrigues)."""
    angle = np.sqrt(vector[0] ** 2 + vector[1] ** 2 + vector[2] ** 2)
    out = np.eye(3)
    if angle == 0.0:
        return out
    x, y, z = vector[0] / angle, vector[1] / angle, vector[2] / angle
    sine, versine = np.sin(angle), 1.0 - np.cos(angle)
    hat = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    axis = (x, y, z)
    for j in range(3):
        for k in range(3):
            out[j, k] += sine * hat[j, k] + versine * (axis[j] * axis[k] - (1.0 if j == k else 0.0))
    return out


@jit
def turned(matrix, vector):
    """``matrix @ vector`` in three dimensions; numba's own product would need SciPy."""
    out = np.zeros(3)
    for j in range(3):
        out[j] = matrix[j, 0] * vector[0] + matrix[j, 1] * vector[1] + matrix[j, 2] * vector[2]
    return out


@jit
def copy_starts(rows, columns, which, starts, status):
    """Put the nominal rod, at rest in the start's equilibrium, into the lanes of ``which``; ``columns`` (num_starts,
    rows).
    """
    width = rows.shape[2]
    for i in which:
        for row in range(rows.shape[1]):
            rows[i // width, row, i % width] = columns[starts[i], row]
        status[i] = 0


@jit
def tilted(gravity, tilt, heading):
    """Gravity tilted by an angle about an axis across it, at a heading."""
    size = np.sqrt((gravity**2).sum())
    if size == 0.0 or tilt == 0.0:
        return gravity.copy()
    along = gravity / size
    helper = np.array([1.0, 0.0, 0.0]) if abs(along[0]) < 0.9 else np.array([0.0, 1.0, 0.0])
    first = np.cross(along, helper)
    first /= np.sqrt((first**2).sum())
    second = np.cross(along, first)
    return turned(rotation_of(tilt * (np.cos(heading) * first + np.sin(heading) * second)), gravity)


@jit
def vary_rods(parameters, making, episodes, which, starts, draws, loads):
    """Parameters of rods that differ from the nominal one, and the field that acts on each at its start.

    ``parameters``: `RodParameters` of all; ``loads`` (len(which), 12) gets the acting field in its first columns.
    """
    for m in range(len(which)):
        i = which[m]
        parameters.modulus[i], parameters.density[i] = draws.modulus[i], draws.density[i]
        parameters.moment[i], parameters.magnet_shift[i] = draws.remanence[i], draws.magnet_shift[i]
        parameters.drag[i] = making.drag * draws.drag[i]
        pull = tilted(making.gravity, draws.tilt[i], draws.heading[i])
        turn = rotation_of(draws.misalignment[i])
        episodes.mixing[i] = draws.gain[i] * turn
        episodes.unmixing[i] = turn.T / draws.gain[i]
        field = turned(episodes.mixing[i], making.fields[starts[i]] + draws.initial_field[i])
        for k in range(3):
            inside = k != making.across
            parameters.gravity[i, k] = pull[k] if inside else 0.0
            loads[m, k] = field[k] if inside else 0.0


@jit
def write_fields(rows, making, which, starts, draws, episodes, loads, status):
    """Let the acting fields of ``vary_rods`` act on the rods of ``which``, whose drive has come to rest there.

    The reference of turned coils behind a slew limit is in the coils' own frame.
    """
    width, layout, axes = rows.shape[2], making.layout, making.axes
    for m in range(len(which)):
        i = which[m]
        block, lane = i // width, i % width
        command = making.fields[starts[i]] + draws.initial_field[i]
        for k in range(3):
            for first in (FIELD, REFERENCE, TARGET):
                rows[block, first + k, lane] = loads[m, axes[k]]
        if layout.mixing != layout.node_damping:
            for k in range(3):
                rows[block, REFERENCE + k, lane] = command[axes[k]]
                rows[block, TARGET + k, lane] = command[axes[k]]
                for j in range(3):
                    rows[block, layout.mixing + 3 * k + j, lane] = episodes.mixing[i][axes[k], axes[j]]
        status[i] = 0
