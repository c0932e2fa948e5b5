"""Estimators in a batch of environments: what they are told, what cameras show them, and when they start again."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any

import numpy as np
from gymnasium.error import ResetNeeded
from numpy.typing import ArrayLike

from magrod_env.envs.arguments import flag, reals, told, whole
from magrod_env.envs.core import SteeringCore
from magrod_env.envs.estimates import Estimator
from magrod_env.envs.nominal_coils import NominalCoils
from magrod_env.envs.observing import Outcome, observe_estimate
from magrod_env.estimation import EnsembleFilter, GaussianCameras, Measurement, Unknown
from magrod_env.estimation.cameras import Cameras
from magrod_env.estimation.measurement import marker_arc_lengths, marker_nodes
from magrod_env.rod.state import BatchState
from magrod_env.simulation import SimulationDiverged, StabilityError

MEMBERS, MOST_MEMBERS = 32, 10_000
UNKNOWNS = {  # loads of 2 m/s^2 rather than the filter's 0.5: fields may jump at every control step
    "modulus": Unknown(deviation=0.2, memory=50.0),
    "acceleration": Unknown(deviation=2.0, memory=2.0),
}
CONTRACT = ("reset", "predict", "update", "time", "positions")


class Estimation:
    """An estimator of every rod of a core, which replaces the camera's entries of its observations.

    Per control step each estimate is predicted with the nominal rod in the field that was commanded (`NominalCoils`),
    then updated by what the cameras see of the true markers. An environment that is reset resets its own estimate only,
    to the nominal rod's equilibrium in the commanded field of the start.

    Args: see `magrod_env.envs.EstimateState`; core: the `SteeringCore`.
    """

    def __init__(
        self,
        core: SteeringCore,
        *,
        estimator: Callable[..., Estimator] | None = None,
        members: int | None = None,
        markers: str | ArrayLike = "tip",
        cameras: Cameras | None = None,
        timed: bool = False,
    ) -> None:
        if core.full is not None:
            raise ValueError(
                'observe of an environment whose state is estimated must be "camera" or "estimate", but got "state": '
                "estimators tell no rotations."
            )
        self.core, self.timed = core, flag("timed", timed)
        self.cameras: Cameras = GaussianCameras(noise=core.camera.noise or 5e-5) if cameras is None else cameras
        if isinstance(self.cameras, type) or not hasattr(self.cameras, "measure"):
            raise ValueError(
                f"cameras must have measure, but got {told(cameras)}: give StereoCameras() or GaussianCameras()."
            )
        if not isinstance(markers, str) and reals(markers) is None:
            raise ValueError(
                f'markers must be "tip", "magnets" or arc lengths, but got {told(markers)}: give arc lengths in metres.'
            )
        self.nodes = marker_nodes(core.rods.arc_lengths_of(0), marker_arc_lengths(core.scene, markers))
        self.estimator = self._build(estimator, members, markers)
        self._truth, self._coils = BatchState(core.batch), NominalCoils(core)
        self._tracked = list(core.nodes)
        self._every = np.arange(core.num_envs)
        self._generators: list[np.random.Generator | None] = [None] * core.num_envs
        shape = (core.optics.delay + 1, core.num_envs, len(self.nodes), 3)
        self._frames, self._covariances = np.full(shape, np.nan), np.zeros((*shape, 3))
        self._newest = 0  # place of the newest frame in that ring
        self._before = np.zeros((core.num_envs, len(self._tracked), 3))  # m, tracked points a control step ago
        self._seen = core.episodes._replace(seen=np.zeros_like(core.episodes.seen))
        self._errors, self._lost = np.zeros(core.num_envs), np.zeros(core.num_envs, bool)
        self._running = np.zeros(core.num_envs, bool)
        self.seconds = 0.0  # wall time of the last step's estimation, resets after it included

    def _build(
        self, estimator: Callable[..., Estimator] | None, members: int | None, markers: str | ArrayLike
    ) -> Estimator:
        core = self.core
        if estimator is not None and members is not None:
            raise ValueError(
                f"members must be None with an estimator of your own, but got {told(members)}: build it in."
            )
        settings: dict[str, Any] = {
            "num_rods": core.num_envs,
            "num_elements": core.num_elements,
            "axial_softening": core.resolution.axial_softening,
            "rotary_scaling": core.resolution.rotary_scaling,
            "markers": markers,
            "plane": core.plane,
            "expected_field": float(np.linalg.norm(core.coils.limit)) + 2.0 * core.randomization.initial_field,
        }
        if estimator is None:
            late = core.optics.delay * core.control_time
            advice = "32 is a good start"
            count = MEMBERS if members is None else whole("members", members, at_most=MOST_MEMBERS, advice=advice)
            return EnsembleFilter(
                core.scene,
                num_members=count,
                parameters=UNKNOWNS,
                history=late + core.control_time if late > 0.0 else 0.0,
                on_failure="report",
                precision=core.precision,
                num_threads=core.batch.num_threads,
                **settings,
            )
        if not callable(estimator):
            raise ValueError(
                f"estimator must build one when called, but got {told(estimator)}: give a class such as "
                "EnsembleFilter, or functools.partial of it with options."
            )
        try:
            built = estimator(core.scene, **settings)
        except TypeError as error:
            raise ValueError(
                f"estimator must take a scene and {', '.join(settings)}, but {told(estimator)} did not: {error}."
            ) from error
        lacking = [name for name in CONTRACT if not hasattr(built, name)]
        if lacking:
            raise ValueError(
                f"estimator must have {', '.join(CONTRACT)}, but a {type(built).__name__} lacks {', '.join(lacking)}: "
                "see the estimators of magrod_env.estimation."
            )
        shape = (core.num_envs, core.num_elements + 1, 3)
        if np.shape(built.positions) != shape:
            raise ValueError(
                f"positions of the estimator must have shape {shape}, the environment's rods and nodes, but got "
                f"{np.shape(built.positions)}: build it with the num_rods and num_elements that it is given."
            )
        return built

    # ---- running

    def reset(self, which: np.ndarray, out: Outcome) -> None:
        """Begin new estimates in the environments ``which`` and write their first observations again."""
        start, core = time.perf_counter(), self.core
        self._coils.reset(which)
        chosen = np.isin(self._every, which)
        self._running |= chosen
        self._frames[:, which] = np.nan
        for i in which:
            self._generators[i] = np.random.default_rng(int(core.episodes.streams[i]))
        with np.errstate(all="ignore"):
            self._begin(self._coils.field, chosen)
            self._look(which)
            self._take_in(which)
            self._tell(which, chosen, out)
        self._lost[which] = False
        self.seconds = time.perf_counter() - start + (0.0 if chosen.all() else self.seconds)

    def step(self, out: Outcome) -> None:
        """Follow one control step of all environments and write their observations again."""
        if not self._running.all():
            raise ResetNeeded("environment must be reset before its state is estimated, but was not: call reset().")
        start = time.perf_counter()
        self._newest = (self._newest + 1) % len(self._frames)
        self._frames[self._newest] = np.nan
        with np.errstate(all="ignore"):  # of rods and members that diverge
            self._lost = self._predict()
            self._look(self._every)
            self._take_in(self._every)
            self._tell(self._every, self._lost, out)
        self.seconds = time.perf_counter() - start

    def info(self) -> dict[str, np.ndarray]:
        """What the environments add to their info; first axis num_envs."""
        info = {"estimate_error": self._errors.copy(), "estimate_lost": self._lost.copy()}
        if self.timed:
            info["estimate_time"] = np.full(self.core.num_envs, self.seconds)
        return info

    def _begin(self, fields: np.ndarray, chosen: np.ndarray) -> None:
        """Reset estimates (num_envs,) bool; one whose rod would buckle on the way to its field begins straight."""
        mask = None if chosen.all() else chosen
        try:
            self.estimator.reset(fields, mask)
            return
        except StabilityError:
            self.estimator.reset(None, mask)
        for i in np.flatnonzero(chosen):
            try:
                self.estimator.reset(fields, self._every == i)
            except StabilityError:
                self.estimator.reset(None, self._every == i)

    def _predict(self) -> np.ndarray:
        """Predict over the control step; which estimates failed, and began again at its end, (num_envs,) bool.

        An estimator that tells no status by rod begins again for all of them, and so does its clock.
        """
        pieces = self._coils.step()
        try:
            for field, duration in pieces:
                self.estimator.predict(field, duration)
            lost = np.asarray(getattr(self.estimator, "status", np.zeros(self.core.num_envs))) != 0
        except (SimulationDiverged, np.linalg.LinAlgError):
            lost = np.ones(self.core.num_envs, bool)
        if lost.any():
            self._frames[:, lost] = np.nan
            self._begin(self._coils.field, lost)
        return lost

    def _look(self, which: np.ndarray) -> None:
        """The cameras see the markers of environments whose frame is due; not those of a diverged rod."""
        core = self.core
        due = which[(core.episodes.steps[which] % core.optics.every == 0) & (core.batch.status[which] == 0)]
        rods = self._truth.positions
        for i in due:
            one = rods[i : i + 1]
            seen, covariance = self.cameras.measure(one[:, self.nodes], self._generators[i], one)
            self._frames[self._newest, i], self._covariances[self._newest, i] = seen[0], covariance[0]

    def _take_in(self, which: np.ndarray) -> None:
        """Update the estimates of the environments ``which`` by the frame that arrives now."""
        core = self.core
        arriving = (self._newest - core.optics.delay) % len(self._frames)
        seen = np.full(self._frames.shape[1:], np.nan)
        seen[which] = self._frames[arriving, which]
        if np.isnan(seen).all():
            self.estimator.update(None)
            return
        exposed = self.estimator.time - core.optics.delay * core.control_time
        self.estimator.update(Measurement(positions=seen, covariance=self._covariances[arriving], time=exposed))

    def _tell(self, which: np.ndarray, begun: np.ndarray, out: Outcome) -> None:
        """Write observations and errors of the environments ``which``; where an estimate has just ``begun``,
        (num_envs,) bool, it has not moved yet.
        """
        core, nodes = self.core, self.estimator.positions
        now, planar = nodes[:, self._tracked], core.batch.terms.planar
        self._before[begun] = now[begun]
        observe_estimate(core.batch.rows, core.view, planar, self._seen, now, self._before, which, out)
        self._before[which] = now[which]
        self._errors[which] = self._tip_errors(nodes[:, -1])[which]

    def _tip_errors(self, tips: np.ndarray) -> np.ndarray:
        """Distances, m, of estimated tips (num_envs, 3) from the true ones; what is lost lies at the clamp."""
        true = np.where(self.core.batch.status[:, None] == 0, self._truth.positions[:, -1], 0.0)
        return np.linalg.norm(np.where(np.isfinite(tips), tips, 0.0) - true, axis=-1)
