"""The one loop that runs a rod through samples of time, what it sees, and how a call is timed."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, TypedDict

import numpy as np

from magrod_env import Scene, Simulation, SimulationDiverged
from magrod_env.magnetics import FieldCourse

if TYPE_CHECKING:
    from typing_extensions import Unpack

Field = Callable[[float], np.ndarray]
See = Callable[[Simulation], np.ndarray]


class Options(TypedDict, total=False):
    """Arguments of `Simulation` beside its scene."""

    num_rods: int
    num_elements: int | None
    element: str
    time_step: float | None
    tolerance: float | None
    expected_field: float
    precision: str
    plane: str | None
    axial_softening: float | None
    rotary_scaling: float | None
    integrator: str | None
    frequency_shaping: bool
    on_failure: str
    num_threads: int | None


def build(scene: Scene, options: Options, **more: Unpack[Options]) -> Simulation:
    """A simulation with some options, of which `more` replaces or adds some."""
    every: Options = {**options, **more}
    return Simulation(scene, **every)


@dataclass(frozen=True)
class Course:
    """What was seen of a run: times (K,) s, seen (K, ...), NaN after a divergence; wall: its run time, s."""

    times: np.ndarray
    seen: np.ndarray
    wall: float

    @property
    def whole(self) -> bool:
        """Whether the rod got to the end."""
        return bool(np.isfinite(self.seen[-1]).all())


def tip(simulation: Simulation) -> np.ndarray:
    """Tip of the first rod, (3,) m."""
    return simulation.tip_position[0]


def tips(simulation: Simulation) -> np.ndarray:
    """Tips of all rods, (num_rods, 3) m, NaN where one was lost."""
    return np.where(simulation.status[:, None] == 0, simulation.tip_position, np.nan)


def magnets(simulation: Simulation) -> np.ndarray:
    """Magnets of the first rod, the tip's first, or its tip where it has none, (points, 3) m."""
    return simulation.positions[0, list(simulation.magnet_nodes) or [simulation.num_elements]]


def follow(
    simulation: Simulation,
    times: np.ndarray,
    field: Field | FieldCourse | np.ndarray | None = None,
    *,
    see: See = tip,
    after: Callable[[Simulation, float], None] | None = None,
) -> Course:
    """Run a simulation from its present state, and see it at every sample.

    Args:
        simulation: what runs.
        times: samples, (K,) s, the first at its present state.
        field: T: a function of time or a `FieldCourse` for all of the run, one field for each interval
            (K - 1, 3) or (K - 1, num_rods, 3), or None for the present one.
        see: what is kept of a sample.
        after: called with the simulation and the interval (s) before a sample is seen.
    """
    seen, held = [see(simulation)], isinstance(field, np.ndarray)
    start = time.perf_counter()
    try:
        for k, interval in enumerate(np.diff(times)):
            simulation.advance(interval, field[k] if held else field)  # type: ignore[index]
            if after is not None:
                after(simulation, interval)
            seen.append(see(simulation))
    except SimulationDiverged:
        seen += [np.full_like(seen[0], np.nan)] * (len(times) - len(seen))
    return Course(np.asarray(times), np.array(seen), time.perf_counter() - start)


def samples(duration: float, interval: float) -> np.ndarray:
    """Evenly spaced times from 0 to a duration, s."""
    return interval * np.arange(round(duration / interval) + 1)


def rms(found: np.ndarray, truth: np.ndarray) -> float:
    """Root mean square of the distance of points (..., 3), mm for m."""
    return 1e3 * float(np.sqrt(np.mean(np.sum((found - truth) ** 2, axis=-1))))


def slope(x: Sequence[float], y: Sequence[float]) -> float:
    """Exponent p of the fit y = c x^p, by least squares."""
    return float(np.polyfit(np.log(x), np.log(y), 1)[0])


def whole_steps(interval: float, time_step: float) -> int:
    """The fewest steps of at most `time_step` that fill an interval (s)."""
    return max(1, math.ceil(interval / time_step - 1e-9))


def least_time(call: Callable[[], object], *, repeats: int = 5, duration: float = 0.05) -> float:
    """Shortest time (s) of a call over `repeats` runs of about `duration` s each, after a warm-up call.

    Other processes only ever add time: the minimum is what the call takes.
    """
    call()
    count = max(1, round(duration / max(_time(call, 1), 1e-9)))
    return min(_time(call, count) for _ in range(repeats)) / count


def _time(call: Callable[[], object], count: int) -> float:
    """Time (s) of a number of calls."""
    start = time.perf_counter()
    for _ in range(count):
        call()
    return time.perf_counter() - start
