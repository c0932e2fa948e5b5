"""Frames in time: when they are exposed, when they arrive, and which never do."""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence

import numpy as np

from magrod_env import _checks
from magrod_env.estimation.cameras import Cameras, checked_positions
from magrod_env.estimation.measurement import SAME_TIME, Measurement
from magrod_env.simulation import Simulation
from magrod_env.simulation.simulation import Field


class CameraStream:
    """Measurements of a batch of rods as they come in: at a rate, late, and not all of them.

    A frame is due at every whole multiple of 1/rate from time 0. Three ways to use it, from exact to simple:

    - `film(simulation, duration, field)` advances a simulation and stops at every exposure;
    - stop at `next_exposure` by yourself, `expose(time, positions)` there, and ask for what has `arrived(time)`;
    - `observe(time, positions)` at each control step: a frame that is due is exposed at that moment, which is up to a
      control step later than its multiple of 1/rate, and says so in `Measurement.time`. Exact where exposures coincide
      with control steps.

    All rods are exposed together. Time never goes backwards; only `reset` starts again.

    Args:
        cameras: `StereoCameras`, `GaussianCameras` or anything with their `measure`.
        rate: frames a second.
        delay: from exposure to arrival, s; None for none.
        drop_probability: that the frame of a rod never arrives, for each rod independently. Where others do arrive, the
            markers of that rod are NaN; where none does there is no measurement.

    Raises:
        ValueError: on a bad number.
    """

    def __init__(
        self, cameras: Cameras, *, rate: float = 50.0, delay: float | None = None, drop_probability: float = 0.0
    ) -> None:
        if not hasattr(cameras, "measure"):
            raise ValueError(f"cameras must have measure, but got {cameras!r}: give StereoCameras or GaussianCameras.")
        self.cameras = cameras
        self.rate = _checks.number("rate", rate, above=0.0, advice="give frames a second")
        advice = "give it in seconds, or None for none"
        self.delay = 0.0 if delay is None else _checks.number("delay", delay, at_least=0.0, advice=advice)
        self.drop_probability = _checks.number(
            "drop_probability", drop_probability, at_least=0.0, at_most=1.0, advice="give a probability"
        )
        self.reset()

    def reset(self, seed: int | np.random.SeedSequence | None = None) -> None:
        """Back to time 0 with no frame under way; the same seed gives the same noise, and None another each time.

        Frames that are dropped take their random numbers too: another drop probability leaves the noise as it is.
        """
        self._generator = np.random.default_rng(seed)
        self._frames = 0  # exposed since time 0
        self._time = 0.0
        self._under_way: deque[Measurement] = deque()

    @property
    def time(self) -> float:
        """Latest time that was told, s."""
        return self._time

    @property
    def next_exposure(self) -> float:
        """Time of the next frame, s."""
        return self._frames / self.rate

    def expose(self, time: float, positions: np.ndarray, centrelines: np.ndarray | None = None) -> None:
        """Take the frame that is due.

        Args:
            time: of the exposure, s: `next_exposure`, or later by less than one frame.
            positions: m, world, (num_rods, num_markers, 3); not finite where a rod diverged, which is then not seen.
            centrelines: nodes of the rods, m, world, (num_rods, num_nodes, 3), for cameras that need them.

        Raises:
            ValueError: on a wrong shape, a frame that is not due yet, one that was missed, or time going backwards.
        """
        positions = checked_positions("positions", positions)
        time = self._later(time)
        due = self.next_exposure
        if time < due - SAME_TIME:
            raise ValueError(f"time must be at a frame, but got {time:.9g} s: the next is due at {due:.9g} s.")
        if time > due + 1.0 / self.rate - SAME_TIME:
            raise ValueError(
                f"time must be less than a frame after the exposure at {due:.9g} s, but got {time:.9g} s: a frame was "
                "missed; call at least once a frame, use film, or lower rate."
            )
        measured, covariance = self.cameras.measure(positions, self._generator, centrelines)
        self._time, self._frames = time, self._frames + 1
        lost = self._generator.random(len(measured)) < self.drop_probability
        measured[lost] = np.nan
        if not lost.all():
            self._under_way.append(Measurement(positions=measured, covariance=covariance, time=time))

    def arrived(self, time: float) -> list[Measurement]:
        """Measurements that came in by `time` (s) and were not handed out before, oldest first.

        Raises:
            ValueError: if time goes backwards.
        """
        self._time = self._later(time)
        here = []
        while self._under_way and self._under_way[0].time + self.delay <= self._time + SAME_TIME:
            here.append(self._under_way.popleft())
        return here

    def observe(self, time: float, positions: np.ndarray, centrelines: np.ndarray | None = None) -> list[Measurement]:
        """Expose a frame if one is due, and hand out what came in by `time` (s); arguments as in `expose`.

        Raises:
            ValueError: on a wrong shape, time going backwards, or more than one frame since the last call.
        """
        if self._later(time) >= self.next_exposure - SAME_TIME:
            self.expose(time, positions, centrelines)
        return self.arrived(time)

    def film(
        self, simulation: Simulation, duration: float, field: Field = None, *, nodes: Sequence[int] | np.ndarray = (-1,)
    ) -> list[Measurement]:
        """Advance a simulation and expose every frame on the way at its own moment.

        Stops split the simulation's steps, so that its last digits depend on the rate.

        Args:
            simulation: whose clock agrees with the stream's: reset both together.
            duration: s.
            field: as in `Simulation.advance`.
            nodes: of the markers, indices into `simulation.positions` (`marker_nodes` finds them); the tip if none are.

        Returns:
            What came in by the end, oldest first.

        Raises:
            ValueError: on what `Simulation.advance` refuses, or where the simulation's time is before the stream's, or
                so late that a frame was missed.
        """
        duration = _checks.number("duration", duration, at_least=0.0, advice="give it in seconds")
        end, here = self._later(simulation.time) + duration, []
        while self.next_exposure <= end + SAME_TIME:
            simulation.advance(max(0.0, self.next_exposure - simulation.time), field)
            rods = simulation.positions
            self.expose(simulation.time, rods[:, np.asarray(nodes, int)], rods)
            here += self.arrived(simulation.time)
        simulation.advance(max(0.0, end - simulation.time), field)
        return here + self.arrived(end)

    def _later(self, time: float) -> float:
        time = _checks.number("time", time, advice="give it in seconds")
        if time < self._time - SAME_TIME:
            raise ValueError(
                f"time must not go backwards, but got {time:.9g} s after {self._time:.9g} s: go on, or reset."
            )
        return max(time, self._time)
