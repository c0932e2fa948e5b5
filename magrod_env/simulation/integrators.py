"""Which scheme steps the rod in time, what it asks of a scene, and how long its steps are where nothing is said."""

from __future__ import annotations

import math

from magrod_env.rod.loads.fluid_drag import FluidDrag
from magrod_env.scene import Scene

_OUTER = 1.0 / (4.0 - 4.0 ** (1.0 / 3.0))
SHARES: dict[str, tuple[float, ...]] = {
    "explicit": (),
    "implicit": (1.0,),
    "implicit4": (_OUTER, _OUTER, 1.0 - 4.0 * _OUTER, _OUTER, _OUTER),  # Suzuki 1990: order 4 of a symmetric step
}
"""Midpoint steps, in shares of a time step, that an implicit scheme is made of."""
MIDPOINT_COST = 20.0  # explicit steps that take as long as an implicit midpoint step: 14 to 30, measured
STEPS_A_PERIOD = {"implicit": 64.0, "implicit4": 12.0}  # of the slowest vibration: its phase errs by 8e-4, 7e-5
CHAIN = 1.2024  # half of the first zero of the Bessel function J0
DAMPED_STEP = 2.0  # of implicit4, over the time of a drag: its middle share goes back in time


def implicit_schemes(scene: Scene) -> tuple[str, ...]:
    """Those that can step the scene, the most exact first."""
    one_way = scene.damping_time is not None or _in_fluid(scene)
    return ("implicit",) if one_way else ("implicit4", "implicit")


def check_integrator(
    integrator: str | None, scene: Scene, *, element: str, precision: str, tolerance: float | None
) -> str:
    """The integrator asked for, explicit where nothing is said; ValueError if it cannot do what else is asked for."""
    if integrator is None:
        return "explicit"
    if integrator not in SHARES:
        raise ValueError(
            f"integrator must be one of {', '.join(map(repr, SHARES))}, but got {integrator!r}: choose one of them."
        )
    if integrator == "explicit":
        return integrator
    for name, value, needed in (
        ("element", element, "helical"),
        ("precision", precision, "float64"),
        ("tolerance", tolerance, None),
    ):
        if value != needed:
            raise ValueError(
                f"{name} must be {needed!r} with integrator={integrator!r}, but got {value!r}: leave it out, or use "
                'integrator="explicit".'
            )
    if integrator == "implicit4" and _in_fluid(scene):
        raise ValueError(
            'loads must hold no FluidDrag with integrator="implicit4", part of whose step goes back in time, but they '
            'do: use integrator="implicit".'
        )
    if integrator not in implicit_schemes(scene):
        raise ValueError(
            'internal_damping must be None with integrator="implicit4", part of whose step goes back in time, but got '
            f'{scene.damping_time!r}: use integrator="implicit".'
        )
    return integrator


def _in_fluid(scene: Scene) -> bool:
    return any(isinstance(load, FluidDrag) for load in scene.loads)


def cost_rate(integrator: str, num_elements: int, time_step: float) -> float:
    """Elements times steps in a second of motion, in explicit steps."""
    return (MIDPOINT_COST * len(SHARES[integrator]) or 1.0) * num_elements / time_step


def largest_step(integrator: str, drag_rate: float | None, spin_drag_rate: float | None) -> float:
    """Largest stable step, s, of an implicit scheme under drag at these rates, 1/s."""
    rate = max(drag_rate or 0.0, spin_drag_rate or 0.0)
    return DAMPED_STEP / rate if integrator == "implicit4" and rate > 0.0 else math.inf


def working_step(integrator: str, frequency: float, largest: float, pull: float = 0.0) -> float:
    """Step, s, of an implicit scheme for a rod whose slowest vibration has this frequency, Hz.

    ``pull`` is gravity over the length, 1/s^2: a limp rod swings at the 1.2 sqrt(pull) of a hanging chain.
    """
    frequency = math.hypot(frequency, CHAIN * math.sqrt(pull) / (2.0 * math.pi))
    return min(1.0 / (STEPS_A_PERIOD[integrator] * frequency), largest)
