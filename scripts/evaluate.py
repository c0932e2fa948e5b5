"""Evaluate controllers on the circle, on the same seeds: `python -m scripts.evaluate --help`."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path

import gymnasium
import tyro

from agents.command_line import one_sentence
from agents.open_loop_circle import InverseStatics, RotatingField
from agents.policy import Policy
from agents.rollout import REAL_RODS, Controller, Result, check_env_id, core_of, evaluate, table
from magrod_env import _checks
from scripts.common import ROOT

WEIGHTS = ROOT / "agents" / "weights" / "circle_ppo.npz"


@dataclass
class Args:
    """What to evaluate."""

    env_id: str = "MagRod/Circle-v0"
    """registered environment that follows a path"""
    policy: list[Path] = field(default_factory=lambda: [WEIGHTS])
    """trained policies, .npz files"""
    episodes: int = 64
    """rods, each with one episode"""
    seed: int = 1_000_000
    """of the first rod"""


def controllers(policies: list[Path]) -> dict[str, Controller]:
    """The open-loop controllers and the trained policies by name."""
    trained = {"PPO" if len(policies) == 1 else f"PPO {path.stem}": Policy.load(path) for path in policies}
    return {"rotating field (paper)": RotatingField(), "inverse statics": InverseStatics(), **trained}


def compare(args: Args, randomized: bool) -> list[Result]:
    """Every controller on the same rods."""
    rods = REAL_RODS if randomized else None
    return [
        evaluate(name, controller, args.env_id, num_episodes=args.episodes, seed=args.seed, randomization=rods)
        for name, controller in controllers(args.policy).items()
    ]


def check(args: Args) -> None:
    """Refuse arguments with which nothing can be compared.

    Raises:
        ValueError: with the argument's name, what it must be and what it was.
    """
    check_env_id(args.env_id)
    if core_of(gymnasium.make(args.env_id)).task.path is None:
        raise ValueError(f"env_id must be an environment that follows a path, but got {args.env_id!r}: try Circle.")
    _checks.count("episodes", args.episodes, advice="give the number of rods")
    _checks.number("seed", args.seed, at_least=0, advice="give the seed of the first rod")


def main() -> None:
    """Print a table for the nominal rod and one for rods that differ from it."""
    with one_sentence():
        args = tyro.cli(Args, description=__doc__)
        check(args)
        for title, randomized in (("Nominal rod", False), ("Rods that differ from the model", True)):
            results = table(compare(args, randomized))
            print(f"\n{title}, tip error in mm, {args.episodes} episodes:\n\n{results}")


if __name__ == "__main__":
    main()
