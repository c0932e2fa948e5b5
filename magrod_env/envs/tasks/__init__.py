"""What environments ask of their rods: one file a task, listed here.

Importing the tasks loads no kernel of the environments: their ids are registered from here when `magrod_env` is
imported.
"""

from magrod_env.envs.tasks import circle, path, planar_reach, reach, two_magnet
from magrod_env.envs.tasks.task import Argument, EnvironmentId, Reward, Task, TaskSpec

TASKS: dict[str, TaskSpec] = {
    module.SPEC.name: module.SPEC for module in (circle, path, reach, two_magnet, planar_reach)
}
"""The tasks by name, as the environments' argument `task` calls them."""

__all__ = ["TASKS", "Argument", "EnvironmentId", "Reward", "Task", "TaskSpec"]
