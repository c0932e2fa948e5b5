"""The state of rods as a value: taken, kept, changed, given back."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from magrod_env.rod.batch import RodBatch
from magrod_env.rod.layout import DRAG, ENERGY, FIELD, LEAST_COSINE, PLANAR, SPATIAL, NodeRows
from magrod_env.rod.planes import (
    quaternions_in_plane,
    quaternions_in_space,
    spins_in_plane,
    spins_in_space,
    vectors_in_plane,
    vectors_in_space,
)
from magrod_env.rotations import rotation_matrices

_LOADS = DRAG - FIELD  # rows of field, command and gradient
_WATCH = ENERGY + 1 - LEAST_COSINE
_ARRAYS = ("nodes", "loads", "watch", "status", "travel", "compliance", "field", "gradient")


@dataclass(frozen=True, eq=False)
class RodState:
    """States of K rods as their kernel holds them, so that a run goes on from them bit for bit.

    It can be pickled, indexed (``state[3]``, ``state[:8]``) and stacked (`RodState.stack`). Positions and motion are
    properties; arrays are not meant to be changed in place.

    Args:
        nodes: (K, num_nodes, 13 or, in a plane, 7) position, rotation, velocity and angular momentum of every node.
        loads: (K, 18) acting field (T), command of the drive, acting gradient (T/m).
        watch: (K, 2) least cosine of half a bend, least energy (J): the watchdog's.
        status: (K,) as in `Simulation.status`.
        travel: (K,) T, by which the field has moved since the watchdog looked.
        compliance: (K, num_nodes, 3) 1/(2 J) about the body axes, 1/(kg m^2).
        field: (K, 3) T, commanded.
        gradient: (K, 3, 3) T/m, commanded.
        plane: None, "xy" or "xz".
        time: s, of the simulation that it was taken from.
        made_with: the scene and arguments of the simulation; None from elsewhere.
    """

    nodes: np.ndarray
    loads: np.ndarray
    watch: np.ndarray
    status: np.ndarray
    travel: np.ndarray
    compliance: np.ndarray
    field: np.ndarray
    gradient: np.ndarray
    plane: str | None
    time: float = 0.0
    made_with: Mapping[str, object] | None = None

    @classmethod
    def of(cls, batch: RodBatch) -> RodState:
        """The state of all rods of a batch."""
        nodes = _nodes(batch)
        count = batch.num_rods
        rows = batch.rows
        loads = rows[:, FIELD : FIELD + _LOADS].transpose(0, 2, 1).reshape(-1, _LOADS)[:count]
        watch = rows[:, LEAST_COSINE : LEAST_COSINE + _WATCH].transpose(0, 2, 1).reshape(-1, _WATCH)[:count]
        moving = batch.node_rows.inverse_mass
        every = nodes.transpose(0, 3, 1, 2).reshape(-1, nodes.shape[1], nodes.shape[2])[:count]
        last = 2 if batch.plane is None else 1
        soft = every[..., batch.node_rows.compliance : batch.node_rows.compliance + last].astype(float)
        return cls(
            nodes=every[..., :moving].copy(),
            loads=loads.copy(),
            watch=watch.copy(),
            status=batch.status.copy(),
            travel=batch.travel.copy(),
            compliance=soft[..., [0, 1, 1] if last == 2 else [0, 0, 0]],
            field=np.zeros((count, 3)),
            gradient=np.zeros((count, 3, 3)),
            plane=batch.plane,
        )

    def write(self, batch: RodBatch, rods: np.ndarray | None = None) -> None:
        """Put rods (M,; None for all) of a batch into these states: one for all, or one for each."""
        nodes, moving = _nodes(batch), batch.node_rows.inverse_mass
        loads = batch.rows[:, FIELD : FIELD + _LOADS]
        watch = batch.rows[:, LEAST_COSINE : LEAST_COSINE + _WATCH]
        if rods is None and len(self) == 1:
            nodes[:, :, :moving] = self.nodes[0, :, :, None]
            loads[:] = self.loads[0, :, None]
            watch[:] = self.watch[0, :, None]
            batch.status[:], batch.travel[:] = self.status[0], self.travel[0]
            return
        if rods is None:  # blocks are filled up with the last rod
            rods = np.arange(len(nodes) * batch.width)
        which = np.minimum(np.arange(len(rods)), len(self) - 1)
        block, lane = rods // batch.width, rods % batch.width
        nodes[block, :, :moving, lane] = self.nodes[which]
        loads[block, :, lane], watch[block, :, lane] = self.loads[which], self.watch[which]
        real = rods < batch.num_rods
        batch.status[rods[real]], batch.travel[rods[real]] = self.status[which[real]], self.travel[which[real]]

    def __len__(self) -> int:
        return len(self.nodes)

    def __getitem__(self, rods: object) -> RodState:
        """The states of some rods: an index, a slice or an array of indices."""
        keep = np.atleast_1d(np.arange(len(self))[rods])  # type: ignore[call-overload]
        return self._with({name: getattr(self, name)[keep] for name in _ARRAYS})

    @classmethod
    def stack(cls, states: Sequence[RodState]) -> RodState:
        """States one after another; time and origin are those of the first."""
        return states[0]._with({name: np.concatenate([getattr(one, name) for one in states]) for name in _ARRAYS})

    def _with(self, arrays: Mapping[str, np.ndarray]) -> RodState:
        return RodState(**arrays, plane=self.plane, time=self.time, made_with=self.made_with)

    # ---- what it says

    def _part(self, name: str) -> np.ndarray:
        """One of a node's quantities as the kernel has it."""
        first = getattr(self._rows, name)
        last = min(row for row in (*self._rows[:4], self._rows.inverse_mass) if row > first)
        return self.nodes[..., first:last].astype(float)

    @property
    def _rows(self) -> NodeRows:
        return SPATIAL if self.plane is None else PLANAR

    @property
    def positions(self) -> np.ndarray:
        """m, world, (K, num_nodes, 3)."""
        return vectors_in_space(self._part("position"), self.plane)

    @property
    def quaternions(self) -> np.ndarray:
        """Rotations of the sections, body to world, scalar first, (K, num_nodes, 4)."""
        return quaternions_in_space(self._part("rotation"), self.plane)

    @property
    def rotations(self) -> np.ndarray:
        """Rotation matrices of the sections, body to world, (K, num_nodes, 3, 3)."""
        return rotation_matrices(self.quaternions)

    @property
    def tip_position(self) -> np.ndarray:
        """m, world, (K, 3)."""
        return self.positions[:, -1].copy()

    @property
    def velocities(self) -> np.ndarray:
        """m/s, world, (K, num_nodes, 3)."""
        return vectors_in_space(self._part("velocity"), self.plane)

    @property
    def angular_velocities(self) -> np.ndarray:
        """rad/s, body frame, (K, num_nodes, 3)."""
        return spins_in_space(self._part("momentum"), self.plane) * (2.0 * self.compliance)

    def replace(
        self,
        *,
        positions: ArrayLike | None = None,
        quaternions: ArrayLike | None = None,
        velocities: ArrayLike | None = None,
        angular_velocities: ArrayLike | None = None,
    ) -> RodState:
        """The same with some of these instead, shapes and units as in the properties; the clamp's are ignored.

        The watchdog takes the energy anew.
        """
        nodes, watch, rows, plane = self.nodes.copy(), self.watch.copy(), self._rows, self.plane
        free = slice(1, None)
        if positions is not None:
            nodes[:, free, : rows.rotation] = vectors_in_plane(np.asarray(positions, float)[:, free], plane)
        if quaternions is not None:
            turned = quaternions_in_plane(np.asarray(quaternions, float)[:, free], plane)
            nodes[:, free, rows.rotation : rows.velocity] = turned
        if velocities is not None:
            moved = vectors_in_plane(np.asarray(velocities, float)[:, free], plane)
            nodes[:, free, rows.velocity : rows.momentum] = moved
        if angular_velocities is not None:
            spins = np.asarray(angular_velocities, float)[:, free] / (2.0 * self.compliance[:, free])
            nodes[:, free, rows.momentum : rows.inverse_mass] = spins_in_plane(spins, plane)
        watch[:] = (1.0, np.inf)
        return dataclasses.replace(self, nodes=nodes, watch=watch, status=np.zeros_like(self.status))


def _nodes(batch: RodBatch) -> np.ndarray:
    """View of the nodes of a batch, (num_blocks, num_nodes, rows, L)."""
    layout = batch.layout
    return batch.rows[:, layout.nodes : layout.elements].reshape(len(batch.rows), -1, batch.node_rows.size, batch.width)


def check_state(
    state: object, batch: RodBatch, made_with: Mapping[str, object], num_rods: int, *, exactly: bool = False
) -> None:
    """Refuse what is no state of a simulation made with these, or of another number of rods than 1 and `num_rods`.

    Raises:
        ValueError: if it is so.
    """
    if not isinstance(state, RodState) or state.made_with is None:
        raise ValueError(
            f"state must be what state() returned, but got {type(state).__name__}: take one of this simulation."
        )
    _check_origin(state.made_with, made_with)
    count = len(state)
    if count != num_rods and (exactly or count != 1):
        raise ValueError(
            f"state must be of one rod or of {num_rods}, but is of {count}: index it, state[0], or choose rods."
        )
    num_nodes = batch.layout.num_elements + 1
    double, single = np.dtype(np.float64), batch.dtype
    parts = (
        ("nodes", state.nodes, (count, num_nodes, batch.node_rows.inverse_mass), single),
        ("loads", state.loads, (count, _LOADS), single),
        ("watch", state.watch, (count, _WATCH), single),
        ("status", state.status, (count,), np.dtype(np.int64)),
        ("travel", state.travel, (count,), double),
        ("compliance", state.compliance, (count, num_nodes, 3), double),
        ("field", state.field, (count, 3), double),
        ("gradient", state.gradient, (count, 3, 3), double),
    )
    for name, value, shape, kind in parts:
        fits = isinstance(value, np.ndarray) and value.shape == shape and value.dtype == kind
        if not fits or (name in ("loads", "field", "gradient", "travel") and not np.isfinite(value).all()):
            raise ValueError(
                f"{name} of a state must be finite, {kind}, of shape {shape}, but got "
                f"{f'{value.dtype} of shape {value.shape}' if isinstance(value, np.ndarray) else repr(value)}: "
                "do not change a state but by replace()."
            )
    if not isinstance(state.time, float) or not (math.isfinite(state.time) and state.time >= 0.0):
        raise ValueError(f"time of a state must be a finite time in seconds, but got {state.time!r}: take another one.")


def _check_origin(theirs: Mapping[str, object], own: Mapping[str, object]) -> None:
    if theirs is own or theirs == own:
        return
    name = next((name for name, value in own.items() if theirs.get(name) != value), "origin")
    values = "" if name == "scene" else f" ({theirs.get(name)!r}, here {own.get(name)!r})"
    raise ValueError(
        f"state must come from a simulation of the same scene and settings, but its {name} differs{values}: "
        "take one of this simulation, or give both the same arguments."
    )
