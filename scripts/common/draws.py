"""Random numbers of random scenes."""

from __future__ import annotations

import math

import numpy as np


def log_uniform(random: np.random.Generator, low: float, high: float) -> float:
    """Between two bounds, evenly in its logarithm."""
    return math.exp(random.uniform(math.log(low), math.log(high)))


def direction(random: np.random.Generator, plane: str | None = None) -> np.ndarray:
    """A unit vector (3,), in the plane "xz" where one is named."""
    vector = random.normal(size=3)
    if plane is not None:
        vector[1] = 0.0
    return vector / np.linalg.norm(vector)
