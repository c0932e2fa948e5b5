"""What a user may choose about an environment besides its scene: camera, domain randomisation."""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import Any

from magrod_env.magnetics import _checks


@dataclass(frozen=True, kw_only=True, slots=True)
class Camera:
    """What measures the positions that an observation holds.

    Args:
        noise: standard deviation of each coordinate, m; None for none.
        rate: frames a second; None for one every control step. The control rate must be a whole multiple of it.
        delay: age of a frame when it is seen, s, rounded to control steps; None for none.
    """

    noise: float | None = None
    rate: float | None = None
    delay: float | None = None

    def __post_init__(self) -> None:
        for name, unit in (("noise", "metres"), ("rate", "frames a second"), ("delay", "seconds")):
            value = getattr(self, name)
            if value is not None:
                advice = f"give it in {unit}, or None to leave it out"
                value = _checks.number(f"{name} of the camera", value, above=0.0, advice=advice)
                object.__setattr__(self, name, value)


@dataclass(frozen=True, kw_only=True, slots=True)
class Randomization:
    """How much the real rod may differ from the nominal one; drawn anew at every reset, independently and uniformly.

    Relative quantities are multiplied by a factor in [1 - x, 1 + x]. Zero leaves a quantity as it is.

    Args:
        modulus, density, drag, remanence: relative.
        magnet_position: shift along the rod of every magnet that is not at the tip, m, in [-x, x].
        field_gain: relative error of the coils' gain.
        field_misalignment: largest angle between the coils' frame and the world, rad; axis of any direction.
        gravity_direction: largest tilt of gravity, rad; about a horizontal axis of any direction.
        initial_field: field added to the one that the episode starts from, T, each axis in [-x, x].
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
        relative = ("modulus", "density", "drag", "remanence", "field_gain")
        for field in fields(self):
            bound = {"at_most": 0.9} if field.name in relative else {}
            value: Any = _checks.number(
                f"{field.name} of the randomization",
                getattr(self, field.name),
                at_least=0.0,
                advice="give how far the quantity may lie from its nominal value",
                **bound,
            )
            object.__setattr__(self, field.name, value)

    @property
    def active(self) -> bool:
        """Whether anything is randomised."""
        return any(getattr(self, field.name) > 0.0 for field in fields(self))
