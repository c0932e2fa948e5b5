"""What each feature of a scene costs, and how the cost grows with rods and elements (part of `scripts.bench`)."""

from __future__ import annotations

from functools import partial
from typing import Any

import gymnasium
import numpy as np
from tqdm import tqdm

from magrod_env import DistributedForce, FluidDrag, Magnet, PointLoad, Scene, Simulation, TipWrench, load_scene
from magrod_env.envs.observing import observe_blocks
from magrod_env.envs.settings import Camera
from magrod_env.rod.batch import RodBatch
from magrod_env.values import rod_values
from scripts import Report, Table, least_time

STEPS = 100
RODS = 512
LISTED = {
    "wrench at the tip": TipWrench(force=(0.0, 0.0, 1e-4)),
    "wrench that follows the tip": TipWrench(force=(0.0, 0.0, 1e-4), follows=True),
    "force per length": DistributedForce(force_per_length=(0.0, 0.0, 1e-3)),
    "force per length that follows": DistributedForce(force_per_length=(0.0, 0.0, 1e-3), follows=True),
    "point load in the middle": PointLoad(position=30e-3, force=(0.0, 0.0, 1e-4)),
    "fluid drag": FluidDrag(density=1000.0, normal_coefficient=1.1, tangential_coefficient=0.02),
    "fluid drag in a flow": FluidDrag(
        density=1000.0, normal_coefficient=1.1, tangential_coefficient=0.02, flow=(0.0, 0.0, 0.05)
    ),
}


def make_batch(scene: Scene, *, plane: str | None = None, lag: bool = False, num_elements: int = 4, num_rods=RODS):
    """A batch of rods as an environment has it, on one thread."""
    values, segments = rod_values(scene)
    return RodBatch(
        values,
        segments,
        num_rods=num_rods,
        num_elements=num_elements,
        nodal=False,
        precision="float64",
        plane=plane,
        gravity=scene.gravity,
        drag_rate=scene.drag_rate,
        spin_drag_rate=scene.spin_drag_rate,
        internal_damping=scene.internal_damping,
        loads=scene.acting_loads,
        lag=lag,
        num_threads=1,
    )


def nanoseconds(batch: RodBatch, quick: bool) -> float:
    """Time of a step of a rod."""
    run = partial(batch.run, STEPS, 2e-5, 0.1)
    return 1e9 * least_time(run, repeats=3 if quick else 15, duration=0.05) / STEPS / batch.num_rods


def features(report: Report, quick: bool) -> None:
    """A scene with and without each feature, all else alike."""
    full = load_scene("paper5_circle", modulus="effective").replace(drag_rate=5.0)
    tip = full.magnets[0]
    second = Magnet.dipole(position=tip.position / 2, moment=tip.moment, mass=tip.mass)
    table = Table(
        "Cost of a feature: time of a step of one rod, N = 4, float64 lanes, one core",
        ("feature", "without, ns", "with, ns", "with / without"),
        note="The rest of the scene: gravity, tip magnet, drag. A feature that is left out is not in the kernel.",
    )
    pairs: list[tuple[str, Any, Any]] = [
        ("gravity", {"scene": full.replace(gravity=None)}, {"scene": full}),
        ("tip magnet", {"scene": full.replace(magnets=())}, {"scene": full}),
        ("second magnet", {"scene": full}, {"scene": full.replace(magnets=(tip, second))}),
        ("drag", {"scene": full.replace(drag_rate=None)}, {"scene": full}),
        ("spin drag", {"scene": full}, {"scene": full.replace(spin_drag_rate=100.0)}),
        ("internal damping", {"scene": full}, {"scene": full.replace(internal_damping=1e-4)}),
        *[(name, {"scene": full}, {"scene": full.replace(loads=(load,))}) for name, load in LISTED.items()],
        ("lag of the coils", {"scene": full}, {"scene": full, "lag": True}),
        ("space instead of a plane", {"scene": full, "plane": "xz"}, {"scene": full}),
    ]
    for name, without, with_it in tqdm(pairs[:2] if quick else pairs, desc="features", leave=False):
        times = [nanoseconds(make_batch(**settings), quick) for settings in (without, with_it)]
        table.rows.append((name, *times, times[1] / times[0]))
    if not quick:
        plain, pulled = make_batch(full), make_batch(full)
        pulled.use_gradient()
        times = [nanoseconds(batch, quick) for batch in (plain, pulled)]
        table.rows.append(("force of a field gradient", *times, times[1] / times[0]))
        for name, settings in (
            ("noise of the camera (observation of one env)", {"camera": Camera(noise=5e-5)}),
            ("full state (observation of one env)", {"observe": "state"}),
        ):
            times = [_observation(**chosen) for chosen in ({}, settings)]
            table.rows.append((name, *times, times[1] / times[0]))
    report.show("features", table)


def _observation(**settings: Any) -> float:
    """Time, ns, of one environment's observation and reward."""
    env: Any = gymnasium.make_vec("MagRod/Circle-v0", num_envs=RODS, num_threads=1, **settings)
    env.reset(seed=0)
    core, actions = env.core, np.zeros(env.action_space.shape)
    out = core.new_outcome()
    observe = partial(
        core.batch.share,
        observe_blocks,
        core.batch.terms,
        core.view,
        core.full,
        core.episodes,
        actions,
        core.batch.status,
        out,
    )
    return 1e9 * least_time(observe, repeats=15, duration=0.05) / RODS


def slope(sizes: list[int], times: list[float], first: int) -> float:
    """Exponent of the growth of a time with a size, from entry `first` on, by least squares."""
    return float(np.polyfit(np.log(sizes[first:]), np.log(times[first:]), 1)[0])


def scaling(report: Report, quick: bool) -> None:
    """Time against the number of rods and of elements."""
    scene = load_scene("paper5_circle", modulus="effective").replace(drag_rate=5.0)
    rods = [1, 8, 64] if quick else [1, 8, 16, 64, 256, 1024, 4096, 16384]
    table = Table(
        "Rods: time of a step of all, N = 4, float64, one core", ("rods", "µs a step", "ns a rod", "bytes a rod")
    )
    times = []
    for count in tqdm(rods, desc="rods", leave=False):
        batch = make_batch(scene, num_rods=count)
        each = nanoseconds(batch, quick)
        times.append(each * count)
        table.rows.append((count, 1e-3 * each * count, each, batch.blocks.nbytes / count))
    table.note = f"Growth with the rods from 8 on: exponent {slope(rods, times, 1):.3f} (1: linear)."
    report.show("rods", table)
    elements = [1, 4, 16] if quick else [1, 2, 4, 8, 16, 32, 64, 128, 200]
    table = Table(
        "Elements: time of a step of one rod, float64, one core",
        ("elements", "ns, in a batch of 64", "ns an element", "ns, single", "stable step, s"),
    )
    times = []
    for count in tqdm(elements, desc="elements", leave=False):
        each = nanoseconds(make_batch(scene, num_elements=count, num_rods=64), quick)
        single = nanoseconds(make_batch(scene, num_elements=count, num_rods=1), quick)
        times.append(each)
        bound = Simulation(scene, num_elements=count).stable_time_step
        table.rows.append((count, each, each / count, single, bound))
    table.note = f"Growth with the elements from 4 on: exponent {slope(elements, times, 2 if not quick else 1):.3f}."
    report.show("elements", table)
