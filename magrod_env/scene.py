"""What a simulation is about: the rod, its magnets and the loads that act without command; all SI.

A rod of length L is clamped at the origin of the world frame and lies along +x when unloaded. Arc length runs
from the clamp (0) to the tip (L). The body frame of a section has its first axis along the tangent.
"""

from __future__ import annotations

import dataclasses
import itertools
import math
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np

from magrod_env import _checks
from magrod_env.magnetics import dipole_moment
from magrod_env.rod.loads.distributed_force import DistributedForce
from magrod_env.rod.loads.fluid_drag import FluidDrag
from magrod_env.rod.loads.hub import KINDS, SINGLE
from magrod_env.rod.loads.point_load import PointLoad
from magrod_env.rod.loads.tip_wrench import TipWrench

Vector = _checks.Vector
"""Three floats."""

Load = TipWrench | DistributedForce | PointLoad | FluidDrag
"""What `Scene.loads` may list."""

_SAME_PLACE = 1e-9  # positions closer than this share of the rod's length are one place

# From the smallest to the largest that is accepted, SI; far beyond what can be built. Within them areas, stiffness,
# masses and moments neither overflow nor vanish.
_SIZES = (1e-9, 1e4)  # m
_DENSITIES = (1e-12, 1e9)  # kg/m^3
_MODULI = (1e-20, 1e18)  # Pa: next to nothing stands for a rod that does not resist
_LARGEST_MOMENT = 1e9  # A m^2
_LARGEST_MASS = 1e9  # kg
_LARGEST_REMANENCE = 100.0  # T: neodymium has 1.5
_LARGEST_ACCELERATION = 1e9  # m/s^2
_LARGEST_RATE = 1e12  # 1/s
_LONGEST_DAMPING = 1e6  # s
_LARGEST_LOSS = 1e3


@dataclass(frozen=True, kw_only=True, slots=True)
class Rod:
    """Straight, uniform, isotropic rod of solid circular or square section.

    There is no shear correction factor, and the torsional stiffness uses the polar moment I2 + I3, both as in
    the paper (Tables 3-7). For a square section the true torsion constant is 0.1406 width^4, 16 % less than
    the polar moment.

    Args:
        shape: "circular" or "square"; `Rod.circular` and `Rod.square` set it.
        length: length from clamp to tip, m.
        width: diameter or edge of the section, m.
        density: mass density, kg/m^3.
        youngs_modulus: Young's modulus E, Pa.
        poissons_ratio: Poisson's ratio nu, above -1 and at most 0.5.

    Raises:
        ValueError: if the shape is unknown or a number is not finite and within these bounds, or so small or large
            that it must be a slip of units (sizes are accepted from 1 nm to 10 km).
    """

    shape: Literal["circular", "square"]
    length: float
    width: float
    density: float
    youngs_modulus: float
    poissons_ratio: float

    def __post_init__(self) -> None:
        if self.shape not in ("circular", "square"):
            raise ValueError(
                f'shape of the rod must be "circular" or "square", but got {self.shape!r}: '
                "use Rod.circular or Rod.square."
            )
        width = "diameter" if self.shape == "circular" else "edge"
        self._check("length", "length", "metres", _SIZES)
        self._check("width", width, "metres, 2 mm is 2e-3", _SIZES)
        self._check("density", "density", "kg/m^3, water has 1000", _DENSITIES)
        self._check("youngs_modulus", "Young's modulus", "pascal, 1 MPa is 1e6", _MODULI)
        ratio = _checks.number(
            "Poisson's ratio of the rod",
            self.poissons_ratio,
            above=-1.0,
            at_most=0.5,
            advice="rubber has 0.5, metals about 0.33",
        )
        object.__setattr__(self, "poissons_ratio", ratio)

    def _check(self, name: str, words: str, unit: str, bounds: tuple[float, float]) -> None:
        least, most = bounds
        value = _checks.bounded(
            f"{words} of the rod", getattr(self, name), above=0.0, least=least, most=most, advice=f"give it in {unit}"
        )
        object.__setattr__(self, name, value)

    @classmethod
    def circular(
        cls, *, length: float, diameter: float, density: float, youngs_modulus: float, poissons_ratio: float
    ) -> Rod:
        """Return a rod of solid circular section; arguments as in the class."""
        return cls(
            shape="circular",
            length=length,
            width=diameter,
            density=density,
            youngs_modulus=youngs_modulus,
            poissons_ratio=poissons_ratio,
        )

    @classmethod
    def square(cls, *, length: float, edge: float, density: float, youngs_modulus: float, poissons_ratio: float) -> Rod:
        """Return a rod of solid square section; arguments as in the class."""
        return cls(
            shape="square",
            length=length,
            width=edge,
            density=density,
            youngs_modulus=youngs_modulus,
            poissons_ratio=poissons_ratio,
        )

    @property
    def area(self) -> float:
        """Area A of the section, m^2."""
        return math.pi / 4.0 * self.width**2 if self.shape == "circular" else self.width**2

    @property
    def second_moment(self) -> float:
        """Second moment of area I = I2 = I3, m^4."""
        return math.pi / 64.0 * self.width**4 if self.shape == "circular" else self.width**4 / 12.0

    @property
    def polar_moment(self) -> float:
        """Polar moment of area J = I2 + I3, m^4."""
        return 2.0 * self.second_moment

    @property
    def shear_modulus(self) -> float:
        """Shear modulus G = E / (2 (1 + nu)), Pa."""
        return self.youngs_modulus / (2.0 * (1.0 + self.poissons_ratio))

    @property
    def axial_stiffness(self) -> float:
        """Stretching stiffness EA, N."""
        return self.youngs_modulus * self.area

    @property
    def shear_stiffness(self) -> float:
        """Shear stiffness GA, N, without a shear correction factor."""
        return self.shear_modulus * self.area

    @property
    def bending_stiffness(self) -> float:
        """Bending stiffness EI, N m^2."""
        return self.youngs_modulus * self.second_moment

    @property
    def torsional_stiffness(self) -> float:
        """Torsional stiffness GJ, N m^2, with the polar moment."""
        return self.shear_modulus * self.polar_moment

    @property
    def mass_per_length(self) -> float:
        """Mass per length rho A, kg/m."""
        return self.density * self.area

    @property
    def rotary_inertia_per_length(self) -> float:
        """Rotary inertia per length rho I about a transverse axis, kg m; twice this about the tangent."""
        return self.density * self.second_moment

    @property
    def mass(self) -> float:
        """Mass of the rod without magnets, kg."""
        return self.mass_per_length * self.length


@dataclass(frozen=True, kw_only=True, slots=True)
class Magnet:
    """Permanent magnet in the rod: a point mass with a dipole fixed to the section at its centre.

    Not modelled: its rotary inertia, and the stretch of rod that it stiffens.

    Args:
        position: arc length of its centre from the clamp, m.
        moment: magnitude of the dipole moment, A m^2.
        mass: mass, kg.
        direction: direction of the moment in the body frame, scaled to length 1; the first axis is the
            tangent.
        diameter: diameter, m, for drawing; None where it is not known.
        length: length, m, for drawing; None where it is not known.

    Raises:
        ValueError: if a number is not finite, negative or (position, diameter, length) zero, or beyond what can be
            built, or the direction is zero.
    """

    position: float
    moment: float
    mass: float = 0.0
    direction: Vector = (1.0, 0.0, 0.0)
    diameter: float | None = None
    length: float | None = None

    def __post_init__(self) -> None:
        position = _checks.number(
            "position of the magnet",
            self.position,
            above=0.0,
            advice="give its arc length from the clamp in metres; at the clamp a magnet cannot act",
        )
        moment = _checks.bounded(
            "moment of the magnet",
            self.moment,
            at_least=0.0,
            most=_LARGEST_MOMENT,
            advice="give A m^2 and turn it round with `direction`",
        )
        mass = _checks.bounded(
            "mass of the magnet",
            self.mass,
            at_least=0.0,
            most=_LARGEST_MASS,
            advice="give it in kg, 1 mg is 1e-6",
        )
        direction = _checks.unit_vector(
            "direction of the magnet",
            self.direction,
            advice="(1, 0, 0) points along the tangent towards the tip",
        )
        for name, value in (
            ("position", position),
            ("moment", moment),
            ("mass", mass),
            ("direction", direction),
        ):
            object.__setattr__(self, name, value)
        for name in ("diameter", "length"):
            if getattr(self, name) is not None:
                object.__setattr__(self, name, _size_of_magnet(name, getattr(self, name)))

    @classmethod
    def cylinder(
        cls,
        *,
        position: float,
        diameter: float,
        length: float,
        mass: float,
        remanence: float,
        direction: Vector = (1.0, 0.0, 0.0),
    ) -> Magnet:
        """Return a cylindrical magnet with the moment Br V / mu0 (paper, section 4.3).

        Args:
            position, mass, direction: as in the class.
            diameter, length: size of the cylinder, m.
            remanence: residual flux density Br, T.

        Raises:
            ValueError: as the class, and if the remanence or a size is not above 0 or beyond what can be built.
        """
        volume = math.pi / 4.0 * _size_of_magnet("diameter", diameter) ** 2 * _size_of_magnet("length", length)
        remanence = _checks.bounded(
            "remanence of the magnet",
            remanence,
            above=0.0,
            most=_LARGEST_REMANENCE,
            advice="give it in tesla, N45 has 1.345",
        )
        return cls(
            position=position,
            moment=dipole_moment(remanence, volume),
            mass=mass,
            direction=direction,
            diameter=diameter,
            length=length,
        )

    @classmethod
    def dipole(
        cls, *, position: float, moment: float, mass: float = 0.0, direction: Vector = (1.0, 0.0, 0.0)
    ) -> Magnet:
        """Return a magnet known by its moment only; arguments as in the class."""
        return cls(position=position, moment=moment, mass=mass, direction=direction)

    @property
    def dipole_moment(self) -> np.ndarray:
        """Dipole moment in the body frame, A m^2, shape (3,)."""
        return self.moment * np.array(self.direction)


@dataclass(frozen=True, kw_only=True, slots=True)
class Scene:
    """A rod, its magnets, gravity and damping; the magnetic field is the command and not part of the scene.

    `None` leaves a term out: it is then absent from the computation, not multiplied by zero.

    Args:
        rod: the rod.
        magnets: its magnets, in any order, no two at one position; the order is kept.
        gravity: acceleration of free fall in the world frame, m/s^2, shape (3,).
        drag_rate: external viscous drag, 1/s: a force -drag_rate * m * v on each lumped mass, magnets
            included.
        spin_drag_rate: viscous drag on the sections' rotation, 1/s: a torque -spin_drag_rate * J * omega. The
            rotary inertia J of a thin rod is tiny: 100 /s brakes the first bending modes by less than 0.1 /s, and
            the ringing of a magnet's section after a step of the field by 50 /s.
        internal_damping: Kelvin-Voigt time constant, s: stress is stiffness * (strain + internal_damping *
            strain rate).
        loss_factor: the same as a loss factor at the first bending vibration, 0.1 for many silicones: the Kelvin-Voigt
            time is loss_factor/(2 pi `first_frequency`), and a vibration of frequency f has f/`first_frequency` times
            the loss factor.
        loads: further loads, in any order: at most one `TipWrench`, one `DistributedForce` and one `FluidDrag`, and any
            number of `PointLoad`.

    Raises:
        ValueError: if an entry is of the wrong kind, a magnet lies off the rod or on another, a load lies off the rod
            or is there twice, or a number is negative or beyond what can be built.
    """

    rod: Rod
    magnets: tuple[Magnet, ...] = ()
    gravity: Vector | None = None
    drag_rate: float | None = None
    spin_drag_rate: float | None = None
    internal_damping: float | None = None
    loss_factor: float | None = None
    loads: tuple[Load, ...] = ()

    def __post_init__(self) -> None:
        if not isinstance(self.rod, Rod):
            raise ValueError(f"rod of the scene must be a Rod, but got {self.rod!r}: use Rod.circular or Rod.square.")
        object.__setattr__(self, "magnets", _placed(self.magnets, self.rod.length))
        places = [magnet.position for magnet in self.magnets]
        object.__setattr__(self, "loads", _placed_loads(self.loads, self.rod.length, places))
        if self.gravity is not None:
            advice = "give a world vector in m/s^2, for instance (0, 0, -9.81), or None for no gravity"
            gravity = _checks.vector("gravity of the scene", self.gravity, advice=advice)
            most = _LARGEST_ACCELERATION
            for part in gravity:
                _checks.bounded("an entry of the gravity of the scene", part, least=-most, most=most, advice=advice)
            object.__setattr__(self, "gravity", gravity)
        for name, unit, most in (
            ("drag_rate", "1/s", _LARGEST_RATE),
            ("spin_drag_rate", "1/s", _LARGEST_RATE),
            ("internal_damping", "seconds", _LONGEST_DAMPING),
            ("loss_factor", "parts of the stiffness", _LARGEST_LOSS),
        ):
            value = getattr(self, name)
            if value is not None:
                advice = f"give it in {unit}, or None to leave it out"
                value = _checks.bounded(f"{name} of the scene", value, at_least=0.0, most=most, advice=advice)
                object.__setattr__(self, name, value)

        if self.internal_damping is not None and self.loss_factor is not None:
            raise ValueError(
                "internal_damping of the scene must be None beside a loss_factor, which says the same, but got "
                f"{self.internal_damping!r}: give one of them."
            )

    @property
    def damping_time(self) -> float | None:
        """Kelvin-Voigt time, s: `internal_damping`, or the one that `loss_factor` means; None without either."""
        if self.loss_factor is None:
            return self.internal_damping
        return self.loss_factor / (2.0 * math.pi * self.first_frequency)

    @property
    def first_frequency(self) -> float:
        """Frequency, Hz, of the first bending vibration of the clamped straight rod with its magnets, without gravity
        or field.

        Ritz's method with seven powers for the Euler-Bernoulli beam with point masses; shear and rotary inertia, which
        lower the frequency of a rod ten times as long as wide by about one percent, are left out.
        """
        powers = np.arange(2, 9)
        i, j = powers[:, None], powers
        rod = self.rod
        stiffness = rod.bending_stiffness / rod.length**3 * (i * (i - 1) * j * (j - 1)) / (i + j - 3)
        mass = rod.mass_per_length * rod.length / (i + j + 1.0)
        for magnet in self.magnets:
            mass = mass + magnet.mass * (magnet.position / rod.length) ** (i + j)
        root = np.linalg.inv(np.linalg.cholesky(stiffness))
        return float(1.0 / (2.0 * math.pi * np.sqrt(np.linalg.eigvalsh(root @ mass @ root.T)[-1])))

    @property
    def segment_ends(self) -> tuple[float, ...]:
        """Arc lengths at which a node must sit, m: the positions of the magnets, the point loads and the tip,
        increasing.
        """
        points = {load.position for load in self.loads if isinstance(load, PointLoad)}
        return tuple(sorted({magnet.position for magnet in self.magnets} | points | {self.rod.length}))

    @property
    def acting_loads(self) -> tuple[Load, ...]:
        """The listed loads, with the rod's width where a diameter is None."""
        width = self.rod.width
        return tuple(load.of_width(width) if isinstance(load, FluidDrag) else load for load in self.loads)

    @property
    def mass(self) -> float:
        """Mass of the rod with its magnets, kg."""
        return self.rod.mass + sum(magnet.mass for magnet in self.magnets)

    def replace(self, **changes: Any) -> Scene:
        """Return a copy with some fields changed; a name that is no field is a TypeError."""
        return dataclasses.replace(self, **changes)


def _size_of_magnet(name: str, value: float) -> float:
    least, most = _SIZES
    return _checks.bounded(
        f"{name} of the magnet", value, above=0.0, least=least, most=most, advice="give it in metres, 2 mm is 2e-3"
    )


def _placed(magnets: tuple[Magnet, ...], length: float) -> tuple[Magnet, ...]:
    """Return the magnets as a tuple, those within rounding of the tip exactly at the tip."""
    if not isinstance(magnets, (tuple, list)) or not all(isinstance(magnet, Magnet) for magnet in magnets):
        raise ValueError(
            f"magnets of the scene must be a tuple or list of Magnet, but got {magnets!r}: "
            "use Magnet.cylinder or Magnet.dipole."
        )
    placed = tuple(_on_rod(magnet, length) for magnet in magnets)
    positions = sorted(magnet.position for magnet in placed)
    for low, high in itertools.pairwise(positions):
        if high - low <= _SAME_PLACE * length:
            raise ValueError(
                f"magnets of the scene must lie at different positions, but two lie at {low!r} m: "
                "merge them into one with the sum of their moments and masses."
            )
    return placed


def _on_rod(magnet: Magnet, length: float) -> Magnet:
    return dataclasses.replace(magnet, position=_place("magnet", magnet.position, length, []))


def _place(what: str, position: float, length: float, others: list[float]) -> float:
    """A position on the rod, exactly that of the tip or of another that is within rounding of it."""
    for place in (length, *others):
        if abs(position - place) <= _SAME_PLACE * length:
            return place
    if position > length:
        raise ValueError(
            f"position of a {what} must be at most the rod's length {length!r} m, "
            f"but got {position!r} m: "
            "measure it along the rod from the clamp."
        )
    return position


def _placed_loads(loads: tuple[Load, ...], length: float, places: list[float]) -> tuple[Load, ...]:
    """Return the loads as a tuple, point loads within rounding of the tip, a magnet or one another exactly there."""
    if not isinstance(loads, (tuple, list)) or not all(isinstance(load, KINDS) for load in loads):
        names = ", ".join(kind.__name__ for kind in KINDS)
        raise ValueError(f"loads of the scene must be a tuple or list of {names}, but got {loads!r}: build them so.")
    for kind in SINGLE:
        count = sum(isinstance(load, kind) for load in loads)
        if count > 1:
            raise ValueError(
                f"loads of the scene must have at most one {kind.__name__}, but got {count}: merge them into one."
            )
    placed: list[Load] = []
    for load in loads:
        if isinstance(load, PointLoad):
            position = _place("PointLoad", load.position, length, places)
            load, places = dataclasses.replace(load, position=position), [*places, position]
        placed.append(load)
    return tuple(placed)
