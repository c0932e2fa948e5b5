"""Which scheme steps the rod in time, what it asks of a scene, and how long its steps are where nothing is said."""

from __future__ import annotations

import math

from magrod_env.scene import Scene

_OUTER = 1.0 / (4.0 - 4.0 ** (1.0 / 3.0))
SHARES: dict[str, tuple[float, ...]] = {
    "explicit": (),
    "implicit": (1.0,),
    "implicit4": (_OUTER, _OUTER, 1.0 - 4.0 * _OUTER, _OUTER, _OUTER),  # Suzuki 1990: order 4 of a symmetric step
}
"""Midpoint steps, in shares of a time step, that an implicit scheme is made of."""
STEPS_A_PERIOD = {"implicit": 64.0, "implicit4": 12.0}  # of the slowest vibration: its phase errs by 8e-4, 7e-5
DAMPED_STEP = 2.0  # of implicit4, over the time of a drag: its middle share goes back in time


def check_integrator(
    integrator: str, scene: Scene, *, element: str, precision: str, plane: str | None, tolerance: float | None
) -> None:
    """Refuse an unknown integrator, or one that cannot do what else is asked for."""
    if integrator not in SHARES:
        raise ValueError(
            f"integrator must be one of {', '.join(map(repr, SHARES))}, but got {integrator!r}: choose one of them."
        )
    if integrator == "explicit":
        return
    for name, value, needed in (
        ("element", element, "helical"),
        ("precision", precision, "float64"),
        ("plane", plane, None),
        ("tolerance", tolerance, None),
    ):
        if value != needed:
            raise ValueError(
                f"{name} must be {needed!r} with integrator={integrator!r}, but got {value!r}: leave it out, or use "
                'integrator="explicit".'
            )
    if integrator == "implicit4" and scene.internal_damping is not None:
        raise ValueError(
            'internal_damping must be None with integrator="implicit4", part of whose step goes back in time, but got '
            f'{scene.internal_damping!r}: use integrator="implicit".'
        )


def largest_step(integrator: str, drag_rate: float | None, spin_drag_rate: float | None) -> float:
    """Largest stable step, s, of an implicit scheme under drag at these rates, 1/s."""
    rate = max(drag_rate or 0.0, spin_drag_rate or 0.0)
    return DAMPED_STEP / rate if integrator == "implicit4" and rate > 0.0 else math.inf


def working_step(integrator: str, frequency: float, largest: float) -> float:
    """Step, s, of an implicit scheme for a rod whose slowest vibration has this frequency, Hz."""
    return min(1.0 / (STEPS_A_PERIOD[integrator] * frequency), largest)
