"""The tip goes to a point on the surface that it can reach, and stays there; with and without goals."""

from __future__ import annotations

from magrod_env.envs.tasks.reaching import REST, reach_limit_argument, reach_points
from magrod_env.envs.tasks.scenes import ROUND_ROD, round_rod
from magrod_env.envs.tasks.task import EnvironmentId, Task, TaskSpec
from magrod_env.envs.workspace import Workspace


def reach(workspace: Workspace, *, reach_limit: float) -> Task:
    """Points that fields of up to `reach_limit` T along y and z hold."""
    return reach_points(workspace, axes="yz", limit=reach_limit)


SPEC = TaskSpec(
    name="reach",
    ids=(
        EnvironmentId(name="MagRod/Reach-v0", max_episode_steps=100, summary="the tip goes to a random point"),
        EnvironmentId(
            name="MagRod/ReachGoal-v0",
            max_episode_steps=100,
            summary="the same with goals and a sparse reward, for hindsight replay",
            goal=True,
        ),
    ),
    scene=round_rod,
    make=reach,
    arguments=(reach_limit_argument("targets are equilibria in fields up to this along each axis"),),
    sets_fields="reach_limit",
    resolution=ROUND_ROD,
    start=REST,
)
