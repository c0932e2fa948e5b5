"""Scenes and set-ups of the comparison of error against run time (`scripts.error_vs_runtime`)."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from functools import cache
from itertools import pairwise
from typing import Any

import numpy as np

from magrod_env import Scene, Simulation, SimulationDiverged, load_scene
from magrod_env.magnetics import FieldCourse
from magrod_env.rod.layout import ELEMENT_ROWS, LENGTH, SPATIAL, SWAY, TILT, rows_of
from scripts import ROOT
from scripts.accuracy import CASES, ramp
from scripts.peers import Problem

RIGID = 1e9  # times GA: sections that do not tilt
REFERENCE = ROOT / "tests" / "reference" / "reference.npz"
SAMPLES = 201
HIDDEN = ("element", "precision", "plane", "num_rods", "integrator")  # settings that a line is named for
PARTS = (1, 2, 5, 20)  # of the time between two samples: steps of the implicit schemes
SHARES = (0.9, 0.7, 0.5)  # of the stable step, tried in turn
CONDITIONINGS = ((1.0, 4.0), (1.0, 16.0), (4.0, 9.0), (16.0, 33.0), (64.0, 129.0), (256.0, 513.0), (1024.0, 2049.0))


@dataclass(frozen=True)
class Trial:
    """A scene in motion: straight at time 0, at rest or with given velocities.

    ``field`` T of the time (s); ``velocity`` m/s, transverse (z), of the share of the length; ``finest`` elements of
    our own reference; ``magnitude`` T, strongest field;
    ``elements`` of every line, ``finer_elements`` of the best one alone.
    """

    name: str
    title: str
    scene: Scene
    field: Callable[[float], np.ndarray] | None = None
    duration: float = 2.0
    magnitude: float = 0.0
    plane: str | None = None
    velocity: float | None = None
    finest: int = 64
    peers: bool = False
    elements: tuple[int, ...] = (2, 3, 4, 6, 10, 20, 40)
    finer_elements: tuple[int, ...] = ()
    tolerances: tuple[float, ...] = (1e-3, 1e-4, 1e-5)  # m

    @property
    def times(self) -> np.ndarray:
        """Sampling times, s."""
        return np.linspace(0.0, self.duration, SAMPLES)

    @property
    def course(self) -> FieldCourse | None:
        """The field as samples every millisecond."""
        if self.field is None:
            return None
        times = np.linspace(0.0, self.duration, round(self.duration / 1e-3) + 1)
        return FieldCourse(times=times, fields=np.array([self.field(at) for at in times]))


@dataclass
class Setup:
    """One way of computing a trial: a line of the diagram and its resolution."""

    line: str
    settings: dict[str, Any] = field(default_factory=dict)
    step_share: float | None = None  # of the stable step; None: the simulation's own choice
    without: tuple[str, ...] = ()  # corrections left out: "flexibility", "masses"

    @property
    def resolution(self) -> str:
        """What tells it from the others of its line."""
        shown = {k: v for k, v in self.settings.items() if k not in HIDDEN}
        text = ", ".join(f"{name.replace('_', ' ')} {value:g}" for name, value in shown.items() if value is not True)
        return text + ("" if self.step_share is None else f", {self.step_share:g} of the bound")


def trials() -> list[Trial]:
    """The scenes compared."""
    round_rod = load_scene("paper4_pdms_tip_magnet")
    stiffer = load_scene("paper4_pdms_tip_magnet", modulus=1.48e6)
    rising = {name: CASES[name] for name in CASES}
    return [
        Trial(
            "free_decay",
            "free decay, undamped",
            round_rod.replace(drag_rate=None),
            plane="xz",
            peers=True,
            finer_elements=(80, 160),
        ),
        Trial(
            "rotating_field",
            "rotating field, damped",
            *rising["rotating_field"],
            magnitude=17e-3,
            peers=True,
            finest=48,
            finer_elements=(80, 160),
        ),
        Trial(
            "gravity_rotating_field",
            "circle: gravity and rotating field",
            *rising["gravity_rotating_field"],
            magnitude=17e-3,
            peers=True,
            finer_elements=(80, 160),
        ),
        Trial(
            "two_magnet_free_decay",
            "two magnets, rising field",
            *rising["two_magnet_free_decay"],
            magnitude=10e-3,
            plane="xz",
            elements=(3, 4, 6, 10, 20, 40),
        ),
        Trial(
            "fast_step",
            "sudden field of 10 mT",
            stiffer.replace(drag_rate=5.0),
            lambda at: np.array([0.0, 0.0, 10e-3]),
            magnitude=10e-3,
            plane="xz",
        ),
        Trial(
            "aluminium",
            "aluminium rod, first mode (paper 1)",
            load_scene("paper1_aluminium_in_plane"),
            duration=0.5,
            plane="xz",
            velocity=2.3,
            finest=32,
            elements=(2, 3, 4, 6, 10, 20),
        ),
        Trial(
            "niti",
            "NiTi wire, 20 mT rotating",
            load_scene("niti_guidewire"),
            lambda at: 20e-3 * ramp(2.0 * at) * np.array([0.0, math.cos(2 * math.pi * at), math.sin(2 * math.pi * at)]),
            duration=1.0,
            magnitude=20e-3,
            finest=24,
            elements=(2, 3, 4, 6, 10),
            tolerances=(1e-3, 1e-4),  # 1e-5 takes minutes to choose
        ),
    ]


def setups(trial: Trial, quick: bool) -> Iterator[Setup]:
    """The lines of a trial, from the paper's element to everything left out that the scene does not need."""
    counts = trial.elements[1:4:2] if quick else trial.elements
    longest = {"step_share": SHARES[0]}
    for n in counts:
        yield Setup("helical, default step", {"num_elements": n})
        yield Setup("helical", {"num_elements": n}, **longest)
        yield Setup("helical, float32", {"num_elements": n, "precision": "float32"}, **longest)
        yield Setup("helical, batch of 64, per rod", {"num_elements": n, "num_rods": 64}, **longest)
        if trial.plane:
            yield Setup("helical, planar", {"num_elements": n, "plane": trial.plane}, **longest)
        if n > 2:
            yield Setup("helical, no corrections", {"num_elements": n}, **longest, without=("flexibility", "masses"))
            yield Setup("helical, flexibility only", {"num_elements": n}, **longest, without=("masses",))
            yield Setup("helical, masses only", {"num_elements": n}, **longest, without=("flexibility",))
        if n <= 10:
            for name, line in (("implicit", "helical, implicit"), ("implicit4", "helical, implicit, order 4")):
                for parts in PARTS[1:2] if quick else PARTS:
                    step = trial.duration / (SAMPLES - 1) / parts
                    yield Setup(line, {"num_elements": n, "integrator": name, "time_step": step})
            for axial, rotary in CONDITIONINGS[1:3] if quick else CONDITIONINGS:
                chosen = {"num_elements": n, "axial_softening": axial, "rotary_scaling": rotary}
                yield Setup("helical, conditioned", chosen, **longest)
    for n in trial.finer_elements if not quick else ():
        yield Setup(
            "helical, planar" if trial.plane else "helical", {"num_elements": n, "plane": trial.plane}, **longest
        )
    for n in (10,) if quick else (10, 20, 40, 80):
        if n <= 2 * trial.elements[-1]:
            yield Setup("nodal (paper)", {"num_elements": n, "element": "nodal"}, **longest)
            shaped = {"num_elements": n, "element": "nodal", "frequency_shaping": True}
            yield Setup("nodal, frequency shaping (paper)", shaped, **longest)
    for tolerance in trial.tolerances[:1] if quick else trial.tolerances:
        yield Setup("tolerance", {"tolerance": tolerance, "expected_field": max(trial.magnitude, 1e-3)})


def build(trial: Trial, setup: Setup) -> Simulation:
    """The simulation of a set-up."""
    simulation = Simulation(trial.scene, num_threads=1, **setup.settings)
    if setup.without:
        _leave_out(simulation, setup.without)
    if setup.step_share is not None:
        simulation.time_step = setup.step_share * simulation.stable_time_step_in(trial.magnitude)
    return simulation


def _leave_out(simulation: Simulation, names: tuple[str, ...]) -> None:
    """Undo corrections of the helical element in the rows of the kernels: GA for GA*, half lengths for end weights."""
    rod, arc = simulation.scene.rod, simulation.arc_lengths
    carried = np.zeros(len(arc))
    carried[:-1] += 0.5 * np.diff(arc)
    carried[1:] += 0.5 * np.diff(arc)
    layout = simulation.rods.batch.layout
    masses = rod.mass_per_length * carried
    for magnet, node in zip(simulation.scene.magnets, simulation.magnet_nodes):
        masses[node] += magnet.mass
    static = rows_of(simulation.rods.model.static._block[None], len(simulation.rods.model.static.terms.lanes))
    for rows, sizes in ((simulation.rods.batch.rows, layout), (static, simulation.rods.model.static.layout)):
        if "flexibility" in names:
            for element in range(layout.num_elements):
                first = sizes.elements + ELEMENT_ROWS * element
                rows[:, first + TILT], rows[:, first + SWAY] = RIGID * rod.shear_stiffness, 0.0
                assert np.allclose(rows[:, sizes.elements + ELEMENT_ROWS * element + LENGTH], np.diff(arc)[element])
        if "masses" in names:
            for node in range(1, layout.num_elements + 1):
                row = sizes.nodes + SPATIAL.size * node
                rows[:, row + SPATIAL.inverse_mass] = 1.0 / masses[node]
                inertia = rod.rotary_inertia_per_length * carried[node]
                rows[:, row + SPATIAL.compliance] = 0.25 / inertia
                rows[:, row + SPATIAL.compliance + 1] = 0.5 / inertia
    simulation.__dict__.pop("stable_time_step", None)  # that of the rod before


def begin(simulation: Simulation, trial: Trial) -> None:
    """Straight, at rest or with the trial's velocities."""
    simulation.reset()
    if trial.velocity is None:
        return
    length = trial.scene.rod.length
    share = simulation.arc_lengths / length
    velocities = np.zeros((simulation.num_rods, len(share), 3))
    turning = np.zeros_like(velocities)
    velocities[..., 2] = trial.velocity * (6.0 * share**2 - 4.0 * share**3 + share**4) / 3.0
    turning[..., 1] = -trial.velocity * (12.0 * share - 12.0 * share**2 + 4.0 * share**3) / (3.0 * length)
    simulation.set_motion(velocities, turning)


def trace(simulation: Simulation, trial: Trial) -> np.ndarray | None:
    """Tip (SAMPLES, 3) m of the first rod; None if it diverged."""
    course, tips = trial.course, []
    begin(simulation, trial)
    try:
        tips.append(simulation.tip_position[0])
        for start, stop in pairwise(trial.times):
            simulation.advance(stop - start, course)
            tips.append(simulation.tip_position[0])
    except SimulationDiverged:
        return None
    return np.array(tips)


def wall(simulation: Simulation, trial: Trial, repeats: int) -> float | None:
    """Wall time of a simulated second and rod, s: the least of several runs; None if it diverged.

    In one piece the step is a little longer than in `trace`, where it divides the time between two samples.
    """
    course, least = trial.course, math.inf
    for _ in range(repeats):
        begin(simulation, trial)
        start = time.perf_counter()
        try:
            simulation.advance(trial.duration, course)
        except SimulationDiverged:
            return None
        least = min(least, time.perf_counter() - start)
    return least / trial.duration / simulation.num_rods


@cache
def independent(name: str) -> np.ndarray | None:
    """Tip (SAMPLES, 3) m by the independent spectral solver; None where there is none."""
    with np.load(REFERENCE) as stored:
        return stored[f"{name}_tip"] if f"{name}_tip" in stored else None


def own_finest(trial: Trial) -> np.ndarray:
    """Tip (SAMPLES, 3) m of our own finest run: default step, no conditioning."""
    tips = trace(Simulation(trial.scene, num_elements=trial.finest, num_threads=1), trial)
    if tips is None:
        raise RuntimeError(f"the finest run of {trial.name} diverged")
    return tips


def problem(trial: Trial) -> Problem:
    """The trial as other simulators take it."""
    rod = trial.scene.rod
    return Problem(
        length=rod.length,
        diameter=rod.width,
        density=rod.density,
        youngs_modulus=rod.youngs_modulus,
        poissons_ratio=rod.poissons_ratio,
        gravity=trial.scene.gravity,
        drag_rate=trial.scene.drag_rate,
        magnets=tuple((magnet.position, magnet.mass, magnet.dipole_moment) for magnet in trial.scene.magnets),
        field=trial.field,
        duration=trial.duration,
    )
