"""How fast it is: `python -m scripts.bench [--quick] [--json FILE]`.

The first step of a fresh process, the cold compilation of what the demo needs, environment and kernel speeds, frames a
second, memory. Every speed is the least time of several runs after a warm-up: other processes only ever add time. The
load average beside the machine's facts says how quiet it was.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
import tempfile
import time
import tracemalloc
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
import tyro
from gymnasium.vector import VectorEnv
from tqdm import tqdm

import magrod_env  # noqa: F401  (registers the ids)
from agents.rollout import REAL_RODS
from magrod_env import Simulation, load_scene
from magrod_env.rod.threads import usable_cores
from scripts import ROOT, Check, Report, Table, least_time
from scripts.bench_scaling import features, scaling
from scripts.bench_targets import targets

PAGE = """# Speed

What a step costs: of the environments, with the tip error of the very configuration that is timed; of the kernels;
of every feature of a scene; with the number of rods and of elements; and what a batch takes in memory. How fast at
which error, beside other simulators: [error against run time](precision.md).

Every time is the least of several runs after a warm-up. What bounds the batch is arithmetic: the state of a block of
rods stays in the first-level cache, and the time of a step grows with elements and rods alone (the tables of growth).
One env is bound by its substeps on one core, which use no lanes of the vector unit.

The errors beside the speeds are of smooth motion. Under *random* actions, a new field within the limits at every
control step, the default rod (4 elements, 3 ms of internal damping) is 0.42 mm (RMS, first ten control steps, 16 rods;
0.68 mm over fifty) from one of 24 elements, with 6 elements 0.07 and 0.17 mm; with coils that lag by 10 ms 0.19 and
0.52 mm, with 6 elements 0.04 and 0.15 mm. Without internal damping it would be 5.2 mm, and no number of elements would
help for long: loads that differ by 1e-4 then move the tip of 24 elements by 4 mm within a second
(`python -m scripts.random_actions`, [resolution](resolution.md#hard-driving)).
"""

CIRCLE, PLANAR = "MagRod/Circle-v0", "MagRod/PlanarReach-v0"

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


@dataclass
class Args:
    """What to measure."""

    quick: bool = False
    """a small part of it, in seconds; leaves out the cold compilation"""
    json: Path | None = None
    """where to write the numbers as JSON"""
    page: Path | None = None
    """where to write the page of documentation"""


def fresh_process(code: str, **environment: str) -> tuple[float, list[float]]:
    """Wall time (s) of a new Python process that runs `code`, and the list of numbers that it prints."""
    start = time.perf_counter()
    done = subprocess.run(
        [sys.executable, "-c", code],
        cwd=ROOT,
        env=os.environ | environment,
        capture_output=True,
        text=True,
    )
    wall = time.perf_counter() - start
    if done.returncode != 0:
        raise RuntimeError(f"a process that the benchmark started failed:\n{done.stderr}")
    return wall, json.loads(done.stdout.splitlines()[-1])


def start_up(report: Report, quick: bool) -> None:
    """(g) From nothing to the first step, with the kernels compiled and without."""
    fresh_process(FIRST_STEP)  # fills the cache
    runs = [fresh_process(FIRST_STEP) for _ in tqdm(range(2 if quick else 5), desc="first step", leave=False)]
    wall, parts = min(runs)
    table = Table(
        "(g) First step of a fresh process, kernels in the cache",
        ("imports, s", "make and reset, s", "step, s", "of processor time, s", "whole process, s"),
        [(*parts, wall)],
        f"The quickest of {len(runs)} processes.",
    )
    report.show("first_step", table)
    report.checks.append(Check("g", "first step of a fresh process", wall, 3.0, "s", timing=True))
    cold = None
    if not quick:
        with tempfile.TemporaryDirectory(prefix="magrod-bench-") as folder:
            cold, parts = fresh_process(COLD, MAGROD_CACHE_DIR=folder)
        table = Table(
            "(g) The demo's kernels, nothing compiled",
            (
                "single, s",
                "64 envs, s",
                "64 randomised envs, s",
                "single, randomised, filmed, s",
                "of processor time, s",
                "whole process, s",
            ),
            [(*parts, cold)],
            "Each column has what those before it left to compile. One process, compiling on one core: where the "
            "processor time is less than the whole, it had to wait for others.",
        )
        report.show("cold", table)
    report.checks.append(Check("g", "cold compilation of the demo's kernels", cold, 60.0, "s", timing=True))


def random_actions(shape: tuple[int, ...]) -> list[np.ndarray]:
    """Actions to choose from in turn: drawing them is not part of a step."""
    generator = np.random.default_rng(0)
    return [generator.uniform(-0.5, 0.5, shape).astype(np.float32) for _ in range(16)]


def stepper(env: Any) -> Callable[[], None]:
    """A function that steps an environment, single or batch, and resets a single one at its end."""
    env.reset(seed=0)
    actions, count = random_actions(env.action_space.shape), 0
    single = not isinstance(env, VectorEnv)

    def step() -> None:
        nonlocal count
        count += 1
        _, _, terminated, truncated, _ = env.step(actions[count % len(actions)])
        if single and (terminated or truncated):
            env.reset()

    return step


def make(name: str, size: int, **settings: Any) -> Any:
    """A single environment, or a batch whose episodes have no end."""
    if size == 1:
        return gymnasium.make(name, **settings)
    return gymnasium.make_vec(name, num_envs=size, max_episode_steps=-1, **settings)


def environments(report: Report, quick: bool) -> None:
    """Steps a second of the environments, and what a reset takes."""
    table = Table(
        "Environments",
        (
            "id",
            "envs",
            "float64, steps/s",
            "float32, steps/s",
            "float64, simulated/wall",
            "reset, µs an env",
            "randomised reset, µs an env",
        ),
        note=f"Random actions; a step is 20 ms; a batch's resets are apart, {usable_cores()} threads share it. "
        "A randomised reset builds a new rod and finds its equilibrium.",
    )
    effort = {"repeats": 3, "duration": 0.02} if quick else {"repeats": 7, "duration": 0.3}
    for name in tqdm((CIRCLE,) if quick else (CIRCLE, PLANAR), desc="environments", leave=False):
        for size in (1, 64) if quick else (1, 64, 256, 1024, 4096):
            double = make(name, size)
            speed, reset = size / least_time(stepper(double), **effort), least_time(double.reset, **effort)
            single, varied = None, None
            if not quick:
                single = size / least_time(stepper(make(name, size, precision="float32")), **effort)
                various = make(name, size, randomization=REAL_RODS)
                various.reset(seed=0)
                varied = 1e6 / size * least_time(various.reset, **effort)
            table.rows.append((name, size, speed, single, 0.02 * speed, 1e6 * reset / size, varied))
    report.show("environments", table)


def kernels(report: Report, quick: bool) -> None:
    """Time of a rod's step, without an environment around it."""
    table = Table(
        "Kernels: time of one step of one rod, N = 6, gravity, one magnet, drag",
        (
            "kernel",
            "rods",
            "precision",
            "threads",
            "ns per step",
            "ns per step and element",
            "simulated/wall, all rods",
            "with internal damping / without",
        ),
        note="The step that Simulation chooses by itself. Internal damping: a Kelvin-Voigt time of 3 ms.",
    )
    scene = load_scene("paper5_circle", modulus="effective").replace(drag_rate=5.0)
    cores = usable_cores()
    for plane in tqdm((None,) if quick else (None, "xz"), desc="kernels", leave=False):
        for rods, precision, threads in (
            (1, "float64", 1),
            (512, "float64", 1),
            (512, "float64", cores),
            (512, "float32", 1),
            (512, "float32", cores),
        ):
            if quick and (threads > 1 or precision == "float32"):
                continue
            options = dict(num_rods=rods, plane=plane, precision=precision, num_threads=threads)
            plain, damped = (Simulation(scene.replace(internal_damping=tau), **options) for tau in (None, 3e-3))
            span = (2000 if rods == 1 else 20) * plain.time_step
            wall, damped_wall = (
                least_time(partial(simulation.advance, span), repeats=3 if quick else 9, duration=0.1)
                for simulation in (plain, damped)
            )
            nanoseconds = 1e9 * wall / (round(span / plain.time_step) * rods)
            name, ratio = "spatial" if plane is None else "planar", span * rods / wall
            table.rows.append((name, rods, precision, threads, nanoseconds, nanoseconds / 6, ratio, damped_wall / wall))
    report.show("kernels", table)


def frames(report: Report, quick: bool) -> None:
    """Pictures a second."""
    env = gymnasium.make(CIRCLE, render_mode="rgb_array")
    step = stepper(env)
    for _ in range(60):  # a trace to draw
        step()

    def step_and_render() -> None:
        step()
        env.render()

    repeats = 2 if quick else 7
    alone, both = (1.0 / least_time(call, repeats=repeats, duration=0.3) for call in (env.render, step_and_render))
    height, width, _ = env.render().shape
    table = Table(
        "rgb_array",
        ("size", "frames a second", "with a step each"),
        [(f"{width} x {height}", float(alone), float(both))],
    )
    report.show("frames", table)
    report.checks.append(
        Check("speed", "rgb_array with a step each", both, 30.0, "frames/s", at_least=True, timing=True)
    )


def memory(report: Report, quick: bool) -> None:
    """Bytes that a rod of a batch takes."""
    table = Table(
        "Memory, bytes an environment",
        ("id", "envs", "precision", "rod's state and constants", "held", "largest"),
        note="Traced allocations of making a batch, one reset and one step, over the number of environments: what is "
        "held afterwards and the largest on the way.",
    )
    size = 256 if quick else 4096
    for name, precision in ((CIRCLE, "float64"), (CIRCLE, "float32"), (PLANAR, "float64")):
        if quick and (name, precision) != (CIRCLE, "float64"):
            continue
        for warm in (True, False):  # the first time compiles and fills caches that every environment shares
            tracemalloc.start()
            env = make(name, 8 if warm else size, precision=precision)
            stepper(env)()
            held, peak = tracemalloc.get_traced_memory()
            tracemalloc.stop()
        rods = env.unwrapped.core.batch.blocks.nbytes / size
        table.rows.append((name, size, precision, float(rods), held / size, peak / size))
    report.show("memory", table)


def measure(args: Args) -> Report:
    """Every table, printed as it is ready."""
    report = Report("scripts.bench", args.quick)
    start_up(report, args.quick)
    targets(report, args.quick, stepper, make)
    environments(report, args.quick)
    kernels(report, args.quick)
    features(report, args.quick)
    scaling(report, args.quick)
    frames(report, args.quick)
    memory(report, args.quick)
    return report


def main() -> None:
    """Measure and report."""
    args = tyro.cli(Args, description=__doc__)
    report = measure(args)
    if args.page is not None:
        report.write_page(args.page, PAGE, {})
    report.finish(args.json)


if __name__ == "__main__":
    main()
