"""What resolves a scene: elements, step, conditioning of stiff modes, integrator; how many elements loads need."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

from magrod_env import _checks

NUM_ELEMENTS = 6  # where nothing is said
EXPECTED_FIELD = 45e-3  # T: the limit of the paper's coils
EPSILON = 2.0**-23  # of float32
LARGEST_ROUNDING = 0.01  # of `rounding_share`


@dataclass(frozen=True, kw_only=True, slots=True)
class Resolution:
    """What a simulation resolves a scene with.

    Args:
        num_elements: elements along the rod.
        time_step: s; None leaves it to the simulation.
        axial_softening: divides the axial stiffness.
        rotary_scaling: multiplies the rotary inertia of the sections.
        integrator: "explicit", "implicit" or "implicit4".
        error: RMS error of the tip, m, that pilot runs estimate; None where none were run.
    """

    num_elements: int
    time_step: float | None = None
    axial_softening: float = 1.0
    rotary_scaling: float = 1.0
    integrator: str = "explicit"
    error: float | None = None


def checked_expected_field(value: Any) -> float:
    """The strongest field that is likely, T; ValueError where it is none."""
    return _checks.number("expected_field", value, at_least=0.0, advice="give its magnitude in tesla, 45 mT is 45e-3")


def checked_resolution(
    num_elements: Any, time_step: Any, axial_softening: Any, rotary_scaling: Any, tolerance: Any
) -> Resolution:
    """What the user has said about the resolution; with a tolerance, nothing else may be said.

    Raises:
        ValueError: on a number out of range, or a tolerance beside another choice.
    """
    given = {
        "num_elements": num_elements,
        "time_step": time_step,
        "axial_softening": axial_softening,
        "rotary_scaling": rotary_scaling,
    }
    if tolerance is not None:
        _checks.number("tolerance", tolerance, above=0.0, advice="give the tip's RMS error in metres, 0.1 mm is 1e-4")
        for name, value in given.items():
            if value is not None:
                raise ValueError(
                    f"{name} must be None beside a tolerance, which chooses it, but got {value!r}: give one of them."
                )
        return Resolution(num_elements=NUM_ELEMENTS)
    count = NUM_ELEMENTS if num_elements is None else num_elements

    def factor(name: str) -> float:
        advice = "1 leaves the rod as it is; larger allows longer steps"
        return 1.0 if given[name] is None else _checks.number(name, given[name], at_least=1.0, advice=advice)

    return Resolution(
        num_elements=int(_checks.count("num_elements", count, advice="6 is a good start")),
        time_step=time_step,
        axial_softening=factor("axial_softening"),
        rotary_scaling=factor("rotary_scaling"),
    )


def elements_for(load: float, longest_element: float) -> float:
    """How many times as many elements a rod should have for its loads; 1 or less where it has enough.

    An element has to be short against the length sqrt(EI/(EI/L + moments)) over which the loads bend the rod: at most
    half of it. An estimate before any run, for sudden loads; `scripts.stability` counts what it misses and what it
    tells of in vain.

    Args:
        load: moments of the loads at the clamp over EI/L.
        longest_element: over the rod's length.
    """
    return 2.0 * longest_element * math.sqrt(1.0 + load)


def rounding_share(slenderness: float, steps_of_damping: float, num_elements: int) -> float:
    """Share of its swing by which float32 may hold up a rod with internal damping; 0.01 or more is worth a warning.

    In a step, a slow point moves by less than the last place of its position, about eps L. Damping resists the jumps
    that are left: elements strain at a rate of eps L/(dt h), and the tension that this costs, EA tau eps N/dt, stiffens
    the rod as p = EA tau eps N/dt over EI/L^2 says. The share, 4e-3 sqrt(p)/N^2, is a fit to rods 15 to 250 times as
    long as wide, of 2 to 6 elements and damping ratios of 0.02 to 1, within a factor of three of the errors found.

    Args:
        slenderness: L sqrt(EA/EI).
        steps_of_damping: Kelvin-Voigt time over time step.
        num_elements: N.
    """
    p = slenderness**2 * steps_of_damping * EPSILON * num_elements
    return 4e-3 * math.sqrt(p) / num_elements**2
