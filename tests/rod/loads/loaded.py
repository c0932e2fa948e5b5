"""Scenes whose loads are all there, many of them of size zero, so that they share compiled kernels."""

from magrod_env import DistributedForce, FluidDrag, PointLoad, Scene, TipWrench
from rod.beams import slender_rod

WIRE = slender_rod(diameter=5e-5, youngs_modulus=1e7)  # 2000 times as long as wide: shear and stretch are 1e-7
STIFFNESS, LENGTH = WIRE.bending_stiffness, WIRE.length
FORCE, MOMENT = STIFFNESS / LENGTH**2, STIFFNESS / LENGTH  # units in which loads are of the order of 1


def listed(*, tip=None, line=(0.0, 0.0, 0.0), follows=False, point=(0.0, 0.0, 0.0), place=0.5 * LENGTH, fluid=None):
    """Every kind of load; ``tip`` and ``fluid`` are keywords of theirs, ``follows`` is that of the line force."""
    still = {"density": 0.0, "normal_coefficient": 1.0, "tangential_coefficient": 1.0}
    return (
        TipWrench(**(tip or {})),
        DistributedForce(force_per_length=line, follows=follows),
        PointLoad(position=place, force=point),
        FluidDrag(**{**still, **(fluid or {})}),
    )


def wire(**loads):
    """A weightless wire under listed loads."""
    return Scene(rod=WIRE, loads=listed(**loads))
