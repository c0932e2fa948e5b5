"""The owner of a batch of rods of one make: their state, what differs from rod to rod, the field, and their statics.

`Simulation`, environments and estimators stand on it. It checks nothing that a user gives; they do.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import ArrayLike

from magrod_env._jit import Bound
from magrod_env.rod.batch import PLANE_AXES, RodBatch
from magrod_env.rod.equilibrium import Shapes, StaticModel
from magrod_env.rod.loads.hub import first_rows
from magrod_env.rod.mesh import arc_lengths
from magrod_env.rod.parameters import RodParameters, write_parameters
from magrod_env.rod.placing import lay_rods
from magrod_env.rod.state import BatchState
from magrod_env.rotations import rotate, rotation_matrices_of_vectors
from magrod_env.simulation.integrators import SHARES
from magrod_env.simulation.model import RodModel
from magrod_env.simulation.state import RodState


class Rods:
    """Rods that share a model, in lanes.

    Args:
        model: their make.
        num_rods: how many.
        precision: "float64" or "float32".
        plane: None, "xy" or "xz".
        slew, lag, turned: what the drive of the coils does in the kernel (see `RodBatch`).
        num_threads: threads that share the batch.
    """

    def __init__(
        self,
        model: RodModel,
        *,
        num_rods: int,
        precision: str = "float64",
        plane: str | None = None,
        slew: bool = False,
        lag: bool = False,
        turned: bool = False,
        num_threads: int | None = None,
    ) -> None:
        self.model, self.num_rods, self.plane, self.precision = model, num_rods, plane, precision
        self.batch = RodBatch(
            model.values,
            model.segments,
            num_rods=num_rods,
            num_elements=model.num_elements,
            nodal=model.nodal,
            precision=precision,
            plane=plane,
            **model.terms,
            slew=slew,
            lag=lag,
            turned=turned,
            num_threads=num_threads,
        )
        self.motion = BatchState(self.batch)
        self.parameters = model.nominal(num_rods)
        self.load_rows: dict[int, np.ndarray] = {}  # (num_rods, rows) of loads that differ, in space
        self.mixing: np.ndarray | None = None  # (num_rods, 3, 3), from commanded to acting field, where they differ
        self.varied = False  # whether any rod differs from the nominal one
        inside = PLANE_AXES[plane]
        self.axes = (*inside, *({0, 1, 2} - set(inside)))
        self._write, self._write_static, self._lay = Bound(write_parameters), Bound(write_parameters), Bound(lay_rods)

    # ---- what differs from rod to rod

    def set_parameters(self, values: Mapping[str, np.ndarray], rods: np.ndarray | None = None) -> None:
        """Set parameters of some rods (all: None) by their names in `RodParameters`, each (M,) or (M, 3).

        Angular velocities stay as they are where the inertia changes.
        """
        rods = np.arange(self.num_rods) if rods is None else rods
        spins = self.motion.angular_velocities if "density" in values or "magnet_shift" in values else None
        if not values:
            return
        for name, value in values.items():
            getattr(self.parameters, name)[rods] = value
        self.varied = True
        self.write(rods)
        if spins is not None:
            self.motion.set_momenta(self.motion.momenta_of(spins))

    def set_load(self, number: int, rods: np.ndarray, values: Mapping[str, ArrayLike]) -> None:
        """Give some rods (M,) values of their own of one of the listed loads, by the names of its fields."""
        load = self.batch.loads[number]
        if number not in self.load_rows:
            self.load_rows[number] = load.rows(None, self.num_rods)
        own = load.rows(None, len(rods), **values)
        self.batch.write_load(number, rods, **values)
        self.load_rows[number][rods] = own
        self.varied = True

    def write(self, rods: np.ndarray) -> None:
        """Write the constants of some rods (M,) into the batch after their parameters have changed."""
        batch, model = self.batch, self.model
        self._write(
            batch.rows,
            batch.layout,
            model.counts,
            model.values,
            batch.terms.planar,
            batch.terms.nodal,
            self.axes,
            self.parameters,
            rods,
            rods,
        )

    def turn_field(self, rotations: np.ndarray | None, gains: np.ndarray | None, rods: np.ndarray) -> None:
        """From now on turn the commanded field of some rods by rotation vectors (M, 3) rad and scale it by gains (M,);
        None leaves what was.
        """
        if self.mixing is None:
            self.mixing = np.tile(np.eye(3), (self.num_rods, 1, 1))
        before = self.mixing[rods]
        size = np.linalg.norm(before[:, :, 0], axis=1)
        turns = before / size[:, None, None] if rotations is None else rotation_matrices_of_vectors(rotations)
        self.mixing[rods] = (size if gains is None else gains)[:, None, None] * turns

    def kept_parameters(self) -> tuple[RodParameters, np.ndarray | None, bool]:
        """What `restore_parameters` takes."""
        mixing = None if self.mixing is None else self.mixing.copy()
        return RodParameters(*(value.copy() for value in self.parameters)), mixing, self.varied

    def restore_parameters(self, kept: tuple[RodParameters, np.ndarray | None, bool], rods: np.ndarray) -> None:
        """Go back to parameters as they were before those of some rods (M,) were set."""
        values, self.mixing, varied = kept
        self.set_parameters({name: getattr(values, name)[rods] for name in values._fields}, rods)
        self.varied = varied

    def acting(self, fields: np.ndarray) -> np.ndarray:
        """Fields that act, T, where (..., num_rods, 3) are commanded; what leaves the plane of planar rods is left out
        by the batch.
        """
        return fields if self.mixing is None else rotate(self.mixing, fields)

    def acting_gradient(self, gradients: np.ndarray) -> np.ndarray:
        """The same for gradients (num_rods, 3, 3) T/m."""
        if self.mixing is None:
            return gradients
        turn = self.mixing / np.linalg.norm(self.mixing[:, :, 0], axis=1)[:, None, None]
        return np.einsum("rij,rjk,rlk->ril", self.mixing, gradients, turn)

    @property
    def largest_gain(self) -> float:
        """The largest factor by which a commanded field is scaled."""
        return 1.0 if self.mixing is None else float(np.linalg.norm(self.mixing[:, :, 0], axis=1).max())

    @property
    def softness(self) -> float:
        """The largest factor by which moments of a rod's magnets over its stiffness exceed those of the nominal one; at
        least that of its stiffness alone.
        """
        if not self.varied:
            return 1.0
        return float((np.maximum(self.parameters.moment, 1.0) / self.parameters.modulus).max())

    @property
    def limit(self) -> StaticModel:
        """Statics of a rod whose largest stable step no rod of the batch falls below."""
        return self.model.extreme(self.parameters) if self.varied else self.model.static

    @property
    def arc_lengths(self) -> np.ndarray:
        """Arc length of every node, m: (num_nodes,), or (num_rods, num_nodes) where magnets are shifted."""
        shifts = self.parameters.magnet_shift
        if not shifts.any():
            return arc_lengths(self.model.values.ends, self.model.counts)
        return np.stack([self.arc_lengths_of(rod) for rod in range(self.num_rods)])

    def arc_lengths_of(self, rod: int) -> np.ndarray:
        """The same of one rod, (num_nodes,)."""
        ends = self.model.values.ends.copy()
        ends[:-1] += self.parameters.magnet_shift[rod]
        return arc_lengths(ends, self.model.counts)

    # ---- running

    def run(self, num_steps: int, time_step: float, integrator: str, fields: np.ndarray | None = None) -> None:
        """Step all rods, under acting fields (num_steps, num_rods, 3) T of the steps' middles or the present one."""
        table = None if fields is None else self.batch.field_table(fields)
        if integrator == "explicit":
            self.batch.run(num_steps, time_step, fields=table)
        else:
            self.batch.run_implicit(num_steps, time_step, SHARES[integrator], table)

    def repeated(self, rods: np.ndarray) -> Rods:
        """New rods in float64 with the parameters of some of these (M,), straight and at rest."""
        new = Rods(
            self.model,
            num_rods=len(rods),
            plane=self.plane,
            num_threads=self.batch.num_threads,
        )
        if self.varied:
            new.set_parameters({name: getattr(self.parameters, name)[rods] for name in self.parameters._fields})
        for number, own in self.load_rows.items():
            first = first_rows(self.batch.layout, self.batch.loads)[number]
            new.batch.scatter(first, self.batch.gather(first, own.shape[1])[rods])
            new.load_rows[number] = own[rods]
        new.mixing = None if self.mixing is None else self.mixing[rods]
        return new

    # ---- statics

    def static_blocks(self, rods: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Lane blocks of some rods (M,) for statics, and a view of their rows (num_blocks, rows, L)."""
        model, static = self.model, self.model.static
        if not self.varied:
            return static.blocks(np.broadcast_to(static.column, (len(rods), static.layout.size)))
        blocks, rows = static.blocks(np.broadcast_to(static.column, (len(rods), static.layout.size)))
        lanes = np.arange(len(blocks) * rows.shape[2])
        self._write_static(
            rows,
            static.layout,
            model.counts,
            model.values,
            None,
            static.terms.nodal,
            (0, 1, 2),
            self.parameters,
            rods[np.minimum(lanes, len(rods) - 1)],
            lanes,
        )
        firsts = first_rows(static.layout, static.loads) if self.load_rows else []
        for number, own in self.load_rows.items():
            full = own[rods[np.minimum(lanes, len(rods) - 1)]].reshape(len(blocks), -1, own.shape[1])
            rows[:, firsts[number] : firsts[number] + own.shape[1]] = full.transpose(0, 2, 1)
        return blocks, rows

    def columns(self, rods: np.ndarray) -> np.ndarray | None:
        """Constants of some rods (M,) as their statics take them, (M, rows); None where none differs."""
        if not self.varied:
            return None
        _, rows = self.static_blocks(rods)
        return np.ascontiguousarray(rows.transpose(0, 2, 1)).reshape(-1, rows.shape[1])[: len(rods)]

    def column(self, rod: int) -> np.ndarray | None:
        """The same for one rod, (rows,)."""
        columns = self.columns(np.array([rod]))
        return None if columns is None else columns[0]

    def equilibria(self, loads: np.ndarray, rods: np.ndarray, start: Shapes | None = None) -> Shapes:
        """Equilibria of some rods (M,) under acting fields and gradients (M, 12) T, T/m; from poses near them, or from
        the straight rod.
        """
        return self.model.static.solve(loads, self.columns(rods), start, share=self.batch.share_out)

    def lay(self, rods: np.ndarray, positions: np.ndarray, quaternions: np.ndarray) -> None:
        """Put some rods (M,) at rest into poses (M, num_nodes, 3) m and (M, num_nodes, 4)."""
        batch = self.batch
        self._lay(batch.rows, batch.layout, batch.terms.planar, self.axes, rods, positions, quaternions)

    # ---- state

    def state(self) -> RodState:
        """Everything that changes as time goes on, but for commands and clocks of those above."""
        return RodState.of(self.batch)

    def set_state(self, state: RodState, rods: np.ndarray | None = None) -> None:
        """Put some rods (all: None) into states: one for all, or one for each."""
        state.write(self.batch, rods)
