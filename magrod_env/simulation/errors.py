"""What a simulation raises and warns of."""

from __future__ import annotations

import numpy as np

from magrod_env.rod.energy import BENT, ENERGETIC, NOT_FINITE, STRETCHED
from magrod_env.rod.equilibrium import Equilibrium
from magrod_env.rod.implicit import UNSOLVED
from magrod_env.scene import Scene

SYMPTOMS = {
    NOT_FINITE: "its state is not finite",
    BENT: "one element has bent by 180 degrees or more: use more elements",
    STRETCHED: "an element is stretched or squeezed by half its length",
    ENERGETIC: "its energy rose by more than the field and the loads can have put in",
    UNSOLVED: "the equations of an implicit step were not solved",
}
"""What each status of a rod means."""


class SimulationDiverged(RuntimeError):
    """A rod left the range in which its numbers mean anything; the message says which, when and what to do."""


class CoarseWarning(UserWarning):
    """The elements may be too few, an implicit step too long or float32 too short for the loads; the message says what
    to take.
    """


class StabilityError(RuntimeError):
    """No stable equilibrium is reached as gravity, then the field are turned on: the rod buckles or snaps through."""

    @classmethod
    def at(cls, case: Equilibrium, scene: Scene) -> StabilityError:
        """The error where stability is lost on the way to an equilibrium of `scene`."""
        lost = "the rod loses stability (it buckles or snaps through)"
        if case.strained:
            return cls(
                "an equilibrium must not stretch an element by more than half, shear it by more than 0.8 or bend it "
                f"by a half turn, but under gravity and {case.field.tolist()} T it does: use more elements, a stiffer "
                "rod or weaker loads."
            )
        if case.share < 1.0:
            return cls(
                f"gravity must not buckle a rod that is to start in equilibrium, but at {100 * case.share:.3g} % of "
                f"{list(scene.gravity or ())} m/s^2, before any field acts, {lost}: make the rod shorter or stiffer, "
                "let it hang another way, or start straight with reset() and let it fall."
            )
        names = ["field"] if case.field.any() or not case.gradient.any() else []
        names += ["gradient"] if case.gradient.any() else []
        loads = [f"{case.field.tolist()} T"] if names[0] == "field" else []
        loads += [f"a gradient of up to {np.abs(case.gradient).max():.3g} T/m"] if case.gradient.any() else []
        name = " and ".join(names)
        return cls(
            f"{name} must lead to a stable equilibrium from zero, but at {' and '.join(loads)} {lost} at "
            f"{100 * (case.share - 1):.3g} % of the {name}: start from a weaker {names[0]} and let the dynamics carry "
            "the rod over."
        )
