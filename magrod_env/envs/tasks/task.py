"""What describes a task: its ids, scene, coils, arguments and rewards; and the task made for one scene."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from magrod_env import _checks
from magrod_env.envs.targets import Targets
from magrod_env.magnetics import Actuator
from magrod_env.rod.equilibrium import Equilibrium
from magrod_env.scene import Scene
from magrod_env.simulation.resolution import Resolution


@dataclass(frozen=True, kw_only=True)
class Task:
    """A task made for one scene: its tables, and the equilibria that an episode may start from.

    Args:
        targets: what the kernels read.
        start_cases: equilibria in which an episode may start.
        needed_fields: T, (M, 3), fields that the coils must be able to make: those that hold the nominal rod on its
            targets, or the strongest of them.
        fields: T, (A, 3), those that hold the nominal rod at each point of the path; None for reaching.
        path: m, (A, num_tracked, 3), the targets at each point of the path, world; None for reaching.
        period: s, of one round of the path; None for reaching.
    """

    targets: Targets
    start_cases: tuple[Equilibrium, ...]
    needed_fields: np.ndarray
    fields: np.ndarray | None = None
    path: np.ndarray | None = None
    period: float | None = None


@dataclass(frozen=True, kw_only=True)
class Argument:
    """An argument that a task has of its own.

    Args:
        name: of the keyword.
        default: its value where none is given.
        check: called with name and value, returns the value as the task's maker takes it, hashable; raises ValueError.
        meaning: unit, and what it means, for the documentation.
        shown: the default as the documentation shows it; None for its `repr`.
    """

    name: str
    default: object
    check: Callable[[str, Any], Any]
    meaning: str
    shown: str | None = None


def within(advice: str, **bounds: float) -> Callable[[str, Any], float]:
    """A check for a number within bounds (see `_checks.number`)."""

    def check(name: str, value: Any) -> float:
        return _checks.number(name, value, advice=advice, **bounds)

    return check


@dataclass(frozen=True, kw_only=True)
class Reward:
    """Scales and weights of the four terms of the dense reward.

    Args:
        tracking: error that costs one, as a share of the rod's length.
        precision: m, width of the bonus near the target.
        effort: weight of the squared action.
        smoothness: weight of the squared change of the action.
    """

    tracking: float = 0.1
    precision: float = 1e-3
    effort: float = 0.01
    smoothness: float = 0.05


@dataclass(frozen=True, kw_only=True)
class EnvironmentId:
    """A registered id of a task.

    Args:
        name: such as "MagRod/Circle-v0".
        max_episode_steps: control steps of an episode.
        summary: what is asked for, for the list of environments.
        goal: whether observations hold goals and the reward is sparse.
    """

    name: str
    max_episode_steps: int
    summary: str
    goal: bool = False


@dataclass(frozen=True, kw_only=True, eq=False)
class TaskSpec:
    """Everything that the environments know of a task.

    Args:
        name: what the environments' argument `task` calls it.
        ids: ids that are registered for it.
        scene: makes its own scene, for a user who gives none.
        make: makes the task from the `Workspace` of a scene and the arguments of its own, by name.
        arguments: those arguments.
        sets_fields: the one of them that decides which fields hold the rod, for error messages.
        resolution: of its own scene; what it costs in accuracy is measured in docs/resolution.md.
        axes, plane, actuator: defaults of the environments' arguments of these names.
        reward: scales of the dense reward.
        success_distance: m, error below which a rod has succeeded.
        start: how an episode starts, a sentence for the documentation.
    """

    name: str
    ids: tuple[EnvironmentId, ...]
    scene: Callable[[], Scene]
    make: Callable[..., Task]
    arguments: tuple[Argument, ...]
    sets_fields: str
    resolution: Resolution
    axes: str = "yz"
    plane: str | None = None
    actuator: Actuator = field(default_factory=Actuator)
    reward: Reward = Reward()
    success_distance: float = 1e-3
    start: str

    def checked(self, settings: Mapping[str, Any]) -> dict[str, Any]:
        """The arguments of its own, by name, from a user's settings or by default.

        Raises:
            ValueError: on a value out of range or of the wrong kind.
        """
        return {
            one.name: one.check(one.name, settings[one.name]) if one.name in settings else one.default
            for one in self.arguments
        }
