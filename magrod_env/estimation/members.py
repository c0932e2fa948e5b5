"""Many guesses of one rod as lanes of one simulation, each with its own stiffness, drag, moment, field and load."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np

from magrod_env.estimation.coordinates import nodes_of, strains_of
from magrod_env.estimation.modes import slow_modes
from magrod_env.estimation.unknowns import Unknown, Unknowns
from magrod_env.rod.batch import PLANE_AXES
from magrod_env.rod.layout import GRAVITY
from magrod_env.rotations import rotate, rotation_matrices_of_vectors
from magrod_env.scene import Scene
from magrod_env.simulation import Simulation, SimulationDiverged, StabilityError

QUIET = 100.0  # 1/s: spin drag where the scene has none, against ringing sections; brakes slow modes by < 0.1 /s
HEADROOM = 3.0  # standard deviations of stiffness and moment for which the time step is chosen beforehand


class Rest(NamedTuple):
    """What the slow coordinates of members leave out."""

    strains: np.ndarray  # (K, N, 6)
    motion: np.ndarray  # (K, N, 6) velocities and angular velocities of the free nodes


class Members:
    """`num_members` guesses of each of `num_rods` rods; member m of rod r is lane ``r * num_members + m``.

    A filter sees a member's motion as its slow coordinates (`modes`) and leaves the rest of it alone. Its parameters
    are a row of `Unknowns`.

    Args:
        scene: of the rods.
        unknowns: parameters that differ from member to member, as in `Unknowns`.
        num_rods, num_members: size of the batch.
        num_modes: slow modes, as in `modes.slow_modes`.
        settings: of the `Simulation`; `time_step` is that of the nominal rod, stiffer members shorten it.
        on_failure: "raise" where a member fails, or only note its rod in `failed`.
    """

    def __init__(
        self,
        scene: Scene,
        unknowns: Mapping[str, Unknown | float],
        num_rods: int,
        num_members: int,
        num_modes: int,
        settings: dict[str, Any],
        on_failure: str = "raise",
    ) -> None:
        self.on_failure = on_failure
        self.failed = np.zeros(num_rods, bool)
        loaded = scene if scene.gravity is not None else scene.replace(gravity=(0.0, 0.0, 0.0))
        if scene.spin_drag_rate is None:
            loaded = loaded.replace(spin_drag_rate=QUIET)
        self.simulation = Simulation(loaded, num_rods=num_rods * num_members, on_failure="report", **settings)
        self.shape = (num_rods, num_members)
        self.plane = self.simulation.plane
        self.unknowns = Unknowns(scene, unknowns, self.plane)
        self.gravity = np.array(loaded.gravity)
        self.lengths = np.diff(self.simulation.arc_lengths)
        self._spin_scale = 2.0 * self.simulation.rods.motion.compliance[0, 1:]
        self._straight = np.tile(np.eye(6)[3], self.num_elements)
        self.slow = slow_modes(self.simulation, num_modes)
        self._parameters = np.zeros((*self.shape, len(self.unknowns)))
        self._base_step = self.simulation.time_step
        spread = dict(zip(self.unknowns.names, self.unknowns.deviations))
        self._room = HEADROOM * max(spread.get("modulus", 0.0), spread.get("moment", 0.0))
        self.parameters = self._parameters

    @property
    def num_elements(self) -> int:
        """Elements of a rod."""
        return self.simulation.num_elements

    # ---- parameters

    @property
    def parameters(self) -> np.ndarray:
        """Parameters of every member, (num_rods, num_members, P)."""
        return self._parameters

    @parameters.setter
    def parameters(self, values: np.ndarray) -> None:
        """Give the members their parameters; factors are kept in their bounds (`Unknowns.bounded`)."""
        self._parameters = values = self.unknowns.bounded(values)
        flat = values.reshape(self.shape[0] * self.shape[1], len(self.unknowns))
        given: dict[str, np.ndarray] = {}
        for name in ("modulus", "moment"):
            if name in self.columns:
                given[name] = np.asarray(self.unknowns.factor(name, flat))
        if "drag" in self.columns:
            given["drag"] = np.asarray(self.unknowns.factor("drag", flat)) * (self.simulation.scene.drag_rate or 0.0)
        if "acceleration" in self.columns:
            given["gravity"] = self.gravity + self.unknowns.vector("acceleration", flat)
        self.simulation.rods.set_parameters(given)
        stiffest = max(
            (values[..., self.unknowns.columns[name]].max() for name in ("modulus", "moment") if name in self.columns),
            default=0.0,
        )
        self.simulation.time_step = self._base_step * math.exp(-0.5 * max(self._room, float(stiffest)))

    @property
    def columns(self) -> dict[str, np.ndarray]:
        """Columns of each parameter."""
        return self.unknowns.columns

    # ---- time

    def advance(self, field: np.ndarray, duration: float) -> None:
        """Step all members over `duration` (s) under the rods' fields (num_rods, 3) T, turned for each member.

        Raises:
            SimulationDiverged: if a member fails and `on_failure` is "raise".
        """
        self.simulation.rods.batch.mark()
        self.simulation.advance(duration, self.fields(field))
        failed = np.flatnonzero(self.simulation.status)
        self.failed[failed // self.shape[1]] = True
        if len(failed) and self.on_failure == "raise":
            rod, member = divmod(int(failed[0]), self.shape[1])
            raise SimulationDiverged(
                f"member {member} of rod {rod} left the stable range: lower time_step, or the deviations of the "
                "parameters, or start the filter nearer to the truth."
            )

    def fields(self, field: np.ndarray, values: np.ndarray | None = None) -> np.ndarray:
        """Field of every member, T, (num_rods * num_members, 3)."""
        values = self._parameters if values is None else values
        fields = np.broadcast_to(field[:, None], (*values.shape[:2], 3)).reshape(-1, 3)
        if "misalignment" not in self.columns:
            return fields
        turns = rotation_matrices_of_vectors(self.unknowns.vector("misalignment", values).reshape(-1, 3))
        return rotate(turns, fields)

    # ---- state

    def strains(self) -> np.ndarray:
        """Strains and their rates of all members (K, N, 12), as in `coordinates`."""
        simulation = self.simulation
        return strains_of(
            simulation.positions,
            simulation.rods.motion.quaternions,
            simulation.velocities,
            simulation.angular_velocities,
            self.lengths,
        )

    def split(self) -> tuple[np.ndarray, Rest]:
        """Slow coordinates of every member (num_rods, num_members, n), and what they leave out."""
        simulation = self.simulation
        strains = self.strains()[..., :6]
        motion = np.concatenate([simulation.velocities[:, 1:], simulation.angular_velocities[:, 1:]], axis=-1)
        bends = (strains.reshape(len(strains), -1) - self._straight) @ self.slow.dual.T
        fields = self.slow.motions(strains, self.lengths)
        rates = self.slow.amplitudes(fields, motion)
        rest = Rest(
            strains - (bends @ self.slow.shapes).reshape(strains.shape),
            motion - np.einsum("kmnc,km->knc", fields, rates),
        )
        return np.concatenate([bends, rates], axis=1).reshape(*self.shape, -1), rest

    def join(self, values: np.ndarray, rest: Rest) -> None:
        """Put the members where slow coordinates (num_rods, num_members, n) and the rest say."""
        flat = values.reshape(-1, values.shape[-1])
        bends, rates = flat[:, : len(self.slow.shapes)], flat[:, len(self.slow.shapes) :]
        strains = rest.strains + (bends @ self.slow.shapes).reshape(-1, self.num_elements, 6)
        self._write(strains, rest.motion + np.einsum("kmnc,km->knc", self.slow.motions(strains, self.lengths), rates))

    def lay(self, strains: np.ndarray, chosen: np.ndarray) -> None:
        """Lay the members of `chosen` rods (num_rods,) out at rest, with strains (num_chosen, num_members, N, 6)."""
        every, simulation = self.strains()[..., :6], self.simulation
        motion = np.concatenate([simulation.velocities[:, 1:], simulation.angular_velocities[:, 1:]], axis=-1)
        lanes = np.repeat(chosen, self.shape[1])
        self.failed[chosen] = False
        every[lanes], motion[lanes] = strains.reshape(-1, self.num_elements, 6), 0.0
        self._write(every, motion)

    def _write(self, strains: np.ndarray, motion: np.ndarray) -> None:
        simulation = self.simulation
        positions, quaternions, velocities, momenta = nodes_of(
            np.concatenate([strains, 0.0 * strains], -1), self.lengths
        )
        velocities[:, 1:] = motion[..., :3]
        momenta[:, 1:] = motion[..., 3:] / self._spin_scale
        simulation.rods.motion.write(positions, quaternions, velocities, momenta)

    def at_rest(self, field: np.ndarray | None, values: np.ndarray) -> np.ndarray:
        """Strains (num_rods, K, N, 6) of rods with parameters (num_rods, K, P), straight or in equilibrium.

        Loads divided by the factor of the modulus act on the nominal rod as the loads on the member: one static model
        serves all. A member that loses stability on the way starts from its last stable shape.

        Args:
            field: (num_rods, 3) T, or None for straight rods.
            values: parameters.

        Raises:
            StabilityError: if most of a rod's members buckle or snap through on the way.
        """
        rods, count = values.shape[:2]
        if field is None:
            return np.broadcast_to(self._straight.reshape(-1, 6), (rods, count, self.num_elements, 6)).copy()
        modulus = np.broadcast_to(self.unknowns.factor("modulus", values), (rods, count)).reshape(-1, 1)
        moment = np.broadcast_to(self.unknowns.factor("moment", values), (rods, count)).reshape(-1, 1)
        gravities = (self.gravity + self.unknowns.vector("acceleration", values).reshape(-1, 3)) / modulus
        fields = moment / modulus * self.fields(field, values)
        static = self.simulation.rods.model.static
        columns = np.tile(static.column, (rods * count, 1))
        columns[:, GRAVITY : GRAVITY + 3] = gravities
        loads = np.concatenate([fields, np.zeros((rods * count, 9))], axis=1)
        positions, quaternions, shares, _ = static.solve(loads, columns)
        lost = (shares.reshape(rods, count) < 2.0).mean(axis=1) > 0.5
        if lost.any():
            rod = int(lost.argmax())
            raise StabilityError(_lost(rod, field[rod], shares.reshape(rods, count)[rod]))
        still = np.zeros_like(positions)
        strains = strains_of(positions, quaternions, still, still, self.lengths)[..., :6]
        return strains.reshape(rods, count, self.num_elements, 6)

    def bends(self) -> np.ndarray:
        """Changes of strain (2, N, 6), (1, N, 6) in a plane, that bend a rod as a load at its tip does and move it by
        1 m there per unit, in the linear range: one along each transverse axis.
        """
        length, middles = self.lengths.sum(), np.cumsum(self.lengths) - 0.5 * self.lengths
        curvature = 3.0 * (length - middles) / length**3 * self.lengths
        full = np.zeros((2, self.num_elements, 6))
        full[0, :, 2] = curvature  # along y: about the third axis
        full[1, :, 1] = -curvature
        return full[[axis - 1 for axis in PLANE_AXES[self.plane][1:]]]


def _lost(rod: int, field: np.ndarray, shares: np.ndarray) -> str:
    """What is to be said where most of a rod's members lose stability, at shares (K,) of the loads."""
    if np.median(shares) < 1.0:
        return (
            f"gravity must not buckle rods that are to start in equilibrium, but buckles most members of rod {rod} "
            "before any field acts: make the rod shorter or stiffer, or start straight, without a field."
        )
    return (
        f"field must lead to a stable equilibrium from zero, but most members of rod {rod} "
        f"buckle or snap through at {field.tolist()} T: start from a weaker field."
    )
