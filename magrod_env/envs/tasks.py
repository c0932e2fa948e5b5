"""What an episode asks for: a closed path to follow, or a point to reach. Tables of reachable targets, made once."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from magrod_env import _checks
from magrod_env.envs.observing import Targets
from magrod_env.envs.paths import evenly_spaced, shape
from magrod_env.envs.workspace import Workspace
from magrod_env.rod.equilibrium import Equilibrium

PATH_POINTS = 120
GRID_POINTS = 13


@dataclass(frozen=True)
class Task:
    """A task made for one scene: its tables, and the equilibria that an episode may start from.

    ``fields`` (A, 3) T hold the nominal rod at each point of the path; None for reaching.
    """

    targets: Targets
    start_cases: tuple[Equilibrium, ...]
    fields: np.ndarray | None
    path: np.ndarray | None
    period: float | None


def follow_path(
    workspace: Workspace, points: ArrayLike, *, period: float, axes: str, random_start: bool, name: str = "path"
) -> Task:
    """Follow a closed curve of points (M, 2) in the plane of the two axes, or (M, 3) of which those coordinates count.

    The third coordinate is the nominal rod's own where it is held on the curve: a tip moves on a surface.

    Raises:
        ValueError: if a point is out of reach, the shape is wrong or the period is not above 0.
    """
    period = _checks.number("period", period, above=0.0, advice="give the time of one round in seconds")
    try:
        array = np.asarray(points, float)
    except (TypeError, ValueError):
        array = np.full((0,), np.nan)
    if array.ndim != 2 or array.shape[0] < 2 or array.shape[1] not in (2, 3) or not np.isfinite(array).all():
        raise ValueError(
            f"{name} must be finite points of shape (M, 2) or (M, 3), but got shape {array.shape}: M >= 2."
        )
    columns = ["xyz".index(letter) for letter in axes]
    full = np.zeros((len(array), 3))
    full[:, columns] = array if array.shape[1] == 2 else array[:, columns]
    cases = workspace.hold_along(evenly_spaced(full, PATH_POINTS), axes=axes)
    return path_of_cases(workspace, cases, period, random_start)


def follow_fields(workspace: Workspace, fields: ArrayLike, *, period: float, random_start: bool) -> Task:
    """Follow, with every tracked point, the positions that a closed path of fields (M, 3) T holds in equilibrium."""
    period = _checks.number("period", period, above=0.0, advice="give the time of one round in seconds")
    return path_of_cases(workspace, workspace.equilibria(fields), period, random_start)


def path_of_cases(workspace: Workspace, cases: list[Equilibrium], period: float, random_start: bool) -> Task:
    """A path task through equilibria."""
    table = workspace.positions(cases)
    return Task(
        targets=Targets(np.ascontiguousarray(table[:, None]), len(cases) / period, len(cases) if random_start else 1),
        start_cases=tuple(cases) if random_start else (cases[0],),
        fields=np.array([case.field for case in cases]),
        path=table,
        period=period,
    )


def reach_points(workspace: Workspace, *, axes: str, limit: float) -> Task:
    """Reach a point drawn from the equilibria of fields along two axes: +-`limit` T on each, x from 0."""
    sides = [np.linspace(0.0 if letter == "x" else -limit, limit, GRID_POINTS) for letter in axes]
    columns, rows = ["xyz".index(letter) for letter in axes], []
    rest = workspace.equilibrium(np.zeros(3))
    for first in sides[0]:
        fields = np.zeros((GRID_POINTS, 3))
        fields[:, columns[0]], fields[:, columns[1]] = first, sides[1]
        rows.append(workspace.positions([workspace.equilibrium(field) for field in fields]))
    return Task(targets=Targets(np.array(rows), 0.0, 1), start_cases=(rest,), fields=None, path=None, period=None)


def circle(workspace: Workspace, *, radius: float, period: float, center_field: ArrayLike, random_start: bool) -> Task:
    """The paper's experiment 5: a circle across the rod about the point where `center_field` (3,) T holds the tip."""
    radius = _checks.number("radius", radius, above=0.0, advice="give it in metres")
    center = workspace.equilibrium(center_field).tip_position[1:]
    points = center + radius * shape("circle", PATH_POINTS)
    return follow_path(workspace, points, period=period, axes="yz", random_start=random_start)


def named_path(
    workspace: Workspace,
    path: str | ArrayLike,
    *,
    size: float,
    period: float,
    center_field: ArrayLike,
    random_start: bool,
) -> Task:
    """A shape by name, `size` (m) from its centre to its sides, about where `center_field` holds the tip; or given
    points.
    """
    if not isinstance(path, str):
        return follow_path(workspace, path, period=period, axes="yz", random_start=random_start)
    size = _checks.number("size", size, above=0.0, advice="give it in metres")
    points = workspace.equilibrium(center_field).tip_position[1:] + size * shape(path)
    return follow_path(workspace, points, period=period, axes="yz", random_start=random_start)


def two_magnet_fields(amplitude: float, num_points: int = PATH_POINTS) -> np.ndarray:
    """A closed path of fields (num_points, 3) T in the vertical plane of the rod, for two opposed magnets.

    The paper does not state the field of its experiment 6; this one sweeps the amplitude up and down with a small
    axial part, so that tip and middle move on different curves.
    """
    angle = np.linspace(0.0, 2.0 * np.pi, num_points, endpoint=False)
    zero = np.zeros_like(angle)
    return amplitude * np.stack([0.3 * np.sin(2.0 * angle), zero, 0.5 - 0.5 * np.cos(angle)], axis=1)
