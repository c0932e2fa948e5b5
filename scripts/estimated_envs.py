"""Environments that observe an estimate: how well they know their rods, what control loses by it, what it costs.

`python -m scripts.estimated_envs` prints the tables of docs/environments.md; `--quick` tries everything out.
"""

from __future__ import annotations

import sys
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
import tyro
from tqdm import tqdm

import magrod_env  # noqa: F401  (registers the ids)
from agents.policy import Policy
from agents.rollout import REAL_RODS
from magrod_env.envs import Camera, EstimateState
from magrod_env.estimation import PredictionFilter
from scripts import ROOT, Report, Table

CIRCLE = "MagRod/Circle-v0"
NOISE = 5e-5  # m
SETTLED = 50  # control steps after which errors count
SETTINGS: dict[str, tuple[dict[str, Any], dict[str, Any] | None]] = {
    "perfect camera": ({}, None),
    "camera with 0.05 mm of noise": ({"camera": Camera(noise=NOISE)}, None),
    "ensemble of 32 (default)": ({}, {}),
    "ensemble of 16": ({}, {"members": 16}),
    "prediction filter": ({}, {"estimator": PredictionFilter}),
}


@dataclass
class Args:
    """What to run."""

    quick: bool = False
    """few environments, few steps"""
    json: Path | None = None
    """also write all numbers there"""


def make(name: str, num_envs: int) -> Any:
    """The circle with rods that differ from the nominal one, seen as `SETTINGS` say."""
    settings, options = SETTINGS[name]
    envs = gymnasium.make_vec(CIRCLE, num_envs=num_envs, randomization=REAL_RODS, **settings)
    return envs if options is None else EstimateState(envs, **options)


def drive(envs: Any, controller: Any, steps: int) -> dict[str, np.ndarray]:
    """Tip errors and estimate errors, m, and the time of each step's estimation, s, (steps, num_envs)."""
    observations, _ = envs.reset(seed=0)
    history: dict[str, list[np.ndarray]] = {"tip_error": [], "estimate_error": [], "estimate_time": []}
    for _ in tqdm(range(steps), leave=False, disable=None):
        observations, _, _, _, info = envs.step(controller(observations))
        for key, values in history.items():
            values.append(info.get(key, np.full(envs.num_envs, np.nan)))
    return {key: np.array(values) for key, values in history.items()}


def policy() -> Any:
    """The shipped policy, which was trained on a perfect camera."""
    network = Policy.load(ROOT / "agents" / "weights" / "circle_ppo.npz")
    return lambda observations: network(observations).astype(np.float32)


def white_noise(observations: np.ndarray, generator: np.random.Generator) -> np.ndarray:
    """Actions anywhere in their space, drawn anew every step."""
    return generator.uniform(-1.0, 1.0, (len(observations), 2)).astype(np.float32)


def show_errors(report: Report, num_envs: int, steps: int) -> None:
    """Errors under the policy, and of the estimate under white noise."""
    columns = (
        "the observation is made of",
        "tip from target, mean, mm",
        "estimate from tip, mean, mm",
        "99 % are below, mm",
        "under white noise: median, mm",
        "99 % are below, mm",
    )
    table = Table("What the estimate is worth", columns)
    for name in tqdm(SETTINGS, desc="errors", disable=None):
        followed = drive(make(name, num_envs), policy(), steps)
        row: tuple[Any, ...] = (name, 1e3 * float(followed["tip_error"][SETTLED:].mean()))
        if SETTINGS[name][1] is None:
            table.rows.append((*row, None, None, None, None))
            continue
        shaken = drive(make(name, num_envs), partial(white_noise, generator=np.random.default_rng(0)), steps)
        found, lost = (1e3 * run["estimate_error"][SETTLED:] for run in (followed, shaken))
        table.rows.append(
            (*row, float(found.mean()), *(float(np.quantile(*of)) for of in ((found, 0.99), (lost, 0.5), (lost, 0.99))))
        )
    table.note = (
        f"{CIRCLE}, {num_envs} rods drawn as in `agents.rollout.REAL_RODS`, {steps} steps, errors from step {SETTLED} "
        "on; shipped policy, trained on a perfect camera; then actions uniform in their space, new at every step."
    )
    report.show("errors", table)


def show_cost(report: Report, batches: tuple[int, ...], steps: int) -> None:
    """What estimation adds to a step."""
    names = [name for name, (_, options) in SETTINGS.items() if options is not None]
    table = Table(
        "Wall time of the estimation in a control step, all rods together, median",
        ("environments", *(f"{name}, ms" for name in names)),
    )
    for num_envs in tqdm(batches, desc="cost", disable=None):
        times = [drive(make(name, num_envs), policy(), steps)["estimate_time"][:, 0] for name in names]
        table.rows.append((num_envs, *(1e3 * float(np.median(time)) for time in times)))
    report.show("cost", table)


def main(args: Args) -> bool:
    """All tables."""
    report = Report("scripts.estimated_envs", args.quick)
    show_errors(report, 2 if args.quick else 32, SETTLED + (10 if args.quick else 250))
    show_cost(report, (1,) if args.quick else (1, 16, 256), 5 if args.quick else 40)
    return report.finish(args.json)


if __name__ == "__main__":
    sys.exit(0 if main(tyro.cli(Args)) else 1)
