"""Quadratic drag of a slender rod in a fluid that flows uniformly, unequal across and along the rod.

The cross-flow principle (Hoerner 1965; Morison's drag term): with u the velocity relative to the fluid and u_n, u_t its
parts across and along the tangent, the force per length is -(rho/2) d (C_n |u_n| u_n + pi C_t |u_t| u_t). A kick takes
it at the mean of the velocities before and after, a quadratic equation with a closed solution (docs/physics.md):
symmetric in time, of second order, and dissipative in the fluid's frame at every step.
"""

from __future__ import annotations

import dataclasses
import math
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from magrod_env._jit import inline_jit
from magrod_env._simd import load, maximum, square_root
from magrod_env.rod.access import load_vector
from magrod_env.rod.damping import add_tensor, add_tensors, tensor
from magrod_env.rod.loads.rows import Vector, checked_amount, checked_length, checked_load, for_rods, put_vectors
from magrod_env.rod.vectors import (
    add_scaled_vector,
    add_vectors,
    inner,
    scaled_vector,
    subtract_vectors,
    tangent,
)

NORMAL, TANGENTIAL, FLOW = 0, 1, 2  # (rho/2) C_n d and (rho/2) C_t pi d, kg/m^2; m/s, world
LARGEST_DENSITY, LARGEST_COEFFICIENT, LARGEST_FLOW = 1e6, 1e6, 1e6  # kg/m^3, 1, m/s
TINY = 1e-300  # beside a speed, against 0/0


@dataclass(frozen=True, kw_only=True, slots=True)
class FluidDrag:
    """Drag of the fluid that a rod moves in; no added mass, no lift, no moment.

    Args:
        density: of the fluid, kg/m^3.
        normal_coefficient: drag coefficient C_n across the rod, about 1.1 for a cylinder at Reynolds numbers of 1e3 to
            1e5.
        tangential_coefficient: friction coefficient C_t along the rod, on its circumference pi d: 0.003 to 0.05.
        flow: velocity of the fluid, m/s, world, (3,).
        diameter: d, m; None takes the rod's width.

    Raises:
        ValueError: if a number is not finite, negative or beyond what can be built.
    """

    density: float
    normal_coefficient: float
    tangential_coefficient: float
    flow: Vector = (0.0, 0.0, 0.0)
    diameter: float | None = None

    TERM: ClassVar[str] = "fluid_drag"
    ROWS: ClassVar[int] = 5
    FORCES: ClassVar[int] = 2  # first rows, in which the load is linear
    follows: ClassVar[bool] = False

    def __post_init__(self) -> None:
        for name, most, unit in (
            ("density", LARGEST_DENSITY, "kg/m^3, water has 1000"),
            ("normal_coefficient", LARGEST_COEFFICIENT, "parts of (rho/2) d u^2"),
            ("tangential_coefficient", LARGEST_COEFFICIENT, "parts of (rho/2) pi d u^2"),
        ):
            value = checked_amount(f"{name} of the FluidDrag", getattr(self, name), unit, most)
            object.__setattr__(self, name, value)
        object.__setattr__(self, "flow", checked_load("flow of the FluidDrag", self.flow, "m/s", LARGEST_FLOW))
        if self.diameter is not None:
            advice = "give it in metres, or None for the rod's width"
            object.__setattr__(self, "diameter", checked_length("diameter of the FluidDrag", self.diameter, advice))

    @property
    def conservative(self) -> bool:
        """Whether it leaves a rod at rest alone: where the fluid is at rest."""
        return not any(self.flow)

    def of_width(self, width: float) -> FluidDrag:
        """The same with the rod's width where no diameter is given."""
        return dataclasses.replace(self, diameter=width) if self.diameter is None else self

    def clamp_moment(self, length: float) -> float:
        """Moment, N m, of a flow across a rod of a length, m, at the clamp."""
        line = 0.5 * self.density * self.normal_coefficient * (self.diameter or 0.0)
        return 0.5 * line * float(np.dot(self.flow, self.flow)) * length**2

    def rows(self, plane: str | None, num_rods: int = 1, **values: Any) -> np.ndarray:
        """Rows of ``num_rods`` rods, (num_rods, ROWS); ``values`` replace its fields, one for all or a rod."""
        numbers = {}
        for name in ("density", "normal_coefficient", "tangential_coefficient", "diameter"):
            given = values.pop(name, getattr(self, name))
            numbers[name] = for_rods(f"{name} of the FluidDrag", given, (), least=0.0)
        flow = for_rods("flow of the FluidDrag", values.pop("flow", self.flow), (3,))
        if values:
            raise ValueError(f"values of the FluidDrag must be its own, but got {', '.join(values)}.")
        if self.conservative and flow.any():
            raise ValueError(
                f"flow of the FluidDrag must be zero where the scene's fluid is at rest, but got {flow.tolist()!r}: "
                "give the scene's FluidDrag a flow, so that its kernels are compiled for one."
            )
        pressure = 0.5 * numbers["density"] * numbers["diameter"]
        rows = np.zeros((num_rods, self.ROWS))
        rows[:, NORMAL] = pressure * numbers["normal_coefficient"]
        rows[:, TANGENTIAL] = math.pi * pressure * numbers["tangential_coefficient"]
        put_vectors(rows, FLOW, "flow of the FluidDrag", flow, plane)
        return rows


@inline_jit
def split(velocity, rotation, planar):
    """Tangent, speed along it, velocity across it, and its size."""
    t = tangent(rotation, planar)
    along = inner(velocity, t, planar)
    across = add_scaled_vector(velocity, -along, t, planar)
    return t, along, across, square_root(inner(across, across, planar))


@inline_jit
def lost_share(strength, speed):
    """Share of a mean velocity w that drag takes: w - u with u (1 + strength |u|) = w, over w."""
    x = 4.0 * strength * speed
    root = 1.0 + square_root(1.0 + x)
    return x / (root * root)


@inline_jit
def resisted(block, row, carried, share, rotation, before, after, lanes, planar):
    """Velocity after a kick with the fluid's drag, from those before and after a kick without.

    ``share`` = gain/(2 m) of the node, ``gain`` what a unit acceleration adds in the kick; ``carried`` is its length.
    """
    mean = scaled_vector(0.5, add_vectors(before, after, planar), planar)
    relative = subtract_vectors(mean, load_vector(block, row + FLOW, lanes, planar), planar)
    t, along, across, size = split(relative, rotation, planar)
    strength = share * carried
    lost = lost_share(strength * load(block, row + NORMAL, lanes), size)
    rubbed = lost_share(strength * load(block, row + TANGENTIAL, lanes), maximum(along, -along)) * along
    return add_scaled_vector(add_scaled_vector(after, -2.0 * lost, across, planar), -2.0 * rubbed, t, planar)


@inline_jit
def fluid_force(block, row, carried, rotation, velocity, lanes, planar):
    """Force of the fluid on a node that moves with a velocity, world."""
    relative = subtract_vectors(velocity, load_vector(block, row + FLOW, lanes, planar), planar)
    t, along, across, size = split(relative, rotation, planar)
    pressed = -carried * load(block, row + NORMAL, lanes) * size
    rubbed = -carried * load(block, row + TANGENTIAL, lanes) * maximum(along, -along) * along
    return add_scaled_vector(scaled_vector(pressed, across, planar), rubbed, t, planar)


@inline_jit
def add_fluid_slope(block, scratch, row, own, carried, rotation, velocity, rate, lanes):
    """Add ``-rate`` times the derivative of the force in space by the velocity to a node's diagonal block."""
    t, along, across, size = split(
        subtract_vectors(velocity, load_vector(block, row + FLOW, lanes, None), None), rotation, None
    )
    normal = rate * carried * load(block, row + NORMAL, lanes)
    tangential = 2.0 * rate * carried * load(block, row + TANGENTIAL, lanes) * maximum(along, -along)
    pressed = tensor(normal * size, normal / (size + TINY), across)
    add_tensor(scratch, own, 0, add_tensors(pressed, tensor(0.0 * size, tangential - normal * size, t)), lanes)
