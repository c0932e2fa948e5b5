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
from typing import Any

import numpy as np

CONTROL_TIME, CONTROL_STEPS, REPEATS = 0.02, 5, 5  # of a batch: s, steps timed together, of which the least counts

Field = Callable[[float], np.ndarray]
Magnet = tuple[float, float, np.ndarray]


@dataclass(frozen=True)
class Problem:
    """A round rod along x, clamped at the origin, straight and at rest at time 0; SI units, world axes.

    length, diameter (m); density (kg/m^3); youngs_modulus (Pa); poissons_ratio: shear stiffness E A / (2 (1 + nu)),
    no shear correction. gravity (3,) m/s^2 or None. drag_rate (1/s) or None: force -drag_rate * mass * velocity on rod
    and magnets, none on rotation. magnets: (position along the rod m, point mass kg, moment (3,) A m^2 in the body
    frame whose first axis is the tangent). field: time (s) -> uniform flux density (3,) T, or None. duration (s).
    """

    length: float
    diameter: float
    density: float
    youngs_modulus: float
    poissons_ratio: float = 0.5
    gravity: tuple[float, float, float] | None = None
    drag_rate: float | None = None
    magnets: tuple[Magnet, ...] = ()
    field: Field | None = None
    duration: float = 2.0

    @property
    def area(self) -> float:
        """Cross-section, m^2."""
        return math.pi * self.diameter**2 / 4

    @property
    def second_moment(self) -> float:
        """Of area about a diameter, m^4; the polar one is twice that."""
        return math.pi * self.diameter**4 / 64

    @property
    def shear_modulus(self) -> float:
        """Pa."""
        return self.youngs_modulus / (2 * (1 + self.poissons_ratio))

    def field_at(self, at: float) -> np.ndarray:
        """Flux density (3,) T at a time (s)."""
        return np.zeros(3) if self.field is None else np.asarray(self.field(at), dtype=float)


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
        if self.diverged:
            return None
        return 1e3 * float(np.sqrt(np.mean(np.sum((self.tip - truth) ** 2, axis=-1))))


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


def whole_steps(interval: float, time_step: float) -> int:
    """The fewest steps of at most `time_step` that fill an interval (s)."""
    return max(1, math.ceil(interval / time_step - 1e-9))


def finished(
    peer: str,
    setting: Any,
    problem: Problem,
    times: np.ndarray,
    simulate: Callable[[], tuple[np.ndarray, float]],
    repeats: int,
) -> PeerRun:
    """A PeerRun from `simulate() -> (tip (T, 3), wall time of the steps in s)`, called `repeats` times."""
    tip, wall = simulate()
    diverged = not np.all(np.isfinite(tip)) or bool(np.any(np.linalg.norm(tip, axis=-1) > 2 * problem.length))
    for _ in range(0 if diverged else repeats - 1):
        wall = min(wall, simulate()[1])
    tip = np.full_like(tip, np.nan) if diverged else tip
    return PeerRun(peer, setting.label, setting.resolution, times, tip, wall / float(times[-1] - times[0]), diverged)


def control_steps_per_second(num_rods: int, step: Callable[[int], Any], begin: Callable[[], Any]) -> float:
    """Control steps per second of `num_rods` rods together; `step` makes that of a number, after `begin`."""
    shortest = math.inf
    for _ in range(REPEATS):
        begin()
        start = clock()
        for k in range(CONTROL_STEPS):
            step(k)
        shortest = min(shortest, clock() - start)
    return num_rods * CONTROL_STEPS / shortest


def clock() -> float:
    """Seconds, for differences."""
    return time.perf_counter()
