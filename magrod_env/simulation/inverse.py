"""Fields that hold rods where one wants them, and how equilibria move with the field; many at once, in lanes."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from magrod_env._jit import PRESENT
from magrod_env.rod.equilibrium import Shapes
from magrod_env.rod.internal import field_sensitivity
from magrod_env.rod.layout import FIELD, GRADIENT
from magrod_env.rotations import rotate
from magrod_env.simulation.errors import StabilityError
from magrod_env.simulation.rods import Rods

MOST_ITERATIONS = 40
LARGEST_TURN = 1.0  # first radius of the steps, over EI/(moment * length)
DAMPING = 1e-6  # of the square of the largest singular value: no step along directions that hardly move the point
CLOSE = 0.1  # of the tolerance: near enough to stop
WAYPOINTS, COARSE = 8, 0.02  # of a second approach, and how near to each, of the way
LEAST_RADIUS = 1e-5  # of the steps, over the same
DAMPING_ITERATIONS = 6
STALLED = 1e-3  # of the distance: progress below which a target counts as out of reach


@dataclass(frozen=True, eq=False)
class InverseStatics:
    """Fields for M targets.

    Args:
        fields: T, world, (M, 3), as they are to be commanded.
        reached: whether the point is held at the target to the tolerance, (M,).
        distances: from the target to where the point is held, m, (M,).
        positions: where it is held, m, (M, 3).
    """

    fields: np.ndarray
    reached: np.ndarray
    distances: np.ndarray
    positions: np.ndarray


def static_jacobian(
    rods: Rods, which: np.ndarray, shapes: Shapes, loads: np.ndarray, nodes: tuple[int, ...]
) -> np.ndarray:
    """Derivatives of the positions of `nodes` by the *commanded* field at equilibria of rods `which` (M,), m/T,
    (M, len(nodes), 3, 3); `loads` (M, 12) act.
    """
    static = rods.model.static
    blocks, rows = rods.static_blocks(which)
    static.put(rows, shapes.positions, shapes.quaternions)
    width = rows.shape[2]
    full = loads[np.minimum(np.arange(len(blocks) * width), len(loads) - 1)].reshape(len(blocks), width, 12)
    rows[:, FIELD : FIELD + 3] = full[..., :3].transpose(0, 2, 1)
    rows[:, GRADIENT : GRADIENT + 9] = full[..., 3:].transpose(0, 2, 1)
    terms = static.terms._replace(gradient=PRESENT if loads[:, 3:].any() else None)
    out = np.zeros((len(blocks), 9 * len(nodes) * width))
    rods.batch.share_out(field_sensitivity, blocks, static.layout, terms, np.ones(2 * width), np.array(nodes), out)
    slopes = out.reshape(len(blocks), len(nodes), 3, 3, width).transpose(0, 4, 1, 2, 3)
    slopes = slopes.reshape(-1, len(nodes), 3, 3)[: len(which)]
    return slopes if rods.mixing is None else slopes @ rods.mixing[which][:, None]


def inverse_statics(
    rods: Rods,
    targets: np.ndarray,
    which: np.ndarray,
    node: int,
    start: np.ndarray,
    limit: float,
    tolerance: float,
) -> InverseStatics:
    """Fields that hold a node of rods `which` (M,) at targets (M, 3) m, from fields `start` (M, 3) T on, none stronger
    than `limit` (T); see `Simulation.inverse_statics`.

    Targets that are not reached at once are approached again from rest, along a straight line in WAYPOINTS pieces.
    """
    search = _Search(rods, which, node, start, limit)
    search.approach(targets, np.arange(len(targets)), tolerance)
    missed = np.flatnonzero(search.distances(targets) > tolerance)
    if len(missed):
        again = _Search(rods, which[missed], node, np.zeros((len(missed), 3)), limit)
        rest, every = again.points.copy(), np.arange(len(missed))
        for k in range(1, WAYPOINTS + 1):
            goals = rest + k / WAYPOINTS * (targets[missed] - rest)
            again.approach(goals, every, tolerance if k == WAYPOINTS else COARSE * np.abs(goals - rest).max())
        better = again.distances(targets[missed]) < search.distances(targets)[missed]
        search.take(missed[better], again, better)
    distances = search.distances(targets)
    return InverseStatics(search.fields, distances <= tolerance, distances, search.points)


class _Search:
    """Equilibria of rods `which` (M,) in fields that are moved until a node is at a target."""

    def __init__(self, rods: Rods, which: np.ndarray, node: int, start: np.ndarray, limit: float) -> None:
        self.rods, self.which, self.node, self.limit = rods, which, node, limit
        moments = np.linalg.norm(rods.model.values.magnet_moments, axis=1).sum()
        self.stiffness = rods.model.values.bending / float(moments * rods.model.values.ends[-1])  # T
        self.fields, self.loads = start.copy(), np.zeros((len(which), 12))
        self.loads[:, :3] = _acting(rods, self.fields, which)
        self.shapes = rods.equilibria(self.loads, which)
        lost = ~self.shapes.reached
        if lost.any():
            self.fields[lost], self.loads[lost] = 0.0, 0.0
            self.shapes = rods.equilibria(self.loads, which)
        if not self.shapes.reached.all():
            raise StabilityError(
                "rods must bear their own weight for inverse statics, but some buckle before any field acts: make the "
                "rod shorter or stiffer, or let it hang another way."
            )

    @property
    def points(self) -> np.ndarray:
        """Where the node is, m, (M, 3)."""
        return self.shapes.positions[:, self.node]

    def distances(self, targets: np.ndarray) -> np.ndarray:
        """From the node to targets (M, 3) m, (M,)."""
        return np.linalg.norm(targets - self.points, axis=1)

    def take(self, which: np.ndarray, other: _Search, theirs: np.ndarray) -> None:
        """Take over what another search has found."""
        self.fields[which] = other.fields[theirs]
        for part, new in zip(self.shapes, other.shapes, strict=True):
            part[which] = new[theirs]

    def approach(self, targets: np.ndarray, active: np.ndarray, tolerance: float) -> None:
        """Move the fields of the searches `active` until their nodes are nearer than the tolerance, or come no nearer.

        Every target takes steps of its own (Levenberg and Marquardt), no longer than a radius that doubles after a
        step that brings the point nearer, and falls to a quarter after one that does not or that loses stability.
        """
        radius = np.full(len(targets), LARGEST_TURN * self.stiffness)
        slopes, fresh = np.zeros((len(targets), 3, 3)), np.ones(len(targets), bool)
        active = active[self.distances(targets)[active] > CLOSE * tolerance]
        for _ in range(MOST_ITERATIONS):
            if not len(active):
                return
            new = active[fresh[active]]
            if len(new):
                shapes = _some(self.shapes, new)
                found = static_jacobian(self.rods, self.which[new], shapes, self.loads[new], (self.node,))
                slopes[new] = found[:, 0]
            steps = _steps(slopes[active], targets[active] - self.points[active], radius[active])
            far, before = self._try(targets, active, steps)
            better = far < before
            radius[active] = np.where(better, 2.0, 0.25) * radius[active]
            fresh[active] = better
            done = better & ((far <= CLOSE * tolerance) | (far > (1.0 - STALLED) * before))
            active = active[~(done | (radius[active] < LEAST_RADIUS * self.stiffness))]

    def _try(self, targets: np.ndarray, active: np.ndarray, steps: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Take the steps that bring points nearer; distances after each, infinite where unstable, and before."""
        tried = self.fields[active] + steps
        size = np.linalg.norm(tried, axis=1, keepdims=True)
        tried *= np.minimum(1.0, self.limit / np.maximum(size, 1e-300))
        loads = self.loads[active].copy()
        loads[:, :3] = _acting(self.rods, tried, self.which[active])
        found = self.rods.equilibria(loads, self.which[active], _some(self.shapes, active))
        before = self.distances(targets)[active]
        far = np.linalg.norm(targets[active] - found.positions[:, self.node], axis=1)
        far = np.where(found.reached, far, np.inf)
        better = far < before
        accepted = active[better]
        self.fields[accepted], self.loads[accepted] = tried[better], loads[better]
        for part, new in zip(self.shapes, found, strict=True):
            part[accepted] = new[better]
        return far, before


def _acting(rods: Rods, fields: np.ndarray, which: np.ndarray) -> np.ndarray:
    return fields if rods.mixing is None else rotate(rods.mixing[which], fields)


def _some(shapes: Shapes, which: np.ndarray) -> Shapes:
    return Shapes(*(part[which] for part in shapes))


def _steps(slopes: np.ndarray, misses: np.ndarray, radius: np.ndarray) -> np.ndarray:
    """Steps, T, (M, 3), towards the misses (M, 3) m by slopes (M, 3, 3) m/T: of least norm where they are short, else
    damped until none is longer than its radius (M,), T.
    """
    left, sizes, right = np.linalg.svd(slopes)
    along = np.einsum("mij,mi->mj", left, misses) * sizes
    squares, damping = sizes**2, DAMPING * sizes[:, 0] ** 2
    for _ in range(DAMPING_ITERATIONS):  # Hebden's iteration on 1/|step|
        parts = along / (squares + damping[:, None])
        norm = np.linalg.norm(parts, axis=1)
        slope = (parts**2 / (squares + damping[:, None])).sum(axis=1)
        change = norm**2 * (norm / radius - 1.0) / np.maximum(slope, 1e-300)
        damping = np.where(norm > radius, damping + np.maximum(change, 0.0), damping)
    steps = np.einsum("mj,mji->mi", along / (squares + damping[:, None]), right)
    return steps * np.minimum(1.0, radius / np.maximum(np.linalg.norm(steps, axis=1), 1e-300))[:, None]
