"""Compiled resets: where episodes begin, what they reach for, and how their rods differ from the nominal one."""

from typing import NamedTuple

import numpy as np

from magrod_env._jit import jit
from magrod_env.envs.streams import normal, uniform
from magrod_env.rod.layout import (
    DRAG,
    ENERGY,
    FIELD,
    GRAVITY,
    LEAST_COSINE,
    PLANAR,
    REFERENCE,
    SPATIAL,
    TARGET,
    Layout,
    Terms,
)
from magrod_env.rod.mesh import RodValues, write_rod
from magrod_env.rod.statics import find_equilibrium


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
    plane: int  # the in-plane axis beside x: 2 for "xz", 1 for "xy"
    counts: np.ndarray  # elements of each segment
    values: RodValues  # of the nominal rod
    gravity: np.ndarray  # (3,) m/s^2
    drag: float  # 1/s
    still_layout: Layout  # of the spatial block in which equilibria are found
    still_terms: Terms
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
def varied(values, draws, i):
    """Values of the rod of environment ``i``, which differs from the nominal one."""
    ends = values.ends.copy()
    for segment in range(len(ends) - 1):
        ends[segment] += draws.magnet_shift[i]
    modulus, density = draws.modulus[i], draws.density[i]
    return RodValues(
        ends,
        values.axial * modulus,
        values.shear * modulus,
        values.bending * modulus,
        values.torsion * modulus,
        values.mass_per_length * density,
        values.rotary * density,
        values.polar * density,
        values.magnet_masses,
        values.magnet_moments * draws.remanence[i],
    )


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
def make_rods(rows, making, planar, scratch, episodes, which, starts, draws, status):
    """Write rods that differ from the nominal one into the lanes of ``which``, each at rest in its own equilibrium.

    ``scratch`` (1, rows, 8) is a spatial block for the statics. Where a rod loses stability on the way, it starts from
    the last stable shape.
    """
    num_nodes, plane = making.layout.num_elements + 1, making.plane
    positions, rotations = np.zeros((num_nodes, 3)), np.zeros((num_nodes, 4))
    for i in which:
        rod, pull = varied(making.values, draws, i), tilted(making.gravity, draws.tilt[i], draws.heading[i])
        turn = rotation_of(draws.misalignment[i])
        episodes.mixing[i] = draws.gain[i] * turn
        episodes.unmixing[i] = turn.T / draws.gain[i]
        command = making.fields[starts[i]] + draws.initial_field[i]
        field = turned(episodes.mixing[i], command)
        if planar is not None:
            pull[3 - plane], field[3 - plane] = 0.0, 0.0
        for lane in range(8):
            write_rod(scratch[0], lane, making.still_layout, making.counts, rod, None, None)
            for k in range(3):
                scratch[0, GRAVITY + k, lane] = pull[k]
        find_equilibrium(
            scratch.reshape(-1),
            making.still_layout,
            making.still_terms,
            None,
            None,
            field,
            np.zeros(9),
            positions,
            rotations,
        )
        write_lane(rows, making, planar, i, rod, pull, field, making.drag * draws.drag[i])
        write_drive(rows, making, planar, i, command, episodes.mixing[i])
        write_shape(rows, making, planar, i, positions, rotations)
        status[i] = 0


@jit
def write_lane(rows, making, planar, i, rod, pull, field, drag):
    """Constants, gravity, field and drag of rod ``i``, in the axes of its motion."""
    block, lane = i // rows.shape[2], i % rows.shape[2]
    axes = (0, 1, 2) if planar is None else (0, making.plane, 3 - making.plane)
    moments = np.zeros_like(rod.magnet_moments)
    for k in range(3):
        moments[:, k] = rod.magnet_moments[:, axes[k]]
    values = RodValues(
        rod.ends,
        rod.axial,
        rod.shear,
        rod.bending,
        rod.torsion,
        rod.mass_per_length,
        rod.rotary,
        rod.polar,
        rod.magnet_masses,
        moments,
    )
    write_rod(rows[block], lane, making.layout, making.counts, values, planar, None)
    for k in range(3):
        rows[block, GRAVITY + k, lane] = pull[axes[k]]
        for first in (FIELD, REFERENCE, TARGET):
            rows[block, first + k, lane] = field[axes[k]]
    rows[block, DRAG, lane] = drag
    rows[block, LEAST_COSINE, lane] = 1.0
    rows[block, ENERGY, lane] = np.inf  # the watchdog takes what it sees first


@jit
def write_drive(rows, making, planar, i, command, mixing):
    """For turned coils behind a slew limit: command, reference and mixing of rod ``i`` in the coils' own frame."""
    if making.layout.mixing == making.layout.node_damping:
        return
    block, lane = i // rows.shape[2], i % rows.shape[2]
    axes = (0, 1, 2) if planar is None else (0, making.plane, 3 - making.plane)
    for k in range(3):
        rows[block, REFERENCE + k, lane] = command[axes[k]]
        rows[block, TARGET + k, lane] = command[axes[k]]
        for j in range(3):
            rows[block, making.layout.mixing + 3 * k + j, lane] = mixing[axes[k], axes[j]]


@jit
def write_shape(rows, making, planar, i, positions, rotations):
    """Put rod ``i`` at rest into a shape in space: ``positions`` (num_nodes, 3) m, ``rotations`` (num_nodes, 4)."""
    block, lane, plane = i // rows.shape[2], i % rows.shape[2], making.plane
    for node in range(making.layout.num_elements + 1):
        if planar is None:
            row = making.layout.nodes + SPATIAL.size * node
            for k in range(3):
                rows[block, row + k, lane] = positions[node, k]
            for k in range(4):
                rows[block, row + SPATIAL.rotation + k, lane] = rotations[node, k]
        else:
            row = making.layout.nodes + PLANAR.size * node
            rows[block, row, lane] = positions[node, 0]
            rows[block, row + 1, lane] = positions[node, plane]
            rows[block, row + PLANAR.rotation, lane] = rotations[node, 0]
            turn = rotations[node, 3] if plane == 1 else -rotations[node, 2]
            rows[block, row + PLANAR.rotation + 1, lane] = turn
