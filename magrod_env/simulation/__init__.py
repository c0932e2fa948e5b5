"""Rods in time: `Simulation`, and what it stands on."""

from magrod_env.simulation.errors import CoarseWarning, SimulationDiverged, StabilityError
from magrod_env.simulation.simulation import Simulation, resolution_for

__all__ = ["CoarseWarning", "Simulation", "SimulationDiverged", "StabilityError", "resolution_for"]
