"""What a controller may read of an environment beside its observations."""

from __future__ import annotations

import gymnasium
import numpy as np
from gymnasium.vector import VectorEnv

from magrod_env.envs.core import SteeringCore
from magrod_env.envs.observation import ObservationLayout
from magrod_env.envs.tasks import Task
from magrod_env.envs.workspace import Workspace
from magrod_env.magnetics import UniformCoils
from magrod_env.scene import Scene


class RodAttributes:
    """Attributes of `MagRodEnv` and `MagRodVectorEnv`, behind wrappers as `env.unwrapped.task`; to be read only.

    They describe the nominal rod: nothing here tells what a `Randomization` drew.
    """

    core: SteeringCore  # the rods themselves, not for controllers

    @property
    def scene(self) -> Scene:
        """The nominal rod, its magnets and gravity."""
        return self.core.scene

    @property
    def coils(self) -> UniformCoils:
        """The coils: `coils.fraction(field)` is the action that asks for a field, T, world."""
        return self.core.coils

    @property
    def task(self) -> Task:
        """What is asked for: `path`, m, and `fields`, T, that hold the nominal rod on it, both None for reaching."""
        return self.core.task

    @property
    def workspace(self) -> Workspace:
        """Statics of the nominal rod: equilibria for fields, and fields for positions."""
        return self.core.workspace

    @property
    def control_time(self) -> float:
        """Time that an action acts for, s."""
        return self.core.control_time

    @property
    def num_tracked(self) -> int:
        """How many points have a target: the magnets, from the tip inwards."""
        return len(self.core.nodes)

    @property
    def observation_layout(self) -> ObservationLayout:
        """What an observation holds, and where; `observation_layout.table()` is readable."""
        return self.core.observation

    def phase(self, steps_ahead: float = 0.0) -> np.ndarray:
        """Where on the closed path each environment's target will be, in rounds from the path's first point,
        (num_envs,).

        The target is then near `task.path[int(phase % 1.0 * len(task.path))]`, and `task.fields` has the field.

        Args:
            steps_ahead: control steps from now; 0.5 is the middle of the next one.

        Raises:
            ValueError: if the task follows no path.
        """
        path, episodes = self.task.path, self.core.episodes
        if path is None:
            raise ValueError("task must follow a path to have a phase, but reaches for a point: its target is fixed.")
        ahead = (episodes.steps + steps_ahead) * self.control_time
        return (episodes.place[:, 0] + self.task.targets.rate * ahead) / len(path)


def attributes_of(env: gymnasium.Env | VectorEnv) -> RodAttributes:
    """An environment without its wrappers, as controllers see it.

    Raises:
        ValueError: on an environment of another kind.
    """
    inner = getattr(env, "unwrapped", None)
    if not isinstance(inner, RodAttributes):
        raise ValueError(
            f"env must be a MagRodEnv or a MagRodVectorEnv, wrapped or not, but got {env!r}: make it with "
            "gymnasium.make, or gymnasium.make_vec without a vectorization_mode."
        )
    return inner
