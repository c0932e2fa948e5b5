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
LARGEST_TURN = 0.5  # rad, about, by which one step may bend a rod
DAMPING = 1e-6  # of the square of the largest singular value: no step along directions that hardly move the point
CLOSE = 0.1  # of the tolerance: near enough to stop
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

    Every target takes steps of its own: a step that brings its point no nearer, or loses stability, is halved.
    """
    fields, loads = start.copy(), np.zeros((len(targets), 12))
    loads[:, :3] = _acting(rods, fields, which)
    shapes = rods.equilibria(loads, which)
    if not shapes.reached.all():
        fields[~shapes.reached], loads[~shapes.reached] = 0.0, 0.0
        shapes = rods.equilibria(loads, which)
        if not shapes.reached.all():
            from_rest = "rods must bear their own weight for inverse statics, but some buckle before any field acts: "
            raise StabilityError(from_rest + "make the rod shorter or stiffer, or let it hang another way.")
    misses = targets - shapes.positions[:, node]
    shares, active = np.ones(len(targets)), np.linalg.norm(misses, axis=1) > CLOSE * tolerance
    steps = np.zeros_like(fields)
    fresh = active.copy()
    for _ in range(MOST_ITERATIONS):
        now = np.flatnonzero(active)
        if not len(now):
            break
        new = np.flatnonzero(active & fresh)
        if len(new):
            slopes = static_jacobian(rods, which[new], _some(shapes, new), loads[new], (node,))[:, 0]
            steps[new] = _least_steps(slopes, misses[new], rods, limit)
        tried = fields[now] + shares[now, None] * steps[now]
        size = np.linalg.norm(tried, axis=1, keepdims=True)
        tried *= np.minimum(1.0, limit / np.maximum(size, 1e-300))
        trial = loads[now].copy()
        trial[:, :3] = _acting(rods, tried, which[now])
        found = rods.equilibria(trial, which[now], _some(shapes, now))
        miss = targets[now] - found.positions[:, node]
        far, before = np.linalg.norm(miss, axis=1), np.linalg.norm(misses[now], axis=1)
        better = found.reached & (far < before)
        for k, good in zip(now, better, strict=True):
            shares[k] = min(1.0, 2.0 * shares[k]) if good else 0.25 * shares[k]
        accepted = now[better]
        fields[accepted], loads[accepted], misses[accepted] = tried[better], trial[better], miss[better]
        for old, fresh_shapes in zip(shapes, found, strict=True):
            old[accepted] = fresh_shapes[better]
        fresh[now] = better
        slow = better & (far > (1.0 - STALLED) * before)
        done = (better & (far <= CLOSE * tolerance)) | slow | (shares[now] < 1e-4)
        active[now[done]] = False
    positions = shapes.positions[:, node].copy()
    distances = np.linalg.norm(targets - positions, axis=1)
    return InverseStatics(fields, distances <= tolerance, distances, positions)


def _acting(rods: Rods, fields: np.ndarray, which: np.ndarray) -> np.ndarray:
    return fields if rods.mixing is None else rotate(rods.mixing[which], fields)


def _some(shapes: Shapes, which: np.ndarray) -> Shapes:
    return Shapes(*(part[which] for part in shapes))


def _least_steps(slopes: np.ndarray, misses: np.ndarray, rods: Rods, limit: float) -> np.ndarray:
    """Steps of least norm, T, (M, 3), towards the misses (M, 3) m by slopes (M, 3, 3) m/T, none of which bends a rod
    far.
    """
    left, sizes, right = np.linalg.svd(slopes)
    along = np.einsum("mij,mi->mj", left, misses)
    parts = along * sizes / (sizes**2 + DAMPING * sizes[:, :1] ** 2)
    steps = np.einsum("mj,mji->mi", parts, right)
    length = float(rods.model.values.ends[-1])
    turns = np.linalg.norm(np.einsum("mij,mj->mi", slopes, steps), axis=1) / (0.5 * length)
    size = np.linalg.norm(steps, axis=1)
    shrink = np.minimum(1.0, LARGEST_TURN / np.maximum(turns, 1e-300))
    shrink = np.minimum(shrink, 0.5 * limit / np.maximum(size, 1e-300))
    return steps * shrink[:, None]
