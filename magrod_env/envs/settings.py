"""What a user may choose about an environment besides its scene: camera, domain randomisation."""

from __future__ import annotations

import math
from dataclasses import dataclass, fields
from typing import Any

from magrod_env import _checks
from magrod_env.envs.arguments import FARTHEST, LATEST, STRONGEST

_CAMERA = {  # least, most, unit
    "noise": (1e-9, 1.0, "metres"),
    "rate": (0.1, 1e4, "frames a second"),
    "delay": (1e-6, LATEST, "seconds"),
}


@dataclass(frozen=True, kw_only=True, slots=True)
class Camera:
    """What measures the positions that an observation holds.

    Args:
        noise: standard deviation of each coordinate, m, from 1 nm to 1 m; None for none.
        rate: frames a second, 0.1 or more; None for one every control step. The control rate must be a whole multiple
            of it.
        delay: age of a frame when it is seen, s, at most 10, rounded to control steps; None for none.

    Raises:
        ValueError: on a number out of these ranges.
    """

    noise: float | None = None
    rate: float | None = None
    delay: float | None = None

    def __post_init__(self) -> None:
        for name, (least, most, unit) in _CAMERA.items():
            value = getattr(self, name)
            if value is not None:
                advice = f"give it in {unit}, or None to leave it out"
                value = _checks.number(f"{name} of the camera", value, at_least=least, at_most=most, advice=advice)
                object.__setattr__(self, name, value)


@dataclass(frozen=True, kw_only=True, slots=True)
class Randomization:
    """How much the real rod may differ from the nominal one; drawn anew at every reset, independently and uniformly.

    Relative quantities are multiplied by a factor in [1 - x, 1 + x]. Zero leaves a quantity as it is.

    Args:
        modulus, density, drag, remanence: relative, at most 0.9.
        magnet_position: shift along the rod of every magnet that is not at the tip, m, in [-x, x].
        field_gain: relative error of the coils' gain, at most 0.9.
        field_misalignment: largest angle between the coils' frame and the world, rad, at most pi; axis of any
            direction.
        gravity_direction: largest tilt of gravity, rad, at most pi; about a horizontal axis of any direction.
        initial_field: field added to the one that the episode starts from, T, each axis in [-x, x]; at most the
            actuator's limit.

    Raises:
        ValueError: on a number out of these ranges.
    """

    modulus: float = 0.0
    density: float = 0.0
    drag: float = 0.0
    remanence: float = 0.0
    magnet_position: float = 0.0
    field_gain: float = 0.0
    field_misalignment: float = 0.0
    gravity_direction: float = 0.0
    initial_field: float = 0.0

    def __post_init__(self) -> None:
        most = {
            "magnet_position": FARTHEST,
            "field_misalignment": math.pi,
            "gravity_direction": math.pi,
            "initial_field": STRONGEST,
        }
        for field in fields(self):
            value: Any = _checks.number(
                f"{field.name} of the randomization",
                getattr(self, field.name),
                at_least=0.0,
                at_most=most.get(field.name, 0.9),
                advice="give how far the quantity may lie from its nominal value",
            )
            object.__setattr__(self, field.name, value)

    @property
    def active(self) -> bool:
        """Whether anything is randomised."""
        return any(getattr(self, field.name) > 0.0 for field in fields(self))
