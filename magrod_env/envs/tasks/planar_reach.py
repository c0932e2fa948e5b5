"""Reach in the vertical plane of the rod, computed in the plane."""

from __future__ import annotations

from magrod_env.envs.tasks.reaching import REST, reach_limit_argument, reach_points
from magrod_env.envs.tasks.scenes import ROUND_ROD, round_rod
from magrod_env.envs.tasks.task import EnvironmentId, Task, TaskSpec
from magrod_env.envs.workspace import Workspace


def planar_reach(workspace: Workspace, *, reach_limit: float) -> Task:
    """Points that fields of 0 to `reach_limit` T along x, and of up to it along z, hold."""
    return reach_points(workspace, axes="xz", limit=reach_limit)


SPEC = TaskSpec(
    name="planar_reach",
    ids=(
        EnvironmentId(
            name="MagRod/PlanarReach-v0",
            max_episode_steps=100,
            summary="reach in the vertical plane, computed in the plane",
        ),
    ),
    scene=round_rod,
    make=planar_reach,
    arguments=(
        reach_limit_argument("targets are equilibria in fields of 0 to this along x and up to this along z, both ways"),
    ),
    sets_fields="reach_limit",
    resolution=ROUND_ROD,
    axes="xz",
    plane="xz",
    start=REST,
)
