"""Speeds of the environments beside the error of the very configuration that was timed (part of `scripts.bench`)."""

from __future__ import annotations

from typing import Any

import gymnasium
import numpy as np
from tqdm import tqdm

from magrod_env.rod.threads import usable_cores
from scripts import Check, Report, Table, least_time

CIRCLE, PLANAR = "MagRod/Circle-v0", "MagRod/PlanarReach-v0"
LARGEST_ERROR = 0.06  # mm
FINEST = 24  # elements of the reference
TARGETS = (
    ("Circle, float32, batch", CIRCLE, "float32", 4096, 400_000),
    ("PlanarReach, float32, batch", PLANAR, "float32", 4096, 1_000_000),
    ("Circle, float64, batch", CIRCLE, "float64", 4096, 150_000),
    ("Circle, float64, single", CIRCLE, "float64", 1, 6_000),
)


def commands(env: Any, steps: int) -> np.ndarray:
    """Open-loop actions (steps, num_axes): fields that hold the rod on its path, or a smooth wander for reaching."""
    core = env.unwrapped.core
    if core.task.fields is not None:
        at = (np.arange(steps) + 0.5) * core.control_time / core.task.period * len(core.task.fields)
        fields, first, share = core.task.fields, at.astype(int), (at % 1.0)[:, None]
        return core.coils.fraction(
            (1.0 - share) * fields[first % len(fields)] + share * fields[(first + 1) % len(fields)]
        )
    time = np.arange(steps) * core.control_time
    share = 25e-3 / core.actuator.limit * np.minimum(time / 0.3, 1.0)
    return np.stack([share * (0.5 - 0.5 * np.cos(3.0 * time)), share * np.sin(5.0 * time)], axis=1)


def prepare(name: str, settings: dict[str, Any]) -> Any:
    """An environment at the start of an episode, always the same."""
    env = gymnasium.make(name, **({"random_start": False} if name == CIRCLE else {}), **settings)
    env.reset(seed=0)
    return env


def error(name: str, settings: dict[str, Any], steps: int = 100) -> float:
    """RMS distance of the tip from that of a rod with many elements and no conditioning, mm."""
    envs = prepare(name, settings), prepare(name, {"num_elements": FINEST})
    actions = commands(envs[1], steps)  # the same for both: what holds a rod on its path depends on its elements
    tips = [np.array([env.step(action)[4]["tip_position"] for action in actions]) for env in envs]
    gap = tips[0] - tips[1]
    return 1e3 * float(np.sqrt(np.mean(np.sum(gap**2, axis=-1))))


def targets(report: Report, quick: bool, stepper: Any, make: Any) -> None:
    """Steps a second at an error."""
    table = Table(
        "Environment steps a second, and the tip's RMS error of the same configuration",
        ("configuration", "envs", "elements", "substeps of 20 ms", "error, mm", "steps/s"),
        note=f"50 Hz control, observation and reward included, {usable_cores()} threads share a batch. "
        f"Error: open-loop motion of 2 s against {FINEST} elements without conditioning.",
    )
    for title, name, precision, size, least in tqdm(TARGETS[2:] if quick else TARGETS, desc="targets", leave=False):
        env = make(name, min(size, 64) if quick else size, precision=precision)
        core = env.unwrapped.core
        speed = core.num_envs / least_time(stepper(env), repeats=3 if quick else 15, duration=0.05 if quick else 0.4)
        off = error(name, {"precision": precision})
        table.rows.append((title, core.num_envs, core.num_elements, core.num_steps, off, float(speed)))
        report.checks.append(Check("error", title, off, LARGEST_ERROR, "mm"))
        if not quick:
            report.checks.append(Check("speed", title, speed, float(least), "steps/s", at_least=True, timing=True))
    report.show("targets", table)
