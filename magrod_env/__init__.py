"""Magnetic steering of soft continuum manipulators: rod physics and Gymnasium environments."""

from magrod_env.magnetics import Actuator, UniformCoils
from magrod_env.registration import register_all
from magrod_env.rod.equilibrium import Equilibrium
from magrod_env.rod.loads.distributed_force import DistributedForce
from magrod_env.rod.loads.fluid_drag import FluidDrag
from magrod_env.rod.loads.point_load import PointLoad
from magrod_env.rod.loads.tip_wrench import TipWrench
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
    "DistributedForce",
    "Equilibrium",
    "FluidDrag",
    "InverseStatics",
    "LinearModel",
    "Magnet",
    "PointLoad",
    "Reactions",
    "Rod",
    "RodState",
    "Scene",
    "Simulation",
    "SimulationDiverged",
    "StabilityError",
    "TipWrench",
    "UniformCoils",
    "load_scene",
    "paper_scene",
    "scene_names",
]
