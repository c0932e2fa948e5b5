"""Magnetic steering of soft continuum manipulators: rod physics and Gymnasium environments."""

from magrod_env.magnetics import Actuator, UniformCoils
from magrod_env.registration import register_all
from magrod_env.rod.equilibrium import Equilibrium
from magrod_env.scene import Magnet, Rod, Scene
from magrod_env.scenes import load_scene, paper_scene, scene_names
from magrod_env.simulation import (
    CoarseWarning,
    InverseStatics,
    LinearModel,
    Reactions,
    RodState,
    Simulation,
    SimulationDiverged,
    StabilityError,
)

register_all()

__version__ = "0.1.0"

__all__ = [
    "Actuator",
    "CoarseWarning",
    "Equilibrium",
    "InverseStatics",
    "LinearModel",
    "Magnet",
    "Reactions",
    "Rod",
    "RodState",
    "Scene",
    "Simulation",
    "SimulationDiverged",
    "StabilityError",
    "UniformCoils",
    "load_scene",
    "paper_scene",
    "scene_names",
]
