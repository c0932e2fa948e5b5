"""Rods in time: `Simulation`, and what it stands on."""

from magrod_env.simulation.errors import CoarseWarning, SimulationDiverged, StabilityError
from magrod_env.simulation.inverse import InverseStatics
from magrod_env.simulation.linear import LinearModel
from magrod_env.simulation.reactions import Reactions
from magrod_env.simulation.simulation import Simulation, resolution_for
from magrod_env.simulation.state import RodState

__all__ = [
    "CoarseWarning",
    "InverseStatics",
    "LinearModel",
    "Reactions",
    "RodState",
    "Simulation",
    "SimulationDiverged",
    "StabilityError",
    "resolution_for",
]
