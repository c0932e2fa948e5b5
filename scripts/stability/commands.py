"""Environments under the worst commands: every coil at its limit, its sign flipped every few control steps."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass, field

import gymnasium
import numpy as np
from tqdm import tqdm

import magrod_env  # noqa: F401  (registers the ids)
from agents.rollout import REAL_RODS, core_of
from magrod_env.registration import IDS
from magrod_env.simulation.errors import SYMPTOMS
from magrod_env.simulation.simulation import PRECISIONS
from scripts.common.report import Report

EVERY = (1, 2, 3, 4, 6, 9)  # control steps between flips
SIGNS = ("in phase", "drawn anew")
LEAST_STEPS = 1e6  # of all rods of an id together
RODS = {"nominal": None, "randomised": REAL_RODS}
SIZES = {True: (("MagRod/PlanarReach-v0",), 16, 18), False: (tuple(IDS), 64, 400)}
"""Ids, environments of a batch, control steps of a pattern of commands, by whether quick."""


@dataclass
class Fate:
    """What became of the rods of one environment under one pattern of commands.

    Args:
        steps: control steps of all rods.
        lost: rods by what was reported of them.
        unreported: rods with a tip that is not finite, but no report.
    """

    steps: int = 0
    lost: Counter[str] = field(default_factory=Counter)
    unreported: int = 0


def flips(rng: np.random.Generator, shape: tuple[int, ...], every: int, signs: str, steps: int) -> np.ndarray:
    """Commands (steps, *shape) of size 1: "in phase", each coil with a sign of its own, all of them turned over every
    so many control steps, or every sign "drawn anew" then.
    """
    count = -(-steps // every)
    if signs == "in phase":
        held = rng.choice([-1.0, 1.0], shape) * (-1.0) ** np.arange(count).reshape(-1, *(1,) * len(shape))
    else:
        held = rng.choice([-1.0, 1.0], (count, *shape))
    return np.repeat(held, every, axis=0)[:steps]


def drive(batch: gymnasium.vector.VectorEnv, commands: np.ndarray) -> Fate:
    """Run a batch of environments, whose ended episodes begin anew in the next step."""
    fate, over = Fate(), np.zeros(batch.num_envs, bool)
    batch.reset(seed=0)
    for action in commands:
        _, _, terminated, truncated, info = batch.step(action)
        status = core_of(batch).batch.status
        fate.steps += int((~over).sum())
        fate.lost.update(SYMPTOMS[int(one)] for one in status[terminated])
        fate.unreported += int((~np.isfinite(info["tip_position"]).all(axis=1) & ~terminated).sum())
        over = terminated | truncated
    return fate


def commands(report: Report, quick: bool) -> None:
    """Rods that are lost under commands at the coils' limit, nominal and randomised, in both precisions."""
    ids, envs, steps = SIZES[quick]
    losses, done, lost, unreported = [], Counter[str](), 0, 0
    patterns = [(every, signs) for every in EVERY for signs in SIGNS]
    with report.table(
        "commands",
        "Environments under bang-bang commands at the coils' limit",
        "id | rods | precision | elements | rotary scaling | substeps of 20 ms | control steps | lost",
        f"Flips every {', '.join(map(str, EVERY))} control steps: of all coils in phase, each with a sign of its "
        "own, and with signs drawn anew. A lost rod is reported, its episode ends and a new one begins.",
    ) as table:
        cases = [(name, rods, precision) for name in ids for rods in RODS for precision in PRECISIONS]
        for name, rods, precision in tqdm(cases, desc="commands", leave=False):
            batch = gymnasium.make_vec(name, num_envs=envs, precision=precision, randomization=RODS[rods])
            total, gone, shape = 0, 0, batch.action_space.shape or ()
            for number, (every, signs) in enumerate(patterns):
                fate = drive(batch, flips(np.random.default_rng(number), shape, every, signs, steps))
                words = ", ".join(f"{count}: {symptom}" for symptom, count in fate.lost.most_common())
                if words:
                    losses.append((name, rods, precision, every, signs, words))
                total, gone = total + fate.steps, gone + fate.lost.total()
                unreported += fate.unreported
            core = core_of(batch)
            about = (core.num_elements, core.resolution.rotary_scaling, core.num_steps)
            table.add(name, rods, precision, *about, total, gone)
            done[name], lost = done[name] + total, lost + gone
    if losses:
        columns = "id | rods | precision | flips every | signs | lost"
        with report.table("commands_lost", "Rods lost under bang-bang commands", columns) as table:
            table.rows = losses
    report.check("commands", "rods lost", float(lost), 0.0)
    report.check("commands", "tips that are not finite and not reported", float(unreported), 0.0)
    if not quick:
        what = "control steps of rods, least of all ids"
        report.check("commands", what, float(min(done.values())), LEAST_STEPS, at_least=True)
