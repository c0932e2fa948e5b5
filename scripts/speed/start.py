"""From nothing to the first step, with the kernels compiled and without."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import tempfile
import time

from tqdm import tqdm

from scripts.common import ROOT
from scripts.common.report import Report
from scripts.speed.environments import CIRCLE

FIRST_STEP = f"""
import json, time
start = time.perf_counter()
import gymnasium, magrod_env
imported = time.perf_counter()
env = gymnasium.make("{CIRCLE}")
env.reset(seed=0)
reset = time.perf_counter()
env.step(env.action_space.sample())
done = time.perf_counter()
print(json.dumps([imported - start, reset - imported, done - reset, time.process_time()]))
"""
"""Runs in a process of its own; its wall time, from outside, also has Python's start and end in it."""

COLD = f"""
import json, time
import gymnasium, magrod_env
from agents.rollout import REAL_RODS
def use(make):
    start = time.perf_counter()
    env = make()
    env.reset(seed=0)
    env.step(env.action_space.sample())
    env.close()
    return time.perf_counter() - start
def film():
    env = gymnasium.make("{CIRCLE}", render_mode="rgb_array", randomization=REAL_RODS)
    env.reset(seed=0)
    env.render()
    return env
print(json.dumps([
    use(lambda: gymnasium.make("{CIRCLE}")),
    use(lambda: gymnasium.make_vec("{CIRCLE}", num_envs=64)),
    use(lambda: gymnasium.make_vec("{CIRCLE}", num_envs=64, randomization=REAL_RODS)),
    use(film),
    time.process_time(),
]))
"""
"""What `make demo` compiles: nominal rods, rods that differ from the model, and one of these filmed."""


def fresh_process(code: str, **environment: str) -> tuple[float, list[float]]:
    """Wall time (s) of a new Python process that runs `code`, and the list of numbers that it prints."""
    start = time.perf_counter()
    command = [sys.executable, "-c", code]
    done = subprocess.run(command, cwd=ROOT, env=os.environ | environment, capture_output=True, text=True)
    wall = time.perf_counter() - start
    if done.returncode != 0:
        raise RuntimeError(f"a process that the benchmark started failed:\n{done.stderr}")
    return wall, json.loads(done.stdout.splitlines()[-1])


def start_up(report: Report, quick: bool) -> None:
    """(g) The first step of a fresh process; the cold compilation only if not quick."""
    fresh_process(FIRST_STEP)  # fills the cache
    runs = [fresh_process(FIRST_STEP) for _ in tqdm(range(2 if quick else 5), desc="first step", leave=False)]
    wall, parts = min(runs)
    with report.table(
        "first_step",
        "(g) First step of a fresh process, kernels in the cache",
        "imports, s | make and reset, s | step, s | of processor time, s | whole process, s",
        f"The quickest of {len(runs)} processes.",
    ) as table:
        table.add(*parts, wall)
    report.check("g", "first step of a fresh process", wall, 3.0, "s", timing=True)
    cold = None if quick else compile_cold(report)
    report.check("g", "cold compilation of the demo's kernels", cold, 60.0, "s", timing=True)


def compile_cold(report: Report) -> float:
    """(g) What the demo compiles where nothing is in the cache, s."""
    with tempfile.TemporaryDirectory(prefix="magrod-bench-") as folder:
        cold, parts = fresh_process(COLD, MAGROD_CACHE_DIR=folder)
    with report.table(
        "cold",
        "(g) The demo's kernels, nothing compiled",
        "single, s | 64 envs, s | 64 randomised envs, s | single, randomised, filmed, s | of processor time, s | "
        "whole process, s",
        "Each column has what those before it left to compile. One process, compiling on one core: where the "
        "processor time is less than the whole, it had to wait for others.",
    ) as table:
        table.add(*parts, cold)
    return cold
