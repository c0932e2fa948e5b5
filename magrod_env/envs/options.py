"""From a task's id and a user's keyword arguments to a :class:`SteeringCore`."""

from __future__ import annotations

import dataclasses
from functools import lru_cache
from typing import Any

import numpy as np

from magrod_env.envs import tasks
from magrod_env.envs.arguments import actuator_limit, checked_settings, choice, told
from magrod_env.envs.core import OBSERVE, SteeringCore
from magrod_env.envs.settings import Camera, Randomization
from magrod_env.envs.tasks import Task
from magrod_env.envs.workspace import Workspace
from magrod_env.magnetics import Actuator, UniformCoils
from magrod_env.resolution import Resolution, checked_resolution
from magrod_env.rod.batch import LANES
from magrod_env.rod.threads import checked_num_threads
from magrod_env.scene import Scene
from magrod_env.scenes import load_scene
from magrod_env.simulation import StabilityError, resolution_for
from magrod_env.values import check_plane

DRAG_RATE = 5.0  # 1/s: the paper's rods come to rest within a second
SPIN_DRAG_RATE = 100.0  # 1/s: lets the ringing of a section after a step of the field die out
INTERNAL_DAMPING = 3e-3  # s: a loss factor of 0.09 at the first vibration (two magnets: 0.03), as silicone may have
COMPENSATION = (0.0, 0.0, 7.75e-3)  # T: the paper's field against the sag, upwards

_TASKS: dict[str, dict[str, Any]] = {
    "circle": {"radius": 16e-3, "period": 2.0, "center_field": COMPENSATION, "random_start": True},
    "path": {
        "path": "figure_eight",
        "size": 12e-3,
        "period": 4.0,
        "center_field": COMPENSATION,
        "random_start": True,
    },
    "reach": {"reach_limit": 25e-3},
    "two_magnet": {"amplitude": 20e-3, "period": 4.0, "random_start": True},
    "planar_reach": {"reach_limit": 25e-3},
}
_DEFAULTS: dict[str, dict[str, Any]] = {
    "circle": {"axes": "yz"},
    "path": {"axes": "yz"},
    "reach": {"axes": "yz"},
    "two_magnet": {"axes": "xz", "actuator": Actuator(limit=25e-3)},
    "planar_reach": {"axes": "xz", "plane": "xz"},
}
_OWN_RESOLUTION = {  # for the id's own scene; what it costs in accuracy is measured in docs/resolution.md
    "two_magnet": Resolution(num_elements=10, rotary_scaling=8.0),
}
_ROUND_ROD = Resolution(num_elements=4, rotary_scaling=8.0)


_RESOLUTION = ("num_elements", "time_step", "axial_softening", "rotary_scaling", "tolerance")
_NAMES: dict[str, tuple[str | None, ...]] = {
    "plane": ("xy", "xz", None),
    "observe": OBSERVE,
    "precision": tuple(LANES),
}
_SETS_FIELDS = {  # the argument that decides which fields hold the rod
    "circle": "center_field",
    "path": "center_field",
    "reach": "reach_limit",
    "two_magnet": "amplitude",
    "planar_reach": "reach_limit",
}


def default_scene(task: str) -> Scene:
    """The paper's rod with the modulus that moves like the paper's, damped as silicone is; its two-magnet rod for
    "two_magnet".
    """
    scene = (
        load_scene("paper6_two_magnets") if task == "two_magnet" else load_scene("paper5_circle", modulus="effective")
    )
    return scene.replace(drag_rate=DRAG_RATE, spin_drag_rate=SPIN_DRAG_RATE, internal_damping=INTERNAL_DAMPING)


@lru_cache(maxsize=32)
def _make_task(
    task: str,
    scene: Scene,
    num_elements: int,
    axial_softening: float,
    axes: str,
    settings: tuple[tuple[str, Any], ...],
) -> tuple[Workspace, Task]:
    """Workspace and task of a scene; kept, since every environment of a process asks for the same few."""
    workspace, chosen = Workspace(scene, num_elements, axial_softening), dict(settings)
    if task == "circle":
        made = tasks.circle(workspace, **chosen)
    elif task == "path":
        made = tasks.named_path(workspace, chosen.pop("path"), **chosen)
    elif task == "two_magnet":
        made = tasks.follow_fields(workspace, tasks.two_magnet_fields(chosen.pop("amplitude")), **chosen)
    else:
        axes = "xz" if task == "planar_reach" else "yz"
        made = tasks.reach_points(workspace, axes=axes, limit=chosen["reach_limit"])
    return workspace, made


def _stable_task(
    task: str, scene: Scene, num_elements: int, axial_softening: float, axes: str, special: tuple[tuple[str, Any], ...]
) -> tuple[Workspace, Task]:
    """`_make_task`; where the rod loses stability, the error names what takes it there."""
    try:
        return _make_task(task, scene, num_elements, axial_softening, axes, special)
    except StabilityError as error:
        if not Workspace(scene, num_elements, axial_softening).model.equilibrium(np.zeros(3)).reached:
            raise ValueError(
                "scene must have a rod that bears its own weight, but it buckles before the field is on: take a "
                "stiffer or shorter rod, less gravity or less axial_softening."
            ) from error
        name = _SETS_FIELDS[task]
        raise ValueError(
            f"{name} must ask for fields in which the rod is stable, but got {told(dict(special)[name])}, and it loses "
            "stability on the way: choose a smaller one, or a stiffer rod."
        ) from error


def make_core(task: str, num_envs: int, settings: dict[str, Any]) -> SteeringCore:
    """Build the core of an environment from its task and the user's settings.

    Raises:
        ValueError: on an unknown task or setting, or a value that a part refuses.
    """
    choice("task", task, tuple(_TASKS))
    common = {
        "scene": None,
        "precision": "float64",
        "plane": None,
        "axes": "yz",
        "actuator": Actuator(),
        "control_rate": 50.0,
        "camera": Camera(),
        "observe": "camera",
        "randomization": None,
        "num_threads": None,
    } | _DEFAULTS[task]
    known = {*common, *_TASKS[task], *_RESOLUTION}
    unknown = set(settings) - known
    if unknown:
        raise ValueError(
            f"arguments of this environment must be among {', '.join(sorted(known))}, "
            f"but got {', '.join(map(repr, sorted(unknown)))}: check the spelling."
        )
    settings = checked_settings(settings)
    chosen: dict[str, Any] = {name: settings.get(name, value) for name, value in common.items()}
    scene = chosen.pop("scene")
    if scene is None:
        scene = default_scene(task)
    elif isinstance(scene, str):
        scene = load_scene(scene)
    _check_parts(scene, chosen)
    limit = actuator_limit(chosen["actuator"])
    for name, names in _NAMES.items():
        choice(name, chosen[name], names)
    if not scene.magnets:
        raise ValueError("scene of an environment must have a magnet, but got none: no field would move the rod.")
    chosen["num_threads"] = checked_num_threads(chosen["num_threads"])
    special = tuple((name, settings.get(name, value)) for name, value in sorted(_TASKS[task].items()))
    coils = UniformCoils(limit=limit, axes=chosen["axes"])
    check_plane(scene, chosen["plane"])
    resolution = _choose_resolution(task, scene, chosen, special, settings)
    axes = chosen.pop("axes")
    workspace, made = _stable_task(task, scene, resolution.num_elements, resolution.axial_softening, axes, special)
    if chosen["randomization"] is None:
        chosen["randomization"] = Randomization()
    if chosen["randomization"].initial_field > limit:
        raise ValueError(
            f"initial_field of the randomization must be at most {limit:.3g} T, the limit of the actuator, but got "
            f"{chosen['randomization'].initial_field:.3g} T: the coils make no more."
        )
    _check_reach(task, made, coils, chosen["plane"], dict(special).get("reach_limit"))
    return SteeringCore(scene, made, workspace, num_envs=num_envs, resolution=resolution, coils=coils, **chosen)


def _choose_resolution(
    task: str, scene: Scene, chosen: dict[str, Any], special: tuple[tuple[str, Any], ...], settings: dict[str, Any]
) -> Resolution:
    """The user's choice; else the id's own for its own scene; else 5 elements. A tolerance counts for the fields that
    the targets need, from rest under gravity.
    """
    given = {name: settings.get(name) for name in _RESOLUTION}
    said = checked_resolution(**given)
    if given["tolerance"] is not None:
        _, made = _stable_task(task, scene, max(5, len(scene.segment_ends)), 1.0, chosen["axes"], special)
        limit = dict(special).get("reach_limit")
        strongest = float(np.linalg.norm(needed_fields(task, made, limit), axis=1).max())
        return resolution_for(scene, float(given["tolerance"]), chosen["plane"], strongest, hanging=True)
    if scene != default_scene(task) or given["num_elements"] is not None:
        count = given["num_elements"] or max(5, len(scene.segment_ends))
        return dataclasses.replace(said, num_elements=int(count))
    own = _OWN_RESOLUTION.get(task, _ROUND_ROD)
    return dataclasses.replace(own, **{name: value for name, value in given.items() if value is not None})


def needed_fields(task: str, made: Task, reach_limit: float | None) -> np.ndarray:
    """Fields, T, (M, 3), that hold the nominal rod on its targets; for reaching, the strongest of them."""
    if made.fields is not None:
        return made.fields
    return (reach_limit or 0.0) * np.array([[1.0, 0.0, 1.0] if task == "planar_reach" else [0.0, 1.0, 1.0]])


def _check_reach(task: str, made: Task, coils: UniformCoils, plane: str | None, reach_limit: float | None) -> None:
    """Refuse targets that no field of the coils can hold."""
    largest = np.abs(needed_fields(task, made, reach_limit)).max(axis=0)
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


def _check_parts(scene: Any, chosen: dict[str, Any]) -> None:
    for name, value, kind in (
        ("scene", scene, Scene),
        ("actuator", chosen["actuator"], Actuator),
        ("camera", chosen["camera"], Camera),
        ("randomization", chosen["randomization"], Randomization),
    ):
        if not (isinstance(value, kind) or (value is None and name == "randomization")):
            raise ValueError(
                f"{name} must be a {kind.__name__}, but got {told(value)}: build one with {kind.__name__}(...)."
            )
