"""Compiled resets: where episodes begin, what they reach for, and how their rods differ from the nominal one."""

from typing import NamedTuple

import numpy as np

from magrod_env._jit import jit
from magrod_env.envs.streams import normal, uniform
from magrod_env.rod.layout import FIELD, REFERENCE, TARGET, Layout


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

    ``starts`` (num_envs,) gets the start table's entry; ``draws`` (num_envs, 14) factors and offsets from ``spread``
    (9,): modulus, density, drag, remanence (factors), magnet shift (m), gain (factor), misalignment (3, rotation
    vector), gravity tilt (2: angle and heading), initial field (3, T).
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
    return turned(rotation_of(draw[9] * (np.cos(draw[10]) * first + np.sin(draw[10]) * second)), gravity)


@jit
def vary_rods(parameters, making, episodes, which, starts, draws, loads):
    """Parameters of rods that differ from the nominal one, and the field that acts on each at its start.

    ``parameters``: `RodParameters` of all; ``loads`` (len(which), 12) gets the acting field in its first columns.
    """
    for m in range(len(which)):
        i = which[m]
        draw = draws[i]
        parameters.modulus[i], parameters.density[i], parameters.moment[i] = draw[0], draw[1], draw[3]
        parameters.drag[i], parameters.magnet_shift[i] = making.drag * draw[2], draw[4]
        pull, turn = tilted(making.gravity, draw), rotation_of(draw[6:9])
        episodes.mixing[i] = draw[5] * turn
        episodes.unmixing[i] = turn.T / draw[5]
        field = turned(episodes.mixing[i], making.fields[starts[i]] + draw[11:14])
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
        command = making.fields[starts[i]] + draws[i, 11:14]
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
