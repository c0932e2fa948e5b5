"""Statics and linearisation of one rod behind a small object: equilibria, branches, stiffness, stable steps."""

import copy
import dataclasses
from dataclasses import dataclass

import numpy as np

from magrod_env._jit import PRESENT
from magrod_env.rod import stability
from magrod_env.rod.energy import LARGEST_STRAIN, SHEAR_SHARE
from magrod_env.rod.layout import Terms, make_blocks, make_layout, rows_of
from magrod_env.rod.loads.hub import SHARE, first_rows, load_terms, place_loads
from magrod_env.rod.mesh import RodValues, write_rod
from magrod_env.rod.state import rotation_matrices
from magrod_env.rod.statics import LARGEST_TURN, REACHED, SHORTEST_STEP, find_equilibrium, relax, set_loads, turn
from magrod_env.rod.tangent import BAND, LANES, assemble, band_width, factorise, solve_factored

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


class StaticModel:
    """One rod's constants, always in float64 and in space, for equilibria and linearisation."""

    def __init__(self, values: RodValues, counts, magnet_segments, nodal: bool, gravity, loads=()):
        def present(flag):
            return PRESENT if flag else None

        self.counts = counts
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
        self._block = make_blocks(len(LANES), self.layout, self.terms, np.float64)[0]
        rows = rows_of(self._block[None], len(LANES))[0]
        for lane in range(len(LANES)):
            write_rod(rows, lane, self.layout, counts, values, None, self.terms.nodal)
        stability.set_gravity(self._block, self.terms, self.gravity)
        self._write_loads(rows)
        length = values.ends[-1]
        self._flow = values.bending / length * np.tile([length**-2] * 3 + [1.0] * 3, self.layout.num_elements)

    def _write_loads(self, rows, factor: float = 1.0) -> None:
        """Write the listed loads, times a factor, into all lanes of a block's rows."""
        if not self.loads:
            return
        rows[self.layout.loads.own + SHARE] = 1.0
        for load, first in zip(self.loads, first_rows(self.layout, self.loads), strict=True):
            rows[first : first + load.ROWS] = load.rows(None)[0][:, None]
            rows[first : first + load.FORCES] *= factor

    def straight(self):
        """Positions (num_nodes, 3) and quaternions (num_nodes, 4) of the straight rod."""
        return stability.straight(self._block, self.layout, self.terms)

    def equilibrium(self, field, gradient=None) -> Equilibrium:
        """Equilibrium in ``field`` (3,) T and ``gradient`` (3, 3) T/m or None (see ``find_equilibrium``)."""
        block = self._block.copy()
        positions, quaternions = self.straight()
        slopes = _slopes(gradient)
        present = None if gradient is None else PRESENT
        status, share = find_equilibrium(
            block,
            self.layout,
            self.terms,
            self.terms.nodal,
            present,
            np.array(field, float),
            slopes,
            positions,
            quaternions,
        )
        return self._result(positions, quaternions, status == REACHED, share, field, slopes)

    def continued(self, start: Equilibrium, field, gradient=None) -> Equilibrium:
        """Equilibrium in ``field`` (3,) T and ``gradient`` (3, 3) T/m, followed from that of other loads.

        The loads go from those of ``start`` to these along a straight line, gravity staying on. Every accepted point is
        stable and near the one before, as in ``find_equilibrium``; ``share`` is 1 plus the share of the way.
        """
        begin = np.concatenate([start.field, start.gradient.ravel()])
        end = np.concatenate([np.asarray(field, float), _slopes(gradient)])
        positions, quaternions = start.positions.copy(), start.quaternions.copy()
        with_gradient = bool(begin[3:].any() or end[3:].any())
        share, step = 0.0, 1.0
        while share < 1.0 and step >= SHORTEST_STEP:
            goal = min(share + step, 1.0)
            found = self._relax(positions, quaternions, (1.0 - goal) * begin + goal * end, with_gradient)
            if found is None:
                step *= 0.5
            else:
                (positions, quaternions), share, step = found, goal, min(2.0 * step, 1.0)
        return self._result(positions, quaternions, share >= 1.0, 1.0 + share, end[:3], end[3:])

    def holds(self, case: Equilibrium) -> bool:
        """Whether a shape is a stable equilibrium of this rod under its loads."""
        loads = np.concatenate([case.field, case.gradient.ravel()])
        found = self._relax(case.positions, case.quaternions, loads, bool(loads[3:].any()))
        if found is None:
            return False
        moved = np.abs(found[0] - case.positions).max() / self.straight()[0][-1, 0]
        return max(moved, np.abs(found[1] - case.quaternions).max()) < HELD

    def relaxed(self, positions, quaternions, field, gradient=None) -> Equilibrium:
        """Equilibrium in ``field`` (3,) T and ``gradient`` (3, 3) T/m in which a shape comes to rest.

        The shape flows down its energy as if there were no inertia and every node were braked by EI/L^3 against
        displacement and EI/L against rotation: implicit Euler steps, as long as they turn no node far, until Newton's
        method converges. A shape that balances on an unstable equilibrium stays there and counts as not reached.
        """
        loads = np.concatenate([np.asarray(field, float), _slopes(gradient)])
        positions, quaternions = positions.copy(), quaternions.copy()
        rate = 1.0  # one over the step
        for _ in range(MOST_FLOWS):
            change = self._flow_step(positions, quaternions, loads, rate)
            largest = np.inf if change is None else self._size(change)
            if not largest <= LARGEST_TURN:
                rate *= 4.0
                continue
            self._move(positions, quaternions, change)
            if largest < SMALL_FLOW:
                found = self._relax(positions, quaternions, loads, bool(loads[3:].any()))
                if found is not None:
                    return self._result(*found, True, 2.0, loads[:3], loads[3:])
                if largest < AT_REST and rate <= 1.0:
                    break
            if largest < 0.5 * LARGEST_TURN:
                rate *= 0.5
        return self._result(positions, quaternions, False, 1.0, loads[:3], loads[3:])

    def _result(self, positions, quaternions, reached, share, field, slopes) -> Equilibrium:
        loads = np.array(field, float), slopes.reshape(3, 3).copy()
        strained = self._strain(positions, quaternions) > LARGEST_STRAIN
        found = bool(reached) and not strained
        case = Equilibrium(positions, quaternions, found, float(share), *loads, strained)
        if found and band_width(self.terms) > BAND and stability.diverges(self._scaled_stiffness(case)):
            return dataclasses.replace(case, reached=False)  # its determinant did not show it: two passed zero at once
        return case

    def _scaled_stiffness(self, case: Equilibrium):
        """Dense stiffness (6 N, 6 N), N m, with displacements over the first element's length."""
        length = np.diff(self.straight()[0][:2, 0])[0]
        scale = np.tile([length] * 3 + [1.0] * 3, self.layout.num_elements)
        return scale[:, None] * self.linearise(case)[0] * scale

    def _strain(self, positions, quaternions) -> float:
        """Largest stretch or squeeze of an element's chord or, of helical elements, SHEAR_SHARE of its shear against
        the middle section; infinite where an element is bent by a half turn or more.
        """
        lengths = np.diff(self.straight()[0][:, 0])
        chords = np.diff(positions, axis=0) / lengths[:, None]
        sizes = np.linalg.norm(chords, axis=1)
        if ((quaternions[1:] * quaternions[:-1]).sum(axis=1) <= 0.0).any():
            return np.inf
        stretch = np.abs(sizes - 1.0).max()
        if self.terms.nodal is not None:
            return float(stretch)
        middle = quaternions[1:] + quaternions[:-1]
        normal = rotation_matrices(middle / np.linalg.norm(middle, axis=1, keepdims=True))[..., 0]
        return float(max(stretch, SHEAR_SHARE * np.linalg.norm(np.cross(normal, chords), axis=1).max()))

    def _flow_step(self, positions, quaternions, loads, rate: float):
        """Change (6 N,) of the degrees of freedom in a step of 1/``rate`` of the flow; None where it has no minimum."""
        residual, band = self._room()
        block, present = self._loaded(loads), PRESENT if loads[3:].any() else None
        terms = self.terms
        assemble(block, self.layout, terms, terms.nodal, present, positions, quaternions, residual, band, 2)
        band[:, BAND - 1] += rate * self._flow
        if factorise(band) != 0:
            return None
        solve_factored(band, residual)
        return residual

    def _room(self):
        size = 6 * self.layout.num_elements
        return np.zeros(size), np.zeros((size, band_width(self.terms)))

    def _loaded(self, loads):
        """The rod's block with gravity and loads (12,): field, T, and gradient, T/m."""
        block = self._block.copy()
        set_loads(block, self.terms, 2.0, self.gravity, loads[:3].copy(), loads[3:].copy())
        return block

    def _relax(self, positions, quaternions, loads, with_gradient: bool):
        """Positions and quaternions of the stable equilibrium near a shape under loads (12,); None where none is."""
        positions, quaternions = positions.copy(), quaternions.copy()
        block, present = self._loaded(loads), PRESENT if with_gradient else None
        room = self._room()
        terms = self.terms
        reached = relax(block, self.layout, terms, terms.nodal, present, positions, quaternions, *room)
        return (positions, quaternions) if reached else None

    def _size(self, change) -> float:
        """Largest rotation (rad) or displacement (over the length) of a change (6 N,) of the degrees of freedom."""
        length = self.straight()[0][-1, 0]
        return float(np.abs(change.reshape(-1, 6) / ([length] * 3 + [1.0] * 3)).max())

    def _move(self, positions, quaternions, change) -> None:
        """Displace and rotate the nodes beyond the clamp, in place."""
        for node, part in enumerate(change.reshape(-1, 6), start=1):
            positions[node] += part[:3]
            turn(quaternions[node], part[3], part[4], part[5])

    def follow(self, case: Equilibrium, field) -> Equilibrium:
        """Equilibrium in ``field`` (3,) T, continued from one nearby; from zero field where that is too far."""
        loads = np.concatenate([np.asarray(field, float), np.zeros(9)])
        found = self._relax(case.positions, case.quaternions, loads, False) if case.reached else None
        return self.equilibrium(field) if found is None else self._result(*found, True, 2.0, loads[:3], loads[3:])

    def linearise(self, case: Equilibrium | None):
        """Dense stiffness and lumped inertia at an equilibrium; None: straight and without load."""
        block = self._block.copy()
        if case is None:
            terms = self.terms._replace(magnets=None, loads=())
            return stability.linearise(block, self.layout, terms, None, *self.straight())
        set_loads(block, self.terms, 2.0, self.gravity, case.field, case.gradient.ravel())
        present = PRESENT if case.gradient.any() else None
        return stability.linearise(block, self.layout, self.terms, present, case.positions, case.quaternions)

    def stable_time_step(self, field_magnitude: float, plane: str | None, pull: float = 0.0) -> float:
        """See ``stability.stable_time_step``."""
        return stability.stable_time_step(self._block, self.layout, self.terms, field_magnitude, plane, pull=pull)

    def stable_time_step_at(self, case: Equilibrium, plane: str | None) -> float:
        """Largest stable step, s, of small motions about an equilibrium."""
        return stability.time_step_bound(*self.linearise(case), plane)

    def working_time_step(self, field_magnitude: float, plane: str | None) -> float:
        """Bound on the step, s, that also covers a swing under gravity and sudden fields up to ``field_magnitude`` T.

        The least of straight, pulled by three times the listed loads, sagging under 2 g and twice these loads, and
        hanging under 3 g, as at the bottom of a swing, all with ``shock_stiffness`` added (docs/physics.md).
        """
        shock = stability.shock_stiffness(self._block, self.layout, self.terms, field_magnitude)
        pulled = self._swung(self.gravity, 3.0)._block
        bound = stability.stable_time_step(pulled, self.layout, self.terms, field_magnitude, plane, shock)
        cases = []
        if self.terms.gravity is not None or self.loads:
            cases.append((2.0 * self.gravity, 2.0))
        if self.terms.gravity is not None:
            cases.append((np.array([3.0 * np.linalg.norm(self.gravity), 0.0, 0.0]), 1.0))
        for gravity, factor in cases:
            swung = self._swung(gravity, factor)
            stiffness, inertia = swung.linearise(swung.equilibrium(np.zeros(3)))
            bound = min(bound, stability.time_step_bound(stiffness + np.diag(shock), inertia, plane))
        return bound

    def _swung(self, gravity, factor: float):
        """The same rod under another gravity (3,) m/s^2 and a multiple of the listed loads."""
        swung = copy.copy(self)
        swung.gravity, swung._block = gravity, self._block.copy()
        stability.set_gravity(swung._block, self.terms, gravity)
        swung._write_loads(rows_of(swung._block[None], len(LANES))[0], factor)
        return swung


def _slopes(gradient) -> np.ndarray:
    """A gradient (3, 3) T/m, or None, as the kernels take it, (9,)."""
    return np.zeros(9) if gradient is None else np.array(gradient, float).ravel()
