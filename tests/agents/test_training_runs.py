"""Training runs: refused arguments, going on, extending, Ctrl-C, and a process that is killed at any moment."""

import dataclasses
import json
import os
import random
import re
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest
import torch

from agents import ppo
from agents.policy import Policy
from agents.ppo import Args, load_args, train
from agents.rollout import Result
from agents.run_folder import checkpoint_path, checkpoints
from scripts import evaluate

ROOT = Path(__file__).parents[2]
TINY = {"num_envs": 8, "rollout_steps": 64, "minibatch": 128, "epochs": 1, "checkpoint_every": 512, "progress": False}
ROLLOUT = TINY["num_envs"] * TINY["rollout_steps"]
NAN = float("nan")


def tiny(folder, **options):
    return Args(**TINY | {"total_steps": 2 * ROLLOUT, "folder": folder} | options)


def command(module, *arguments, **options):
    return subprocess.run(
        [sys.executable, "-m", module, *map(str, arguments)],
        cwd=ROOT,
        capture_output=True,
        text=True,
        timeout=300,
        **options,
    )


@pytest.fixture
def no_evaluation(monkeypatch):
    """Training without the figures of its end, which take a second and say nothing here."""
    monkeypatch.setattr(ppo, "evaluate", lambda *_, **__: Result("PPO", np.zeros((1, 1)), 0.0, 0, 1.0))


# ---- arguments

REFUSED = [
    ("env_id", ["Nothing-v0", "CartPole-v1", "", "MagRod/Circle-v9", 3, None]),
    ("seed", [-1, 2**32, 1.5, True, NAN, "x"]),
    ("total_steps", [0, -1, 1.5, 1e6, True, "x"]),
    ("num_envs", [0, -1, 2.5, None]),
    ("rollout_steps", [0, -1]),
    ("minibatch", [0, 1, -4]),
    ("epochs", [0, -1]),
    ("learning_rate", [0.0, -1e-3, NAN, float("inf"), 2.0, "x", None]),
    ("gamma", [2, -0.1, NAN]),
    ("gae_lambda", [1.1, -0.1, NAN]),
    ("entropy", [-1.0, NAN, float("inf")]),
    ("first_log_std", [NAN, float("inf"), 1e3]),
    ("hidden", [0, -1]),
    ("randomized", ["yes", 1, None]),
    ("precision", ["float16", 32, None]),
    ("torch_threads", [0, -1]),
    ("checkpoint_every", [0, -1]),
    ("progress", ["yes", 0]),
]
CASES = [(name, value) for name, values in REFUSED for value in values]


@pytest.mark.parametrize(("name", "value"), CASES, ids=[f"{name}={value!r}" for name, value in CASES])
def test_an_argument_with_which_no_run_can_be_is_refused_before_the_folder_is_made(tmp_path, name, value):
    with pytest.raises(ValueError, match=f"^{name} must ") as refused:
        train(Args(folder=tmp_path / "run", **{name: value}))
    assert repr(value) in str(refused.value) and "\n" not in str(refused.value)
    assert not (tmp_path / "run").exists()


@pytest.mark.parametrize(
    ("module", "arguments", "word"),
    [
        ("scripts.train_ppo", ("--gamma", "2", "--folder", "{}/run"), "gamma must be"),
        ("agents.ppo", ("--folder", "{}/file/run"), "files must be readable and writable"),
        ("scripts.evaluate", ("--policy", "{}/file", "--episodes", "2"), "must be a policy file"),
    ],
)
def test_commands_say_what_is_wrong_and_end_with_code_2(tmp_path, module, arguments, word):
    (tmp_path / "file").touch()
    done = command(module, *(argument.format(tmp_path) for argument in arguments))
    assert done.returncode == 2, done.stderr
    assert done.stderr.startswith("error: ") and word in done.stderr
    assert done.stderr.count("\n") == 1


@pytest.mark.parametrize(
    ("arguments", "word"),
    [
        ({"env_id": "Nothing-v0"}, "env_id must be a registered"),
        ({"env_id": "MagRod/Reach-v0"}, "follows a path"),
        ({"episodes": 0}, "episodes must be"),
        ({"episodes": 2.5}, "episodes must be"),
        ({"seed": -1}, "seed must be"),
    ],
)
def test_nothing_is_evaluated_with_arguments_that_cannot_be(arguments, word):
    with pytest.raises(ValueError, match=word):
        evaluate.check(evaluate.Args(**arguments))


def test_a_folder_that_is_no_run_cannot_be_resumed(tmp_path):
    for folder in (tmp_path, tmp_path / "missing"):
        with pytest.raises(ValueError, match=r"resume must be the folder of a run, but .* has no args.json"):
            train(Args(resume=folder))


def test_an_environment_with_goals_cannot_be_trained_on(tmp_path):
    with pytest.raises(ValueError, match="env_id must have an array as observation"):
        train(tiny(tmp_path / "run", env_id="MagRod/ReachGoal-v0"))


# ---- going on


def test_a_run_can_be_extended_and_nothing_else_about_it_changed(tmp_path, capsys, no_evaluation):
    folder = train(tiny(tmp_path / "run"))
    assert [path.name for path in checkpoints(folder)] == ["checkpoint_1024_steps.zip", "checkpoint_512_steps.zip"]
    with pytest.raises(ValueError, match="folder of a new run must be empty"):
        train(tiny(folder))
    with pytest.raises(ValueError, match=r"learning_rate of a resumed run must be what it began with, 0\.001"):
        train(Args(resume=folder, learning_rate=1e-4))
    with pytest.raises(ValueError, match="total_steps must be at least the 1024"):
        train(Args(resume=folder, total_steps=512))
    train(Args(resume=folder, total_steps=3 * ROLLOUT, progress=False))
    said = capsys.readouterr().out
    assert "goes on from 1024 of 1536 steps" in said and "trained 512 steps" in said
    assert load_args(folder).total_steps == 3 * ROLLOUT
    train(Args(resume=folder, progress=False))
    assert "trained 0 steps" in capsys.readouterr().out


def test_random_numbers_go_on_and_do_not_repeat(tmp_path, no_evaluation):
    """Of the rods, of torch and of NumPy; the same at each resumption from the same checkpoint."""
    folder = train(tiny(tmp_path / "run", total_steps=ROLLOUT))

    def drawn(model):
        return model.env.reset(), torch.rand(3).numpy(), np.random.rand(3)  # noqa: NPY002 (Stable-Baselines3's)

    first = drawn(ppo.begin(tiny(tmp_path / "again", total_steps=ROLLOUT))[2])
    later, later_again = (drawn(ppo.go_on(Args(resume=folder), folder)[2]) for _ in range(2))
    for one, other, same in zip(first, later, later_again, strict=True):
        np.testing.assert_array_equal(other, same)
        assert not np.any(np.all(one == other, axis=-1))


def test_a_damaged_checkpoint_is_skipped_and_the_one_before_taken(tmp_path, capsys, no_evaluation):
    folder = train(tiny(tmp_path / "run"))
    newest, before = checkpoints(folder)
    newest.write_bytes(newest.read_bytes()[:-1000])
    train(Args(resume=folder, progress=False))
    said = capsys.readouterr()
    assert f"skipped {newest.name}" in said.err and "goes on from 512 of 1024 steps" in said.out
    for path in (newest, before):
        path.write_bytes(b"")
    with pytest.raises(ValueError, match="none of the 2"):
        train(Args(resume=folder, progress=False))


def test_a_checkpoint_with_weights_that_are_not_finite_is_skipped(tmp_path, capsys, no_evaluation):
    folder = train(tiny(tmp_path / "run", total_steps=ROLLOUT))
    _, _, model = ppo.go_on(Args(resume=folder), folder)
    next(model.policy.parameters()).data[0] = NAN
    checkpoint_path(folder, 2 * ROLLOUT).write_bytes(ppo.saved(model))
    ppo.go_on(Args(resume=folder), folder)
    assert "weights of the policy must stay finite" in capsys.readouterr().err


def test_a_run_without_a_checkpoint_begins_again(tmp_path, capsys, no_evaluation):
    args = tiny(tmp_path, total_steps=ROLLOUT)
    (tmp_path / "args.json").write_text(json.dumps(dataclasses.asdict(args), default=str))
    train(Args(resume=tmp_path, progress=False))
    assert "goes on from 0 of 512 steps" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("change", "word"),
    [({"gamma": 2}, "gamma"), ({"total_steps": 0}, "total_steps"), ({"x": 1}, "'x'"), ({"seed": "1"}, "seed")],
)
def test_arguments_that_somebody_has_changed_are_checked_again(tmp_path, change, word):
    saved = dataclasses.asdict(tiny(None)) | change
    (tmp_path / "args.json").write_text(json.dumps(saved))
    with pytest.raises(ValueError, match=word):
        train(Args(resume=tmp_path))


def test_arguments_with_one_missing_are_refused(tmp_path):
    saved = dataclasses.asdict(tiny(None))
    del saved["hidden"]
    (tmp_path / "args.json").write_text(json.dumps(saved))
    with pytest.raises(ValueError, match="'hidden' is missing or unknown"):
        train(Args(resume=tmp_path))


# ---- ends that were not planned


def test_after_ctrl_c_what_was_learned_is_kept(tmp_path, capsys, monkeypatch, no_evaluation):
    """In the middle of the third rollout: two have been learned from."""
    steps = []

    def interrupt(self):
        steps.append(self.num_timesteps)
        if len(steps) == 2 * TINY["rollout_steps"] + 10:
            raise KeyboardInterrupt
        return True

    with monkeypatch.context() as patch:
        patch.setattr(ppo.TipErrors, "_on_step", interrupt)
        with pytest.raises(KeyboardInterrupt):
            train(tiny(tmp_path / "run", total_steps=4 * ROLLOUT, checkpoint_every=10**6))
    assert f"stopped after {2 * ROLLOUT} steps; go on with --resume" in capsys.readouterr().out
    assert checkpoints(tmp_path / "run") == [checkpoint_path(tmp_path / "run", 2 * ROLLOUT)]
    Policy.load(tmp_path / "run" / "policy.npz")
    train(Args(resume=tmp_path / "run", progress=False))
    assert f"trained {2 * ROLLOUT} steps" in capsys.readouterr().out


def test_weights_that_are_lost_end_the_run_in_one_sentence_and_leave_no_checkpoint(tmp_path, monkeypatch):
    def lose(self):
        if self.num_timesteps > ROLLOUT:
            next(self.model.policy.parameters()).data[:] = NAN
        return True

    monkeypatch.setattr(ppo.TipErrors, "_on_step", lose)
    with pytest.raises(ValueError, match="weights of the policy must stay finite"):
        train(tiny(tmp_path / "run", total_steps=4 * ROLLOUT))
    assert checkpoints(tmp_path / "run") == [checkpoint_path(tmp_path / "run", ROLLOUT)]


FULL_DISK = """
import os, sys
from agents import ppo, run_folder
def full(*_):
    raise OSError(28, "No space left on device", "checkpoint")
write = run_folder.write_whole
ppo.write_whole = lambda path, content: full() if "1024" in path.name else write(path, content)
ppo.main()
"""


def test_a_full_disk_ends_the_run_in_one_sentence_and_keeps_what_there_is(tmp_path):
    arguments = [f"--{name.replace('_', '-')}={value}" for name, value in TINY.items() if name != "progress"]
    done = subprocess.run(
        [sys.executable, "-c", FULL_DISK, *arguments, "--no-progress", "--total-steps=2048", f"--folder={tmp_path}"],
        cwd=ROOT,
        capture_output=True,
        text=True,
        timeout=300,
    )
    assert done.returncode == 2, done.stderr
    assert done.stderr.startswith("error: ") and "No space left" in done.stderr and done.stderr.count("\n") == 1
    assert checkpoints(tmp_path) == [checkpoint_path(tmp_path, 512)]


@pytest.mark.slow
@pytest.mark.skipif(not os.environ.get("MAGROD_NIGHTLY"), reason="takes minutes; MAGROD_NIGHTLY=1 runs it")
def test_a_run_that_is_killed_at_20_random_moments_loses_only_the_steps_since_its_last_checkpoint(tmp_path):
    """The moments are drawn from the first 10 s of a process: loading, the first rollouts, checkpoints."""
    moments, folder = random.Random(0), tmp_path / "run"
    new = [f"--{name.replace('_', '-')}={value}" for name, value in TINY.items() if name != "progress"]
    new += ["--no-progress", "--total-steps=1000000000", f"--folder={folder}"]
    again = ["--no-progress", f"--resume={folder}"]
    for _ in range(20):
        before = newest_steps(folder)
        arguments = again if (folder / "args.json").exists() else new
        said = killed(arguments, after=moments.uniform(0.0, 10.0))
        assert "skipped" not in said and "Traceback" not in said and "error" not in said, said
        for start in re.findall(r"goes on from (\d+)", said):
            assert int(start) == before
        assert newest_steps(folder) >= before
    done = newest_steps(folder)
    assert done > 0
    end = command("scripts.train_ppo", *again, f"--total-steps={done + 2 * ROLLOUT}")
    assert end.returncode == 0, end.stderr
    assert f"goes on from {done} of" in end.stdout and f"trained {2 * ROLLOUT} steps" in end.stdout
    assert newest_steps(folder) == done + 2 * ROLLOUT
    assert not list(folder.glob("*.partial"))
    steps = [int(path.stem.split("_")[1]) for path in checkpoints(folder)]
    assert steps == list(range(done + 2 * ROLLOUT, 0, -ROLLOUT))  # each rollout was learned from, and counted once


def newest_steps(folder):
    paths = checkpoints(folder)
    return int(paths[0].stem.split("_")[1]) if paths else 0


def killed(arguments, after):
    """What a training command says until it is killed, a number of seconds after its start."""
    process = subprocess.Popen(
        [sys.executable, "-u", "-m", "scripts.train_ppo", *arguments],
        cwd=ROOT,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
    )
    time.sleep(after)
    process.send_signal(signal.SIGKILL)
    return process.communicate(timeout=60)[0]
