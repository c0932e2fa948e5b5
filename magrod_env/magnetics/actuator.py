"""What lies between a commanded field and the field that acts on the rod."""

from __future__ import annotations

from dataclasses import dataclass

from magrod_env import _checks


@dataclass(frozen=True, kw_only=True, slots=True)
class Actuator:
    """Limits and dynamics of a coil drive, the same for each axis of the field.

    A command passes through the effects in this order:

        command -> dead time -> saturation -> slew limit -> first-order lag -> field at the rod

    so that a command beyond the limit does not wind up the slew limit, and the lag smooths what the amplifier
    can do. `None` leaves an effect out; its code is then absent from the loop rather than run with a neutral
    number.

    Args:
        limit: largest field along an axis, T; None for no saturation. The paper's coils reach 45 mT (section
            4.3).
        slew_limit: fastest change of the field along an axis, T/s.
        lag: time constant of the first-order response of the coils, L/R, s.
        dead_time: delay of the command, s, for instance of the bus and the controller of the amplifier.

    Raises:
        ValueError: if a number is not finite and above 0.
    """

    limit: float | None = 45e-3
    slew_limit: float | None = None
    lag: float | None = None
    dead_time: float | None = None

    def __post_init__(self) -> None:
        for name, unit in (
            ("limit", "tesla"),
            ("slew_limit", "T/s"),
            ("lag", "seconds"),
            ("dead_time", "seconds"),
        ):
            value = getattr(self, name)
            if value is not None:
                advice = f"give it in {unit}, or None to leave it out"
                value = _checks.number(f"{name} of the actuator", value, above=0.0, advice=advice)
                object.__setattr__(self, name, value)
