"""Speeds of the kernels: what a step, each feature of a scene, and more rods and elements cost."""

from __future__ import annotations

import dataclasses
from functools import partial
from typing import TYPE_CHECKING, TypedDict

import gymnasium
import numpy as np
from tqdm import tqdm

from agents.rollout import EnvSettings, core_of
from magrod_env import DistributedForce, FluidDrag, Magnet, PointLoad, Scene, Simulation, TipWrench, load_scene
from magrod_env.envs.observing import observe_blocks
from magrod_env.envs.settings import Camera
from magrod_env.rod.batch import RodBatch
from magrod_env.rod.threads import usable_cores
from magrod_env.simulation.scene_values import rod_values
from scripts.common.report import Report
from scripts.common.run import Options, least_time, slope

if TYPE_CHECKING:
    from typing_extensions import Unpack

STEPS = 128  # whole groups of steps between which internal damping acts
RODS = 512
SIZES = ((1, 1), (RODS, 1), (RODS, usable_cores()))  # rods, threads
SCENE = load_scene("paper5_circle", modulus="effective").replace(drag_rate=5.0)
LIFT = (0.0, 0.0, 1e-4)  # N
LINE = (0.0, 0.0, 1e-3)  # N/m
WATER = FluidDrag(density=1000.0, normal_coefficient=1.1, tangential_coefficient=0.02)
LISTED = {
    "wrench at the tip": TipWrench(force=LIFT),
    "wrench that follows the tip": TipWrench(force=LIFT, follows=True),
    "force per length": DistributedForce(force_per_length=LINE),
    "force per length that follows": DistributedForce(force_per_length=LINE, follows=True),
    "point load in the middle": PointLoad(position=30e-3, force=LIFT),
    "fluid drag": WATER,
    "fluid drag in a flow": dataclasses.replace(WATER, flow=(0.0, 0.0, 0.05)),
}


def kernels(report: Report, quick: bool) -> None:
    """Time of a rod's step, without an environment around it."""
    cases = [(rods, precision, threads) for precision in ("float64", "float32") for rods, threads in SIZES]
    cases = [case for case in cases if case[0] > 1 or case[1] == "float64"]
    with report.table(
        "kernels",
        "Kernels: time of one step of one rod, N = 6, gravity, one magnet, drag",
        "kernel | rods | precision | threads | ns per step | ns per step and element | simulated/wall, all rods | "
        "with internal damping / without",
        "The step that Simulation chooses by itself. Internal damping: a Kelvin-Voigt time of 3 ms.",
    ) as table:
        for plane in tqdm((None,) if quick else (None, "xz"), desc="kernels", leave=False):
            for rods, precision, threads in cases[:2] if quick else cases:
                options: Options = {"num_rods": rods, "plane": plane, "precision": precision, "num_threads": threads}
                plain, damped = (Simulation(SCENE.replace(internal_damping=tau), **options) for tau in (None, 3e-3))
                span = (2048 if rods == 1 else 64) * plain.time_step
                wall, damped_wall = (
                    least_time(partial(rod.advance, span), repeats=3 if quick else 9, duration=0.1)
                    for rod in (plain, damped)
                )
                each = 1e9 * wall / (round(span / plain.time_step) * rods)
                row = ("spatial" if plane is None else "planar", rods, precision, threads, each, each / 6)
                table.add(*row, span * rods / wall, damped_wall / wall)


class Kind(TypedDict, total=False):
    """A batch to make."""

    plane: str | None
    lag: bool
    num_elements: int
    num_rods: int


def make_batch(scene: Scene = SCENE, **kind: Unpack[Kind]) -> RodBatch:
    """A batch of rods as an environment has it, on one thread."""
    values, segments = rod_values(scene)
    return RodBatch(
        values,
        segments,
        num_rods=kind.get("num_rods", RODS),
        num_elements=kind.get("num_elements", 4),
        nodal=False,
        precision="float64",
        plane=kind.get("plane"),
        gravity=scene.gravity,
        drag_rate=scene.drag_rate,
        spin_drag_rate=scene.spin_drag_rate,
        internal_damping=scene.internal_damping,
        loads=scene.acting_loads,
        lag=kind.get("lag", False),
        num_threads=1,
    )


def nanoseconds(batch: RodBatch, quick: bool) -> float:
    """Time of a step of a rod."""
    run = partial(batch.run, STEPS, 2e-5, 0.1)
    return 1e9 * least_time(run, repeats=3 if quick else 15, duration=0.05) / STEPS / batch.num_rods


def features(report: Report, quick: bool) -> None:
    """A scene with and without each feature, all else alike."""
    tip, bare = SCENE.magnets[0], make_batch
    second = Magnet.dipole(position=tip.position / 2, moment=tip.moment, mass=tip.mass)
    pairs = [
        ("gravity", bare(SCENE.replace(gravity=None)), bare()),
        ("tip magnet", bare(SCENE.replace(magnets=())), bare()),
        ("second magnet", bare(), bare(SCENE.replace(magnets=(tip, second)))),
        ("drag", bare(SCENE.replace(drag_rate=None)), bare()),
        ("spin drag", bare(), bare(SCENE.replace(spin_drag_rate=100.0))),
        ("internal damping", bare(), bare(SCENE.replace(internal_damping=1e-4))),
        *[(name, bare(), bare(SCENE.replace(loads=(load,)))) for name, load in LISTED.items()],
        ("lag of the coils", bare(), bare(lag=True)),
        ("space instead of a plane", bare(plane="xz"), bare()),
        ("force of a field gradient", bare(), bare()),
    ]
    pairs[-1][2].use_gradient()
    cameras: dict[str, EnvSettings] = {
        "noise of the camera (observation of one env)": {"camera": Camera(noise=5e-5)},
        "full state (observation of one env)": {"observe": "state"},
    }
    with report.table(
        "features",
        "Cost of a feature: time of a step of one rod, N = 4, float64 lanes, one core",
        "feature | without, ns | with, ns | with / without",
        "The rest of the scene: gravity, tip magnet, drag. A feature that is left out is not in the kernel.",
    ) as table:
        for name, without, with_it in tqdm(pairs[:2] if quick else pairs, desc="features", leave=False):
            times = [nanoseconds(batch, quick) for batch in (without, with_it)]
            table.add(name, *times, times[1] / times[0])
        for name, settings in cameras.items() if not quick else ():
            times = [_observation(EnvSettings()), _observation(settings)]
            table.add(name, *times, times[1] / times[0])


def _observation(settings: EnvSettings) -> float:
    """Time, ns, of one environment's observation and reward."""
    envs = gymnasium.make_vec("MagRod/Circle-v0", num_envs=RODS, num_threads=1, **settings)
    envs.reset(seed=0)
    core, actions = core_of(envs), np.zeros(envs.action_space.shape or ())
    batch, out = core.batch, core.new_outcome()
    seen = (batch.shown_terms, core.view, core.full, core.episodes, actions, batch.status, out)
    return 1e9 * least_time(partial(batch.share, observe_blocks, *seen), repeats=15, duration=0.05) / RODS


def scaling(report: Report, quick: bool) -> None:
    """Time against the number of rods and of elements."""
    rods = [1, 8, 64] if quick else [1, 8, 16, 64, 256, 1024, 4096, 16384]
    title, columns = (
        "Rods: time of a step of all, N = 4, float64, one core",
        "rods | µs a step | ns a rod | bytes a rod",
    )
    with report.table("rods", title, columns) as table:
        for count in tqdm(rods, desc="rods", leave=False):
            batch = make_batch(num_rods=count)
            each = nanoseconds(batch, quick)
            table.add(count, 1e-3 * each * count, each, batch.blocks.nbytes / count)
        growth = slope(rods[1:], [row[1] for row in table.rows[1:]])
        table.note = f"Growth with the rods from 8 on: exponent {growth:.3f} (1: linear)."
    elements, first = ([1, 4, 16], 1) if quick else ([1, 2, 4, 8, 16, 32, 64, 128, 200], 2)
    title = "Elements: time of a step of one rod, float64, one core"
    columns = "elements | ns, in a batch of 64 | ns an element | ns, single | stable step, s"
    with report.table("elements", title, columns) as table:
        for count in tqdm(elements, desc="elements", leave=False):
            each, single = (nanoseconds(make_batch(num_elements=count, num_rods=n), quick) for n in (64, 1))
            table.add(count, each, each / count, single, Simulation(SCENE, num_elements=count).stable_time_step)
        growth = slope(elements[first:], [row[1] for row in table.rows[first:]])
        table.note = f"Growth with the elements from 4 on: exponent {growth:.3f}."
