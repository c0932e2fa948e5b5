"""How exact the rod is, and what that costs: the program `python -m scripts.accuracy`, in parts."""

from __future__ import annotations

import numpy as np

from magrod_env import Simulation
from scripts.common import run
from scripts.common.cases import CASES, LOADED, STATICS, TIMES, reference

LOADED_LIMITS = {name: loaded.limits for name, loaded in LOADED.items()}
__all__ = ["CASES", "LOADED", "LOADED_LIMITS", "STATICS", "follow", "reference"]


def follow(simulation: Simulation, field: run.Field | None, times: np.ndarray = TIMES) -> np.ndarray | None:
    """Magnets' positions (times, magnets, 3) m from the straight rod at rest; None if the rod diverged."""
    simulation.reset()
    course = run.follow(simulation, times, field, see=run.magnets)
    return course.seen if course.whole else None
