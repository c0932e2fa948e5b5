"""What the arguments of the environments may be: for anything else, one sentence that names it and what came."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from magrod_env import _checks
from magrod_env.magnetics import Actuator

MOST_ENVS = 2**20
MOST_ELEMENTS = 200  # a rod of more takes seconds to build
MOST_EPISODE_STEPS = 1_000_000_000
FARTHEST = 10.0  # m
STRONGEST = 10.0  # T
LATEST = 10.0  # s: dead times and delays keep a ring of what is under way

_RANGES: dict[str, tuple[dict[str, float], str]] = {
    "control_rate": ({"at_least": 1.0, "at_most": 1e4}, "give it in hertz, 50 is usual"),
    "axial_softening": ({"at_least": 1.0, "at_most": 1e4}, "1 leaves the rod as it is, larger allows longer steps"),
    "rotary_scaling": ({"at_least": 1.0, "at_most": 1e6}, "1 leaves the rod as it is, larger allows longer steps"),
    "tolerance": ({"at_least": 1e-6, "at_most": 1.0}, "give the tip's RMS error in metres, 0.1 mm is 1e-4"),
}
_OPTIONAL = ("axial_softening", "rotary_scaling", "tolerance", "num_elements")  # None leaves them to the environment


def told(value: object) -> str:
    """A value as an error message shows it: one line, not too long."""
    try:
        line = " ".join(repr(value).split())
    except ValueError:  # Python refuses to print whole numbers of thousands of digits
        line = f"a {type(value).__name__} of thousands of digits"
    return line if len(line) <= 80 else f"{line[:77]}..."


def checked_settings(settings: Mapping[str, object]) -> dict[str, Any]:
    """The user's settings of what all tasks share, those that can be judged by themselves as plain numbers.

    Raises:
        ValueError: on a value out of range or of the wrong kind.
    """
    return {name: _checked(name, value) for name, value in settings.items()}


def _checked(name: str, value: object) -> object:
    if value is None and name in _OPTIONAL:
        return None
    if name in _RANGES:
        bounds, advice = _RANGES[name]
        return _checks.number(name, value, advice=advice, **bounds)
    if name == "num_elements":
        return whole(name, value, at_most=MOST_ELEMENTS, advice="4 to 10 are usual")
    return value


def choice(what: str, value: object, among: tuple[str | None, ...]) -> str | None:
    """Return `value` if it is one of the names, or None where that is among them."""
    if (value is None or isinstance(value, str)) and value in among:
        return value
    names = ", ".join(f'"{name}"' if name is not None else "None" for name in among)
    raise ValueError(f"{what} must be one of {names}, but got {told(value)}: choose one of them.")


def flag(what: str, value: object) -> bool:
    """Return `value`, True or False, as a bool."""
    if not isinstance(value, (bool, np.bool_)):
        raise ValueError(f"{what} must be True or False, but got {told(value)}: choose one of them.")
    return bool(value)


def whole(what: str, value: object, *, at_most: int, advice: str) -> int:
    """Return `value`, a whole number from 1 to `at_most`, as an int."""
    try:
        number = _checks.count(what, value, advice=advice)
    except ValueError:
        number = 0.0
    if not 1 <= number <= at_most:
        raise ValueError(f"{what} must be a whole number from 1 to {at_most:,}, but got {told(value)}: {advice}.")
    return int(number)


def reals(value: ArrayLike) -> np.ndarray | None:
    """Return `value` as a float64 array; None where it is no array of real numbers, such as text, bools or rows of
    different lengths.
    """
    try:
        array = np.asarray(value)
    except (TypeError, ValueError, OverflowError):
        return None
    return array.astype(np.float64) if array.dtype.kind in "iuf" else None


def episode_limit(value: object) -> int | None:
    """Control steps of an episode; None for None and, as in `gymnasium.make`, for -1: no limit."""
    if value is None or (isinstance(value, (int, np.integer)) and not isinstance(value, bool) and value == -1):
        return None
    return whole("max_episode_steps", value, at_most=MOST_EPISODE_STEPS, advice="None or -1 is for no limit")


def success_radius(value: object, own: float, length: float) -> float:
    """The distance, m, within which a point is on its target, None for the task's `own`: no more than half of a rod's
    `length`.
    """
    value = own if value is None else value
    advice = "give it in metres, at most half of the rod's length"
    return _checks.number("success_distance", value, above=0.0, at_most=0.5 * length, advice=advice)


def actuator_limit(actuator: Actuator) -> float:
    """The limit, T, of a drive that an environment can run.

    Raises:
        ValueError: on a drive that none can.
    """
    if actuator.limit is None:
        raise ValueError("limit of the actuator must be a number for an environment, but got None: give it in tesla.")
    for name, most, unit in (
        ("limit", STRONGEST, "tesla"),
        ("slew_limit", 1e12, "T/s"),
        ("lag", 1e3, "seconds"),
        ("dead_time", LATEST, "seconds"),
    ):
        value = getattr(actuator, name)
        if value is not None:
            _checks.number(f"{name} of the actuator", value, at_most=most, advice=f"give it in {unit}")
    return actuator.limit


def seed_number(value: object) -> int | None:
    """Return a seed as an int, None as it is."""
    if value is None:
        return None
    if isinstance(value, (bool, np.bool_)) or not isinstance(value, (int, np.integer)) or value < 0:
        raise ValueError(f"seed must be None or a whole number of 0 or more, but got {told(value)}: give one.")
    return int(value)


def reset_options(options: object, known: tuple[str, ...] = ()) -> dict[str, Any]:
    """The options of a reset, every one known."""
    if options is None:
        return {}
    if not isinstance(options, Mapping):
        raise ValueError(f"options of a reset must be None or a dict, but got {told(options)}: give a dict.")
    unknown = [name for name in options if name not in known]
    if unknown:
        may = f"among {', '.join(map(repr, known))}" if known else "empty, since this environment knows none"
        raise ValueError(
            f"options of a reset must be {may}, but got {', '.join(map(told, unknown))}: check the spelling."
        )
    return dict(options)
