"""Run an estimator, or what stands in for one, over a twin, and take its errors."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from magrod_env import SimulationDiverged
from magrod_env.estimation import (
    CameraStream,
    EnsembleFilter,
    GaussianCameras,
    Measurement,
    PredictionFilter,
    Unknown,
    UnscentedFilter,
)
from magrod_env.estimation.measurement import marker_nodes
from scripts.common.run import build as simulate
from scripts.common.track import Estimator, track
from scripts.estimation.twins import NOISE, Case, Twin, model_start

STILL = (3, 5, 6)  # experiments that start at rest in an equilibrium, or straight
LINEAR_DRAG = 1.0  # 1/s: what the ensemble's model has in the place of the dampings it does not know
UNKNOWNS: dict[str, Unknown | float] = {
    "modulus": Unknown(deviation=0.2, memory=1000.0),
    "drag": Unknown(deviation=0.7, memory=50.0),
    "acceleration": Unknown(deviation=0.02, memory=0.5),
}


class ModelAlone:
    """No estimator: the model runs from its own start and no frame changes it."""

    def __init__(self, case: Case, known_start: bool) -> None:
        self._simulation = simulate(case.scene, case.settings, on_failure="report")
        if known_start:
            self._simulation.set_state(model_start(case).state())
        self.arc_lengths = self._simulation.arc_lengths

    def predict(self, field: np.ndarray, duration: float) -> None:
        """Advance."""
        self._simulation.advance(duration, field)

    def update(self, measurement: Measurement) -> None:
        """Nothing."""

    @property
    def positions(self) -> np.ndarray:
        """m, (1, num_nodes, 3)."""
        return self._simulation.positions

    @property
    def velocities(self) -> np.ndarray:
        """m/s, (1, num_nodes, 3)."""
        return self._simulation.velocities


class FramesAlone:
    """No filter: the last frame held, or with `extended` the line through the last two; the unseen is NaN."""

    def __init__(self, case: Case, num_rods: int, extended: bool) -> None:
        self.extended, self._time = extended, 0.0
        self._seen = np.isin(np.round(case.watched, 9), np.round(case.markers, 9))
        self._last = np.full((2, num_rods, len(case.watched), 3), np.nan)
        self._times = np.full((2, num_rods, len(case.watched), 1), np.nan)

    def predict(self, field: np.ndarray, duration: float) -> None:
        """Time passes."""
        self._time += duration

    def update(self, measurement: Measurement) -> None:
        """Keep a frame."""
        new = np.full(self._last.shape[1:], np.nan)
        new[:, self._seen] = measurement.positions
        seen = np.isfinite(new).all(axis=-1, keepdims=True)
        self._last = np.where(seen, [self._last[1], new], self._last)
        self._times = np.where(seen, [self._times[1], np.full(seen.shape, measurement.time)], self._times)

    @property
    def velocities(self) -> np.ndarray:
        """Difference of the last two frames, m/s, (num_rods, points, 3)."""
        return (self._last[1] - self._last[0]) / (self._times[1] - self._times[0])

    @property
    def positions(self) -> np.ndarray:
        """m, (num_rods, points, 3)."""
        if not self.extended:
            return self._last[1]
        moved = self._last[1] + self.velocities * (self._time - self._times[1])
        return np.where(np.isfinite(moved), moved, self._last[1])


def build(case: Case, way: str, num_rods: int, options: Mapping[str, Any], known_start: bool = True) -> Estimator:
    """An estimator in its experiment's start.

    Args:
        case: what it follows.
        way: "model", "held", "extended", "printed" (the paper's law as printed), "paper" (the law by replay),
            "ensemble", "unscented".
        num_rods: noises.
        options: for its class.
        known_start: or straight and at rest.
    """
    if way == "model":
        return ModelAlone(case, known_start)
    if way in ("held", "extended"):
        return FramesAlone(case, num_rods, way == "extended")
    settings: dict[str, Any] = {"num_rods": num_rods, "markers": case.markers, **case.settings, **options}
    if way in ("printed", "paper"):
        law = {"law": "extrapolated", "damped": "seen"} if way == "printed" else {}
        estimator: PredictionFilter | EnsembleFilter | UnscentedFilter = PredictionFilter(
            case.scene, **{"on_failure": "report", **law, **settings}
        )
    else:
        kind = {"ensemble": EnsembleFilter, "unscented": UnscentedFilter}[way]
        scene = case.scene.replace(drag_rate=LINEAR_DRAG)
        estimator = kind(scene, **{"parameters": UNKNOWNS, **settings})
    if not known_start:
        estimator.reset()
    elif case.number in STILL:
        estimator.reset(None if case.number == 3 else model_start(case).field[0])
    else:
        model = model_start(case, settings["num_elements"])
        estimator.reset(shape=(model.positions[0], model.rotations[0]))
    return estimator


@dataclass(frozen=True)
class Course:
    """Errors of a run: estimate minus truth, NaN where an estimator says nothing or has diverged.

    Args:
        times: s, (ticks,).
        at_frames: (ticks,) bool, instants at which a frame is exposed.
        positions, velocities: (ticks, num_rods, points, 3) m, m/s.
        residuals: estimate minus frame at the tip, once the frame was taken in, (frames, num_rods, 3) m.
        seconds: wall time of the estimator.
        parameters: mean estimate of each at the end.
    """

    times: np.ndarray
    at_frames: np.ndarray
    positions: np.ndarray
    velocities: np.ndarray
    residuals: np.ndarray
    seconds: float
    parameters: dict[str, float]


def follow(
    case: Case,
    twin: Twin,
    way: str,
    *,
    num_rods: int = 1,
    rate: int | None = None,
    noise: float | None = NOISE,
    delay: float = 0.0,
    drops: float = 0.0,
    known_start: bool = True,
    ticks_at_once: int = 1,
    seed: int = 1,
    options: Mapping[str, Any] | None = None,
) -> Course:
    """Run an estimator over a twin.

    Args:
        case, twin: what is followed.
        way, options, known_start: as in `build`.
        num_rods: noises; the estimators are a batch.
        rate: frames a second, a divisor of the twin's instants; None for the case's.
        noise: m; None for none.
        delay: of frames, s.
        drops: probability that a frame is lost.
        ticks_at_once: instants that one prediction covers, for timing.
        seed: of the noise.
    """
    rate = rate or case.rate
    every = round(case.rate * case.ticks / rate)
    estimator = build(case, way, num_rods, options or {}, known_start)
    stream = CameraStream(GaussianCameras(noise=noise), rate=rate, delay=delay, drop_probability=drops)
    stream.reset(seed)
    nodes, seen = _nodes(case, estimator), range(len(case.markers))
    taken = range(0, len(twin.times), ticks_at_once)
    found = np.full((2, len(taken), num_rods, len(case.watched), 3), np.nan)
    residuals: list[np.ndarray] = []

    def frames(k: int) -> list[Measurement]:
        now = float(twin.times[taken[k]])
        if taken[k] % every == 0:
            stream.expose(now, np.tile(twin.positions[taken[k], seen], (num_rods, 1, 1)))
        return stream.arrived(now)

    def watch(k: int, arrived: Sequence[Measurement] | None) -> None:
        if arrived is not None:
            at, moving = estimator.positions[:, nodes], estimator.velocities[:, nodes]
            bad = np.asarray(getattr(estimator, "status", 0)).reshape(-1, 1, 1) != 0
            found[0, k] = np.where(bad, np.nan, at - twin.positions[taken[k]])
            found[1, k] = np.where(bad, np.nan, moving - twin.velocities[taken[k]])
            residuals.extend(np.where(bad[..., 0], np.nan, at[:, 0] - frame.positions[:, 0]) for frame in arrived)

    fields, tick, seconds = twin.fields[ticks_at_once - 1 :: ticks_at_once], float(twin.times[ticks_at_once]), np.inf
    try:
        seconds = track(estimator, fields[: len(taken) - 1], tick, frames, watch)
    except SimulationDiverged:
        pass  # the rest stays unknown
    parameters = {name: float(np.mean(value)) for name, value in getattr(estimator, "parameters", {}).items()}
    at_frames = np.array(taken) % every == 0
    times, (positions, velocities) = twin.times[::ticks_at_once], found
    return Course(times, at_frames, positions, velocities, np.array(residuals), seconds, parameters)


def _nodes(case: Case, estimator: Estimator) -> np.ndarray:
    """Where the watched points are in an estimator's arrays."""
    if isinstance(estimator, FramesAlone):
        return np.arange(len(case.watched))
    if isinstance(estimator, EnsembleFilter | UnscentedFilter):
        return marker_nodes(estimator.members.simulation.arc_lengths, case.watched)
    assert isinstance(estimator, PredictionFilter | ModelAlone)
    return marker_nodes(estimator.arc_lengths, case.watched)
