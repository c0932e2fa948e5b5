"""Steer the rod's tip around a circle: two open-loop controllers and a trained policy on the same rods.

`make demo` runs this: a table of errors, a video and a figure. `python -m scripts.demo --help` lists the arguments.
"""

from __future__ import annotations

import time
from dataclasses import dataclass
from pathlib import Path

import gymnasium
import numpy as np
import tyro
from tqdm import tqdm

import magrod_env  # noqa: F401  (registers the ids)
from agents.rollout import REAL_RODS, Controller, Result, evaluate, table
from magrod_env.rendering.video import write_video
from scripts.common.figure import figure
from scripts.evaluate import WEIGHTS, controllers

ENV_ID = "MagRod/Circle-v0"
COLORS = ("#8a8f98", "#2a7f9e", "#d1603d")


@dataclass
class Args:
    """What the demo does."""

    episodes: int = 64
    """rods that each controller steers, with the same seeds"""
    seed: int = 1_000_000
    """of the first rod; training used other seeds"""
    folder: Path = Path("out/demo")
    """where the video and the figure go"""
    policy: Path = WEIGHTS
    """trained policy"""
    video: bool = True
    """write the video"""


def film(controller: Controller, seed: int) -> tuple[list[np.ndarray], np.ndarray, np.ndarray]:
    """Frames of one episode on a rod that differs from the model, its tip's track and its target's track (steps, 3)
    m.
    """
    env = gymnasium.make(ENV_ID, render_mode="rgb_array", randomization=REAL_RODS)
    observation, _ = env.reset(seed=seed)
    frames, tips, targets = [], [], []
    for _ in tqdm(range(gymnasium.spec(ENV_ID).max_episode_steps or 0), desc="filming", leave=False, disable=None):
        observation, _, _, _, info = env.step(controller(observation[None], env)[0])
        tips.append(info["tip_position"])
        targets.append(info["target"])
        frames.append(np.asarray(env.render()))
    return frames, np.array(tips), np.array(targets)


def draw(results: list[Result], tracks: dict[str, tuple[np.ndarray, np.ndarray]], path: Path) -> None:
    """Tracks across the rod, error against time, and the spread of errors over the rods."""
    with figure(path, (13, 4.2)) as drawn:
        left, middle, right = drawn.subplots(1, 3)
        target = next(iter(tracks.values()))[1]
        left.plot(*(1e3 * target[:, 1:].T), color="black", lw=1, ls=":", label="target")
        for color, (name, (tip, _)) in zip(COLORS, tracks.items()):
            left.plot(*(1e3 * tip[:, 1:].T), color=color, lw=1.2, label=name)
        left.set(xlabel="y (mm)", ylabel="z (mm)", title="one rod: path of the tip", aspect="equal")
        left.legend(loc="center", fontsize=8, frameon=False)
        for color, result in zip(COLORS, results):
            seconds = 0.02 * np.arange(1, result.errors.shape[1] + 1)
            middle.plot(seconds, 1e3 * np.median(result.errors, axis=0), color=color, label=result.name)
            spread = 1e3 * np.percentile(result.errors, (10, 90), axis=0)
            middle.fill_between(seconds, *spread, color=color, alpha=0.15, lw=0)
        middle.set(xlabel="time (s)", ylabel="tip error (mm)", title="all rods: median, 10-90 %", ylim=(0, None))
        means = [1e3 * result.errors.mean(axis=1) for result in results]
        right.boxplot(means, tick_labels=[result.name for result in results], whis=(0, 100))
        right.set(ylabel="mean tip error (mm)", title="one value a rod", ylim=(0, None))
        right.tick_params(axis="x", labelsize=8)


def main() -> None:
    """Evaluate, film, draw."""
    args = tyro.cli(Args, description=__doc__)
    args.folder.mkdir(parents=True, exist_ok=True)
    print("Compiling the rod's kernels: under a minute the first time, cached afterwards.")
    start = time.perf_counter()
    everyone = controllers([args.policy])
    print("\nTip error in mm. `effort`: mean square of the action; `sim/wall`: simulated seconds a second, all rods.\n")
    for title, rods in (("Nominal rod", None), ("Rods that differ from the model", REAL_RODS)):
        results = [
            evaluate(name, controller, ENV_ID, num_episodes=args.episodes, seed=args.seed, randomization=rods)
            for name, controller in everyone.items()
        ]
        print(f"{title}, {args.episodes} episodes of 6 s:\n\n{table(results)}\n")
    tracks = {}
    for name, controller in everyone.items():
        frames, tips, targets = film(controller, args.seed)
        tracks[name] = (tips, targets)
    picture = args.folder / "circle.png"
    draw(results, tracks, picture)
    print(f"figure: {picture}")
    if args.video:
        video = args.folder / "circle.mp4"
        write_video(frames, video, 50)
        print(f"video of the trained policy: {video}")
    print(f"done in {time.perf_counter() - start:.0f} s")


if __name__ == "__main__":
    main()
