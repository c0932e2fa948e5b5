"""How far the environments' resolution is from a rod of many elements under random actions.

`python -m scripts.random_actions [--quick] [--json FILE]`: tip errors in mm of rods whose field is drawn anew, evenly
within the coils' limits, at every control step; how far the tip moves where all loads change by 1e-4; and the same
with coils that lag, and with and without internal damping.
"""

from __future__ import annotations

import sys
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import tyro
from tqdm import tqdm

from magrod_env import Scene, Simulation
from magrod_env.envs.tasks import TASKS
from magrod_env.magnetics import FieldCourse
from scripts import Report, Table

CONTROL = 0.02  # s
LIMIT = 45e-3  # T, of either coil
LAG = 10e-3  # s
START = (0.0, 0.0, 7.75e-3)  # T
CHANGE = 1e-4  # of all loads
PARTS = 40  # of a control step, in which the field of lagging coils is straight
FINEST = 24  # elements of what others are compared with
SETTINGS: dict[str, dict[str, Any]] = {
    "4 elements, rotary inertia x 8 (the environments)": {"num_elements": 4, "rotary_scaling": 8.0},
    "4 elements": {"num_elements": 4},
    "6 elements": {"num_elements": 6},
    "8 elements": {"num_elements": 8},
}
CASES = {  # lag of the coils (s), Kelvin-Voigt time (s)
    "coils without lag, no internal damping": (None, None),
    "coils without lag, 3 ms (the environments)": (None, 3e-3),
    "coils with a lag of 10 ms, no internal damping": (LAG, None),
    "coils with a lag of 10 ms, 3 ms": (LAG, 3e-3),
}


@dataclass
class Args:
    """What to measure."""

    quick: bool = False
    """few rods, ten control steps"""
    json: Path | None = None
    """where to write the numbers as JSON"""


def course(actions: np.ndarray, lag: float | None) -> FieldCourse | None:
    """The field that coils with a lag make of commands (K, rods, 2); None without lag."""
    if lag is None:
        return None
    times = CONTROL / PARTS * np.arange(len(actions) * PARTS + 1)
    fields = np.empty((len(times), actions.shape[1], 3))
    fields[0], keep = START, np.exp(-CONTROL / PARTS / lag)
    for k in range(1, len(times)):
        target = np.zeros_like(fields[0])
        target[:, 1:] = LIMIT * actions[(k - 1) // PARTS]
        fields[k] = target + keep * (fields[k - 1] - target)
    return FieldCourse(times=times, fields=fields)


def tips(scene: Scene, actions: np.ndarray, lag: float | None, **settings: Any) -> np.ndarray:
    """Tip after every control step, m, (K, rods, 3)."""
    simulation = Simulation(scene, num_rods=actions.shape[1], on_failure="report", **settings)
    simulation.reset(field=START)
    fields, out = course(actions, lag), []
    for action in actions:
        field = np.zeros((len(action), 3))
        field[:, 1:] = LIMIT * action
        simulation.advance(CONTROL, field if fields is None else fields)
        out.append(np.where(simulation.status[:, None] > 0, np.nan, simulation.tip_position))
    return np.array(out)


def rms(one: np.ndarray, other: np.ndarray, steps: int) -> float:
    """RMS distance of two runs over the first control steps, mm."""
    return float(1e3 * np.sqrt(np.nanmean(np.sum((one[:steps] - other[:steps]) ** 2, axis=-1))))


def measure(report: Report, name: str, lag: float | None, damping: float | None, actions: np.ndarray) -> None:
    """Table of one kind of coils and rod."""
    scene = TASKS["circle"].scene().replace(internal_damping=damping)
    heavier = scene.replace(gravity=tuple((1.0 + CHANGE) * np.array(scene.gravity)))
    reference = tips(scene, actions, lag, num_elements=FINEST)
    steps = len(actions)
    table = Table(
        f"Random actions, {name}: distance of the tip from that of {FINEST} elements, mm",
        ("rod", "first 10 control steps", f"all {steps}", f"loads changed by {CHANGE:g}, all {steps}"),
        note=f"RMS over {actions.shape[1]} rods; last column: distance from the same rod under its own loads.",
    )
    for label, settings in tqdm(SETTINGS.items(), desc=name, leave=False):
        run = tips(scene, actions, lag, **settings)
        moved = tips(heavier, (1.0 + CHANGE) * actions, lag, **settings)
        table.rows.append((label, rms(run, reference, 10), rms(run, reference, steps), rms(moved, run, steps)))
    moved = tips(heavier, (1.0 + CHANGE) * actions, lag, num_elements=FINEST)
    table.rows.append((f"{FINEST} elements", None, None, rms(moved, reference, steps)))
    report.show(f"random_{len(report.tables)}", table)


def main(args: Args) -> bool:
    """Measure all cases; returns whether no check failed."""
    report = Report("scripts.random_actions", args.quick)
    rods, steps = (4, 10) if args.quick else (16, 50)
    actions = np.random.default_rng(0).uniform(-1.0, 1.0, (steps, rods, 2))
    for name, (lag, damping) in CASES.items():
        measure(report, name, lag, damping, actions)
    return report.finish(args.json)


if __name__ == "__main__":
    sys.exit(0 if main(tyro.cli(Args, description=__doc__)) else 1)
