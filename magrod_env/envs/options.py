"""From a task's name and a user's keyword arguments to a :class:`SteeringCore`."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np

from magrod_env.envs.arguments import actuator_limit, checked_settings, choice, told
from magrod_env.envs.core import OBSERVE, SteeringCore
from magrod_env.envs.settings import Camera, Randomization
from magrod_env.envs.tasks import TASKS, Task, TaskSpec
from magrod_env.envs.workspace import Workspace
from magrod_env.magnetics import Actuator, UniformCoils
from magrod_env.rod.batch import LANES
from magrod_env.rod.threads import checked_num_threads
from magrod_env.scene import Scene
from magrod_env.scenes import load_scene
from magrod_env.simulation import StabilityError, resolution_for
from magrod_env.simulation.resolution import Resolution, checked_resolution
from magrod_env.simulation.scene_values import check_plane

_RESOLUTION = ("num_elements", "time_step", "axial_softening", "rotary_scaling", "tolerance")
_NAMES: dict[str, tuple[str | None, ...]] = {
    "plane": ("xy", "xz", None),
    "observe": OBSERVE,
    "precision": tuple(LANES),
}


def make_core(task: str, num_envs: int, settings: dict[str, Any]) -> SteeringCore:
    """Build the core of an environment from its task and the user's settings.

    Raises:
        ValueError: on an unknown task or setting, or a value that a part refuses.
    """
    choice("task", task, tuple(TASKS))
    spec = TASKS[task]
    common = _common_arguments(spec)
    _check_names(settings, {*common, *(one.name for one in spec.arguments), *_RESOLUTION})
    settings = checked_settings(settings)
    chosen = {name: settings.get(name, value) for name, value in common.items()}
    wanted = _Wanted(spec, tuple(sorted(spec.checked(settings).items())))
    scene = _chosen_scene(spec, chosen.pop("scene"))
    if chosen["randomization"] is None:
        chosen["randomization"] = Randomization()
    _check_common(scene, chosen)
    coils = UniformCoils(limit=actuator_limit(chosen["actuator"]), axes=chosen.pop("axes"))
    check_plane(scene, chosen["plane"])
    resolution = _choose_resolution(wanted, scene, chosen["plane"], settings)
    workspace, made = wanted.made(scene, resolution.num_elements, resolution.axial_softening)
    _check_initial_field(chosen["randomization"], chosen["actuator"])
    _check_reach(made, coils, chosen["plane"])
    core = SteeringCore(
        scene, made, workspace, spec.reward, num_envs=num_envs, resolution=resolution, coils=coils, **chosen
    )
    if chosen["observe"] == "estimate":
        from magrod_env.envs.estimation_core import Estimation  # only who estimates loads the filters

        core.estimation = Estimation(core)
    return core


def _common_arguments(spec: TaskSpec) -> dict[str, Any]:
    """The arguments that all tasks have, with this one's defaults."""
    return {
        "scene": None,
        "precision": "float64",
        "plane": spec.plane,
        "axes": spec.axes,
        "actuator": spec.actuator,
        "control_rate": 50.0,
        "camera": Camera(),
        "observe": "camera",
        "randomization": None,
        "num_threads": None,
    }


def _check_names(settings: Mapping[str, Any], known: set[str]) -> None:
    unknown = set(settings) - known
    if unknown:
        raise ValueError(
            f"arguments of this environment must be among {', '.join(sorted(known))}, "
            f"but got {', '.join(map(repr, sorted(unknown)))}: check the spelling."
        )


# ---- the task in a scene


@dataclass(frozen=True)
class _Wanted:
    """A task with the arguments of its own, pairs of name and value."""

    spec: TaskSpec
    arguments: tuple[tuple[str, Any], ...]

    def made(self, scene: Scene, num_elements: int, axial_softening: float) -> tuple[Workspace, Task]:
        """Workspace and task of a scene; where the rod loses stability, the error names what takes it there."""
        try:
            return _make_task(self, scene, num_elements, axial_softening)
        except StabilityError as error:
            if not Workspace(scene, num_elements, axial_softening).model.equilibrium(np.zeros(3)).reached:
                raise ValueError(
                    "scene must have a rod that bears its own weight, but it buckles before the field is on: take a "
                    "stiffer or shorter rod, less gravity or less axial_softening."
                ) from error
            name = self.spec.sets_fields
            raise ValueError(
                f"{name} must ask for fields in which the rod is stable, but got {told(dict(self.arguments)[name])}, "
                "and it loses stability on the way: choose a smaller one, or a stiffer rod."
            ) from error


@lru_cache(maxsize=32)
def _make_task(wanted: _Wanted, scene: Scene, num_elements: int, axial_softening: float) -> tuple[Workspace, Task]:
    """Workspace and task of a scene; kept, since every environment of a process asks for the same few."""
    workspace = Workspace(scene, num_elements, axial_softening)
    return workspace, wanted.spec.make(workspace, **dict(wanted.arguments))


def _choose_resolution(wanted: _Wanted, scene: Scene, plane: str | None, settings: Mapping[str, Any]) -> Resolution:
    """The user's choice; else the task's own for its own scene; else 5 elements. A tolerance counts for the fields that
    the targets need, from rest under gravity.
    """
    given = {name: settings.get(name) for name in _RESOLUTION}
    said = checked_resolution(**given)
    if given["tolerance"] is not None:
        _, made = wanted.made(scene, max(5, len(scene.segment_ends)), 1.0)
        strongest = float(np.linalg.norm(made.needed_fields, axis=1).max())
        return resolution_for(scene, float(given["tolerance"]), plane, strongest, hanging=True)
    if scene != wanted.spec.scene() or given["num_elements"] is not None:
        count = given["num_elements"] or max(5, len(scene.segment_ends))
        return dataclasses.replace(said, num_elements=int(count))
    chosen = {name: value for name, value in given.items() if value is not None}
    return dataclasses.replace(wanted.spec.resolution, **chosen)


# ---- checks


def _chosen_scene(spec: TaskSpec, scene: Scene | str | None) -> Scene:
    """The user's scene, by itself or by name, or the task's own."""
    if scene is None:
        return spec.scene()
    if isinstance(scene, str):
        return load_scene(scene)
    _check_kind("scene", scene, Scene)
    return scene


def _check_common(scene: Scene, chosen: dict[str, Any]) -> None:
    """Check what all tasks have, and put in the number of threads."""
    _check_kind("actuator", chosen["actuator"], Actuator)
    _check_kind("camera", chosen["camera"], Camera)
    _check_kind("randomization", chosen["randomization"], Randomization)
    for name, names in _NAMES.items():
        choice(name, chosen[name], names)
    if not scene.magnets:
        raise ValueError("scene of an environment must have a magnet, but got none: no field would move the rod.")
    chosen["num_threads"] = checked_num_threads(chosen["num_threads"])


def _check_kind(name: str, value: object, kind: type) -> None:
    if not isinstance(value, kind):
        raise ValueError(
            f"{name} must be a {kind.__name__}, but got {told(value)}: build one with {kind.__name__}(...)."
        )


def _check_initial_field(randomization: Randomization, actuator: Actuator) -> None:
    limit = actuator_limit(actuator)
    if randomization.initial_field > limit:
        raise ValueError(
            f"initial_field of the randomization must be at most {limit:.3g} T, the limit of the actuator, but got "
            f"{randomization.initial_field:.3g} T: the coils make no more."
        )


def _check_reach(made: Task, coils: UniformCoils, plane: str | None) -> None:
    """Refuse targets that no field of the coils can hold."""
    largest = np.abs(made.needed_fields).max(axis=0)
    axes, limit = coils.axes, max(np.atleast_1d(coils.limit))
    needed = [letter for letter, field in zip("xyz", largest) if field > 1e-9]
    if set(needed) - set(axes):
        raise ValueError(f"axes must hold {''.join(needed)!r} for this task, but got {axes!r}: add what is missing.")
    if largest.max() > limit:
        raise ValueError(
            f"limit of the actuator must be at least {largest.max():.3g} T for this task, but got {limit:.3g} T: "
            "choose stronger coils or nearer targets."
        )
    if plane in ("xy", "xz") and set(needed) - set(plane):
        raise ValueError(f"plane must hold the targets of the task, but got {plane!r}: leave it None.")
