"""Run a controller on many seeded environments and say how well it did, in the field's usual numbers."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, TypeAlias, TypedDict

import gymnasium
import numpy as np
from gymnasium.vector import VectorEnv
from tqdm import tqdm

import magrod_env  # noqa: F401  (registers the ids)
from magrod_env.envs import Camera, Randomization, attributes_of
from magrod_env.envs.core import SteeringCore

if TYPE_CHECKING:
    from typing_extensions import Unpack

Envs: TypeAlias = gymnasium.Env | VectorEnv


class EnvSettings(TypedDict, total=False):
    """Arguments of an environment."""

    precision: str
    randomization: Randomization | None
    camera: Camera | None
    observe: str
    num_elements: int
    random_start: bool


REAL_RODS = Randomization(
    modulus=0.2,
    density=0.05,
    drag=0.5,
    remanence=0.05,
    field_gain=0.05,
    field_misalignment=0.05,
    gravity_direction=0.05,
    initial_field=1e-3,
)
"""How much a real rod and its coils differ from the model here: the spread of PDMS moduli, N45 grades, hand
alignment.
"""

Controller = Callable[[np.ndarray, Envs], np.ndarray]
"""From observations (num_envs, size) and the vector environment to actions (num_envs, num_axes)."""


def core_of(envs: Envs) -> SteeringCore:
    """What the environments of this package share: rods, task, coils."""
    return envs.unwrapped.core  # type: ignore[union-attr]


@dataclass(frozen=True)
class Result:
    """Errors (num_episodes, steps) m, mean squared action a step, share of diverged episodes, simulated over wall
    time.
    """

    name: str
    errors: np.ndarray
    effort: float
    diverged: int
    speed: float

    @property
    def row(self) -> tuple[str, ...]:
        """mean, RMS, largest error and the mean error of the best and the worst rod in mm, effort, diverged, speed."""
        mm = 1e3 * self.errors
        rods = mm.mean(axis=1)
        numbers = (mm.mean(), np.sqrt((mm**2).mean()), mm.max(), rods.min(), rods.max(), self.effort)
        return (self.name, *(f"{number:.3f}" for number in numbers), str(self.diverged), f"{self.speed:.0f}")


HEADER = ("controller", "mean", "RMS", "max", "best rod", "worst rod", "effort", "diverged", "sim/wall")


def check_env_id(env_id: str) -> None:
    """Refuse an id that no environment of this package has.

    Raises:
        ValueError: with the ids that there are.
    """
    spec = gymnasium.registry.get(env_id) if isinstance(env_id, str) else None
    if spec is None or "magrod_env" not in str(spec.vector_entry_point):
        known = ", ".join(name for name in gymnasium.registry if name.startswith("MagRod/"))
        raise ValueError(f"env_id must be a registered environment of rods, but got {env_id!r}: choose one of {known}.")


def evaluate(
    name: str,
    controller: Controller,
    env_id: str,
    *,
    num_episodes: int = 64,
    seed: int = 1_000_000,
    **settings: Unpack[EnvSettings],
) -> Result:
    """One episode on each of `num_episodes` environments, seeded seed, seed + 1, ...; errors until an episode ends."""
    steps = gymnasium.spec(env_id).max_episode_steps or 300
    envs = gymnasium.make_vec(env_id, num_envs=num_episodes, **settings)
    rods = attributes_of(envs)
    observations, _ = envs.reset(seed=seed)
    controller(observations, envs)  # compiles, loads
    errors, efforts, failed = [], [], np.zeros(num_episodes, bool)
    start = time.perf_counter()
    for _ in tqdm(range(steps), desc=name, leave=False, disable=None):
        actions = controller(observations, envs)
        observations, _, terminated, _, info = envs.step(actions)
        failed |= terminated
        errors.append(np.where(failed, rods.scene.rod.length, info["tip_error"]))
        efforts.append(np.mean(np.square(np.clip(actions, -1.0, 1.0))))
    wall = time.perf_counter() - start
    simulated = num_episodes * steps * rods.control_time
    return Result(name, np.array(errors).T, float(np.mean(efforts)), int(failed.sum()), simulated / wall)


def table(results: list[Result]) -> str:
    """Results as a Markdown table; errors in mm."""
    rows = [HEADER, *(result.row for result in results)]
    widths = [max(len(row[k]) for row in rows) for k in range(len(HEADER))]
    lines = ["| " + " | ".join(cell.ljust(width) for cell, width in zip(row, widths)) + " |" for row in rows]
    return "\n".join([lines[0], "|" + "|".join("-" * (width + 2) for width in widths) + "|", *lines[1:]])
