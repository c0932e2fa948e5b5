"""The one loop that runs an estimator: it predicts tick by tick, and takes in the frames that have come."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from typing import Protocol

import numpy as np

from magrod_env.estimation import Measurement


class Estimator(Protocol):
    """What the loop needs of an estimator."""

    @property
    def positions(self) -> np.ndarray: ...
    @property
    def velocities(self) -> np.ndarray: ...
    def predict(self, field: np.ndarray, duration: float) -> None: ...
    def update(self, measurement: Measurement) -> None: ...


def track(
    estimator: Estimator,
    fields: np.ndarray,
    tick: float,
    frames: Callable[[int], Sequence[Measurement]],
    watch: Callable[[int, Sequence[Measurement] | None], None],
) -> float:
    """Run an estimator over len(fields) ticks; returns its wall time, s.

    Args:
        estimator: predicts and is updated.
        fields: of each tick, (K, 3) T.
        tick: s.
        frames: what arrives after so many ticks, from 0 on.
        watch: called after so many ticks, with None before the frames are taken in, then with the frames.
    """
    seconds = 0.0
    for k in range(len(fields) + 1):
        if k > 0:
            seconds += _timed(lambda: estimator.predict(fields[k - 1], tick))  # noqa: B023
        watch(k, None)
        arrived = frames(k)
        for frame in arrived:
            seconds += _timed(lambda: estimator.update(frame))  # noqa: B023
        watch(k, arrived)
    return seconds


def _timed(call: Callable[[], None]) -> float:
    start = time.perf_counter()
    call()
    return time.perf_counter() - start
