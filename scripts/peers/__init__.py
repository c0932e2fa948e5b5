"""The same rod with other simulators, for error against run time: one adapter a module of this folder.

An adapter names its simulator (`NAME`), says whether it can run (`available`), offers its best set-ups (`settings`),
runs one (`run`) and times many rods at once (`run_batch`): the field is set, all rods advance, states can be read.
Simulators are imported inside functions.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from dataclasses import dataclass
from importlib import metadata
from typing import Protocol

import numpy as np

from magrod_env import Scene
from scripts.common.run import Field, rms

CONTROL_TIME, CONTROL_STEPS, REPEATS = 0.02, 5, 5  # of a batch: s, steps timed together, of which the least counts


@dataclass(frozen=True)
class Problem:
    """A round rod straight and at rest at time 0, without internal damping or spin drag, in a field (3,) T of time."""

    scene: Scene
    field: Field | None = None

    @property
    def gravity(self) -> np.ndarray:
        """m/s^2, (3,)."""
        return np.array(self.scene.gravity or (0.0, 0.0, 0.0))

    @property
    def drag_rate(self) -> float:
        """1/s."""
        return self.scene.drag_rate or 0.0

    @property
    def twists(self) -> bool:
        """Whether a magnet's moment is not along the tangent; nothing else twists the rod."""
        return any(np.any(magnet.dipole_moment[1:]) for magnet in self.scene.magnets)

    def field_at(self, times: np.ndarray) -> np.ndarray:
        """Flux density (K, 3) T at times (K,) s."""
        return np.array([np.zeros(3) if self.field is None else self.field(at) for at in times], dtype=float)


class Setting(Protocol):
    """One set-up: its kind, and what tells it from the others of its kind."""

    @property
    def label(self) -> str: ...
    @property
    def resolution(self) -> str: ...


@dataclass
class PeerRun:
    """What one set-up of a simulator gave.

    times (T,) s; tip (T, 3) m, NaN where the run diverged; wall_per_second: wall time (s) of a simulated second, the
    least of several runs, model building and compilation left out.
    """

    peer: str
    label: str
    resolution: str
    times: np.ndarray
    tip: np.ndarray
    wall_per_second: float
    diverged: bool

    def error(self, truth: np.ndarray) -> float | None:
        """Root mean square over time of the distance to the tip's reference (T, 3) m, in mm; None if it diverged."""
        return None if self.diverged else rms(self.tip, truth)


def missing(package: str, least: str) -> str | None:
    """None if `package` is installed in version `least` or later, else a sentence that says what to install."""
    advice = f'pip install "{package}>={least}"'
    try:
        version = metadata.version(package)
    except metadata.PackageNotFoundError:
        return f"{package} is not installed: {advice}"
    if tuple(map(int, version.split(".")[:2])) < tuple(map(int, least.split("."))):
        return f"{package} {version} is too old: {advice}"
    return None


def finished(
    peer: str,
    setting: Setting,
    problem: Problem,
    times: np.ndarray,
    simulate: Callable[[], tuple[np.ndarray, float]],
    repeats: int,
) -> PeerRun:
    """A PeerRun from `simulate() -> (tip (T, 3), wall time of the steps in s)`, called `repeats` times."""
    tip, wall = simulate()
    lost = np.linalg.norm(tip, axis=-1) > 2 * problem.scene.rod.length
    diverged = not np.all(np.isfinite(tip)) or bool(np.any(lost))
    for _ in range(0 if diverged else repeats - 1):
        wall = min(wall, simulate()[1])
    tip = np.full_like(tip, np.nan) if diverged else tip
    return PeerRun(peer, setting.label, setting.resolution, times, tip, wall / float(times[-1] - times[0]), diverged)


def control_steps_per_second(num_rods: int, step: Callable[[int], object], begin: Callable[[], object]) -> float:
    """Control steps per second of `num_rods` rods together; `step` makes that of a number, after `begin`."""
    shortest = math.inf
    for _ in range(REPEATS):
        begin()
        start = time.perf_counter()
        for k in range(CONTROL_STEPS):
            step(k)
        shortest = min(shortest, time.perf_counter() - start)
    return num_rods * CONTROL_STEPS / shortest
