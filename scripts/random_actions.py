"""How far the environments' resolution is from a rod of many elements under random actions.

`python -m scripts.random_actions [--quick] [--json FILE]`: tip errors in mm of rods whose field is drawn anew, evenly
within the coils' limits, at every control step; how far the tip moves where all loads change by 1e-4; and the same
with coils that lag, and with and without internal damping.
"""

from __future__ import annotations

import numpy as np
from tqdm import tqdm

from magrod_env import Scene
from magrod_env.envs.tasks import TASKS
from magrod_env.magnetics import FieldCourse
from scripts.common import run
from scripts.common.command import Options, main
from scripts.common.report import Report
from scripts.common.run import samples

CONTROL = 0.02  # s
LIMIT = 45e-3  # T, of either coil
LAG = 10e-3  # s
START = (0.0, 0.0, 7.75e-3)  # T
CHANGE = 1e-4  # of all loads
PARTS = 40  # of a control step, in which the field of lagging coils is straight
FINEST = 24  # elements of what others are compared with
SETTINGS: dict[str, run.Options] = {
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


def course(actions: np.ndarray, lag: float) -> FieldCourse:
    """The field that coils with a lag make of commands (K, rods, 2)."""
    times = CONTROL / PARTS * np.arange(len(actions) * PARTS + 1)
    fields = np.empty((len(times), actions.shape[1], 3))
    fields[0], keep = START, np.exp(-CONTROL / PARTS / lag)
    for k in range(1, len(times)):
        target = np.zeros_like(fields[0])
        target[:, 1:] = LIMIT * actions[(k - 1) // PARTS]
        fields[k] = target + keep * (fields[k - 1] - target)
    return FieldCourse(times=times, fields=fields)


def tips(scene: Scene, actions: np.ndarray, lag: float | None, settings: run.Options) -> np.ndarray:
    """Tip after every control step, m, (K, rods, 3)."""
    simulation = run.build(scene, settings, num_rods=actions.shape[1], on_failure="report")
    simulation.reset(field=START)
    held = np.zeros((*actions.shape[:2], 3))
    held[..., 1:] = LIMIT * actions
    field = held if lag is None else course(actions, lag)
    return run.follow(simulation, samples(len(actions) * CONTROL, CONTROL), field, see=run.tips).seen[1:]


def rms(one: np.ndarray, other: np.ndarray, steps: int) -> float:
    """RMS distance of two runs over the first control steps, mm."""
    return float(1e3 * np.sqrt(np.nanmean(np.sum((one[:steps] - other[:steps]) ** 2, axis=-1))))


def show(report: Report, name: str, lag: float | None, damping: float | None, actions: np.ndarray) -> None:
    """Table of one kind of coils and rod."""
    scene = TASKS["circle"].scene().replace(internal_damping=damping)
    heavier = scene.replace(gravity=tuple((1.0 + CHANGE) * np.array(scene.gravity)))
    finest: run.Options = {"num_elements": FINEST}
    reference, steps = tips(scene, actions, lag, finest), len(actions)
    with report.table(
        f"random_{len(report.tables)}",
        f"Random actions, {name}: distance of the tip from that of {FINEST} elements, mm",
        f"rod | first 10 control steps | all {steps} | loads changed by {CHANGE:g}, all {steps}",
        f"RMS over {actions.shape[1]} rods; last column: distance from the same rod under its own loads.",
    ) as table:
        for label, settings in tqdm(SETTINGS.items(), desc=name, leave=False):
            found = tips(scene, actions, lag, settings)
            moved = tips(heavier, (1.0 + CHANGE) * actions, lag, settings)
            table.add(label, rms(found, reference, 10), rms(found, reference, steps), rms(moved, found, steps))
        moved = tips(heavier, (1.0 + CHANGE) * actions, lag, finest)
        table.add(f"{FINEST} elements", None, None, rms(moved, reference, steps))


def measure(args: Options) -> Report:
    """All cases; few rods and ten control steps if quick."""
    report = Report("scripts.random_actions", args.quick)
    rods, steps = (4, 10) if args.quick else (16, 50)
    actions = np.random.default_rng(0).uniform(-1.0, 1.0, (steps, rods, 2))
    for name, (lag, damping) in CASES.items():
        show(report, name, lag, damping, actions)
    return report


if __name__ == "__main__":
    main(Options, measure, __doc__)
