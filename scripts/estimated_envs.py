"""Environments that observe an estimate: how well they know their rods, what control loses by it, what it costs.

`python -m scripts.estimated_envs` prints the tables of docs/environments.md; `--quick` tries everything out.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import TypedDict

import gymnasium
import numpy as np
from gymnasium.vector import VectorEnv
from tqdm import tqdm

import magrod_env  # noqa: F401  (registers the ids)
from agents.policy import Policy
from agents.rollout import REAL_RODS, EnvSettings
from magrod_env.envs import Camera, EstimateState
from magrod_env.estimation import PredictionFilter
from scripts.common.command import Options, main
from scripts.common.report import Report
from scripts.evaluate import WEIGHTS

CIRCLE = "MagRod/Circle-v0"
NOISE = 5e-5  # m
SETTLED = 50  # control steps after which errors count


class EstimateOptions(TypedDict, total=False):
    """Arguments of `EstimateState`."""

    members: int
    estimator: type[PredictionFilter]


SETTINGS: dict[str, tuple[Camera | None, EstimateOptions | None]] = {
    "perfect camera": (None, None),
    "camera with 0.05 mm of noise": (Camera(noise=NOISE), None),
    "ensemble of 32 (default)": (None, {}),
    "ensemble of 16": (None, {"members": 16}),
    "prediction filter": (None, {"estimator": PredictionFilter}),
}
"""The camera, and how the state is estimated from its frames; None for not at all."""


def make(name: str, num_envs: int) -> VectorEnv:
    """The circle with rods that differ from the nominal one, seen as `SETTINGS` say."""
    camera, options = SETTINGS[name]
    settings: EnvSettings = {"randomization": REAL_RODS}
    if camera is not None:
        settings["camera"] = camera
    envs = gymnasium.make_vec(CIRCLE, num_envs=num_envs, **settings)
    return envs if options is None else EstimateState(envs, **options)  # type: ignore[arg-type, return-value]


def drive(envs: VectorEnv, controller: Callable[[np.ndarray], np.ndarray], steps: int) -> dict[str, np.ndarray]:
    """Tip errors and estimate errors, m, and the time of each step's estimation, s, (steps, num_envs)."""
    observations, _ = envs.reset(seed=0)
    history: dict[str, list[np.ndarray]] = {"tip_error": [], "estimate_error": [], "estimate_time": []}
    for _ in tqdm(range(steps), leave=False, disable=None):
        observations, _, _, _, info = envs.step(controller(observations))
        for key, values in history.items():
            values.append(info.get(key, np.full(envs.num_envs, np.nan)))
    return {key: np.array(values) for key, values in history.items()}


def policy() -> Callable[[np.ndarray], np.ndarray]:
    """The shipped policy, which was trained on a perfect camera."""
    network = Policy.load(WEIGHTS)
    return lambda observations: network(observations).astype(np.float32)


def white_noise(observations: np.ndarray, generator: np.random.Generator) -> np.ndarray:
    """Actions anywhere in their space, drawn anew every step."""
    return generator.uniform(-1.0, 1.0, (len(observations), 2)).astype(np.float32)


def show_errors(report: Report, num_envs: int, steps: int) -> None:
    """Errors under the policy, and of the estimate under white noise."""
    with report.table(
        "errors",
        "What the estimate is worth",
        "the observation is made of | tip from target, mean, mm | estimate from tip, mean, mm | 99 % are below, mm | "
        "under white noise: median, mm | 99 % are below, mm",
        f"{CIRCLE}, {num_envs} rods drawn as in `agents.rollout.REAL_RODS`, {steps} steps, errors from step {SETTLED} "
        "on; shipped policy, trained on a perfect camera; then actions uniform in their space, new at every step.",
    ) as table:
        for name in tqdm(SETTINGS, desc="errors", disable=None):
            followed = drive(make(name, num_envs), policy(), steps)
            error = 1e3 * float(followed["tip_error"][SETTLED:].mean())
            if SETTINGS[name][1] is None:
                table.add(name, error, None, None, None, None)
                continue
            shaken = drive(make(name, num_envs), partial(white_noise, generator=np.random.default_rng(0)), steps)
            found, lost = (1e3 * run["estimate_error"][SETTLED:] for run in (followed, shaken))
            quantiles = (float(np.quantile(*of)) for of in ((found, 0.99), (lost, 0.5), (lost, 0.99)))
            table.add(name, error, float(found.mean()), *quantiles)


def show_cost(report: Report, batches: tuple[int, ...], steps: int) -> None:
    """What estimation adds to a step."""
    names = [name for name, (_, options) in SETTINGS.items() if options is not None]
    title = "Wall time of the estimation in a control step, all rods together, median"
    columns = f"environments | {' | '.join(f'{name}, ms' for name in names)}"
    with report.table("cost", title, columns) as table:
        for num_envs in tqdm(batches, desc="cost", disable=None):
            times = [drive(make(name, num_envs), policy(), steps)["estimate_time"][:, 0] for name in names]
            table.add(num_envs, *(1e3 * float(np.median(time)) for time in times))


def measure(args: Options) -> Report:
    """All tables, from few environments and steps if quick."""
    report = Report("scripts.estimated_envs", args.quick)
    show_errors(report, 2 if args.quick else 32, SETTLED + (10 if args.quick else 250))
    show_cost(report, (1,) if args.quick else (1, 16, 256), 5 if args.quick else 40)
    return report


if __name__ == "__main__":
    main(Options, measure, __doc__)
