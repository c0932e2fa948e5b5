"""Environments under the worst commands: every coil at its limit, its sign drawn anew at every control step."""

from __future__ import annotations

import gymnasium
import numpy as np
from tqdm import tqdm

import magrod_env  # noqa: F401  (registers the ids)
from agents.rollout import REAL_RODS
from scripts import Check, Report, Table

IDS = ("Circle", "Path", "Reach", "PlanarReach", "TwoMagnet")


def commands(report: Report, quick: bool) -> None:
    """Rods that are lost under bang-bang commands, nominal and randomised."""
    table = Table(
        "Environments under bang-bang commands at the coils' limit",
        ("id", "rods", "elements", "rotary scaling", "substeps of 20 ms", "control steps of a rod", "lost"),
        note="A lost rod is reported, its episode ends and a new one begins.",
    )
    envs, steps = (32, 25) if quick else (512, 200)
    for name in tqdm(IDS[-1:] if quick else IDS, desc="commands", leave=False):
        for rods, settings in (("nominal", {}), ("randomised", {"randomization": REAL_RODS})):
            batch = gymnasium.make_vec(f"MagRod/{name}-v0", num_envs=envs, **settings)
            generator, lost = np.random.default_rng(0), 0
            batch.reset(seed=0)
            for _ in range(steps):
                _, _, terminated, _, _ = batch.step(generator.choice([-1.0, 1.0], batch.action_space.shape))
                lost += int(terminated.sum())
            core = batch.unwrapped.core
            table.rows.append(
                (name, rods, core.num_elements, core.resolution.rotary_scaling, core.num_steps, envs * steps, lost)
            )
    report.show("commands", table)
    share = sum(row[-1] for row in table.rows) / sum(row[-2] for row in table.rows)
    report.checks.append(Check("commands", "rods lost a control step", share, 1e-5, ""))
