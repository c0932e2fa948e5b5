"""Tasks that reach a point: a grid of equilibria from which targets are drawn."""

from __future__ import annotations

import numpy as np

from magrod_env.envs.arguments import STRONGEST
from magrod_env.envs.targets import Targets
from magrod_env.envs.tasks.task import Argument, Task, within
from magrod_env.envs.workspace import Workspace

GRID_POINTS = 13
REST = "At rest in zero field, sagging under gravity."


def reach_points(workspace: Workspace, *, axes: str, limit: float) -> Task:
    """Reach a point drawn from the equilibria of fields along two axes: +-`limit` T on each, x from 0."""
    sides = [np.linspace(0.0 if letter == "x" else -limit, limit, GRID_POINTS) for letter in axes]
    columns, rows = ["xyz".index(letter) for letter in axes], []
    rest = workspace.equilibrium(np.zeros(3))
    for first in sides[0]:
        fields = np.zeros((GRID_POINTS, 3))
        fields[:, columns[0]], fields[:, columns[1]] = first, sides[1]
        rows.append(workspace.positions([workspace.equilibrium(field) for field in fields]))
    strongest = np.zeros((1, 3))
    strongest[:, columns] = limit
    return Task(targets=Targets(np.array(rows), 0.0, 1), start_cases=(rest,), needed_fields=strongest)


def reach_limit_argument(meaning: str) -> Argument:
    """The strongest field, T, along each axis that a target is held by."""
    check = within("give it in tesla", above=0.0, at_most=STRONGEST)
    return Argument(name="reach_limit", default=25e-3, check=check, meaning=f"T; {meaning}", shown="25e-3")
