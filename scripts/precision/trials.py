"""Scenes and set-ups of the comparison of error against run time, and their runs."""

from __future__ import annotations

import math
import time
from collections.abc import Iterator
from dataclasses import dataclass, field

import numpy as np

from magrod_env import Scene, Simulation, SimulationDiverged
from magrod_env.magnetics import FieldCourse
from magrod_env.rod.layout import ELEMENT_ROWS, LENGTH, SPATIAL, SWAY, TILT
from scripts.common import run
from scripts.common.cases import CASES, stored
from scripts.common.run import Field, Options, follow

RIGID = 1e9  # times GA: sections that do not tilt
SAMPLES = 201
HIDDEN = ("element", "precision", "plane", "num_rods", "integrator")  # settings that a line is named for
PARTS = (1, 2, 5, 20)  # of the time between two samples: steps of the implicit schemes
SHARES = (0.9, 0.7, 0.5)  # of the stable step, tried in turn
CONDITIONINGS = ((1.0, 4.0), (1.0, 16.0), (4.0, 9.0), (16.0, 33.0), (64.0, 129.0), (256.0, 513.0), (1024.0, 2049.0))
FINER = (80, 160)  # elements
CORRECTIONS = {  # lines of the helical element without some of its corrections
    "helical, no corrections": ("flexibility", "masses"),
    "helical, flexibility only": ("masses",),
    "helical, masses only": ("flexibility",),
}


@dataclass(frozen=True)
class Trial:
    """A case in motion: straight at time 0, at rest or with given velocities.

    ``magnitude`` T, strongest field; ``velocity`` m/s, transverse (z), of the share of the length; ``finest`` elements
    of our own reference; ``elements`` of every line, ``finer_elements`` of the best one alone; ``tolerances`` m.
    """

    name: str
    title: str
    magnitude: float = 0.0
    plane: str | None = None
    duration: float = 2.0
    velocity: float | None = None
    finest: int = 64
    peers: bool = False
    elements: tuple[int, ...] = (2, 3, 4, 6, 10, 20, 40)
    finer_elements: tuple[int, ...] = ()
    tolerances: tuple[float, ...] = (1e-3, 1e-4, 1e-5)

    @property
    def scene(self) -> Scene:
        """Rod, magnets and loads."""
        return CASES[self.name][0]

    @property
    def field(self) -> Field | None:
        """Field, T, of the time, s."""
        return CASES[self.name][1]

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


TRIALS = (
    Trial("free_decay", "free decay, undamped", plane="xz", peers=True, finer_elements=FINER),
    Trial("rotating_field", "rotating field, damped", 17e-3, peers=True, finest=48, finer_elements=FINER),
    Trial("gravity_rotating_field", "circle: gravity and rotating field", 17e-3, peers=True, finer_elements=FINER),
    Trial("two_magnet_free_decay", "two magnets, rising field", 10e-3, "xz", elements=(3, 4, 6, 10, 20, 40)),
    Trial("fast_step", "sudden field of 10 mT", 10e-3, "xz"),
    Trial("aluminium", "aluminium rod, first mode (paper 1)", 0.0, "xz", 0.5, 2.3, 32, elements=(2, 3, 4, 6, 10, 20)),
    Trial(
        "niti",
        "NiTi wire, 20 mT rotating",
        20e-3,
        duration=1.0,
        finest=24,
        elements=(2, 3, 4, 6, 10),
        tolerances=(1e-3, 1e-4),  # 1e-5 takes minutes to choose
    ),
)


def trials() -> list[Trial]:
    """The scenes compared."""
    return list(TRIALS)


@dataclass(frozen=True)
class Setup:
    """One way of computing a trial: a line of the diagram and its resolution.

    step_share: of the stable step; None for the simulation's own choice. without: corrections left out.
    """

    line: str
    settings: Options = field(default_factory=Options)
    step_share: float | None = None
    without: tuple[str, ...] = ()

    @property
    def resolution(self) -> str:
        """What tells it from the others of its line."""
        shown = {k: v for k, v in self.settings.items() if k not in HIDDEN}
        text = ", ".join(f"{name.replace('_', ' ')} {value:g}" for name, value in shown.items() if value is not True)
        return text + ("" if self.step_share is None else f", {self.step_share:g} of the bound")


def setups(trial: Trial, quick: bool) -> Iterator[Setup]:
    """The lines of a trial, from the paper's element to everything left out that the scene does not need."""
    longest = SHARES[0]
    for n in trial.elements[1:4:2] if quick else trial.elements:
        yield Setup("helical, default step", {"num_elements": n})
        yield Setup("helical", {"num_elements": n}, longest)
        yield Setup("helical, float32", {"num_elements": n, "precision": "float32"}, longest)
        yield Setup("helical, batch of 64, per rod", {"num_elements": n, "num_rods": 64}, longest)
        if trial.plane:
            yield Setup("helical, planar", {"num_elements": n, "plane": trial.plane}, longest)
        for line, without in CORRECTIONS.items() if n > 2 else ():
            yield Setup(line, {"num_elements": n}, longest, without)
        if n <= 10:
            yield from _soft_or_implicit(trial, n, quick)
    for n in trial.finer_elements if not quick else ():
        line = "helical, planar" if trial.plane else "helical"
        yield Setup(line, {"num_elements": n, "plane": trial.plane}, longest)
    for n in (10,) if quick else (10, 20, 40, 80):
        if n <= 2 * trial.elements[-1]:
            yield Setup("nodal (paper)", {"num_elements": n, "element": "nodal"}, longest)
            shaped: Options = {"num_elements": n, "element": "nodal", "frequency_shaping": True}
            yield Setup("nodal, frequency shaping (paper)", shaped, longest)
    for tolerance in trial.tolerances[:1] if quick else trial.tolerances:
        yield Setup("tolerance", {"tolerance": tolerance, "expected_field": max(trial.magnitude, 1e-3)})


def _soft_or_implicit(trial: Trial, n: int, quick: bool) -> Iterator[Setup]:
    for name, line in (("implicit", "helical, implicit"), ("implicit4", "helical, implicit, order 4")):
        for parts in PARTS[1:2] if quick else PARTS:
            step = trial.duration / (SAMPLES - 1) / parts
            yield Setup(line, {"num_elements": n, "integrator": name, "time_step": step})
    for axial, rotary in CONDITIONINGS[1:3] if quick else CONDITIONINGS:
        chosen: Options = {"num_elements": n, "axial_softening": axial, "rotary_scaling": rotary}
        yield Setup("helical, conditioned", chosen, SHARES[0])


def build(trial: Trial, setup: Setup) -> Simulation:
    """The simulation of a set-up."""
    simulation = run.build(trial.scene, setup.settings, num_threads=1)
    if setup.without:
        _leave_out(simulation, setup.without)
    if setup.step_share is not None:
        simulation.time_step = setup.step_share * simulation.stable_time_step_in(trial.magnitude)
    return simulation


def _leave_out(simulation: Simulation, names: tuple[str, ...]) -> None:
    """Undo corrections of the helical element in the rows of the kernels: GA for GA*, half lengths for end weights."""
    rod, arc = simulation.scene.rod, simulation.arc_lengths
    carried = 0.5 * (np.append(np.diff(arc), 0.0) + np.append(0.0, np.diff(arc)))
    masses = rod.mass_per_length * carried
    for magnet, node in zip(simulation.scene.magnets, simulation.magnet_nodes):
        masses[node] += magnet.mass
    batch, static = simulation.rods.batch, simulation.rods.model.static
    pairs = (batch.rows, batch.layout), (static.column[None, :, None], static.layout)
    for rows, sizes in pairs:
        for element, length in enumerate(np.diff(arc)) if "flexibility" in names else ():
            first = sizes.elements + ELEMENT_ROWS * element
            rows[:, first + TILT], rows[:, first + SWAY] = RIGID * rod.shear_stiffness, 0.0
            assert np.allclose(rows[:, first + LENGTH], length)
        for node in range(1, len(arc)) if "masses" in names else ():
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
    begin(simulation, trial)
    course = follow(simulation, trial.times, trial.course)
    return course.seen if course.whole else None


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


def independent(name: str) -> np.ndarray:
    """Tip (SAMPLES, 3) m by the independent spectral solver."""
    return stored()[f"{name}_tip"]


def own_finest(trial: Trial) -> np.ndarray:
    """Tip (SAMPLES, 3) m of our own finest run: default step, no conditioning."""
    tips = trace(Simulation(trial.scene, num_elements=trial.finest, num_threads=1), trial)
    if tips is None:
        raise RuntimeError(f"the finest run of {trial.name} diverged")
    return tips
