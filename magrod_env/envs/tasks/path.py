"""The tip follows a closed path across the rod: a shape by name, or points."""

from __future__ import annotations

from typing import Any

import numpy as np

from magrod_env.envs.arguments import FARTHEST, reals, told
from magrod_env.envs.paths import SHAPES, shape
from magrod_env.envs.tasks.following import (
    RANDOM_START,
    center_field_argument,
    follow_path,
    path_start,
    period_argument,
)
from magrod_env.envs.tasks.scenes import ROUND_ROD, round_rod
from magrod_env.envs.tasks.task import Argument, EnvironmentId, Task, TaskSpec, within
from magrod_env.envs.workspace import Workspace

Points = tuple[tuple[float, ...], ...]


def named_path(
    workspace: Workspace,
    *,
    path: str | Points,
    size: float,
    period: float,
    center_field: tuple[float, float, float],
    random_start: bool,
) -> Task:
    """A shape by name, `size` (m) from its centre to its sides, about where `center_field` holds the tip; or given
    points.
    """
    if isinstance(path, str):
        center = workspace.equilibrium(center_field).tip_position[1:]
        return follow_path(workspace, center + size * shape(path), period=period, axes="yz", random_start=random_start)
    return follow_path(workspace, path, period=period, axes="yz", random_start=random_start)


def checked_path(name: str, value: Any) -> str | Points:
    """A shape's name, or points as tuples."""
    if isinstance(value, str):
        if value not in SHAPES:
            raise ValueError(
                f"{name} must be one of {', '.join(SHAPES)}, but got {told(value)}: choose one, or give points (M, 2)."
            )
        return value
    array = reals(value)
    if array is None or array.ndim != 2 or array.shape[0] < 2 or array.shape[1] not in (2, 3):
        came = told(value) if array is None else f"shape {array.shape}"
        raise ValueError(
            f"{name} must be finite points of shape (M, 2) or (M, 3), but got {came}: give M >= 2 of them."
        )
    if not (np.isfinite(array).all() and (np.abs(array[:, -2:]) <= FARTHEST).all()):  # y and z count
        raise ValueError(
            f"{name} must be finite points within {FARTHEST:g} m, but got {told(array.tolist())}: give them in metres."
        )
    return tuple(map(tuple, array.tolist()))


SPEC = TaskSpec(
    name="path",
    ids=(
        EnvironmentId(
            name="MagRod/Path-v0",
            max_episode_steps=400,
            summary="the tip follows a figure of eight, a square, a letter or a path of yours",
        ),
    ),
    scene=round_rod,
    make=named_path,
    arguments=(
        Argument(
            name="path",
            default="figure_eight",
            check=checked_path,
            meaning="a name, or points (M, 2): y and z in metres in the world; or (M, 3), of which y and z count",
            shown='"figure_eight"',
        ),
        Argument(
            name="size",
            default=12e-3,
            check=within("give it in metres", above=0.0, at_most=FARTHEST),
            meaning="m, from the centre of a named path to its sides",
            shown="12e-3",
        ),
        period_argument(4.0),
        center_field_argument("the centre of a named path"),
        RANDOM_START,
    ),
    sets_fields="center_field",
    resolution=ROUND_ROD,
    start=path_start("path", "the first point"),
)
