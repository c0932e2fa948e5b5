"""The paper's experiment 5: the tip follows a circle across the rod."""

from __future__ import annotations

from magrod_env.envs.arguments import FARTHEST
from magrod_env.envs.paths import shape
from magrod_env.envs.tasks.following import (
    PATH_POINTS,
    RANDOM_START,
    center_field_argument,
    follow_path,
    path_start,
    period_argument,
)
from magrod_env.envs.tasks.scenes import ROUND_ROD, round_rod
from magrod_env.envs.tasks.task import Argument, EnvironmentId, Task, TaskSpec, within
from magrod_env.envs.workspace import Workspace


def circle(
    workspace: Workspace,
    *,
    radius: float,
    period: float,
    center_field: tuple[float, float, float],
    random_start: bool,
) -> Task:
    """A circle across the rod about the point where `center_field` (3,) T holds the tip."""
    center = workspace.equilibrium(center_field).tip_position[1:]
    points = center + radius * shape("circle", PATH_POINTS)
    return follow_path(workspace, points, period=period, axes="yz", random_start=random_start)


SPEC = TaskSpec(
    name="circle",
    ids=(
        EnvironmentId(
            name="MagRod/Circle-v0", max_episode_steps=300, summary="the tip follows a circle across the rod"
        ),
    ),
    scene=round_rod,
    make=circle,
    arguments=(
        Argument(
            name="radius",
            default=16e-3,
            check=within("give it in metres", above=0.0, at_most=FARTHEST),
            meaning="m",
            shown="16e-3",
        ),
        period_argument(2.0),
        center_field_argument("the circle's centre"),
        RANDOM_START,
    ),
    sets_fields="center_field",
    resolution=ROUND_ROD,
    start=path_start("circle", "the point at +y"),
)
