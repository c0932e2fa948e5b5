"""Ensemble Kalman filter: the members are lanes of one batched simulation, and each has parameters of its own."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from magrod_env import _checks
from magrod_env.estimation.analysis import ensemble_update, exact_draws
from magrod_env.estimation.arrivals import check_arrival, checked_duration, checked_field
from magrod_env.estimation.measurement import SAME_TIME, Measurement, marker_arc_lengths, marker_nodes
from magrod_env.estimation.member_filter import MemberFilter
from magrod_env.estimation.members import Members
from magrod_env.estimation.unknowns import DEFAULTS, Unknown
from magrod_env.scene import Scene
from magrod_env.simulation.resolution import EXPECTED_FIELD
from magrod_env.simulation.starts import Shape

STRAYED = 8.0  # deviations: a parameter that is so far off is an error, and might ask for tiny steps
RECORD_EVERY = 0.01  # s: how densely the members' markers are remembered for late frames


class EnsembleFilter(MemberFilter):
    """Shape, motion and parameters of rods from markers, by a cloud of simulated rods.

    Every rod has `num_members` members that differ in shape, motion and parameters. A prediction steps them all with
    their own parameters, which walk (`Unknown`); an update moves them towards the measurement in proportion to how
    their parameters and shapes covary with what they predicted of it (`analysis`), in the coordinates of `Members`,
    that keep a bent rod a bent rod. Late frames are compared with what the members predicted for the moment of
    exposure. All rods get the same random draws, so that a rod's estimate does not depend on its neighbours.
    Method and choices: docs/ensemble_filter.md.

    Args:
        scene: the rod as far as it is known.
        num_rods: rods in the batch.
        num_members: members for each, at least 2; 32 to 128 are usual.
        num_elements, time_step, axial_softening, rotary_scaling, plane, precision, expected_field, num_threads: as in
            `Simulation`, for the nominal rod.
        markers: what is seen: "tip", "magnets" or arc lengths, m; each must be at a node.
        parameters: what is not known of the rod, by name (`Unknowns`): an `Unknown`, or the deviation of a constant;
            None takes `DEFAULTS`: modulus by 20 %, and a load per mass that no model holds.
        tip_deviation: standard deviation of the tip's place at a reset, m, across the rod, bent as by a load there;
            None takes 1 % of the length.
        relaxation: share of the prior spread that an update keeps, 0 to 1; makes up for sampling errors.
        largest_growth: factor up to which the spread is taken to be larger where it does not explain what is seen,
            so that sudden changes are followed; 1 never does, for consistency tests or where frames may be wrong.
        num_modes: slow modes whose rates an update may change; None takes two bending modes along each axis.
        history: for how long frames may be late, s.
        seed: of all random draws.
        on_failure: "raise" SimulationDiverged where a member leaves the stable range, or only "report" its rod in
            `status`: its estimate means nothing until it is reset, the others go on. Parameters beyond 8 deviations of
            their prior begin anew then, too.

    Raises:
        ValueError: on bad input.
    """

    def __init__(
        self,
        scene: Scene,
        *,
        num_rods: int = 1,
        num_members: int = 64,
        num_elements: int | None = None,
        markers: Any = "tip",
        parameters: Mapping[str, Unknown | float] | None = None,
        tip_deviation: float | None = None,
        relaxation: float = 0.05,
        largest_growth: float = 3.0,
        num_modes: int | None = None,
        history: float = 0.5,
        seed: int = 0,
        on_failure: str = "raise",
        time_step: float | None = None,
        axial_softening: float | None = None,
        rotary_scaling: float | None = None,
        plane: str | None = None,
        precision: str = "float64",
        expected_field: float = EXPECTED_FIELD,
        num_threads: int | None = None,
    ) -> None:
        super().__init__(scene, num_rods, tip_deviation, num_modes, history, plane)
        self.num_members = int(_checks.count("num_members", num_members, advice="64 is a good start"))
        if self.num_members < 2:
            raise ValueError("num_members must be at least 2, but got 1: give some, errors are told by their spread.")
        self.relaxation = _checks.number(
            "relaxation", relaxation, at_least=0.0, at_most=1.0, advice="0 leaves it out, 0.05 is usual"
        )
        self.largest_growth = _checks.number(
            "largest_growth", largest_growth, at_least=1.0, advice="1 leaves it out, 3 follows sudden changes"
        )
        if on_failure not in ("raise", "report"):
            raise ValueError(f'on_failure must be "raise" or "report", but got {on_failure!r}: choose one.')
        places = marker_arc_lengths(scene, markers)
        settings: dict[str, Any] = {
            "num_elements": num_elements,
            "time_step": time_step,
            "axial_softening": axial_softening,
            "rotary_scaling": rotary_scaling,
            "expected_field": expected_field,
            "plane": plane,
            "precision": precision,
            "num_threads": num_threads,
        }
        unknowns = DEFAULTS if parameters is None else parameters
        self.members = Members(scene, unknowns, self.num_rods, self.num_members, self.num_modes, settings, on_failure)
        self.nodes = marker_nodes(self.members.simulation.arc_lengths, places)
        self._mean_weights = np.full(self.num_members, 1.0 / self.num_members)
        self._spread_weights = np.full(self.num_members, 1.0 / (self.num_members - 1))
        self.seed = seed
        self.reset()

    # ---- running

    def reset(self, field: ArrayLike | None = None, mask: ArrayLike | None = None, shape: Shape | None = None) -> None:
        """Start again, at rest: straight, in static equilibrium under gravity and a field, or in a shape.

        Args:
            field: None, or T, (3,) or (num_rods, 3). Every member is in the equilibrium of its own parameters.
            mask: (num_rods,) bool, the rods that start again while the clock runs on; None starts all, at time 0.
            shape: positions and rotations of the nodes, as `Simulation.reset` takes them, about which the members are
                spread as about a straight rod; None beside a field.

        Raises:
            ValueError: on a wrong shape.
            StabilityError: if a rod buckles or snaps through on the way.
        """
        fields, chosen, bent = self._begin(field, mask, shape)
        if mask is None:
            self._generator = np.random.default_rng(self.seed)
            self._times: list[float] = []
            self._tracks = np.empty((0, self.num_rods, self.num_members, len(self.nodes), 6))
        members, unknowns = self.members, self.members.unknowns
        bends = members.bends()
        draws = exact_draws(self._generator, self.num_members, len(unknowns) + len(bends))
        if not chosen.any():
            return
        values = self._prior = draws[:, : len(unknowns)] * unknowns.deviations
        parameters = members.parameters.copy()
        parameters[chosen] = values
        if bent is None:
            strains = members.at_rest(None if fields is None else fields[chosen], parameters[chosen])
        else:
            strains = np.repeat(bent[chosen, None], self.num_members, axis=1)
        strains += self.tip_deviation * np.tensordot(draws[:, len(unknowns) :], bends, axes=1)
        members.parameters = parameters
        members.lay(strains, chosen)
        if mask is None:
            self._remember()
        else:
            self._tracks[:, chosen] = self._track()[chosen]

    def predict(self, field: ArrayLike, duration: float) -> None:
        """Advance the estimate.

        Args:
            field: T, world, (3,) or (num_rods, 3), constant over the duration.
            duration: s.

        Raises:
            ValueError: on a wrong shape, NaN or a field that is too strong for the time step.
            SimulationDiverged: if a member leaves the stable range and `on_failure` is "raise".
        """
        fields, duration = checked_field(field, self.num_rods), checked_duration(duration)
        if duration == 0.0:
            return
        members, unknowns = self.members, self.members.unknowns
        pieces = unknowns.pieces(duration)
        piece, start = duration / pieces, self._time
        shots = max(1, math.ceil(piece / RECORD_EVERY - 1e-9)) if self.history > 0.0 else 1
        for k in range(pieces):
            noise = exact_draws(self._generator, self.num_members, len(unknowns)) * unknowns.noise(piece)
            members.parameters = unknowns.kept(piece) * members.parameters + noise
            for shot in range(1, shots + 1):
                members.advance(fields, piece / shots)
                self._time = start + duration * (k + shot / shots) / pieces
                self._remember()

    def update(self, measurement: Measurement | None) -> None:
        """Take in what cameras saw; None where there is no frame: the estimate stays.

        Raises:
            ValueError: on another number of rods or markers, a frame from the future, one exposed before another that
                was taken in, or one older than the history.
        """
        self._forget()
        if measurement is None:
            return
        check_arrival(measurement, (self.num_rods, len(self.nodes)), self._time, self._last, self._times[0])
        failed = self.members.failed
        seen = measurement.seen & (~failed & (measurement.time >= self._started - SAME_TIME))[:, None]
        predictions = np.where(failed[:, None, None, None], 0.0, self._predicted(measurement.time))
        innovation = measurement.positions - predictions.mean(axis=1)
        update = ensemble_update(
            predictions, innovation, measurement.covariance, seen, self.relaxation, self.largest_growth
        )
        members = self.members
        state, rest = members.split()
        members.join(update.apply(state), rest)
        members.parameters = self._believed(update.apply(members.parameters))
        for k in range(len(self._tracks)):
            self._tracks[k] = update.apply(self._tracks[k])
        self._tracks[-1] = self._track()
        self._last = measurement.time
        self._note(innovation, seen, update.statistic)

    def _believed(self, parameters: np.ndarray) -> np.ndarray:
        """Where failures are reported, parameters that no prior explains begin anew, and the motion goes on."""
        if self.members.on_failure == "report":
            unknowns = self.members.unknowns
            strayed = (np.abs(parameters) > STRAYED * unknowns.deviations).any(axis=(1, 2))
            parameters[strayed | unknowns.pinned(parameters.mean(axis=1))] = self._prior
        return parameters

    @property
    def status(self) -> np.ndarray:
        """0 for a rod that is well, 1 where a member has left the stable range since its reset, (num_rods,)."""
        return self.members.failed.astype(np.int64)

    # ---- what members did at the markers

    def _track(self) -> np.ndarray:
        """Positions and velocities of all members' markers, (num_rods, num_members, num_markers, 6)."""
        simulation = self.members.simulation
        track = np.concatenate([simulation.positions[:, self.nodes], simulation.velocities[:, self.nodes]], axis=-1)
        return track.reshape(self.num_rods, self.num_members, len(self.nodes), 6)

    def _remember(self) -> None:
        oldest = max(self._time - self.history, self._last)
        self._times.append(self._time)
        self._tracks = np.concatenate([self._tracks, self._track()[None]])
        while len(self._times) > 1 and self._times[1] <= oldest:
            self._times.pop(0)
            self._tracks = self._tracks[1:]

    def _predicted(self, time: float) -> np.ndarray:
        """Positions of the members' markers at a time that is remembered, by Hermite's cubic between predictions."""
        k = int(np.searchsorted(self._times, time))
        if k == len(self._times):
            return self._tracks[-1, ..., :3]
        if k == 0 or self._times[k] == time:
            return self._tracks[k, ..., :3]
        span = self._times[k] - self._times[k - 1]
        t = (time - self._times[k - 1]) / span
        before, after = self._tracks[k - 1], self._tracks[k]
        return (
            (1.0 + 2.0 * t) * (1.0 - t) ** 2 * before[..., :3]
            + t * (1.0 - t) ** 2 * span * before[..., 3:]
            + t * t * (3.0 - 2.0 * t) * after[..., :3]
            - t * t * (1.0 - t) * span * after[..., 3:]
        )
