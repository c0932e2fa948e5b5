"""Evaluate controllers on the circle, on the same seeds: `python -m scripts.evaluate --help`."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path

import tyro

from agents.open_loop_circle import InverseStatics, RotatingField
from agents.policy import Policy
from agents.rollout import REAL_RODS, Controller, Result, evaluate, table

WEIGHTS = Path(__file__).parents[1] / "agents" / "weights" / "circle_ppo.npz"


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
    settings = {"randomization": REAL_RODS} if randomized else {}
    return [
        evaluate(name, controller, args.env_id, num_episodes=args.episodes, seed=args.seed, **settings)
        for name, controller in controllers(args.policy).items()
    ]


def main() -> None:
    """Print a table for the nominal rod and one for rods that differ from it."""
    args = tyro.cli(Args, description=__doc__)
    for title, randomized in (("Nominal rod", False), ("Rods that differ from the model", True)):
        print(f"\n{title}, tip error in mm, {args.episodes} episodes:\n\n{table(compare(args, randomized))}")


if __name__ == "__main__":
    main()
