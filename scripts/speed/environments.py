"""Speeds of the environments, beside the error of the very configuration that was timed; frames; memory."""

from __future__ import annotations

import tracemalloc
from collections.abc import Callable
from typing import TYPE_CHECKING

import gymnasium
import numpy as np
from gymnasium.vector import VectorEnv
from tqdm import tqdm

import magrod_env  # noqa: F401  (registers the ids)
from agents.rollout import REAL_RODS, Envs, EnvSettings, core_of
from magrod_env.rod.threads import usable_cores
from scripts.common.report import Report
from scripts.common.run import least_time, rms

if TYPE_CHECKING:
    from typing_extensions import Unpack

CIRCLE, PLANAR = "MagRod/Circle-v0", "MagRod/PlanarReach-v0"
LARGEST_ERROR = 0.06  # mm
FINEST = 24  # elements of the reference
TARGETS = (  # title, id, precision, environments, steps a second at least
    ("Circle, float32, batch", CIRCLE, "float32", 4096, 400_000),
    ("PlanarReach, float32, batch", PLANAR, "float32", 4096, 1_000_000),
    ("Circle, float64, batch", CIRCLE, "float64", 4096, 150_000),
    ("Circle, float64, single", CIRCLE, "float64", 1, 6_000),
)


def make(name: str, size: int, **settings: Unpack[EnvSettings]) -> Envs:
    """A single environment, or a batch whose episodes have no end."""
    if size == 1:
        return gymnasium.make(name, **settings)
    return gymnasium.make_vec(name, num_envs=size, max_episode_steps=-1, **settings)


def stepper(env: Envs) -> Callable[[], None]:
    """A function that steps an environment, single or batch, and resets a single one at its end.

    Random actions are drawn beforehand, to choose from in turn: drawing them is not part of a step.
    """
    env.reset(seed=0)
    generator, count = np.random.default_rng(0), 0
    actions = [generator.uniform(-0.5, 0.5, env.action_space.shape).astype(np.float32) for _ in range(16)]
    single = not isinstance(env, VectorEnv)

    def step() -> None:
        nonlocal count
        count += 1
        _, _, terminated, truncated, _ = env.step(actions[count % len(actions)])
        if single and (terminated or truncated):
            env.reset()

    return step


def commands(env: gymnasium.Env, steps: int) -> np.ndarray:
    """Open-loop actions (steps, num_axes): fields that hold the rod on its path, or a smooth wander for reaching."""
    core = core_of(env)
    if core.task.fields is not None:
        at = (np.arange(steps) + 0.5) * core.control_time / (core.task.period or 1.0) * len(core.task.fields)
        fields, first, share = core.task.fields, at.astype(int), (at % 1.0)[:, None]
        between = (1.0 - share) * fields[first % len(fields)] + share * fields[(first + 1) % len(fields)]
        return core.coils.fraction(between)
    time = np.arange(steps) * core.control_time
    share = 25e-3 / (core.actuator.limit or 1.0) * np.minimum(time / 0.3, 1.0)
    return np.stack([share * (0.5 - 0.5 * np.cos(3.0 * time)), share * np.sin(5.0 * time)], axis=1)


def error(name: str, precision: str, steps: int = 100) -> float:
    """RMS distance of the tip from that of a rod with many elements and no conditioning, mm."""
    start = {"random_start": False} if name == CIRCLE else {}
    envs = [gymnasium.make(name, **start, **more) for more in ({"precision": precision}, {"num_elements": FINEST})]
    for env in envs:
        env.reset(seed=0)
    actions = commands(envs[1], steps)  # the same for both: what holds a rod on its path depends on its elements
    one, other = (np.array([env.step(action)[4]["tip_position"] for action in actions]) for env in envs)
    return rms(one, other)


def targets(report: Report, quick: bool) -> None:
    """Steps a second at an error."""
    with report.table(
        "targets",
        "Environment steps a second, and the tip's RMS error of the same configuration",
        "configuration | envs | elements | substeps of 20 ms | error, mm | steps/s",
        f"50 Hz control, observation and reward included, {usable_cores()} threads share a batch. "
        f"Error: open-loop motion of 2 s against {FINEST} elements without conditioning.",
    ) as table:
        for title, name, precision, size, least in tqdm(TARGETS[2:] if quick else TARGETS, desc="targets", leave=False):
            env = make(name, min(size, 64) if quick else size, precision=precision)
            wall = least_time(stepper(env), repeats=3 if quick else 15, duration=0.05 if quick else 0.4)
            core, off = core_of(env), error(name, precision)
            speed = core.num_envs / wall
            table.add(title, core.num_envs, core.num_elements, core.num_steps, off, float(speed))
            report.check("error", title, off, LARGEST_ERROR, "mm")
            if not quick:
                report.check("speed", title, speed, float(least), "steps/s", at_least=True, timing=True)


def environments(report: Report, quick: bool) -> None:
    """Steps a second of the environments, and what a reset takes."""
    repeats, duration = (3, 0.02) if quick else (7, 0.3)

    def timed(call: Callable[[], object]) -> float:
        return least_time(call, repeats=repeats, duration=duration)

    with report.table(
        "environments",
        "Environments",
        "id | envs | float64, steps/s | float32, steps/s | float64, simulated/wall | reset, µs an env | "
        "randomised reset, µs an env",
        f"Random actions; a step is 20 ms; a batch's resets are apart, {usable_cores()} threads share it. "
        "A randomised reset builds a new rod and finds its equilibrium.",
    ) as table:
        for name in tqdm((CIRCLE,) if quick else (CIRCLE, PLANAR), desc="environments", leave=False):
            for size in (1, 64) if quick else (1, 64, 256, 1024, 4096):
                double = make(name, size)
                speed, reset, single, varied = size / timed(stepper(double)), timed(double.reset), None, None
                if not quick:
                    single = size / timed(stepper(make(name, size, precision="float32")))
                    various = make(name, size, randomization=REAL_RODS)
                    various.reset(seed=0)
                    varied = 1e6 / size * timed(various.reset)
                table.add(name, size, speed, single, 0.02 * speed, 1e6 * reset / size, varied)


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
    height, width, _ = np.asarray(env.render()).shape
    with report.table("frames", "rgb_array", "size | frames a second | with a step each") as table:
        table.add(f"{width} x {height}", float(alone), float(both))
    report.check("speed", "rgb_array with a step each", both, 30.0, "frames/s", at_least=True, timing=True)


def memory(report: Report, quick: bool) -> None:
    """Bytes that a rod of a batch takes."""
    size = 256 if quick else 4096
    with report.table(
        "memory",
        "Memory, bytes an environment",
        "id | envs | precision | rod's state and constants | held | largest",
        "Traced allocations of making a batch, one reset and one step, over the number of environments: what is "
        "held afterwards and the largest on the way.",
    ) as table:
        for name, precision in ((CIRCLE, "float64"), (CIRCLE, "float32"), (PLANAR, "float64"))[: 1 if quick else 3]:
            for warm in (True, False):  # the first time compiles and fills caches that every environment shares
                tracemalloc.start()
                env = make(name, 8 if warm else size, precision=precision)
                stepper(env)()
                held, peak = tracemalloc.get_traced_memory()
                tracemalloc.stop()
            rods = core_of(env).batch.blocks.nbytes / size
            table.add(name, size, precision, float(rods), held / size, peak / size)
