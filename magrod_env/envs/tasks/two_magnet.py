"""After the paper's experiment 6: tip and middle of a rod with two magnets follow two curves at once."""

from __future__ import annotations

import numpy as np

from magrod_env.envs.arguments import STRONGEST
from magrod_env.envs.tasks.following import PATH_POINTS, RANDOM_START, follow_fields, period_argument
from magrod_env.envs.tasks.scenes import two_magnet_rod
from magrod_env.envs.tasks.task import Argument, EnvironmentId, Task, TaskSpec, within
from magrod_env.envs.workspace import Workspace
from magrod_env.magnetics import Actuator
from magrod_env.simulation.resolution import Resolution


def two_magnet(workspace: Workspace, *, amplitude: float, period: float, random_start: bool) -> Task:
    """The positions that a closed path of fields, of `amplitude` T, holds."""
    return follow_fields(workspace, two_magnet_fields(amplitude), period=period, random_start=random_start)


def two_magnet_fields(amplitude: float) -> np.ndarray:
    """A closed path of fields (PATH_POINTS, 3) T in the vertical plane of the rod, for two opposed magnets.

    The paper does not state the field of its experiment 6; this one sweeps the amplitude up and down with a small
    axial part, so that tip and middle move on different curves.
    """
    angle = np.linspace(0.0, 2.0 * np.pi, PATH_POINTS, endpoint=False)
    zero = np.zeros_like(angle)
    return amplitude * np.stack([0.3 * np.sin(2.0 * angle), zero, 0.5 - 0.5 * np.cos(angle)], axis=1)


SPEC = TaskSpec(
    name="two_magnet",
    ids=(
        EnvironmentId(
            name="MagRod/TwoMagnet-v0",
            max_episode_steps=400,
            summary="tip and middle of a rod with two magnets follow two curves",
        ),
    ),
    scene=two_magnet_rod,
    make=two_magnet,
    arguments=(
        Argument(
            name="amplitude",
            default=20e-3,
            check=within("give it in tesla", above=0.0, at_most=STRONGEST),
            meaning="T, of the path of fields",
            shown="20e-3",
        ),
        period_argument(4.0),
        RANDOM_START,
    ),
    sets_fields="amplitude",
    resolution=Resolution(num_elements=10, rotary_scaling=8.0),
    axes="xz",
    actuator=Actuator(limit=25e-3),
    start=(
        f"At rest in the field of the path's point where the targets are: one of {PATH_POINTS} points, drawn evenly. "
        "With `random_start=False` always zero field."
    ),
)
