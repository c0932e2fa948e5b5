"""Thin metal rods: how fast they run, and what their conditioning costs in accuracy."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from tqdm import tqdm

from magrod_env import Scene, Simulation, load_scene
from scripts.common.cases import GRAVITY, smoothstep, turning
from scripts.common.report import Report
from scripts.common.run import Course, Field, Options, build, follow, rms, samples, whole_steps
from scripts.common.starts import pluck

CONTROL_TIME = 0.01  # s: samples, and steps of the field
TREATMENTS: dict[str, Options] = {
    "explicit": {"num_elements": 6},
    "EA/10, rho I x 20": {"num_elements": 6, "axial_softening": 10.0, "rotary_scaling": 20.0},
    "EA/100, rho I x 200": {"num_elements": 6, "axial_softening": 100.0, "rotary_scaling": 200.0},
    "EA/1000, rho I x 2000": {"num_elements": 6, "axial_softening": 1000.0, "rotary_scaling": 2000.0},
    "tolerance 0.1 mm": {"tolerance": 1e-4},
    "implicit": {"num_elements": 6, "integrator": "implicit"},
    "implicit, order 4": {"num_elements": 6, "integrator": "implicit4"},
}


@dataclass(frozen=True)
class Task:
    """A scene with a motion: plucked in its first mode to some tip offset (y, z) m, or in a field, T, of time, s."""

    scene: Scene
    duration: float
    offset: tuple[float, float] = (0.0, 0.0)
    field: Field | None = None
    expected_field: float = 0.0


def turning_field(at: float) -> np.ndarray:
    """20 mT turning about the wire once a second, over a ramp of 0.4 s; T."""
    return smoothstep(at / 0.4) * turning(20e-3, 2.0 * np.pi * at)


_THIN = load_scene("paper2_aluminium_out_of_plane")
TASKS = {
    "aluminium, 2 mm, plucked 12.9 mm": Task(load_scene("paper1_aluminium_in_plane"), 1.5, (0.0, 12.9e-3)),
    "aluminium, 1 mm, plucked 8 and 10 mm": Task(_THIN, 1.5, (8e-3, 10e-3)),
    "aluminium, 1 mm, released, gravity across": Task(_THIN.replace(gravity=(0.0, 0.0, -GRAVITY)), 1.5),
    "NiTi wire, 0.35 mm, field of 20 mT turning": Task(
        load_scene("niti_guidewire"), 2.0, field=turning_field, expected_field=20e-3
    ),
}


def perform(task: Task, simulation: Simulation, duration: float) -> Course:
    """The tip over a task, its field held over control steps."""
    simulation.advance(CONTROL_TIME)  # compile
    simulation.reset()
    pluck(simulation, task.offset)
    times = samples(duration, CONTROL_TIME)
    middle = times[:-1] + 0.5 * CONTROL_TIME
    return follow(simulation, times, None if task.field is None else np.array([task.field(at) for at in middle]))


def stiff(report: Report, quick: bool) -> None:
    """Real-time factor and error of every task and treatment."""
    notes = []
    with report.table(
        "stiff",
        "Stiff rods: speed and error of the tip",
        "task | treatment | N | step, µs | simulated / run time | tip RMS, mm | largest, mm | range of the tip, mm",
    ) as table:
        for words, task in list(TASKS.items())[-1:] if quick else TASKS.items():
            duration, truths = 0.2 if quick else task.duration, []
            for elements in (8,) if quick else (16, 24):
                fine = Simulation(task.scene, num_elements=elements, expected_field=task.expected_field)
                fine.time_step *= 0.5
                truths.append(perform(task, fine, duration).seen[1:])
            notes.append(f"{words} {rms(truths[0], truths[-1]):.2g} mm")
            for treatment in tqdm(["EA/100, rho I x 200"] if quick else TREATMENTS, desc=words, leave=False):
                simulation = build(task.scene, TREATMENTS[treatment], expected_field=task.expected_field)
                course = perform(task, simulation, duration)
                tips, error = course.seen[1:], rms(course.seen[1:], truths[-1])
                step = CONTROL_TIME / whole_steps(CONTROL_TIME, simulation.time_step)
                largest = 1e3 * float(np.linalg.norm(tips - truths[-1], axis=1).max())
                row = (words, treatment, simulation.num_elements, 1e6 * step, duration / course.wall)
                table.add(*row, error, largest, 1e3 * float(np.ptp(truths[-1], axis=0).max()))
                if "tolerance" in treatment and task.offset == (0.0, 0.0):
                    report.check("stiff", f"{words}, tolerance 0.1 mm: tip RMS", error, 0.1, "mm")
        table.note = (
            "One rod on one core, float64. Errors against 24 elements at half of their default step; RMS distance of "
            f"that from 16 elements: {'; '.join(notes)}. Plucked: released in the first mode at full speed, as a "
            "tolerance's pilots are where no field moves the rod; implicit: at the step that is taken where none is "
            "given."
        )
    if quick:
        table.note = "Quick: against 8 elements."
