"""Random scenes far beyond the usual ones, one for each seed."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from magrod_env import Magnet, Rod, Scene
from magrod_env.magnetics import dipole_moment
from scripts.common.cases import GRAVITY
from scripts.common.draws import direction, log_uniform

SMALL_TURN = (1e-2, 0.3)  # rad: how far a field beyond the critical one lies off the line against the dipole
COURSES = ("step", "reversal", "ramp", "antiparallel", "resonance", "turning", "flips", "random")
SUDDEN = ("flips", "random")  # courses with many sudden changes
WEIGHTS = (1.0, 1.0, 1.0, 1.0, 1.0, 1.0, 2.0, 1.5)  # of the courses
MOST_CHANGES = 60
HOLD = (0.05, 3.0)  # own times of the scene between sudden changes
FACTOR = (0.25, 2.0)  # of the default step that a given implicit one is


@dataclass(frozen=True)
class Kind:
    """What a kernel is compiled for. Scenes are drawn from few kinds, since each compiles for half a minute."""

    name: str
    magnets: int = 1
    gravity: bool = True
    drag: bool = False
    damping: bool = False
    element: str = "helical"
    plane: str | None = None
    precision: str = "float64"
    integrator: str = "explicit"
    weight: float = 1.0


KINDS = (
    Kind("one magnet", weight=3.0),
    Kind("one magnet, weightless", gravity=False, weight=2.0),
    Kind("no magnet", magnets=0),
    Kind("two magnets, drag", magnets=2, drag=True, weight=1.5),
    Kind("three magnets, drag", magnets=3, drag=True, weight=1.5),
    Kind("one magnet, internal damping", damping=True, weight=1.5),
    Kind("one magnet, planar", plane="xz", weight=1.5),
    Kind("two magnets, drag, planar", magnets=2, drag=True, plane="xz"),
    Kind("one magnet, nodal", element="nodal"),
    Kind("one magnet, nodal, planar", element="nodal", plane="xz", weight=0.5),
    Kind("one magnet, float32", precision="float32", weight=1.5),
    Kind("one magnet, internal damping, float32", damping=True, precision="float32"),
    Kind("one magnet, internal damping, planar", damping=True, plane="xz"),
    Kind("one magnet, internal damping, planar, float32", damping=True, plane="xz", precision="float32", weight=0.5),
    Kind("one magnet, implicit", integrator="implicit", weight=1.5),
    Kind("one magnet, implicit, planar", plane="xz", integrator="implicit", weight=0.5),
    Kind("one magnet, internal damping, implicit", damping=True, integrator="implicit"),
    Kind("two magnets, drag, implicit", magnets=2, drag=True, integrator="implicit"),
    Kind("two magnets, drag, internal damping, implicit", magnets=2, drag=True, damping=True, integrator="implicit"),
    Kind("one magnet, implicit4", integrator="implicit4", weight=1.5),
    Kind("two magnets, drag, implicit4", magnets=2, drag=True, integrator="implicit4"),
)
QUICK = ("one magnet", "one magnet, planar", "one magnet, nodal", "one magnet, float32", "one magnet, implicit")


@dataclass(frozen=True)
class Trial:
    """A scene, how it is driven and how it is resolved.

    Args:
        seed: makes the trial again.
        kind: of its kernel.
        scene: rod, magnets and loads.
        course: one of COURSES.
        field: magnitude, T, of the strongest field.
        first: world direction of the field, (3,).
        second: the other direction where the field turns, (3,).
        tuning: frequency of the field over the first natural one.
        hanging: start from the equilibrium under gravity, else straight.
        periods: to simulate, of the scene's own time (see `own_time`).
        num_elements: along the rod.
        share: of the bound in the strongest field that the step is, or of the default step that an implicit one is;
            None for the default step.
        told: whether the simulation is told of the strongest field (`expected_field`).
        axial_softening, rotary_scaling: conditioning.
        changes: s, when the field changes suddenly, increasing from 0, (K,); none in courses that are not SUDDEN.
        shares: of `field` along `first`, `second` and their normal from each change on, (K, 3).
    """

    seed: int
    kind: Kind
    scene: Scene
    course: str
    field: float
    first: np.ndarray
    second: np.ndarray
    tuning: float
    hanging: bool
    periods: float
    num_elements: int
    share: float | None
    told: bool
    axial_softening: float
    rotary_scaling: float
    changes: np.ndarray
    shares: np.ndarray

    def fields(self, times: np.ndarray, duration: float, period: float) -> np.ndarray:
        """Field (len(times), 3) T at some times (s) of a run of `duration` (s); `period` (s) of the first mode."""
        if self.course in SUDDEN:
            shares = self.shares[np.searchsorted(self.changes, times, side="right") - 1]
            return self.field * shares @ np.stack([self.first, self.second, np.cross(self.first, self.second)])
        x, phase = times / duration, 2.0 * math.pi * self.tuning * times / period
        along = {
            "step": np.ones_like(x),
            "reversal": np.where(x < 0.5, 1.0, -1.0),
            "ramp": x,
            "antiparallel": np.ones_like(x),
            "resonance": np.sin(phase),
            "turning": np.cos(phase),
        }[self.course]
        across = np.sin(phase) if self.course == "turning" else np.zeros_like(x)
        return self.field * (np.outer(along, self.first) + np.outer(across, self.second))


def first_period(scene: Scene) -> float:
    """Period, s, of the first bending mode of the straight rod, by Rayleigh's quotient of its shape under an end
    load.
    """
    rod, heavy = scene.rod, 33.0 / 140.0 * scene.rod.mass
    for magnet in scene.magnets:
        x = magnet.position / rod.length
        heavy += magnet.mass * (0.5 * x * x * (3.0 - x)) ** 2
    return 2.0 * math.pi * math.sqrt(heavy * rod.length**3 / (3.0 * rod.bending_stiffness))


def own_time(scene: Scene, field: float) -> float:
    """The first period, shortened by a field (T) and a weight that act more strongly than the bending stiffness, s."""
    rod, load = scene.rod, sum(magnet.moment for magnet in scene.magnets) * field * scene.rod.length
    if scene.gravity is not None:
        arms = 0.5 * rod.mass * rod.length + sum(magnet.mass * magnet.position for magnet in scene.magnets)
        load += np.linalg.norm(scene.gravity) * arms * rod.length
    return first_period(scene) / math.sqrt(1.0 + load / rod.bending_stiffness)


def draw(seed: int, quick: bool = False) -> Trial:
    """The trial of a seed; `quick` draws from fewer kinds and fewer elements."""
    rng = np.random.default_rng(seed)
    kinds = [kind for kind in KINDS if not quick or kind.name in QUICK]
    weights = np.array([kind.weight for kind in kinds])
    kind = kinds[rng.choice(len(kinds), p=weights / weights.sum())]
    rod = _rod(rng)
    magnets = _magnets(rng, rod, kind)
    gravity = tuple(GRAVITY * direction(rng, kind.plane)) if kind.gravity else None
    drag_rate = _rate(rng, rod, magnets) if kind.drag else None
    scene = Scene(rod=rod, magnets=magnets, gravity=gravity, drag_rate=drag_rate)
    num_elements = max(len(scene.segment_ends), int(log_uniform(rng, 1.0, 17.0 if quick else 65.0)))
    if kind.damping:
        scene = scene.replace(internal_damping=_damping(rng, scene, num_elements))
    course = COURSES[rng.choice(len(COURSES), p=np.array(WEIGHTS) / sum(WEIGHTS))]
    first = direction(rng, kind.plane)
    if course == "antiparallel" and magnets:
        against = -np.sum([magnet.dipole_moment for magnet in magnets], axis=0)
        if np.linalg.norm(against) > 0.0:
            turned = against / np.linalg.norm(against) + log_uniform(rng, *SMALL_TURN) * first
            first = turned / np.linalg.norm(turned)
    second = np.cross(first, (0.0, 1.0, 0.0)) if kind.plane else np.cross(first, direction(rng))
    second = second / np.linalg.norm(second)
    conditioned = rng.random() < 0.25
    field = _magnitude(rng, rod, magnets, course)
    periods = rng.uniform(1.0, 4.0) if rng.random() < 0.85 else log_uniform(rng, 4.0, 40.0)
    changes, shares = np.empty(0), np.empty((0, 3))
    if course in SUDDEN:
        holds = _holds(rng)
        changes, shares = np.cumsum([0.0, *holds[:-1]]), _shares(rng, course, len(holds), kind.plane)
        changes, periods = changes * own_time(scene, field), float(holds.sum())
    return Trial(
        seed=seed,
        kind=kind,
        scene=scene,
        course=course,
        field=field,
        first=first,
        second=second,
        tuning=rng.uniform(0.9, 1.1),
        hanging=bool(rng.random() < 0.25 and magnets),
        periods=periods,
        num_elements=num_elements,
        share=_share(rng, kind) if rng.random() < 0.4 else None,
        told=bool(rng.random() < 0.7),
        axial_softening=log_uniform(rng, 1.0, 1e4) if conditioned else 1.0,
        rotary_scaling=log_uniform(rng, 1.0, 1e4) if conditioned else 1.0,
        changes=changes,
        shares=shares,
    )


def _rod(rng: np.random.Generator) -> Rod:
    length, slenderness = log_uniform(rng, 5e-3, 0.5), log_uniform(rng, 3.0, 2000.0)
    is_round, density = rng.random() < 0.8, rng.uniform(900.0, 8000.0)
    modulus, ratio, width = log_uniform(rng, 1e3, 200e9), rng.uniform(0.0, 0.5), length / slenderness
    common = {"length": length, "density": density, "youngs_modulus": modulus, "poissons_ratio": ratio}
    return Rod.circular(diameter=width, **common) if is_round else Rod.square(edge=width, **common)


def _magnets(rng: np.random.Generator, rod: Rod, kind: Kind) -> tuple[Magnet, ...]:
    """Cylinders up to a few of the rod's diameters long, light to a hundred times the rod's mass; the first mostly at
    the tip.
    """
    magnets = []
    for number in range(kind.magnets):
        at_tip = number == 0 and rng.random() < 0.7
        position = rod.length * (1.0 if at_tip else rng.uniform(0.02, 0.999))
        volume = 0.25 * math.pi * (rng.uniform(0.2, 1.0) * rod.width) ** 2 * rng.uniform(0.3, 3.0) * rod.width
        along = (1.0, 0.0, 0.0) if rng.random() < 0.6 else tuple(direction(rng, kind.plane))
        if rng.random() < 0.3:
            along = tuple(-x for x in along)
        mass = 7500.0 * volume if rng.random() < 0.6 else rod.mass * log_uniform(rng, 1e-3, 100.0)
        moment = dipole_moment(rng.uniform(1.0, 1.4), volume)
        magnets.append(Magnet(position=position, moment=moment, mass=mass, direction=along))
    return tuple(magnets)


def _rate(rng: np.random.Generator, rod: Rod, magnets: tuple[Magnet, ...]) -> float:
    """Drag, 1/s: up to a hundredfold critical."""
    if rng.random() < 0.2:
        return 0.0
    return log_uniform(rng, 1e-2, 1e2) * 2.0 * math.pi / first_period(Scene(rod=rod, magnets=magnets))


def _damping(rng: np.random.Generator, scene: Scene, num_elements: int) -> float:
    """Kelvin-Voigt time, s, of a damping ratio up to three in the first mode, or up to ten in the highest."""
    rod = scene.rod
    highest = 2.0 * num_elements / rod.length * math.sqrt(rod.youngs_modulus / rod.density)
    if rng.random() < 0.3:
        return log_uniform(rng, 1e-3, 10.0) * 2.0 / highest
    return log_uniform(rng, 1e-4, 3.0) * first_period(scene) / math.pi


def _share(rng: np.random.Generator, kind: Kind) -> float:
    return rng.uniform(0.6, 0.99) if kind.integrator == "explicit" else log_uniform(rng, *FACTOR)


def _holds(rng: np.random.Generator) -> np.ndarray:
    """Own times between sudden changes, of equal length or scattered about their mean."""
    mean, count = log_uniform(rng, *HOLD), round(log_uniform(rng, 3.0, MOST_CHANGES))
    return np.full(count, mean) if rng.random() < 0.5 else mean * rng.uniform(0.2, 1.8, count)


def _shares(rng: np.random.Generator, course: str, count: int, plane: str | None) -> np.ndarray:
    """Shares of the strongest field along the axes of a trial, (count, 3): to and fro along the first, in half of the
    trials broken by the second axis or by none; or drawn anew, each alike in size, as an agent explores.
    """
    axes, shares = 2 if plane else 3, np.zeros((count, 3))
    if course == "random":
        shares[:, :axes] = rng.uniform(-1.0, 1.0, (count, axes)) / math.sqrt(axes)
        return shares
    shares[:, 0] = (-1.0) ** np.arange(count)
    if rng.random() < 0.5:
        kinds = rng.random(count)
        shares[kinds < 0.3] = 0.0
        shares[kinds < 0.15, 1] = rng.choice([-1.0, 1.0], int((kinds < 0.15).sum()))
    return shares


def _magnitude(rng: np.random.Generator, rod: Rod, magnets: tuple[Magnet, ...], course: str) -> float:
    """1 mT to 10 T; mostly about EI/(m L), at which a field against the dipole buckles the rod."""
    anywhere, relative = log_uniform(rng, 1e-3, 10.0), log_uniform(rng, 0.1, 10.0)
    if not magnets or (rng.random() < 0.3 and course != "antiparallel"):
        return anywhere
    largest = max(magnet.moment for magnet in magnets)
    if course == "antiparallel":
        relative = max(relative, 1.0 / relative)
    return float(np.clip(relative * rod.bending_stiffness / (largest * rod.length), 1e-3, 10.0))
