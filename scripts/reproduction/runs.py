"""Runs of the paper's scenes: element, modulus, time step and start, and what is measured on a course of the tip."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from magrod_env import Simulation, load_scene
from magrod_env.magnetics import FieldCourse
from magrod_env.scenes import PaperScene
from scripts.common import run
from scripts.common.run import Options
from scripts.common.starts import pluck
from scripts.reproduction.printed import stated

SHARE_OF_BOUND = 0.9  # where the paper's time step lies beyond the bound
DRAG = 5.0  # 1/s: this project's choice, the paper prints none


@dataclass(frozen=True)
class Model:
    """How a scene is simulated; the modulus as `load_scene` takes it."""

    name: str
    element: str
    modulus: Literal["printed", "effective"] | float = "printed"
    shaping: bool = False
    drag: float = 0.0  # 1/s

    def damped(self) -> Model:
        """The same with drag."""
        return replace(self, name=f"{self.name}, drag", drag=DRAG)


NODAL = Model("nodal", "nodal")
SHAPED = Model("nodal, shaped", "nodal", shaping=True)
PRINTED = Model("helical, printed E", "helical")
EFFECTIVE = Model("helical, effective E", "helical", "effective")
DAMPED = EFFECTIVE.damped()


@dataclass(frozen=True)
class Run(run.Course):
    """The course (K, points, 3) m of the magnets, or of the tip where there are none, of a model's simulation."""

    model: Model
    simulation: Simulation

    @property
    def points(self) -> np.ndarray:
        """Positions, the tip's first, (K, points, 3) m."""
        return self.seen

    @property
    def tip(self) -> np.ndarray:
        """Positions of the tip, (K, 3) m."""
        return self.seen[:, 0]


def build(record: PaperScene, model: Model, *, plane: str | None, field: float = 0.0) -> Simulation:
    """The scene with the paper's number of elements, for fields up to `field` (T).

    The nodal element takes the paper's time step, or 0.9 of the bound where it is beyond that; the helical its default.
    """
    scene = load_scene(record.name, modulus=model.modulus).replace(drag_rate=model.drag)
    options: Options = {"num_elements": record.num_elements, "element": model.element, "plane": plane}
    simulation = run.build(scene, options, frequency_shaping=model.shaping)
    if model.element == "nodal":
        step, bound = stated(record.paper_time_step), simulation.stable_time_step_in(field)
        simulation.time_step = step if step <= bound else SHARE_OF_BOUND * bound
    return simulation


def follow(
    model: Model, simulation: Simulation, duration: float, interval: float, field: FieldCourse | None = None
) -> Run:
    """Positions of the magnets, or of the tip where there are none, from now on."""
    course = run.follow(simulation, run.samples(duration, interval), field, see=run.magnets)
    return Run(course.times, course.seen, course.wall, model, simulation)


# ---- starts


def release(simulation: Simulation, offset: tuple[float, float], stiffening: float = 1.0) -> None:
    """Bring the rod to rest, bent in its first mode by `offset` (y, z) m at the tip.

    It starts straight with the speeds of the mode and runs for a quarter of its period. `stiffening` is the factor by
    which the element is too stiff in bending: it swings faster, so it must also start faster.
    """
    simulation.reset()
    faster = math.sqrt(stiffening)
    pluck(simulation, (faster * offset[0], faster * offset[1]))
    simulation.advance(0.25 / float(simulation.natural_frequencies()[0]))


def chord_angle(simulation: Simulation) -> float:
    """Angle, rad, of the line from the clamp to the tip above the level."""
    x, _, z = simulation.tip_position[0]
    return math.atan2(z, x)


def tangent_angle(simulation: Simulation) -> float:
    """Angle, rad, of the tip's section normal above the level."""
    x, _, z = simulation.rotations[0, -1, :, 0]
    return math.atan2(z, x)


def swing_to(simulation: Simulation, angle: float, measure: Callable[[Simulation], float] = chord_angle) -> None:
    """Bring the rod to the turning point of a swing about its sag under gravity, where it has an angle (rad).

    It starts from the sag with the speeds of its first mode, in the angle's direction; how fast is found by bisection.
    """
    still = (0.0, 0.0, 0.0)
    period = 1.0 / float(simulation.natural_frequencies(still)[0])
    simulation.reset(field=still)
    way = math.copysign(1.0, angle - measure(simulation))
    slow, fast = 0.0, 2.0 * simulation.scene.rod.length
    for _ in range(30):
        amplitude = 0.5 * (slow + fast)
        simulation.reset(field=still)
        pluck(simulation, (0.0, way * amplitude))
        while way * simulation.velocities[0, -1, 2] > 0.0:
            simulation.advance(period / 400.0)
        short = way * measure(simulation) < way * angle
        slow, fast = (amplitude, fast) if short else (slow, amplitude)


# ---- what a course shows


def frequency(times: np.ndarray, values: np.ndarray) -> float | None:
    """Frequency, Hz, of a swing: from the upward crossings of its middle, by straight lines between samples."""
    away = values - 0.5 * (values.max() + values.min())
    before = np.flatnonzero((away[:-1] < 0.0) & (away[1:] >= 0.0))
    if len(before) < 2:
        return None
    crossings = times[before] - away[before] * (times[before + 1] - times[before]) / (away[before + 1] - away[before])
    return float((len(crossings) - 1) / (crossings[-1] - crossings[0]))


def decay_rate(times: np.ndarray, values: np.ndarray, rest: float) -> float | None:
    """Rate, 1/s, at which the turning points of a swing approach a rest position."""
    away = np.abs(values - rest)
    peaks = np.flatnonzero((away[1:-1] > away[:-2]) & (away[1:-1] >= away[2:]) & (away[1:-1] > 0.02 * away.max())) + 1
    if len(peaks) < 3:
        return None
    return float(-np.polyfit(times[peaks], np.log(away[peaks]), 1)[0])


def span(values: np.ndarray) -> float:
    """Range of a coordinate, mm for m."""
    return 1e3 * float(np.ptp(values))
