"""Statics and linearisation of rods of one make: equilibria, branches, stiffness, stable steps."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from magrod_env._jit import PRESENT, Bound
from magrod_env.rod import stability
from magrod_env.rod.energy import LARGEST_STRAIN, SHEAR_SHARE
from magrod_env.rod.layout import (
    ELEMENT_ROWS,
    FIELD,
    GRADIENT,
    GRAVITY,
    LENGTH,
    SPATIAL,
    Terms,
    make_blocks,
    make_layout,
    rows_of,
)
from magrod_env.rod.loads.hub import SHARE, first_rows, load_terms, place_loads
from magrod_env.rod.mesh import RodValues, write_rod
from magrod_env.rod.statics import LARGEST_TURN, flow_step, follow_blocks, lay_straight_blocks, make_room
from magrod_env.rod.tangent import LANES
from magrod_env.rotations import rotation_matrices

HELD = 1e-6  # what a shape may move, in lengths and rad, under loads whose equilibrium it is said to be
MOST_FLOWS = 1000  # steps of a relaxation
SMALL_FLOW = 1e-3  # rad and lengths: a step after which Newton's method is tried
AT_REST = 1e-9


@dataclass(frozen=True, eq=False)
class Equilibrium:
    """An equilibrium, or the last stable shape before stability was lost.

    Args:
        positions: of the nodes, m, world, (num_nodes, 3).
        quaternions: rotations of the sections, body to world, scalar first, (num_nodes, 4).
        reached: whether all loads act.
        share: 2 where it was reached; else where stability was lost: 0-1 the share of gravity, 1-2 one plus the share
            of field and gradient, or of the way to them; from a shape that came to no stable rest, 1.
        field: T, world, at the origin, (3,): what was asked for.
        gradient: T/m, dB_i/dx_j, (3, 3): what was asked for.
        strained: whether an element is stretched or squeezed by more than half, sheared by more than 0.8 or bent by a
            half turn, so that it is no result, and counts as not reached.
    """

    positions: np.ndarray
    quaternions: np.ndarray
    reached: bool
    share: float
    field: np.ndarray
    gradient: np.ndarray
    strained: bool = False

    @property
    def tip_position(self) -> np.ndarray:
        """Position of the tip, m, world, (3,)."""
        return self.positions[-1].copy()

    @property
    def rotations(self) -> np.ndarray:
        """Rotation matrices of the sections, body to world, (num_nodes, 3, 3)."""
        return rotation_matrices(self.quaternions)

    @property
    def tangents(self) -> np.ndarray:
        """First body axis of every section, world, (num_nodes, 3)."""
        return self.rotations[:, :, 0]


class Shapes(NamedTuple):
    """Where K rods came to, each as in `Equilibrium`."""

    positions: np.ndarray  # (K, num_nodes, 3) m, world
    quaternions: np.ndarray  # (K, num_nodes, 4)
    shares: np.ndarray  # (K,)
    strained: np.ndarray  # (K,)

    @property
    def reached(self) -> np.ndarray:
        """Whether each rod is in an equilibrium under all its loads, (K,)."""
        return (self.shares >= 2.0) & ~self.strained


class StaticModel:
    """Equilibria and linearisation of rods of one make, always in float64 and in space, many at once in lanes.

    ``column`` (rows,) holds the nominal rod's constants; rods that differ from it come as columns of their own.
    """

    def __init__(self, values: RodValues, counts, magnet_segments, nodal: bool, gravity, loads=()):
        def present(flag):
            return PRESENT if flag else None

        self.counts, self.values = counts, values
        self.terms = Terms(
            lanes=LANES,
            nodal=present(nodal),
            gravity=present(gravity is not None),
            magnets=present(len(magnet_segments) > 0),
            loads=load_terms(loads),
        )
        ends = np.cumsum(counts)
        layout = make_layout(int(ends[-1]), tuple(int(ends[s]) for s in magnet_segments), self.terms)
        self.layout, self.loads = place_loads(layout, self.terms, loads, values.ends, counts), loads
        self.gravity = np.zeros(3) if gravity is None else np.array(gravity, float)
        rows = np.zeros((self.layout.size, 1))
        write_rod(rows, 0, self.layout, counts, values, None, self.terms.nodal)
        rows[GRAVITY : GRAVITY + 3, 0] = self.gravity
        self.column = rows[:, 0]
        self._write_loads(self.column)
        length = values.ends[-1]
        self._flow = values.bending / length * np.tile([length**-2] * 3 + [1.0] * 3, self.layout.num_elements)
        self._bound: dict[bool, Bound] = {}

    def _write_loads(self, column, factor: float = 1.0) -> None:
        """Write the listed loads, times a factor, into one rod's rows."""
        if not self.loads:
            return
        column[self.layout.loads.own + SHARE] = 1.0
        for load, first in zip(self.loads, first_rows(self.layout, self.loads), strict=True):
            column[first : first + load.ROWS] = load.rows(None)[0]
            column[first : first + load.FORCES] *= factor

    def straight(self):
        """Positions (num_nodes, 3) and quaternions (num_nodes, 4) of the straight rod."""
        return stability.straight(self.column, self.layout)

    # ---- many rods

    def solve(self, loads, columns=None, start: Shapes | None = None, begin=None, share: Callable | None = None):
        """Equilibria of K rods under ``loads`` (K, 12): field, T, and gradient, T/m.

        Args:
            loads: what acts at the end.
            columns: (K, rows) constants of each rod; None for the nominal one.
            start: poses near the equilibria, under the loads ``begin`` (K, 12; None for ``loads``); None starts from
                the unloaded straight rod, as does a rod whose pose leads nowhere and that has no ``begin``.
            share: calls a kernel on all blocks, shared out over threads (see `RodBatch.share_out`); None calls it here.

        Returns:
            `Shapes`; where stability is lost, the last stable shape.
        """
        loads = np.ascontiguousarray(loads, float)
        columns = np.broadcast_to(self.column, (len(loads), self.layout.size)) if columns is None else columns
        found = self._follow(columns, loads, start, loads if begin is None else begin, share)
        if start is not None and begin is None and (found.shares < 2.0).any():
            lost = np.flatnonzero(found.shares < 2.0)
            again = self._follow(columns[lost], loads[lost], None, None, share)
            for old, new in zip(found, again, strict=True):
                old[lost] = new
        if self.circulatory:
            self._find_diverging(columns, loads, found)
        return found

    @property
    def circulatory(self) -> bool:
        """Whether a load has no potential, so that the tangent is not symmetric."""
        return bool(self.loads) and self.terms.loads.circulatory is not None

    def _find_diverging(self, columns, loads, found: Shapes) -> None:
        """Take back the last step to equilibria that have a negative eigenvalue, which the sign of the determinant does
        not show where two of them passed zero at once.
        """
        for k in np.flatnonzero(found.shares >= 2.0):
            case, length = shapes_at(found, k, loads[k]), columns[k, self.layout.elements + LENGTH]
            scale = np.tile([length] * 3 + [1.0] * 3, self.layout.num_elements)
            if stability.diverges(scale[:, None] * self.linearise(case, columns[k])[0] * scale):
                found.shares[k] = np.nextafter(2.0, 0.0)

    def _follow(self, columns, loads, start: Shapes | None, begin, share) -> Shapes:
        blocks, rows = self.blocks(columns)
        count, width = len(loads), len(LANES)
        ends, begins, shares = (np.zeros((len(blocks) * width, *rest)) for rest in ((12,), (12,), ()))
        ends[:count], ends[count:] = loads, loads[-1]
        if start is not None:
            begins[:count], begins[count:], shares[:] = begin, begin[-1], 1.0
            self.put(rows, start.positions, start.quaternions)
        else:
            lay_straight_blocks(rows, self.layout)
        with_gradient = bool(ends[:, 3:].any() or begins[:, 3:].any())
        terms = self.terms._replace(gradient=PRESENT if with_gradient else None)
        kernel = self._bound.setdefault(with_gradient, Bound(follow_blocks))
        arguments = (self.layout, terms, begins, ends, shares)
        if share is None:
            kernel(blocks, 0, len(blocks), *arguments)
        else:
            share(kernel, blocks, *arguments)
        positions, quaternions = self._poses(rows, count)
        return Shapes(positions, quaternions, shares[:count].copy(), self._strains(columns, positions, quaternions))

    def blocks(self, columns):
        """Lane blocks of the rods of ``columns`` (K, rows), the last repeated, and a view of their rows."""
        blocks = make_blocks(len(columns), self.layout, self.terms, np.float64)
        rows, width = rows_of(blocks, len(LANES)), len(LANES)
        lanes = np.minimum(np.arange(len(blocks) * width), len(columns) - 1)
        rows[:] = columns[lanes].reshape(len(blocks), width, -1).transpose(0, 2, 1)
        return blocks, rows

    def put(self, rows, positions, quaternions, velocities=None, momenta=None) -> None:
        """Write poses (K, num_nodes, 3) and (K, num_nodes, 4), and motion where given, into the lanes of ``rows``, the
        last repeated.
        """
        blocks, width = len(rows), rows.shape[2]
        lanes = np.minimum(np.arange(blocks * width), len(positions) - 1)
        nodes = rows[:, self.layout.nodes : self.layout.elements].reshape(blocks, -1, SPATIAL.size, width)
        for first, part in zip(SPATIAL, (positions, quaternions, velocities, momenta), strict=False):
            if part is not None:
                each = part[lanes].reshape(blocks, width, *part.shape[1:])
                nodes[:, :, first : first + part.shape[2]] = each.transpose(0, 2, 3, 1)

    def _poses(self, rows, count: int):
        """Positions (count, num_nodes, 3) and quaternions (count, num_nodes, 4) of the first rods."""
        nodes = rows[:, self.layout.nodes : self.layout.elements].reshape(len(rows), -1, SPATIAL.size, rows.shape[2])
        each = nodes[:, :, : SPATIAL.velocity].transpose(0, 3, 1, 2).reshape(-1, nodes.shape[1], SPATIAL.velocity)
        return each[:count, :, :3].copy(), each[:count, :, 3:].copy()

    def _strains(self, columns, positions, quaternions):
        """Whether an element of each rod is stretched or squeezed by more than half, bent by a half turn or, of helical
        elements, sheared by more than LARGEST_STRAIN/SHEAR_SHARE against the middle section; (K,).
        """
        places = self.layout.elements + LENGTH + ELEMENT_ROWS * np.arange(self.layout.num_elements)
        chords = np.diff(positions, axis=1) / columns[:, places][..., None]
        stretch = np.abs(np.linalg.norm(chords, axis=2) - 1.0).max(axis=1)
        turned = ((quaternions[:, 1:] * quaternions[:, :-1]).sum(axis=2) <= 0.0).any(axis=1)
        if self.terms.nodal is None:
            middle = quaternions[:, 1:] + quaternions[:, :-1]
            size = np.linalg.norm(middle, axis=2, keepdims=True)
            normal = rotation_matrices(middle / np.where(size > 0.0, size, 1.0))[..., 0]
            shear = np.linalg.norm(np.cross(normal, chords), axis=2).max(axis=1)
            stretch = np.maximum(stretch, SHEAR_SHARE * shear)
        return turned | (stretch > LARGEST_STRAIN)

    # ---- one rod

    def equilibrium(self, field, gradient=None, column=None) -> Equilibrium:
        """Equilibrium in ``field`` (3,) T and ``gradient`` (3, 3) T/m or None, reached from the straight rod."""
        loads = _loads(field, gradient)
        return shapes_at(self.solve(loads[None], _one(column)), 0, loads)

    def continued(self, start: Equilibrium, field, gradient=None, column=None) -> Equilibrium:
        """Equilibrium in ``field`` (3,) T and ``gradient`` (3, 3) T/m, followed from that of other loads.

        The loads go from those of ``start`` to these along a straight line, the scene's staying on. Every accepted
        point is stable and near the one before; ``share`` is 1 plus the share of the way.
        """
        begin, loads = _loads(start.field, start.gradient), _loads(field, gradient)
        return shapes_at(self.solve(loads[None], _one(column), _alone(start), begin[None]), 0, loads)

    def holds(self, case: Equilibrium, column=None) -> bool:
        """Whether a shape is a stable equilibrium of this rod under its loads."""
        loads = _loads(case.field, case.gradient)[None]
        found = self.solve(loads, _one(column), _alone(case), loads)
        if found.shares[0] < 2.0:
            return False
        moved = np.abs(found.positions[0] - case.positions).max() / self.values.ends[-1]
        return max(moved, np.abs(found.quaternions[0] - case.quaternions).max()) < HELD

    def follow(self, case: Equilibrium, field) -> Equilibrium:
        """Equilibrium in ``field`` (3,) T, continued from one nearby; from zero field where that is too far."""
        if not case.reached:
            return self.equilibrium(field)
        loads = _loads(field, None)
        return shapes_at(self.solve(loads[None], None, _alone(case)), 0, loads)

    def relaxed(self, positions, quaternions, field, gradient=None, column=None) -> Equilibrium:
        """Equilibrium in ``field`` (3,) T and ``gradient`` (3, 3) T/m in which a shape comes to rest.

        The shape flows down its energy as if there were no inertia and every node were braked by EI/L^3 against
        displacement and EI/L against rotation: implicit Euler steps, as long as they turn no node far, until Newton's
        method converges. A shape that balances on an unstable equilibrium stays there and counts as not reached.
        """
        loads = _loads(field, gradient)
        terms = self.terms._replace(gradient=PRESENT if loads[3:].any() else None)
        blocks, rows = self.blocks(_one(self.column if column is None else column))
        self.put(rows, positions[None], quaternions[None])
        rows[:, FIELD : FIELD + 3], rows[:, GRADIENT : GRADIENT + 9] = loads[:3, None], loads[3:, None]
        room, flow, rate = make_room(self.layout, terms), np.repeat(self._flow, len(LANES)), 1.0
        for _ in range(MOST_FLOWS):
            largest = flow_step(blocks[0], self.layout, terms, terms.nodal, terms.gradient, rate * flow, room)
            if not largest <= LARGEST_TURN:
                rate *= 4.0
                continue
            if largest < SMALL_FLOW:
                near = Shapes(*self._poses(rows, 1), np.zeros(1), np.zeros(1, bool))
                found = self.solve(loads[None], _one(column), near, loads[None])
                if found.shares[0] >= 2.0:
                    return shapes_at(found, 0, loads)
                if largest < AT_REST and rate <= 1.0:
                    break
            if largest < 0.5 * LARGEST_TURN:
                rate *= 0.5
        near = Shapes(*self._poses(rows, 1), np.ones(1), np.zeros(1, bool))
        return shapes_at(near, 0, loads)

    def linearise(self, case: Equilibrium | None, column=None):
        """Dense stiffness (6 N, 6 N) and lumped inertia (6 N,) at an equilibrium; None: straight and without load."""
        column = self.column if column is None else column
        if case is None:
            terms = self.terms._replace(magnets=None, loads=())
            return stability.linearise(column, self.layout, terms, *self.straight())
        terms = self.terms._replace(gradient=PRESENT if case.gradient.any() else None)
        loaded = column.copy()
        loaded[FIELD : FIELD + 3], loaded[GRADIENT : GRADIENT + 9] = case.field, case.gradient.ravel()
        return stability.linearise(loaded, self.layout, terms, case.positions, case.quaternions)

    def stable_time_step(self, field_magnitude: float, plane: str | None, pull: float = 0.0) -> float:
        """See ``stability.stable_time_step``."""
        return stability.stable_time_step(self.column, self.layout, self.terms, field_magnitude, plane, pull=pull)

    def stable_time_step_at(self, case: Equilibrium, plane: str | None) -> float:
        """Largest stable step, s, of small motions about an equilibrium."""
        return stability.time_step_bound(*self.linearise(case), plane)

    def working_time_step(self, field_magnitude: float, plane: str | None) -> float:
        """Bound on the step, s, that also covers a swing under gravity and sudden fields up to ``field_magnitude`` T.

        The least of straight, pulled by three times the listed loads, sagging under 2 g and twice these loads, and
        hanging under 3 g, as at the bottom of a swing, all with ``shock_stiffness`` added (docs/physics.md).
        """
        shock = stability.shock_stiffness(self.column, self.layout, field_magnitude)
        pulled = self._swung(self.gravity, 3.0)
        bound = stability.stable_time_step(pulled, self.layout, self.terms, field_magnitude, plane, shock)
        cases = []
        if self.terms.gravity is not None or self.loads:
            cases.append((2.0 * self.gravity, 2.0))
        if self.terms.gravity is not None:
            cases.append((np.array([3.0 * np.linalg.norm(self.gravity), 0.0, 0.0]), 1.0))
        for gravity, factor in cases:
            column = self._swung(gravity, factor)
            stiffness, inertia = self.linearise(self.equilibrium(np.zeros(3), column=column), column)
            bound = min(bound, stability.time_step_bound(stiffness + np.diag(shock), inertia, plane))
        return bound

    def _swung(self, gravity, factor: float):
        """The rows of the same rod under another gravity (3,) m/s^2 and a multiple of the listed loads."""
        column = self.column.copy()
        column[GRAVITY : GRAVITY + 3] = gravity
        self._write_loads(column, factor)
        return column


def _loads(field, gradient) -> np.ndarray:
    """Field (3,) T and gradient (3, 3) T/m, or None, as the kernels take them, (12,)."""
    slopes = np.zeros(9) if gradient is None else np.asarray(gradient, float).ravel()
    return np.concatenate([np.asarray(field, float), slopes])


def _one(column):
    """The constants of one rod (rows,) as those of K = 1; None stays."""
    return None if column is None else column[None]


def _alone(case: Equilibrium) -> Shapes:
    """One equilibrium as K = 1."""
    return Shapes(case.positions[None], case.quaternions[None], np.full(1, 2.0), np.zeros(1, bool))


def shapes_at(shapes: Shapes, index: int, loads) -> Equilibrium:
    """One of many equilibria, under ``loads`` (12,)."""
    return Equilibrium(
        shapes.positions[index],
        shapes.quaternions[index],
        bool(shapes.reached[index]),
        float(shapes.shares[index]),
        loads[:3].copy(),
        loads[3:].reshape(3, 3).copy(),
        bool(shapes.strained[index]),
    )
