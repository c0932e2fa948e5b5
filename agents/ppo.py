"""PPO (Schulman et al. 2017) from Stable-Baselines3 on the native batch of rods.

`python -m agents.ppo --help` lists the arguments; `scripts/train_ppo.py` is the same command. A run keeps everything in
its folder: arguments, TensorBoard log, checkpoints, the best and the last policy; `--resume FOLDER` goes on from the
last checkpoint.
"""

from __future__ import annotations

import dataclasses
import json
import time
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

import numpy as np
import torch
from stable_baselines3 import PPO
from stable_baselines3.common.callbacks import BaseCallback, CallbackList, CheckpointCallback, ProgressBarCallback

from agents.network import SkipPolicy
from agents.policy import Policy
from agents.rollout import HEADER, REAL_RODS, evaluate, table
from agents.sb3_adapter import BatchedVecEnv


@dataclass
class Args:
    """Arguments of a training run; the defaults are those that made the shipped weights."""

    env_id: str = "MagRod/Circle-v0"
    """registered environment"""
    seed: int = 1
    """of the networks and the environments"""
    total_steps: int = 4_000_000
    """environment steps"""
    num_envs: int = 256
    """rods in the batch"""
    rollout_steps: int = 64
    """control steps of every rod between updates"""
    minibatch: int = 4096
    """samples a gradient step"""
    epochs: int = 5
    """passes over a rollout"""
    learning_rate: float = 1e-3
    """at the start; falls linearly to a tenth"""
    gamma: float = 0.95
    """discount"""
    gae_lambda: float = 0.9
    """of the advantage estimate"""
    entropy: float = 0.0
    """bonus for exploring"""
    first_log_std: float = -2.0
    """logarithm of the first policy's standard deviation"""
    hidden: int = 64
    """units in each of the two hidden layers"""
    randomized: bool = True
    """train on rods that differ (agents/rollout.py: REAL_RODS)"""
    precision: Literal["float32", "float64"] = "float32"
    """of the rods"""
    torch_threads: int = 1
    """one is fastest for networks this small; the other cores step rods"""
    checkpoint_every: int = 500_000
    """environment steps"""
    folder: Path | None = None
    """of the run; default runs/ppo_<task>_<seed>"""
    resume: Path | None = None
    """folder of a run to go on with; its own arguments are used"""
    progress: bool = True
    """show a progress bar"""


class TipErrors(BaseCallback):
    """Log the mean tip error of finished episodes, mm."""

    def _on_step(self) -> bool:
        ended = [info["episode"]["tip_error"] for info in self.locals["infos"] if info]
        if ended:
            self.logger.record_mean("rollout/tip_error_mm", 1e3 * float(np.mean(ended)))
        return True


def settings_of(args: Args) -> dict[str, Any]:
    """Arguments of the environment."""
    settings: dict[str, Any] = {"precision": args.precision}
    if args.randomized:
        settings["randomization"] = REAL_RODS
    return settings


def make_model(args: Args, envs: BatchedVecEnv, folder: Path) -> PPO:
    """A new PPO model."""
    core = envs.env.unwrapped.core  # type: ignore[attr-defined]
    fields = tuple(6 * len(core.nodes) + axis for axis in range(core.coils.num_axes))
    return PPO(
        SkipPolicy,
        envs,
        learning_rate=lambda left: args.learning_rate * (0.1 + 0.9 * left),
        n_steps=args.rollout_steps,
        batch_size=args.minibatch,
        n_epochs=args.epochs,
        gamma=args.gamma,
        gae_lambda=args.gae_lambda,
        ent_coef=args.entropy,
        policy_kwargs={"hidden": args.hidden, "field_entries": fields, "log_std_init": args.first_log_std},
        tensorboard_log=str(folder / "tensorboard"),
        seed=args.seed,
        device="cpu",
    )


def train(args: Args) -> Path:
    """Train, evaluate, and return the folder of the run."""
    torch.set_num_threads(args.torch_threads)
    resuming = args.resume is not None
    if args.resume is not None:
        folder, progress = args.resume, args.progress
        args = load_args(folder)
        args.progress = progress
        last = max(folder.glob("checkpoint_*_steps.zip"), key=lambda path: int(path.stem.split("_")[1]), default=None)
        if last is None:
            raise SystemExit(
                f"resume must be the folder of a run with a checkpoint, but {folder} has none: start a new run."
            )
        envs = BatchedVecEnv(args.env_id, args.num_envs, seed=args.seed + 7919 * args.num_envs, **settings_of(args))
        model = PPO.load(last, env=envs, device="cpu", tensorboard_log=str(folder / "tensorboard"))
    else:
        task = args.env_id.split("/")[-1].split("-")[0].lower()
        folder = args.folder or Path("runs") / f"ppo_{task}_{args.seed}"
        folder.mkdir(parents=True, exist_ok=True)
        (folder / "args.json").write_text(json.dumps(dataclasses.asdict(args), indent=2, default=str) + "\n")
        envs = BatchedVecEnv(args.env_id, args.num_envs, seed=args.seed * args.num_envs, **settings_of(args))
        model = make_model(args, envs, folder)
    callbacks: list[BaseCallback] = [
        CheckpointCallback(max(args.checkpoint_every // args.num_envs, 1), str(folder), "checkpoint"),
        TipErrors(),
    ]
    if args.progress:
        callbacks.append(ProgressBarCallback())
    start, before = time.perf_counter(), model.num_timesteps
    model.learn(
        max(args.total_steps - before, 0),
        callback=CallbackList(callbacks),
        reset_num_timesteps=not resuming,
        tb_log_name="ppo",
    )
    rate = (model.num_timesteps - before) / (time.perf_counter() - start)
    model.save(folder / "policy.zip")
    policy = Policy.of_sb3(model)
    policy.save(folder / "policy.npz", args=json.dumps(dataclasses.asdict(args), default=str))
    print(f"trained {model.num_timesteps - before} steps at {rate:.0f} steps/s; policy in {folder / 'policy.npz'}")
    result = evaluate("PPO", policy, args.env_id, **settings_of(args))
    print(table([result]))
    (folder / "result.json").write_text(
        json.dumps(dict(zip(HEADER, result.row)) | {"steps/s": round(rate)}, indent=2) + "\n"
    )
    return folder


def load_args(folder: Path) -> Args:
    """Arguments of an earlier run."""
    saved = json.loads((folder / "args.json").read_text())
    saved["folder"] = None if saved["folder"] is None else Path(saved["folder"])
    saved["resume"] = None
    return Args(**saved)


if __name__ == "__main__":
    import tyro

    train(tyro.cli(Args, description=__doc__))
