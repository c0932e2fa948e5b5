"""Magnetics: dipoles, ideal and real coils, and the drive between command and field."""

from magrod_env.magnetics.actuator import Actuator
from magrod_env.magnetics.coils import CoilSystem, HelmholtzPair
from magrod_env.magnetics.constants import MU_0
from magrod_env.magnetics.course import FieldCourse
from magrod_env.magnetics.dipole import dipole_energy, dipole_force, dipole_moment, dipole_torque
from magrod_env.magnetics.loop import CircularLoop
from magrod_env.magnetics.uniform import UniformCoils

__all__ = [
    "MU_0",
    "Actuator",
    "CircularLoop",
    "CoilSystem",
    "FieldCourse",
    "HelmholtzPair",
    "UniformCoils",
    "dipole_energy",
    "dipole_force",
    "dipole_moment",
    "dipole_torque",
]
