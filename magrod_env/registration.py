"""Ids of the environments."""

import gymnasium

from magrod_env.envs.tasks import TASKS, TaskSpec
from magrod_env.envs.tasks.task import EnvironmentId


def arguments_of(spec: TaskSpec, one: EnvironmentId) -> dict[str, object]:
    """What an id gives to the environment."""
    return {"task": spec.name} | ({"goal": True} if one.goal else {})


IDS: dict[str, tuple[dict[str, object], int]] = {
    one.name: (arguments_of(spec, one), one.max_episode_steps) for spec in TASKS.values() for one in spec.ids
}
"""Arguments and steps of an episode by id, of the tasks of this package."""


def register_task(spec: TaskSpec) -> None:
    """Make a task known by its name, and register its ids, once.

    Raises:
        ValueError: if another task has the name.
    """
    if TASKS.setdefault(spec.name, spec) is not spec:
        raise ValueError(f"name of a task must be new, but got {spec.name!r}: choose another.")
    for one in spec.ids:
        if one.name not in gymnasium.registry:
            gymnasium.register(
                id=one.name,
                entry_point="magrod_env.envs.single:MagRodEnv",
                vector_entry_point="magrod_env.envs.vector:MagRodVectorEnv",
                max_episode_steps=one.max_episode_steps,
                kwargs=arguments_of(spec, one),
            )


def register_all() -> None:
    """Register every task of this package."""
    for spec in tuple(TASKS.values()):
        register_task(spec)
