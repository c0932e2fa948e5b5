"""Twins: rods that stand for the real ones, finer and damped in ways that no estimator's model knows.

Helical truths have three times the elements, Kelvin-Voigt damping and quadratic air drag, and another integrator than
the models; nodal ones, the paper's element with frequency shaping, have the air drag alone, since that element has no
internal damping.
"""

from __future__ import annotations

import dataclasses
import math
from dataclasses import dataclass
from functools import cache, partial
from typing import TYPE_CHECKING

import numpy as np

from magrod_env import Scene, Simulation, load_scene
from magrod_env.estimation.measurement import marker_arc_lengths, marker_nodes
from magrod_env.scenes import PaperScene, paper_scene
from scripts.common.run import Field, Options, build, follow
from scripts.reproduction import runs
from scripts.reproduction.experiments import EXPERIMENTS, FIELDS, start_offset
from scripts.reproduction.printed import stated

if TYPE_CHECKING:
    from typing_extensions import Unpack

NOISE = 5e-5  # m, of each coordinate of a frame
AIR = 2.0  # 1/m: deceleration AIR |v| v; about ten times what air does to rods of 2 to 5 mm
FINER = 3  # times the elements of the estimators
STEP_SHARE = 0.2  # of a tick: the time step of helical truths
LOAD = 0.2  # of the rod's mass, hung to the tip halfway through a run


@dataclass(frozen=True)
class Case:
    """One of the paper's experiments as the estimators meet it.

    Args:
        number: of the experiment.
        duration: s, and in quick mode.
        rate: frames a second.
        ticks: instants from frame to frame at which errors are taken.
        num_elements: of the estimators' models.
        internal_damping: Kelvin-Voigt time of the truth, s.
        conditioning: axial_softening, rotary_scaling of the estimators' models, 1 for none.
        nodal_scaling: rotary_scaling of the nodal truth.
    """

    number: int
    durations: tuple[float, float]
    rate: int
    ticks: int = 4
    num_elements: int = 6
    internal_damping: float = 2e-3
    conditioning: tuple[float, float] = (1.0, 1.0)
    nodal_scaling: float = 1.0

    @property
    def record(self) -> PaperScene:
        """What the paper states."""
        return paper_scene(EXPERIMENTS[self.number - 1].name)

    @property
    def plane(self) -> str | None:
        """Of the motion."""
        return EXPERIMENTS[self.number - 1].plane

    @property
    def scene(self) -> Scene:
        """The estimators' scene: undamped, with the modulus that swings as the paper's rod where that is one."""
        if self.record.why_no_effective_modulus:
            return load_scene(self.record.name, modulus="printed")
        return load_scene(self.record.name, modulus="effective")

    @property
    def markers(self) -> tuple[float, ...]:
        """Arc lengths that the cameras see, m, the tip first: the magnets, else the tip alone."""
        return marker_arc_lengths(self.scene, "magnets" if len(self.scene.magnets) > 1 else "tip")

    @property
    def watched(self) -> tuple[float, ...]:
        """Arc lengths where errors are taken, m: the tip, and the middle magnet or the middle of the rod, unseen."""
        return self.markers if len(self.markers) > 1 else (*self.markers, 0.5 * self.scene.rod.length)

    @property
    def settings(self) -> Options:
        """Options of a model of this rod."""
        axial, rotary = self.conditioning
        options: Options = {"num_elements": self.num_elements, "plane": self.plane, "num_threads": 1}
        return {**options, "axial_softening": axial, "rotary_scaling": rotary}


CASES = (
    Case(1, (0.5, 0.06), 500, internal_damping=1e-5, conditioning=(64.0, 127.0), nodal_scaling=100.0),
    Case(2, (0.5, 0.06), 500, internal_damping=1e-5, conditioning=(256.0, 511.0), nodal_scaling=400.0),
    Case(3, (1.5, 0.3), 100),
    Case(4, (2.0, 0.3), 100),
    Case(5, (4.0, 0.3), 100),
    Case(6, (7.5, 0.3), 100, conditioning=(4.0, 9.0)),
)


@dataclass(frozen=True)
class Truth:
    """Which truth: factor on the modulus, element, and whether a load comes halfway."""

    factor: float = 1.0
    element: str = "helical"
    load: bool = False

    @property
    def name(self) -> str:
        """For a table."""
        words = f"{self.element}, E x {self.factor:g}"
        return words + ", load" if self.load else words


@dataclass(frozen=True)
class Twin:
    """A truth in time.

    Args:
        times: (ticks + 1,) s.
        fields: of each tick, (ticks, 3) T.
        positions, velocities: of the watched points, (ticks + 1, points, 3) m, m/s.
    """

    times: np.ndarray
    fields: np.ndarray
    positions: np.ndarray
    velocities: np.ndarray


def stiffer(scene: Scene, factor: float) -> Scene:
    """The scene with another Young's modulus."""
    return scene.replace(rod=dataclasses.replace(scene.rod, youngs_modulus=scene.rod.youngs_modulus * factor))


def with_load(scene: Scene, share: float) -> Scene:
    """The scene with a share of its mass added to the magnet at the tip."""
    tip, *others = scene.magnets
    return scene.replace(magnets=(dataclasses.replace(tip, mass=tip.mass + share * scene.mass), *others))


def brake(simulation: Simulation, duration: float) -> None:
    """Quadratic drag over `duration` (s), exactly, at fixed directions."""
    velocities = simulation.velocities
    speed = np.linalg.norm(velocities, axis=-1, keepdims=True)
    simulation.set_motion(velocities / (1.0 + AIR * speed * duration), simulation.angular_velocities)


def loaded(simulation: Simulation, **options: Unpack[Options]) -> Simulation:
    """The same rod in the same state with `LOAD` at its tip; options as for its `Simulation`."""
    heavier = Simulation(with_load(simulation.scene, LOAD), **options)
    heavier.reset(shape=(simulation.positions, simulation.rotations))
    heavier.set_motion(simulation.velocities, simulation.angular_velocities)
    return heavier


def start(case: Case, simulation: Simulation, stiffening: float = 1.0) -> None:
    """Put a model of the case where its experiment starts, at its time 0."""
    if case.number in (1, 2):
        runs.release(simulation, start_offset(case.record), stiffening)
    elif case.number == 4:
        runs.swing_to(simulation, math.radians(stated(case.record.initial_tip_deflection_deg)))
    elif case.number == 3:
        simulation.reset()
    else:
        simulation.reset(field_at(case)(0.0))


@cache
def model_start(case: Case, num_elements: int | None = None) -> Simulation:
    """The estimators' model where it takes the experiment to start; not to be changed."""
    elements = case.num_elements if num_elements is None else num_elements
    simulation = build(case.scene, case.settings, num_elements=elements)
    start(case, simulation)
    return simulation


def field_at(case: Case) -> Field:
    """Field (3,) T against time, s."""
    if case.number not in FIELDS:
        return lambda t: np.zeros(3)
    return FIELDS[case.number](case.record, case.durations[0])


def truth_options(case: Case, truth: Truth) -> Options:
    """How the truth is simulated."""
    options: Options = {"num_elements": FINER * case.num_elements, "num_threads": 1}
    if truth.element == "nodal":
        shaped: Options = {"element": "nodal", "frequency_shaping": True, "plane": case.plane}
        return {**options, **shaped, "rotary_scaling": case.nodal_scaling}
    return {**options, "integrator": "implicit", "time_step": STEP_SHARE / (case.rate * case.ticks)}


def watched(simulation: Simulation, nodes: np.ndarray) -> np.ndarray:
    """Positions and velocities of some nodes, (2, nodes, 3) m, m/s."""
    return np.stack([simulation.positions[0, nodes], simulation.velocities[0, nodes]])


@cache
def make(case: Case, truth: Truth, quick: bool) -> Twin:
    """Run a truth."""
    scene = stiffer(case.scene, truth.factor)
    if truth.element == "helical":
        scene = scene.replace(internal_damping=case.internal_damping)
    options = truth_options(case, truth)
    simulation = Simulation(scene, **options)
    start(case, simulation)
    field, tick = field_at(case), 1.0 / (case.rate * case.ticks)
    times = tick * np.arange(round(case.durations[quick] / tick) + 1)
    fields = np.array([field(at + 0.5 * tick) for at in times[:-1]])
    see = partial(watched, nodes=marker_nodes(simulation.arc_lengths, case.watched))
    half = len(fields) // 2 if truth.load else len(fields)
    seen = follow(simulation, times[: half + 1], fields[:half], see=see, after=brake).seen
    if truth.load:
        heavier = loaded(simulation, **options)
        seen = np.concatenate([seen, follow(heavier, times[half:], fields[half:], see=see, after=brake).seen[1:]])
    return Twin(times, fields, seen[:, 0], seen[:, 1])
