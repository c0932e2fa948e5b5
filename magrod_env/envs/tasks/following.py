"""Tasks that follow a closed path: made from points or from fields, with the arguments that they share."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from magrod_env import _checks
from magrod_env.envs.arguments import STRONGEST, flag
from magrod_env.envs.paths import evenly_spaced
from magrod_env.envs.targets import Targets
from magrod_env.envs.tasks.task import Argument, Task, within
from magrod_env.envs.workspace import Workspace
from magrod_env.rod.equilibrium import Equilibrium

PATH_POINTS = 120
COMPENSATION = (0.0, 0.0, 7.75e-3)  # T: the paper's field against the sag, upwards


def follow_path(workspace: Workspace, points: ArrayLike, *, period: float, axes: str, random_start: bool) -> Task:
    """Follow a closed curve of points (M, 2) in the plane of the two axes, or (M, 3) of which those coordinates count.

    The third coordinate is the nominal rod's own where it is held on the curve: a tip moves on a surface.

    Raises:
        ValueError: if a point is out of reach.
    """
    array, columns = np.asarray(points, float), ["xyz".index(letter) for letter in axes]
    full = np.zeros((len(array), 3))
    full[:, columns] = array if array.shape[1] == 2 else array[:, columns]
    cases = workspace.hold_along(evenly_spaced(full, PATH_POINTS), axes=axes)
    return path_of_cases(workspace, cases, period, random_start)


def follow_fields(workspace: Workspace, fields: ArrayLike, *, period: float, random_start: bool) -> Task:
    """Follow, with every tracked point, the positions that a closed path of fields (M, 3) T holds in equilibrium."""
    return path_of_cases(workspace, workspace.equilibria(fields), period, random_start)


def path_of_cases(workspace: Workspace, cases: list[Equilibrium], period: float, random_start: bool) -> Task:
    """A path task through equilibria, one round in `period` s."""
    table, fields = workspace.positions(cases), np.array([case.field for case in cases])
    return Task(
        targets=Targets(np.ascontiguousarray(table[:, None]), len(cases) / period, len(cases) if random_start else 1),
        start_cases=tuple(cases) if random_start else (cases[0],),
        needed_fields=fields,
        fields=fields,
        path=table,
        period=period,
    )


# ---- arguments


def period_argument(default: float) -> Argument:
    """The time of one round, s."""
    check = within("give the time of one round in seconds", at_least=0.01, at_most=1e6)
    return Argument(name="period", default=default, check=check, meaning="s a round, 0.01 to 1e6")


def center_field_argument(center: str) -> Argument:
    """The field, T, in which the nominal tip lies at the centre of a curve; `center` says of which."""
    return Argument(
        name="center_field",
        default=COMPENSATION,
        check=_checked_field,
        meaning=f"T; the nominal tip's place in it is {center}",
        shown="(0, 0, 7.75e-3)",
    )


RANDOM_START = Argument(name="random_start", default=True, check=flag, meaning="begin at a random point")


def _checked_field(name: str, value: Any) -> tuple[float, float, float]:
    field = _checks.vector(name, value, advice="give a world vector in tesla")
    if max(map(abs, field)) > STRONGEST:
        raise ValueError(
            f"{name} must be at most {STRONGEST:g} T along each axis, but got {field}: 7.75 mT is 7.75e-3."
        )
    return field


def path_start(curve: str, first: str) -> str:
    """How episodes on a curve start, for the documentation; `first` says where without a random start."""
    return (
        f"At rest in the field that holds the nominal rod at the {curve}'s point where the target is: one of "
        f"{PATH_POINTS} points, drawn evenly. With `random_start=False` always {first}."
    )
