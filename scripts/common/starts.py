"""How a rod is set in motion."""

from __future__ import annotations

import math

import numpy as np

from magrod_env import Simulation

FIRST_ROOT = 1.8751040687  # of cosh x cos x = -1


def first_mode(x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """First mode of a slender cantilever at x = s/L, 1 at the tip, and its slope d/dx."""
    k = FIRST_ROOT
    ratio = (math.cosh(k) + math.cos(k)) / (math.sinh(k) + math.sin(k))
    shape = np.cosh(k * x) - np.cos(k * x) - ratio * (np.sinh(k * x) - np.sin(k * x))
    slope = k * (np.sinh(k * x) + np.sin(k * x) - ratio * (np.cosh(k * x) - np.cos(k * x)))
    return 0.5 * shape, 0.5 * slope


def pluck(simulation: Simulation, offset: tuple[float, float]) -> None:
    """Give the straight rod the speeds of its first mode as it passes the middle on its way to a tip offset (m)."""
    rod = simulation.scene.rod
    pace = (FIRST_ROOT / rod.length) ** 2 * math.sqrt(rod.bending_stiffness / rod.mass_per_length)
    shape, slope = first_mode(simulation.arc_lengths / rod.length)
    velocities, spins = (np.zeros((simulation.num_rods, simulation.num_elements + 1, 3)) for _ in range(2))
    velocities[..., 1], velocities[..., 2] = pace * offset[0] * shape, pace * offset[1] * shape
    spins[..., 1], spins[..., 2] = -pace * offset[1] * slope / rod.length, pace * offset[0] * slope / rod.length
    simulation.set_motion(velocities, spins)
