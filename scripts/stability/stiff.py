"""Thin metal rods: how fast they run, and what their conditioning costs in accuracy."""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from tqdm import tqdm

from magrod_env import Scene, Simulation, load_scene
from scripts import Check, Report, Table

CONTROL_TIME = 0.01  # s: samples, and steps of the field
FIRST_ROOT = 1.8751040687  # of cosh x cos x = -1
TREATMENTS: dict[str, dict[str, Any]] = {
    "explicit": {},
    "EA/10, rho I x 20": {"axial_softening": 10.0, "rotary_scaling": 20.0},
    "EA/100, rho I x 200": {"axial_softening": 100.0, "rotary_scaling": 200.0},
    "EA/1000, rho I x 2000": {"axial_softening": 1000.0, "rotary_scaling": 2000.0},
    "tolerance 0.1 mm": {"tolerance": 1e-4},
    "implicit": {"integrator": "implicit"},
    "implicit, order 4": {"integrator": "implicit4"},
}


@dataclass(frozen=True)
class Task:
    """A scene with a motion: plucked in its first mode to some tip offset (y, z) m, or in a field, T, of time, s."""

    scene: Scene
    duration: float
    offset: tuple[float, float] = (0.0, 0.0)
    field: Callable[[float], np.ndarray] | None = None
    expected_field: float = 0.0


def turning_field(at: float) -> np.ndarray:
    """20 mT turning about the wire once a second, over a ramp of 0.4 s; T."""
    share = min(at / 0.4, 1.0)
    angle = 2.0 * math.pi * at
    return 20e-3 * share**2 * (3.0 - 2.0 * share) * np.array([0.0, math.cos(angle), math.sin(angle)])


ACROSS = (0.0, 0.0, -9.81)
TASKS = {
    "aluminium, 2 mm, plucked 12.9 mm": Task(load_scene("paper1_aluminium_in_plane"), 1.5, (0.0, 12.9e-3)),
    "aluminium, 1 mm, plucked 8 and 10 mm": Task(load_scene("paper2_aluminium_out_of_plane"), 1.5, (8e-3, 10e-3)),
    "aluminium, 1 mm, released, gravity across": Task(
        load_scene("paper2_aluminium_out_of_plane").replace(gravity=ACROSS), 1.5
    ),
    "NiTi wire, 0.35 mm, field of 20 mT turning": Task(
        load_scene("niti_guidewire"), 2.0, field=turning_field, expected_field=20e-3
    ),
}


def first_mode(x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """First mode of a slender cantilever at x = s/L, 1 at the tip, and its slope d/dx."""
    k = FIRST_ROOT
    ratio = (math.cosh(k) + math.cos(k)) / (math.sinh(k) + math.sin(k))
    shape = np.cosh(k * x) - np.cos(k * x) - ratio * (np.sinh(k * x) - np.sin(k * x))
    slope = k * (np.sinh(k * x) + np.sin(k * x) - ratio * (np.cosh(k * x) - np.cos(k * x)))
    return 0.5 * shape, 0.5 * slope


def pluck(simulation: Simulation, offset: tuple[float, float]) -> None:
    """Give the straight rod the speeds of its first mode as it passes the middle on its way to a tip offset (m)."""
    rod = simulation.scene.rod
    pace = (FIRST_ROOT / rod.length) ** 2 * math.sqrt(rod.bending_stiffness / rod.mass_per_length)
    shape, slope = first_mode(simulation.arc_lengths / rod.length)
    velocities, spins = (np.zeros((simulation.num_rods, simulation.num_elements + 1, 3)) for _ in range(2))
    velocities[..., 1], velocities[..., 2] = pace * offset[0] * shape, pace * offset[1] * shape
    spins[..., 1], spins[..., 2] = -pace * offset[1] * slope / rod.length, pace * offset[0] * slope / rod.length
    simulation.set_motion(velocities, spins)


def perform(task: Task, simulation: Simulation, duration: float) -> tuple[np.ndarray, float]:
    """Tip (samples, 3) m over a task, and the run time, s."""
    simulation.advance(CONTROL_TIME)  # compile
    simulation.reset()
    pluck(simulation, task.offset)
    tips = []
    start = time.perf_counter()
    for k in range(round(duration / CONTROL_TIME)):
        field = None if task.field is None else task.field((k + 0.5) * CONTROL_TIME)
        simulation.advance(CONTROL_TIME, field=field)
        tips.append(simulation.tip_position[0])
    return np.array(tips), time.perf_counter() - start


def stiff(report: Report, quick: bool) -> None:
    """Real-time factor and error of every task and treatment."""
    table = Table(
        "Stiff rods: speed and error of the tip",
        (
            "task",
            "treatment",
            "N",
            "step, µs",
            "simulated / run time",
            "tip RMS, mm",
            "largest, mm",
            "range of the tip, mm",
        ),
    )
    notes = []
    for words, task in list(TASKS.items())[-1:] if quick else TASKS.items():
        duration = 0.2 if quick else task.duration
        options = dict(expected_field=task.expected_field)
        truths = {}
        for elements in (8,) if quick else (16, 24):
            fine = Simulation(task.scene, num_elements=elements, **options)
            fine.time_step *= 0.5
            truths[elements] = perform(task, fine, duration)[0]
        truth = truths[max(truths)]
        if len(truths) > 1:
            apart = 1e3 * np.sqrt(np.mean(np.sum((truths[16] - truth) ** 2, axis=1)))
            notes.append(f"{words} {apart:.2g} mm")
        for treatment, choice in tqdm(TREATMENTS.items(), desc=words, leave=False):
            if quick and treatment != "EA/100, rho I x 200":
                continue
            if "tolerance" not in choice:
                choice = {"num_elements": 6, **choice}
            simulation = Simulation(task.scene, **options, **choice)
            tips, wall = perform(task, simulation, duration)
            errors, span = np.linalg.norm(tips - truth, axis=1), np.ptp(truth, axis=0).max()
            step = CONTROL_TIME / math.ceil(CONTROL_TIME / simulation.time_step - 1e-9)
            rms = float(np.sqrt(np.mean(errors**2)))
            if treatment == "tolerance 0.1 mm" and task.offset == (0.0, 0.0):
                report.checks.append(Check("stiff", f"{words}, tolerance 0.1 mm: tip RMS", 1e3 * rms, 0.1, "mm"))
            row = (words, treatment, simulation.num_elements, 1e6 * step, duration / wall)
            table.rows.append((*row, 1e3 * rms, 1e3 * float(errors.max()), 1e3 * float(span)))
    table.note = (
        "One rod on one core, float64. Errors against 24 elements at half of their default step; RMS distance of that "
        f"from 16 elements: {'; '.join(notes)}. Plucked: released in the first mode at full speed, as a tolerance's "
        "pilots are where no field moves the rod; implicit: at the step that is taken where none is given."
        if notes
        else "Quick: against 8 elements."
    )
    report.show("stiff", table)
