"""PPO (Schulman et al. 2017) from Stable-Baselines3 on the native batch of rods.

`python -m agents.ppo --help` lists the arguments; `scripts/train_ppo.py` is the same command. A run keeps everything in
its folder: arguments, TensorBoard log, checkpoints, the last policy. `--resume FOLDER` goes on from the newest whole
checkpoint, and `--total-steps` beside it extends the run. docs/training.md says what survives what.
"""

from __future__ import annotations

import dataclasses
import io
import json
import time
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

import gymnasium
import numpy as np
import torch
from stable_baselines3 import PPO
from stable_baselines3.common.callbacks import BaseCallback, CallbackList, ProgressBarCallback

from agents.command_line import one_sentence
from agents.network import SkipPolicy
from agents.policy import Policy
from agents.rollout import HEADER, REAL_RODS, EnvSettings, check_env_id, evaluate, table
from agents.run_folder import (
    checkpoint_path,
    load_newest,
    read_arguments,
    remove_partial,
    require_free,
    write_arguments,
    write_whole,
)
from agents.sb3_adapter import BatchedVecEnv
from magrod_env import _checks
from magrod_env.envs import attributes_of

TOTAL_STEPS = 4_000_000


@dataclass
class Args:
    """Arguments of a training run; the defaults are those that made the shipped weights."""

    env_id: str = "MagRod/Circle-v0"
    """registered environment"""
    seed: int = 1
    """of the networks and the environments"""
    total_steps: int | None = None
    """environment steps; None: 4,000,000, or what the resumed run has"""
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
    """environment steps, rounded up to whole rollouts"""
    folder: Path | None = None
    """of the run; default runs/ppo_<task>_<seed>"""
    resume: Path | None = None
    """folder of a run to go on with; its own arguments are used, but for total_steps and progress"""
    progress: bool = True
    """show a progress bar"""


COUNTS = {
    "total_steps": "give the environment steps of the whole run",
    "num_envs": "give the number of rods in the batch",
    "rollout_steps": "give the control steps of every rod between updates",
    "minibatch": "give the samples of a gradient step",
    "epochs": "give the passes over a rollout",
    "hidden": "give the units of a hidden layer",
    "torch_threads": "1 is fastest for small networks",
    "checkpoint_every": "give environment steps",
}
NUMBERS: dict[str, dict[str, Any]] = {
    "seed": {"at_least": 0, "at_most": 2**32 - 1, "advice": "give a whole number"},
    "minibatch": {"at_least": 2, "advice": "advantages are normalised over it"},
    "learning_rate": {"above": 0.0, "at_most": 1.0, "advice": "1e-3 is usual"},
    "gamma": {"at_least": 0.0, "at_most": 1.0, "advice": "0.95 is a good start"},
    "gae_lambda": {"at_least": 0.0, "at_most": 1.0, "advice": "0.9 is a good start"},
    "entropy": {"at_least": 0.0, "advice": "0 leaves it out"},
    "first_log_std": {"at_least": -20.0, "at_most": 2.0, "advice": "-2 is a good start"},
}


def check(args: Args) -> None:
    """Refuse arguments with which no run could be.

    Raises:
        ValueError: with the argument's name, what it must be and what it was.
    """
    check_env_id(args.env_id)
    for name, advice in COUNTS.items():
        _checks.count(name, getattr(args, name), advice=advice)
    for name, rule in NUMBERS.items():
        _checks.number(name, getattr(args, name), **rule)
    for name in (*COUNTS, "seed"):
        if not isinstance(getattr(args, name), int):
            raise ValueError(f"{name} must be a whole number, but got {getattr(args, name)!r}: leave out the point.")
    for name in ("randomized", "progress"):
        if not isinstance(getattr(args, name), bool):
            raise ValueError(f"{name} must be true or false, but got {getattr(args, name)!r}: choose one.")
    if args.precision not in ("float32", "float64"):
        raise ValueError(f'precision must be "float32" or "float64", but got {args.precision!r}: choose one.')


class TipErrors(BaseCallback):
    """Log the mean tip error of finished episodes, mm."""

    def _on_step(self) -> bool:
        ended = [info["episode"]["tip_error"] for info in self.locals["infos"] if info]
        if ended:
            self.logger.record_mean("rollout/tip_error_mm", 1e3 * float(np.mean(ended)))
        return True


def settings_of(args: Args) -> EnvSettings:
    """Arguments of the environment."""
    settings: EnvSettings = {"precision": args.precision}
    if args.randomized:
        settings["randomization"] = REAL_RODS
    return settings


def make_model(args: Args, envs: BatchedVecEnv, folder: Path) -> PPO:
    """A new PPO model; it seeds environment i with seed + i."""
    if not isinstance(envs.observation_space, gymnasium.spaces.Box):
        raise ValueError(f"env_id must have an array as observation, but got {args.env_id!r}: it has goals as well.")
    place = attributes_of(envs.env).observation_layout.slices["field"]
    fields = tuple(range(place.start, place.stop))
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


def check_weights(model: PPO) -> None:
    """Refuse weights that are not finite.

    Raises:
        ValueError: with advice.
    """
    if not all(bool(torch.isfinite(parameter).all()) for parameter in model.policy.parameters()):
        raise ValueError(
            f"weights of the policy must stay finite, but after {model.num_timesteps} steps some are not: "
            "start a new run with a lower learning_rate; checkpoints from before are kept."
        )


def saved(model: PPO) -> bytes:
    """The model as Stable-Baselines3 saves it: a zip archive with pickles inside."""
    buffer = io.BytesIO()
    model.save(buffer)
    return buffer.getvalue()


class Checkpoints(BaseCallback):
    """Save the model between an update and the next rollout, when all its steps have been learned from.

    every: environment steps from one checkpoint to the next.
    """

    def __init__(self, folder: Path, every: int) -> None:
        super().__init__()
        self.folder, self.every, self.learned, self.last = folder, every, 0, 0

    def _on_training_start(self) -> None:
        self.learned = self.last = self.num_timesteps

    def _on_rollout_start(self) -> None:
        check_weights(self.model)  # type: ignore[arg-type]
        self.learned = self.num_timesteps
        if self.learned - self.last >= self.every:
            self.save()

    def _on_step(self) -> bool:
        return True

    def _on_training_end(self) -> None:
        check_weights(self.model)  # type: ignore[arg-type]
        self.learned = self.num_timesteps
        self.save()

    def save(self) -> None:
        """Save the model, without the steps of a rollout that it has not learned from."""
        self.model.num_timesteps = self.last = self.learned
        write_whole(checkpoint_path(self.folder, self.learned), saved(self.model))  # type: ignore[arg-type]


def train(args: Args) -> Path:
    """Train, evaluate, and return the folder of the run.

    Raises:
        ValueError: on arguments with which no run could be, or a folder that is not this run's.
        KeyboardInterrupt: after Ctrl-C; what was learned has been saved.
    """
    args, folder, model = begin(args) if args.resume is None else go_on(args, args.resume)
    start, before = time.perf_counter(), model.num_timesteps
    learn(model, args, folder)
    rate = (model.num_timesteps - before) / (time.perf_counter() - start)
    write_whole(folder / "policy.zip", saved(model))
    policy = save_policy(model, args, folder)
    print(f"trained {model.num_timesteps - before} steps at {rate:.0f} steps/s; policy in {folder / 'policy.npz'}")
    result = evaluate("PPO", policy, args.env_id, **settings_of(args))
    print(table([result]))
    facts = json.dumps(dict(zip(HEADER, result.row)) | {"steps/s": round(rate)}, indent=2) + "\n"
    write_whole(folder / "result.json", facts.encode())
    return folder


def begin(args: Args) -> tuple[Args, Path, PPO]:
    """A new run: its complete arguments, its folder and its model."""
    args = dataclasses.replace(args, total_steps=TOTAL_STEPS if args.total_steps is None else args.total_steps)
    check(args)
    task = args.env_id.split("/")[-1].split("-")[0].lower()
    folder = args.folder or Path("runs") / f"ppo_{task}_{args.seed}"
    require_free(folder)
    torch.set_num_threads(args.torch_threads)
    model = make_model(args, make_envs(args), folder)
    write_arguments(folder, dataclasses.asdict(args))
    return args, folder, model


def go_on(asked: Args, folder: Path) -> tuple[Args, Path, PPO]:
    """An earlier run, from its newest whole checkpoint on, or from the start where it had none yet.

    Random numbers of networks and environments go on from a seed made of the run's and the steps done: the same after
    the same checkpoint, and others than those that the run began with.
    """
    args = resumed_args(asked, folder)
    remove_partial(folder)
    torch.set_num_threads(args.torch_threads)
    envs = make_envs(args)
    model = load_newest(folder, lambda path: load(path, envs, folder)) or make_model(args, envs, folder)
    done = model.num_timesteps
    if asked.total_steps is not None and asked.total_steps < done:
        raise ValueError(
            f"total_steps must be at least the {done} steps that the run in {folder} has behind it, "
            f"but got {asked.total_steps}: give the steps of the whole run."
        )
    if done:
        model.set_random_seed(int(np.random.SeedSequence([args.seed, done]).generate_state(1)[0]))
    write_arguments(folder, dataclasses.asdict(args))
    print(f"goes on from {done} of {args.total_steps} steps")
    return args, folder, model


def make_envs(args: Args) -> BatchedVecEnv:
    """The batch of rods that a run learns from."""
    return BatchedVecEnv(args.env_id, args.num_envs, seed=args.seed, **settings_of(args))


def load(path: Path, envs: BatchedVecEnv, folder: Path) -> PPO:
    """The model of a checkpoint. It is a pickle: loading it runs whatever its writer wanted."""
    model = PPO.load(path, env=envs, device="cpu", tensorboard_log=str(folder / "tensorboard"))
    check_weights(model)
    return model


def learn(model: PPO, args: Args, folder: Path) -> None:
    """Train up to the run's number of steps; after Ctrl-C save what was learned."""
    checkpoints = Checkpoints(folder, args.checkpoint_every)
    callbacks = [checkpoints, TipErrors(), *([ProgressBarCallback()] if args.progress else [])]
    before = model.num_timesteps
    try:
        model.learn(
            max((args.total_steps or 0) - before, 0),
            callback=CallbackList(callbacks),
            reset_num_timesteps=before == 0,
            tb_log_name="ppo",
        )
    except KeyboardInterrupt:
        if checkpoints.learned:
            checkpoints.save()
            save_policy(model, args, folder)
        print(f"stopped after {checkpoints.learned} steps; go on with --resume {folder}")
        raise
    except ValueError:  # of torch's distributions, if the weights are no numbers
        check_weights(model)
        raise


def save_policy(model: PPO, args: Args, folder: Path) -> Policy:
    """Write the network by itself beside the arguments that made it."""
    policy = Policy.of_sb3(model)
    policy.save(folder / "policy.npz", args=json.dumps(dataclasses.asdict(args), default=str))
    return policy


def resumed_args(asked: Args, folder: Path) -> Args:
    """Arguments of the run in a folder, with the number of steps and the progress bar that are asked for now.

    Raises:
        ValueError: if they are damaged, or another argument is asked to change.
    """
    args = load_args(folder)
    for field in dataclasses.fields(Args):
        now, then = getattr(asked, field.name), getattr(args, field.name)
        if field.name not in ("total_steps", "progress", "resume") and now not in (field.default, then):
            raise ValueError(
                f"{field.name} of a resumed run must be what it began with, {then!r}, but got {now!r}: "
                "leave it out, or start a new run."
            )
    total = args.total_steps if asked.total_steps is None else asked.total_steps
    args = dataclasses.replace(args, total_steps=total, progress=asked.progress)
    check(args)
    return args


def load_args(folder: Path) -> Args:
    """Arguments of an earlier run."""
    arguments = read_arguments(folder)
    names = {field.name for field in dataclasses.fields(Args)}
    if arguments.keys() != names:
        wrong = ", ".join(sorted(map(repr, arguments.keys() ^ names)))
        raise ValueError(
            f"args.json in {folder} must hold the arguments of a run, but {wrong} is missing or unknown: "
            "restore it, or start a new run."
        )
    arguments["folder"] = None if arguments["folder"] is None else Path(str(arguments["folder"]))
    return Args(**arguments | {"resume": None})  # type: ignore[arg-type]


def main(description: str | None = __doc__) -> None:
    """Read the arguments and train."""
    import tyro

    with one_sentence():
        train(tyro.cli(Args, description=description))


if __name__ == "__main__":
    main()
