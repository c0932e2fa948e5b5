"""Unscented Kalman filter: the sigma points are lanes of one batched simulation. Made for rods in a plane."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from magrod_env import _checks
from magrod_env.estimation.arrivals import check_arrival, checked_duration, checked_field
from magrod_env.estimation.measurement import SAME_TIME, Measurement, marker_arc_lengths, marker_nodes
from magrod_env.estimation.member_filter import MemberFilter
from magrod_env.estimation.members import Members, Rest
from magrod_env.estimation.modes import slow_modes
from magrod_env.estimation.unknowns import DEFAULTS, Unknown, Unknowns
from magrod_env.scene import Scene
from magrod_env.simulation import Simulation
from magrod_env.simulation.resolution import EXPECTED_FIELD
from magrod_env.simulation.starts import Shape

KURTOSIS = 2.0  # beta of the scaled transform, for a Gaussian


def sigma_points(mean: np.ndarray, covariance: np.ndarray, spread: float) -> np.ndarray:
    """Sigma points (..., 2 n + 1, n), the mean first, at +-`spread` standard deviations along the principal axes."""
    values, vectors = np.linalg.eigh(covariance)
    steps = spread * np.swapaxes(vectors * np.sqrt(np.maximum(values, 0.0))[..., None, :], -1, -2)
    centre = mean[..., None, :]
    return np.concatenate([centre, centre + steps, centre - steps], axis=-2)


def sigma_weights(size: int, spread: float) -> tuple[np.ndarray, np.ndarray]:
    """Weights (2 n + 1,) of the mean and of the covariance: scaled unscented transform (Julier 2002; van der Merwe
    2004) with alpha = spread/sqrt(n), kappa = 0, beta = 2.
    """
    means = np.full(2 * size + 1, 0.5 / spread**2)
    means[0] = 1.0 - size / spread**2
    covariances = means.copy()
    covariances[0] += 1.0 - spread**2 / size + KURTOSIS
    return means, covariances


def moments(points: np.ndarray, means: np.ndarray, covariances: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Mean (..., n) and covariance (..., n, n) of points (..., K, n) with weights (K,)."""
    mean = np.einsum("k,...kn->...n", means, points)
    spread = points - mean[..., None, :]
    return mean, np.einsum("k,...ki,...kj->...ij", covariances, spread, spread)


@dataclass
class Stage:
    """The estimate at one time, and the field that acted from then on."""

    time: float
    mean: np.ndarray  # (num_rods, n)
    covariance: np.ndarray  # (num_rods, n, n)
    rest: Rest  # of the central points
    field: np.ndarray | None = None


class UnscentedFilter(MemberFilter):
    """Slow motion and parameters of rods as one Gaussian, carried by sigma points.

    The state is that of `EnsembleFilter`: slow coordinates (`modes`) and parameters (`Unknown`). What they leave out is
    that of the central point. A late frame is taken in at its moment of exposure, and the commands since then are run
    again: exact, at the price of the steps. It needs 2 n + 1 members for n numbers and no random draws.

    Args:
        scene, num_rods, num_elements, markers, parameters, tip_deviation, num_modes, history, time_step,
            axial_softening, rotary_scaling, plane, precision, expected_field, num_threads: as in `EnsembleFilter`.
        spread: distance of the sigma points from the mean, in standard deviations.

    Raises:
        ValueError: on bad input.
    """

    _stages: list[Stage]

    def __init__(
        self,
        scene: Scene,
        *,
        num_rods: int = 1,
        num_elements: int | None = None,
        markers: Any = "tip",
        parameters: Mapping[str, Unknown | float] | None = None,
        tip_deviation: float | None = None,
        num_modes: int | None = None,
        history: float = 0.5,
        spread: float = math.sqrt(3.0),
        time_step: float | None = None,
        axial_softening: float | None = None,
        rotary_scaling: float | None = None,
        plane: str | None = None,
        precision: str = "float64",
        expected_field: float = EXPECTED_FIELD,
        num_threads: int | None = None,
    ) -> None:
        super().__init__(scene, num_rods, tip_deviation, num_modes, history, plane)
        self.spread = _checks.number("spread", spread, above=0.0, advice="sqrt(3) is usual")
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
        slow = slow_modes(Simulation(scene, **settings), self.num_modes)
        size = len(slow.shapes) + len(slow.rates) + len(Unknowns(scene, unknowns, plane))
        self.members = Members(scene, unknowns, self.num_rods, 2 * size + 1, self.num_modes, settings)
        self.nodes = marker_nodes(self.members.simulation.arc_lengths, places)
        self._mean_weights, self._spread_weights = sigma_weights(size, self.spread)
        self.reset()

    # ---- running

    def reset(self, field: ArrayLike | None = None, mask: ArrayLike | None = None, shape: Shape | None = None) -> None:
        """Start again, at rest: straight, in static equilibrium under gravity and a field, or in a shape.

        Args:
            field: None, or T, (3,) or (num_rods, 3).
            mask: (num_rods,) bool, the rods that start again while the clock runs on; None starts all, at time 0.
            shape: positions and rotations of the nodes, as `Simulation.reset` takes them, about which the members are
                spread as about a straight rod; None beside a field.

        Raises:
            ValueError: on a wrong shape.
            StabilityError: if a rod buckles or snaps through on the way.
        """
        fields, chosen, bent = self._begin(field, mask, shape)
        before: Stage | None = None if mask is None else self._stages[-1]
        mean, covariance, rest = self._prior(fields, bent)
        if before is not None:
            mean[~chosen], covariance[~chosen] = before.mean[~chosen], before.covariance[~chosen]
            rest.strains[~chosen], rest.motion[~chosen] = before.rest.strains[~chosen], before.rest.motion[~chosen]
        now = Stage(self._time, mean, covariance, rest)
        if before is None:
            self._stages = [now]
        else:  # frames from before are for the other rods
            self._stages[-1] = now
        self._place(now)

    def _prior(self, fields: np.ndarray | None, bent: np.ndarray | None) -> tuple[np.ndarray, np.ndarray, Rest]:
        """Mean, covariance and rest of rods at rest, from sigma points of the parameters and of the tip's place."""
        members, unknowns = self.members, self.members.unknowns
        bends, count = members.bends(), len(members.unknowns)
        size = count + len(bends)
        deviations = np.concatenate([unknowns.deviations, np.full(len(bends), self.tip_deviation)])
        points = sigma_points(np.zeros(size), np.diag(deviations**2), self.spread)
        values = np.tile(points[:, :count], (self.num_rods, 1, 1))
        rest = members.at_rest(fields, values) if bent is None else bent[:, None]
        strains = rest + np.tensordot(points[:, count:], bends, axes=1)
        shapes = members.slow.dual
        amplitudes = (strains.reshape(*strains.shape[:2], -1) - np.tile(np.eye(6)[3], members.num_elements)) @ shapes.T
        still = np.zeros((*amplitudes.shape[:2], len(members.slow.rates)))
        mean, covariance = moments(
            np.concatenate([amplitudes, still, values], axis=-1), *sigma_weights(size, self.spread)
        )
        central = strains[:, 0] - (amplitudes[:, 0] @ members.slow.shapes).reshape(strains[:, 0].shape)
        return mean, covariance, Rest(central, np.zeros((self.num_rods, members.num_elements, 6)))

    def predict(self, field: ArrayLike, duration: float) -> None:
        """Advance the estimate.

        Args:
            field: T, world, (3,) or (num_rods, 3), constant over the duration.
            duration: s.

        Raises:
            ValueError: on a wrong shape, NaN or a field that is too strong for the time step.
            SimulationDiverged: if a sigma point leaves the stable range.
        """
        fields, duration = checked_field(field, self.num_rods), checked_duration(duration)
        if duration == 0.0:
            return
        self._stages[-1].field = fields
        self._run(self._stages[-1], self._time + duration)
        oldest = max(self._time - self.history, self._last)
        while len(self._stages) > 1 and self._stages[1].time <= oldest:
            self._stages.pop(0)

    def update(self, measurement: Measurement | None) -> None:
        """Take in what cameras saw; None where there is no frame: the estimate stays.

        Raises:
            ValueError: on another number of rods or markers, a frame from the future, one exposed before another that
                was taken in, or one older than the history.
        """
        self._forget()
        if measurement is None:
            return
        exposed, stages = measurement.time, self._stages
        check_arrival(measurement, (self.num_rods, len(self.nodes)), self._time, self._last, stages[0].time)
        first = max(k for k, stage in enumerate(stages) if stage.time <= exposed + SAME_TIME)
        later, self._stages = stages[first + 1 :], stages[: first + 1]
        commands = [(stage.field, after.time) for stage, after in zip(stages[first:], later)]
        if exposed > stages[first].time + SAME_TIME:
            self._place(stages[first])
            self._run(stages[first], exposed)
            self._stages[-1].field = stages[first].field
        elif commands:
            self._place(stages[first])
        self._take(measurement)
        for field, end in commands:
            self._stages[-1].field = field
            self._run(self._stages[-1], end)
        self._last = exposed

    def _run(self, stage: Stage, end: float) -> None:
        """Carry a stage, at which the members are, to the time `end` (s), as a new last stage."""
        members, unknowns = self.members, self.members.unknowns
        assert stage.field is not None
        duration = end - stage.time
        pieces = unknowns.pieces(duration)
        kept, noise = unknowns.kept(duration / pieces), unknowns.noise(duration / pieces)
        now = stage
        for _ in range(pieces):
            values = members.parameters
            members.advance(stage.field, duration / pieces)
            slow, rest = members.split()
            points = np.concatenate([slow, kept * values], axis=-1)
            mean, covariance = moments(points, self._mean_weights, self._spread_weights)
            covariance[:, slow.shape[-1] :, slow.shape[-1] :] += np.diag(noise**2)
            central = Rest(*(self._by_member(part)[:, 0].copy() for part in rest))
            now = Stage(end, mean, covariance, central)
            self._place(now)
        self._stages.append(now)
        self._time = end

    def _place(self, stage: Stage) -> None:
        """Put the members on the sigma points of a stage."""
        members = self.members
        points = sigma_points(stage.mean, stage.covariance, self.spread)
        size = points.shape[-1] - len(members.unknowns)
        members.parameters = points[..., size:]
        members.join(points[..., :size], Rest(*(np.repeat(part, members.shape[1], axis=0) for part in stage.rest)))

    def _take(self, measurement: Measurement) -> None:
        """Kalman's update of the last stage, at which the members are."""
        stage = self._stages[-1]
        seen = measurement.seen & (measurement.time >= self._started - SAME_TIME)[:, None]
        points = sigma_points(stage.mean, stage.covariance, self.spread) - stage.mean[:, None]
        expected = self._by_member(self.members.simulation.positions[:, self.nodes])
        mean = self._mean(expected)
        spread = np.where(seen[:, None, :, None], expected - mean[:, None], 0.0).reshape(*self.members.shape, -1)
        innovation = measurement.positions - mean
        residual = np.where(seen[..., None], innovation, 0.0).reshape(self.num_rods, -1, 1)
        markers = len(self.nodes)
        noise = np.zeros((self.num_rods, markers, 3, markers, 3))
        index = np.arange(markers)
        noise[:, index, :, index, :] = np.swapaxes(
            np.where(seen[..., None, None], measurement.covariance, np.eye(3)), 0, 1
        )
        weighted = self._spread_weights[:, None] * spread
        total = np.swapaxes(spread, 1, 2) @ weighted + noise.reshape(self.num_rods, 3 * markers, 3 * markers)
        cross = np.swapaxes(points, 1, 2) @ weighted
        gain = np.swapaxes(np.linalg.solve(total, np.swapaxes(cross, 1, 2)), 1, 2)
        statistic = (residual * np.linalg.solve(total, residual)).sum(axis=(1, 2))
        covariance = stage.covariance - gain @ total @ np.swapaxes(gain, 1, 2)
        stage.mean = stage.mean + (gain @ residual)[..., 0]
        stage.covariance = 0.5 * (covariance + np.swapaxes(covariance, 1, 2))
        self._place(stage)
        self._note(innovation, seen, statistic)
