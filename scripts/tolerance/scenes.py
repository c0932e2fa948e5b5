"""Random rods, magnets and field courses; each trial follows from a seed and an index alone."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from magrod_env import Magnet, Rod, Scene
from scripts.common.cases import GRAVITY
from scripts.common.draws import direction, log_uniform

NUM_RODS = 8
DURATION, CONTROL_TIME = 2.0, 0.02  # s
LARGEST_FIELD = 0.1  # T
LOADS = (0.1, 2.0)  # sum of moments times field times length over bending stiffness
MAGNET_DENSITY = 7500.0  # kg/m^3

Range = tuple[float, float]


@dataclass(frozen=True, slots=True)
class Family:
    """Rods of one make: ranges of modulus (Pa, drawn by its logarithm), diameter and length (m), density (kg/m^3) and
    Poisson's ratio; ``magnet_diameter`` is over the rod's.
    """

    youngs_modulus: Range
    diameter: Range
    length: Range
    density: Range
    poissons_ratio: Range
    magnet_diameter: Range = (0.5, 1.0)


FAMILIES = {
    "soft PDMS": Family((0.3e6, 3e6), (2e-3, 5e-3), (40e-3, 90e-3), (965.0, 1100.0), (0.45, 0.5)),
    "stiff elastomer": Family((5e6, 100e6), (1e-3, 3e-3), (50e-3, 120e-3), (965.0, 1200.0), (0.45, 0.5)),
    "NiTi wire": Family((30e9, 80e9), (0.2e-3, 0.6e-3), (60e-3, 150e-3), (6450.0, 6450.0), (0.33, 0.33), (1.2, 2.5)),
    "aluminium": Family((70e9, 70e9), (0.5e-3, 2e-3), (0.1, 0.25), (2700.0, 2700.0), (0.33, 0.33), (1.0, 1.5)),
}


@dataclass(frozen=True, kw_only=True, slots=True)
class Trial:
    """A scene and the field courses of eight rods.

    Args:
        seed, index: what it was drawn from.
        family: key of FAMILIES.
        scene: rod, magnets, gravity and drag.
        plane: "xz" where all motion is in it, else None.
        magnitude: of the strongest field, T; `expected_field` of the simulation.
        load: sum of moments * magnitude * length / bending stiffness.
        fields: T, (num_times, NUM_RODS, 3), each held over CONTROL_TIME.
    """

    seed: int
    index: int
    family: str
    scene: Scene
    plane: str | None
    magnitude: float
    load: float
    fields: np.ndarray


def make_trial(seed: int, index: int) -> Trial:
    """The trial of this number; families take turns."""
    random = np.random.default_rng((seed, index))
    name = list(FAMILIES)[index % len(FAMILIES)]
    plane = "xz" if random.random() < 1.0 / 3.0 else None
    rod = _rod(random, FAMILIES[name])
    scene = Scene(
        rod=rod,
        magnets=_magnets(random, rod, FAMILIES[name]),
        gravity=_gravity(random, plane),
        drag_rate=[None, 1.0, 5.0, 10.0][random.integers(4)],
        spin_drag_rate=[None, 100.0][random.integers(2)],
    )
    load_of_one_tesla = sum(magnet.moment for magnet in scene.magnets) * rod.length / rod.bending_stiffness
    magnitude = min(log_uniform(random, *LOADS) / load_of_one_tesla, LARGEST_FIELD)
    courses = [field_course(random, plane is not None or k % 4 == 3) for k in range(NUM_RODS)]
    load, fields = magnitude * load_of_one_tesla, magnitude * np.stack(courses, axis=1)
    return Trial(
        seed=seed, index=index, family=name, scene=scene, plane=plane, magnitude=magnitude, load=load, fields=fields
    )


def field_course(random: np.random.Generator, planar: bool) -> np.ndarray:
    """A smooth course, at most 1 long, held over control steps, (num_times, 3): three sinusoids that rise from zero."""
    time = CONTROL_TIME * (np.arange(round(DURATION / CONTROL_TIME)) + 0.5)
    share = np.clip(time / random.uniform(0.1, 0.5), 0.0, 1.0)
    rise = share * share * (3.0 - 2.0 * share)
    directions = random.normal(size=(3, 3))
    if planar:
        directions[:, 1] = 0.0
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    frequencies, phases = random.uniform(0.0, 1.5, 3), random.uniform(0.0, 2.0 * math.pi, 3)
    course = rise[:, None] * (np.sin(2.0 * math.pi * np.outer(time, frequencies) + phases) @ directions)
    return course * random.uniform(0.5, 1.0) / np.linalg.norm(course, axis=1).max()


def _rod(random: np.random.Generator, family: Family) -> Rod:
    return Rod.circular(
        length=random.uniform(*family.length),
        diameter=random.uniform(*family.diameter),
        density=random.uniform(*family.density),
        youngs_modulus=log_uniform(random, *family.youngs_modulus),
        poissons_ratio=random.uniform(*family.poissons_ratio),
    )


def _magnets(random: np.random.Generator, rod: Rod, family: Family) -> tuple[Magnet, ...]:
    """One to three: at the tip, and on 0.3 to 0.8 of the length, a tenth of it apart, where a third are opposed."""
    first, second = random.uniform(0.3, 0.8), random.uniform(0.3, 0.8)
    if abs(first - second) < 0.1:
        second = first + 0.1 if first < 0.55 else first - 0.1
    places = (1.0, first, second)[: random.integers(1, 4)]
    return tuple(_magnet(random, rod, family, place) for place in places)


def _magnet(random: np.random.Generator, rod: Rod, family: Family, place: float) -> Magnet:
    diameter = rod.width * random.uniform(*family.magnet_diameter)
    length = diameter * random.uniform(1.0, 2.0)
    opposed = place < 1.0 and random.random() < 1.0 / 3.0
    return Magnet.cylinder(
        position=place * rod.length,
        diameter=diameter,
        length=length,
        mass=MAGNET_DENSITY * math.pi / 4.0 * diameter**2 * length,
        remanence=random.uniform(1.2, 1.4),
        direction=(-1.0 if opposed else 1.0, 0.0, 0.0),
    )


def _gravity(random: np.random.Generator, plane: str | None) -> tuple[float, float, float] | None:
    """None for three in ten; else mostly downwards, for the rest in any direction."""
    kind = random.random()
    x, y, z = GRAVITY * direction(random, plane)
    if kind < 0.3:
        return None
    return (0.0, 0.0, -GRAVITY) if kind < 0.85 else (float(x), float(y), float(z))
