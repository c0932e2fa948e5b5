"""How exact the rod is, and what that costs: `python -m scripts.accuracy [--quick] [--json FILE] [--parts PART ...]`.

Errors in mm beside run times. The truth of the moving rods and of the equilibria is tests/reference/reference.npz, made
by a spectral-element solver that shares no code with this package; the rest are closed forms. Ends with the acceptance
figures, and with exit status 1 where one is not met. `--parts twist_and_tension` measures that part alone.
"""

from __future__ import annotations

import dataclasses
import math
import sys
import time
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from itertools import pairwise
from pathlib import Path
from typing import Literal

import numpy as np
import tyro
from tqdm import tqdm

from magrod_env import Magnet, Rod, Scene, Simulation, load_scene
from magrod_env.scenes.paper import PAPER_SCENES
from magrod_env.scenes.record import nodal_stiffening
from magrod_env.simulation import SimulationDiverged
from scripts import ROOT, Check, Report, Table, least_time

REFERENCE = ROOT / "tests" / "reference" / "reference.npz"
TIMES = np.linspace(0.0, 2.0, 201)
HELICAL = (3, 4, 5, 6, 10, 20)  # elements
DECAY_LIMITS = {6: 0.15, 10: 0.04, 20: 0.006}  # mm: acceptance figures by elements
FIELD_LIMITS = {4: 0.03, 6: 0.006}
LOADED_COUNTS = (1, 2, 3, 4, 6, 8, 10, 16, 20)
LOADED_LIMITS = {  # mm at the tip by elements: 1.3 times the errors of a prototype of the element, in NumPy
    "static_twist": {1: 0.118, 2: 0.0077, 4: 4.8e-4, 8: 3e-5, 16: 1.9e-6},
    "static_tilted_magnet": {4: 0.016, 6: 0.0034, 10: 5.1e-4, 20: 5.2e-5},
    "static_axial_magnet": {4: 0.0165, 6: 0.0035, 10: 5.1e-4, 20: 5e-5},
    "static_two_tilted_magnets": {4: 0.129, 6: 0.0286, 10: 0.0028, 20: 2.9e-4},
    "static_pull_slight": {4: 0.0037, 6: 0.0016, 10: 4.2e-4},
    "static_pull_straight": {1: 1e-9, 4: 1e-9, 20: 1e-9},  # exact
    "static_pull_aside": {4: 2.1, 6: 1.32, 10: 0.67, 20: 0.2},
    "static_sagging": {4: 9.5, 6: 4.8, 10: 1.65, 20: 0.23},
    "static_hanging": {4: 0.0107, 6: 0.0047, 10: 0.0017, 20: 4.3e-4},
    "static_wire_with_weight": {4: 0.24, 6: 0.135, 10: 0.056, 20: 0.0118},
}
LOADED_ORDERS = {"static_twist": 3.7, "static_tilted_magnet": 3.4}  # at least; the second has its weight at the nodes
TIMING = "Times: one rod on one core, the least of several runs, in ms a simulated second."

Field = Callable[[float], np.ndarray]
Part = Literal[
    "free_decay",
    "driven",
    "statics",
    "energy",
    "order_in_time",
    "order_in_space",
    "arc",
    "locking",
    "twist_and_tension",
]


@dataclass
class Args:
    """What to measure."""

    quick: bool = False
    """a small part of it, in seconds"""
    json: Path | None = None
    """where to write the numbers as JSON"""
    parts: tuple[Part, ...] = ()
    """which tables, in the order of the page; all of them by default"""


# ---- scenes and fields of the reference


def ramp(at: float) -> float:
    """Smoothstep from 0 at time 0 to 1 at 0.5 s."""
    x = min(at / 0.5, 1.0)
    return x * x * (3.0 - 2.0 * x)


def rotating_field(at: float) -> np.ndarray:
    """14.5 mT turning about x at 0.5 Hz, with 7.75 mT along x; T."""
    angle = math.pi * at
    return ramp(at) * np.array([7.75e-3, 14.5e-3 * math.cos(angle), 14.5e-3 * math.sin(angle)])


def vertical_field(at: float) -> np.ndarray:
    """10 mT upwards; T."""
    return ramp(at) * np.array([0.0, 0.0, 10e-3])


def sudden_field(at: float) -> np.ndarray:
    """10 mT upwards from the start; T."""
    return np.array([0.0, 0.0, 10e-3])


def guiding_field(at: float) -> np.ndarray:
    """20 mT turning about x at 1 Hz, after a smooth rise of 0.25 s; T."""
    angle = 2.0 * math.pi * at
    return ramp(2.0 * at) * np.array([0.0, 20e-3 * math.cos(angle), 20e-3 * math.sin(angle)])


def upward_field(at: float) -> np.ndarray:
    """5 mT upwards from the start; T."""
    return np.array([0.0, 0.0, 5e-3])


def magnet(position: float, dipole: tuple[float, float, float], mass: float = 0.0) -> Magnet:
    """A magnet (kg, at a position in m) with a dipole moment (A m^2, body frame) in any direction."""
    moment = math.hypot(*dipole)
    return Magnet.dipole(position=position, moment=moment, mass=mass, direction=dipole if moment else (1.0, 0.0, 0.0))


_ROUND = load_scene("paper4_pdms_tip_magnet")
_STIFFER = load_scene("paper4_pdms_tip_magnet", modulus=1.48e6)
_TWO = load_scene("paper6_two_magnets", modulus=3.65e6)
_TILTED = _STIFFER.replace(magnets=(magnet(_STIFFER.rod.length, (0.010, 0.009, 0.0), 9.6e-5),))
CASES: dict[str, tuple[Scene, Field | None]] = {
    "free_decay": (_ROUND.replace(drag_rate=None), None),
    "rotating_field": (_ROUND.replace(gravity=None, drag_rate=5.0), rotating_field),
    "gravity_rotating_field": (_STIFFER.replace(drag_rate=5.0), rotating_field),
    "two_magnet_free_decay": (_TWO.replace(drag_rate=5.0), vertical_field),
    "fast_step": (_STIFFER.replace(drag_rate=5.0), sudden_field),
    "aluminium": (load_scene("paper1_aluminium_in_plane"), None),
    "niti": (load_scene("niti_guidewire"), guiding_field),
    "tilted_rotating_field": (_TILTED.replace(gravity=None, drag_rate=5.0), rotating_field),
    "tilted_swing": (_TILTED.replace(drag_rate=None), upward_field),
}
STATICS = {
    "static_gravity": (0.0, 0.0, 0.0),
    "static_field_z": (0.0, 0.0, 14.5e-3),
    "static_field_yz": (0.0, 10e-3, 10e-3),
}
_DOWN, _ALONG = (0.0, 0.0, -9.81), (9.81, 0.0, 0.0)
_SOFT = Rod.circular(length=0.1, diameter=1e-3, density=1100.0, youngs_modulus=1e6, poissons_ratio=0.5)
_THIN = dataclasses.replace(_SOFT, length=60e-3, youngs_modulus=2e6)
_SILICONE = Rod.circular(length=0.15, diameter=2e-3, density=1070.0, youngs_modulus=0.15e6, poissons_ratio=0.5)
_PULL = Scene(rod=_SOFT, magnets=(magnet(0.1, (0.2, 0.0, 0.0)),))
_PULLING = np.diag([0.2, -0.1, -0.1])  # T/m
_TWO_TILTED = (
    magnet(85.5e-3, (0.007, 0.006, 0.004), 7.2e-5),
    magnet(49.4e-3, (-0.006, 0.007, 0.003), 7.2e-5),
)


@dataclass(frozen=True)
class Loaded:
    """An equilibrium to find: field (3,) T at the clamp and gradient (3, 3) T/m."""

    scene: Scene
    field: tuple[float, float, float] = (0.0, 0.0, 0.0)
    gradient: np.ndarray | None = None
    about: str = ""


LOADED = {
    "static_twist": Loaded(
        Scene(rod=_THIN, magnets=(magnet(60e-3, (2e-4 * math.sqrt(0.5), 2e-4 * math.sqrt(0.5), 0.0)),)),
        (0.0, 0.0, 1.5 * _THIN.bending_stiffness / (_THIN.length * 2e-4)),
        about="weightless rod of 60 x 1 mm, 2 MPa, magnet at 45 degrees to it, field across both",
    ),
    "static_tilted_magnet": Loaded(
        _TILTED, (3e-3, 8e-3, 10e-3), about="the paper's rod of 1.48 MPa, gravity, tilted magnet, field (3, 8, 10) mT"
    ),
    "static_axial_magnet": Loaded(
        _STIFFER, (3e-3, 8e-3, 10e-3), about="the same with the paper's magnet, along the rod"
    ),
    "static_two_tilted_magnets": Loaded(
        _TWO.replace(magnets=_TWO_TILTED),
        (4e-3, 6e-3, 8e-3),
        about="the paper's square rod, gravity, two tilted magnets, field (4, 6, 8) mT",
    ),
    "static_pull_slight": Loaded(
        _PULL.replace(magnets=(magnet(0.1, (0.01345, 0.0, 0.0)),)),
        (0.0, 0.0, 7.5e-6),
        _PULLING,
        "weightless rod of 100 x 1 mm, 1 MPa, magnet pulled by 0.2 T/m, stretch 0.3 %, 7.5 µT aside",
    ),
    "static_pull_straight": Loaded(_PULL, gradient=_PULLING, about="the same, stretch 5 %, nothing aside"),
    "static_pull_aside": Loaded(_PULL, (0.0, 0.0, 2e-3), _PULLING, "the same, 2 mT aside"),
    "static_sagging": Loaded(
        Scene(rod=_SILICONE, gravity=_DOWN), about="silicone, 150 x 2 mm, 0.15 MPa, sagging from horizontal"
    ),
    "static_hanging": Loaded(Scene(rod=_SILICONE, gravity=_ALONG), about="the same, hanging straight down"),
    "static_wire_with_weight": Loaded(
        Scene(
            rod=load_scene("niti_guidewire").rod,
            magnets=(magnet(0.1, (0.0, 0.0, 0.0), 1.6),),
            gravity=(9.81, 0.3, -0.4),
        ),
        about="nitinol wire of 100 x 0.35 mm with a weight of 1.6 kg, 3 degrees off the wire",
    ),
}
LOCKING_SCENES = (
    "paper3_pdms_no_magnet",
    "paper4_pdms_tip_magnet",
    "paper6_two_magnets",
    "paper1_aluminium_in_plane",
    "paper2_aluminium_out_of_plane",
)


def reference(name: str) -> np.ndarray:
    """Magnets' positions of a reference case, the tip's first, (times, magnets, 3) m."""
    with np.load(REFERENCE) as stored:
        return np.stack([stored[f"{name}_{key}"] for key in ("tip", "middle") if f"{name}_{key}" in stored], axis=1)


def reference_error(name: str) -> float:
    """Largest distance between the reference and its own coarser runs, m."""
    with np.load(REFERENCE) as stored:
        return max(float(stored[f"{name}_error_{kind}"]) for kind in ("space", "time"))


# ---- runs


def follow(simulation: Simulation, field: Field | None, times: np.ndarray = TIMES) -> np.ndarray | None:
    """Magnets' positions (times, magnets, 3) m from the straight rod at rest; None if the rod diverged."""
    simulation.reset()
    nodes = list(simulation.magnet_nodes)
    found = [simulation.positions[0, nodes]]
    try:
        for start, stop in pairwise(times):
            simulation.advance(stop - start, field)
            found.append(simulation.positions[0, nodes])
    except SimulationDiverged:
        return None
    return np.array(found)


def rms(found: np.ndarray | None, truth: np.ndarray | None) -> float | None:
    """Root mean square over time and magnets of the distance, mm."""
    if found is None or truth is None:
        return None
    return 1e3 * float(np.sqrt(np.mean(np.sum((found - truth) ** 2, axis=-1))))


def worst(found: np.ndarray | None, truth: np.ndarray) -> float | None:
    """Largest distance, mm."""
    return None if found is None else 1e3 * float(np.linalg.norm(found - truth, axis=-1).max())


def used_step(simulation: Simulation, interval: float = 0.01) -> float:
    """The step, s, that divides a sampling interval."""
    return interval / math.ceil(interval / simulation.time_step - 1e-9)


def milliseconds(simulation: Simulation) -> float:
    """Run time, ms a simulated second, without a field."""
    simulation.reset()
    return 1e3 * least_time(lambda: simulation.advance(0.05)) / 0.05


def slope(x: list[float], y: list[float]) -> float:
    """Exponent p of the fit y = c x^p."""
    return float(np.polyfit(np.log(x), np.log(y), 1)[0])


# ---- tables


def free_decay(report: Report, quick: bool) -> None:
    """(a) The undamped rod falls from straight: errors against the spectral solution and our own finest one."""
    scene, _ = CASES["free_decay"]
    truth = reference("free_decay")
    fine = {}
    for elements in (20,) if quick else (40, 80):
        step = 0.5 * Simulation(scene, num_elements=elements).time_step
        fine[elements] = follow(Simulation(scene, num_elements=elements, time_step=step), None)
    finest = fine[max(fine)]
    runs: list[tuple[str, int, float | None]] = [("helical", n, None) for n in ((3, 6, 10) if quick else HELICAL)]
    runs += [("helical", n, 0.5) for n in ((6,) if quick else (3, 4, 6, 10))]
    runs += [("nodal", n, None) for n in ((10,) if quick else (10, 20))]
    table = Table(
        "(a) Free decay: undamped, released straight, gravity across, 2 s",
        ("element", "N", "step, µs", "RMS, mm", "largest, mm", "RMS against own finest, mm", "ms/s"),
    )
    for element, elements, share in tqdm(runs, desc="free decay", leave=False):
        simulation = Simulation(scene, num_elements=elements, element=element)
        if share is not None:
            step = share * simulation.stable_time_step
            simulation = Simulation(scene, num_elements=elements, element=element, time_step=step)
        found = follow(simulation, None)
        step, error = 1e6 * used_step(simulation), rms(found, truth)
        row = (element, elements, step, error, worst(found, truth), rms(found, finest), milliseconds(simulation))
        table.rows.append(row)
        if element == "helical" and share is None and elements in DECAY_LIMITS:
            report.checks.append(Check("a", f"free decay, N={elements}: tip RMS", error, DECAY_LIMITS[elements], "mm"))
    agree = ", ".join(f"N = {n}: {rms(found, truth):.2g} mm" for n, found in fine.items())
    between = "" if quick else f"; N = 40 from N = 80: {rms(fine[40], fine[80]):.2g} mm"
    table.note = (
        "Helical first at the default step, which allows for a sudden field of 45 mT, then at half the bound without "
        f"field. Own finest solutions, at half the step, from the spectral one, RMS: {agree}{between}. The spectral "
        f"solution from its own coarser runs, largest: {1e3 * reference_error('free_decay'):.1g} mm. {TIMING}"
    )
    report.show("free_decay", table)


def driven(report: Report, quick: bool) -> None:
    """(b) Rods in a field that changes in time, sampled in the middle of every step."""
    titles = {
        "rotating_field": "no gravity, drag 5 /s, field turning at 0.5 Hz",
        "gravity_rotating_field": "the same under gravity, E = 1.48 MPa",
        "two_magnet_free_decay": "two opposite magnets, gravity, drag 5 /s, upward field",
    }
    table = Table(
        f"(b) Rods in changing fields, {0.5 if quick else 2} s",
        ("case", "element", "N", "step, µs", "RMS, mm", "largest, mm", "ms/s, field held", "ms/s, this run"),
    )
    for name in ("gravity_rotating_field",) if quick else titles:
        scene, field = CASES[name]
        times = TIMES[:51] if quick else TIMES
        truth = reference(name)[: len(times)]
        counts = (6,) if quick else ((2, 3, 4, 6, 10) if len(scene.magnets) == 1 else (4, 6, 10, 20))
        runs = [("helical", n) for n in counts] + ([] if quick else [("nodal", 10)])
        for element, elements in tqdm(runs, desc=name, leave=False):
            simulation = Simulation(scene, num_elements=elements, element=element)
            follow(simulation, field, times[:2])  # compiles
            start = time.perf_counter()
            found = follow(simulation, field, times)
            whole = 1e3 * (time.perf_counter() - start) / times[-1]
            step, error = 1e6 * used_step(simulation), rms(found, truth)
            row = (name, element, elements, step, error, worst(found, truth), milliseconds(simulation), float(whole))
            table.rows.append(row)
            if name == "rotating_field" and element == "helical" and elements in (limits := {4: 0.03, 6: 0.006}):
                report.checks.append(
                    Check("b", f"rotating field, N={elements}: tip RMS", error, limits[elements], "mm")
                )
    about = "; ".join(f"{name}: {title}" for name, title in titles.items())
    table.note = f"{about}. {TIMING} This run, once, calls a Python function for the field at every step."
    report.show("driven", table)


def statics(report: Report, quick: bool) -> None:
    """Equilibria against the reference, and the order in space that they show."""
    counts = (2, 3, 6, 10) if quick else (1, 2, 3, 4, 6, 10, 20)
    table = Table(
        "Equilibria of the rod of 1.48 MPa under gravity: distance of the tip, mm",
        ("element", "N", "no field", "14.5 mT up", "10 mT up and 10 mT aside", "ms for the last"),
    )
    with np.load(REFERENCE) as stored:
        truths = {name: stored[f"{name}_tip"] for name in STATICS}
    errors: dict[int, list[float]] = {}
    for element, elements in [("helical", n) for n in counts] + [("nodal", 10)]:
        simulation = Simulation(_STIFFER, num_elements=elements, element=element)
        found = [simulation.equilibrium(field) for field in STATICS.values()]
        row = [1e3 * float(np.linalg.norm(case.tip_position - truth)) for case, truth in zip(found, truths.values())]
        wall = least_time(partial(simulation.equilibrium, STATICS["static_field_yz"]), repeats=3)
        table.rows.append((element, elements, *row, 1e3 * wall))
        if element == "helical":
            errors[elements] = row
    fitted = [n for n in errors if n >= 3]
    order = -slope(fitted, [float(np.mean(errors[n])) for n in fitted])
    table.note = f"Order in space, fitted for N >= 3 to the mean of the three: {order:.2f}."
    report.show("statics", table)
    report.checks.append(Check("d", "order in space, equilibria", order, 3.5, "", at_least=True))


def energy(report: Report, quick: bool) -> None:
    """(c) Energy of the undamped rod over many steps, and how orthogonal its rotations stay."""
    table = Table(
        "(c) Energy of the undamped falling rod, N = 6, step 100 µs",
        (
            "precision",
            "steps",
            "largest error",
            "slope, 1/s",
            "its standard error, 1/s",
            "slope x duration",
            "orthogonality",
        ),
        note="Energies in units of the largest kinetic energy. Slope: straight line through the means of one-second "
        "pieces (quick: tenths). Orthogonality: largest entry of O'O - 1 over all sections and samples.",
    )
    scene, _ = CASES["free_decay"]
    for precision, seconds in (("float64", 2 if quick else 100), ("float32", 1 if quick else 20)):
        if quick and precision == "float32":
            continue
        simulation = Simulation(scene, num_elements=6, time_step=1e-4, precision=precision)
        start, found, kinetic, skewed = float(simulation.energy()[0]), [], 0.0, 0.0
        for _ in tqdm(range(100 * seconds), desc=f"energy, {precision}", leave=False):
            simulation.advance(0.01)
            found.append(float(simulation.energy()[0]) - start)
            kinetic = max(kinetic, float(simulation.energies()["kinetic"][0]))
            rotations = simulation.rotations[0]
            skewed = max(skewed, float(np.abs(rotations.transpose(0, 2, 1) @ rotations - np.eye(3)).max()))
        errors = np.array(found) / kinetic
        pieces = errors.reshape(-1, 10 if quick else 100).mean(axis=1)
        middle = (np.arange(len(pieces)) + 0.5) * (seconds / len(pieces))
        (rate, _), covariance = np.polyfit(middle, pieces, 1, cov=True)
        largest, drift = float(np.abs(errors).max()), float(abs(rate) * seconds)
        table.rows.append(
            (precision, 10_000 * seconds, largest, float(rate), float(np.sqrt(covariance[0, 0])), drift, skewed)
        )
        if precision == "float64":
            report.checks.append(Check("c", f"energy error over {seconds} s", largest, 1e-5, "of the kinetic"))
            bound = 1e-6 if quick else 1e-7  # the shorter the fit, the more the swing itself is in it
            report.checks.append(Check("c", f"energy drift over {seconds} s", drift, bound, "of the kinetic"))
            report.checks.append(Check("c", "orthogonality", skewed, 1e-12, ""))
    report.show("energy", table)


def order_in_time(report: Report, quick: bool) -> None:
    """(d) The step halved again and again at N = 6, against the same rod at a tiny step."""
    scene, _ = CASES["free_decay"]
    times = TIMES[: 11 if quick else 51]
    table = Table(
        f"(d) Order in time: free decay, N = 6, {times[-1]:g} s, against the same rod at a step of 3.125 µs",
        ("step, µs", "RMS, mm", "order from the row above"),
    )
    truth = follow(Simulation(scene, num_elements=6, time_step=0.01 / 3200), None, times)
    steps, errors = [], []
    for count in tqdm((50, 100, 200, 400), desc="order in time", leave=False):
        steps.append(0.01 / count)
        errors.append(rms(follow(Simulation(scene, num_elements=6, time_step=steps[-1]), None, times), truth))
        order = math.log2(errors[-2] / errors[-1]) if len(errors) > 1 else None
        table.rows.append((1e6 * steps[-1], errors[-1], order))
    fitted = slope(steps, errors)
    table.note = f"Fitted order: {fitted:.3f}."
    report.show("order_in_time", table)
    report.checks.append(Check("d", "distance of the order in time from 2", abs(fitted - 2.0), 0.1, ""))


def follow_finer(case: str, counts: tuple[int, ...]) -> list[float]:
    """RMS over time, mm, of a moving rod with more and more elements at a step of 20 µs, against the reference."""
    (scene, field), truth = CASES[case], reference(case)
    with np.load(REFERENCE) as stored:
        times = stored[f"{case}_time"]
    errors = []
    for elements in tqdm(counts, desc=case, leave=False):
        found = follow(Simulation(scene, num_elements=elements, time_step=2e-5), field, times)
        error = rms(found, truth)
        if error is None:
            raise RuntimeError(f"{case} diverged with {elements} elements")
        errors.append(error)
    return errors


def successive_orders(counts: tuple[int, ...], errors: list[float]) -> list[float | None]:
    """Order of each error from the one before."""
    pairs = zip(pairwise(counts), pairwise(errors))
    return [None, *(math.log(coarse / fine) / math.log(after / before) for (before, after), (coarse, fine) in pairs)]


def order_in_space(report: Report) -> None:
    """(d) More and more elements at a small step, rotating field, against the spectral solution."""
    counts = (3, 4, 6, 8, 12)
    errors = follow_finer("rotating_field", counts)
    table = Table(
        "(d) Order in space: rotating field, step 20 µs, against the spectral solution",
        ("N", "RMS, mm", "order from the row above"),
        list(zip(counts, errors, successive_orders(counts, errors))),
    )
    fitted = -slope(list(counts), errors)
    table.note = f"Fitted order: {fitted:.2f}."
    report.show("order_in_space", table)
    report.checks.append(Check("d", "order in space, rotating field", fitted, 3.5, "", at_least=True))


def arc(report: Report) -> None:
    """(e) A field across a rod without weight loads it with a couple alone: one element gives the exact arc."""
    rod, moment = _ROUND.rod, _ROUND.magnets[0].moment
    weightless = _ROUND.replace(gravity=(0.0, 0.0, 0.0))
    helical = Simulation(weightless, num_elements=1)
    nodal = Simulation(weightless, num_elements=1, element="nodal")
    table = Table(
        "(e) Couple on the tip, one element: distance of the tip from the exact arc, mm",
        ("field, mT", "angle, degrees", "helical", "nodal"),
        note="Exact: angle = m B L cos(angle) / EI, tip at L sin(angle)/angle and L (1 - cos(angle))/angle.",
    )
    largest = 0.0
    for field in (1e-3, 5e-3, 15e-3, 45e-3):
        load, low, high = moment * field * rod.length / rod.bending_stiffness, 0.0, 0.5 * math.pi
        for _ in range(60):
            angle = 0.5 * (low + high)
            low, high = (angle, high) if angle < load * math.cos(angle) else (low, angle)
        exact = rod.length / angle * np.array([math.sin(angle), 0.0, 1.0 - math.cos(angle)])
        found = [simulation.equilibrium((0.0, 0.0, field)).tip_position for simulation in (helical, nodal)]
        errors = [1e3 * float(np.linalg.norm(tip - exact)) for tip in found]
        table.rows.append((1e3 * field, math.degrees(angle), *errors))
        largest = max(largest, errors[0])
    report.show("arc", table)
    report.checks.append(Check("e", "arc of one element: tip", largest, 1e-9, "mm"))


def couple_scene(rod: Rod) -> Scene:
    """A rod that a field loads by a couple on its tip alone."""
    return Scene(rod=rod, magnets=(Magnet.dipole(position=rod.length, moment=1e-3),), gravity=(0.0, 0.0, 0.0))


def tip_stiffness(rod: Rod, element: str, elements: int) -> float:
    """Bending stiffness over the true one, from a couple that turns the tip by about a milliradian."""
    scene, flexibility = couple_scene(rod), rod.length / rod.bending_stiffness
    field = 1e-3 / (scene.magnets[0].moment * flexibility)
    tangent = Simulation(scene, num_elements=elements, element=element).equilibrium((0.0, 0.0, field)).tangents[-1]
    angle = math.atan2(tangent[2], tangent[0])
    return 1e-3 * math.cos(angle) / angle


def first_frequency(rod: Rod, element: str, elements: int) -> float:
    """Lowest natural frequency of the straight rod, Hz."""
    return float(Simulation(couple_scene(rod), num_elements=elements, element=element).natural_frequencies()[0])


def locking(report: Report, quick: bool) -> None:
    """(f) By what factor the paper's element is too stiff in bending."""
    table = Table(
        "(f) Locking of the paper's element: bending stiffness over the true one",
        (
            "scene",
            "N",
            "1 + GA h²/(4 EI)",
            "nodal, tip couple",
            "nodal, first frequency squared",
            "helical, tip couple",
        ),
        note="The first frequency is over that of 40 helical elements; it also has the element's lumped mass in it.",
    )
    worst_share = 0.0
    for name in tqdm(LOCKING_SCENES[:2] if quick else LOCKING_SCENES, desc="locking", leave=False):
        rod, elements = PAPER_SCENES[name].scene.rod, PAPER_SCENES[name].num_elements
        closed = nodal_stiffening(rod, elements)
        found = tip_stiffness(rod, "nodal", elements)
        squared = (first_frequency(rod, "nodal", elements) / first_frequency(rod, "helical", 40)) ** 2
        table.rows.append((name, elements, closed, found, squared, tip_stiffness(rod, "helical", elements)))
        worst_share = max(worst_share, abs(found / closed - 1.0))
    report.show("locking", table)
    report.checks.append(Check("f", "locking factor: largest relative distance", worst_share, 0.02, ""))


def loaded_error(case: str, elements: int) -> float:
    """Distance from the tip's reference, mm, of the equilibrium or of the last stable shape on the way to it."""
    loaded = LOADED[case]
    found = Simulation(loaded.scene, num_elements=elements).equilibrium(loaded.field, loaded.gradient)
    with np.load(REFERENCE) as stored:
        return 1e3 * float(np.linalg.norm(found.tip_position - stored[f"{case}_tip"]))


def fitted_order(errors: dict[int, float]) -> float | None:
    """Order in space for N >= 4; None where rounding is all there is."""
    fine = {n: error for n, error in errors.items() if n >= 4}
    return -slope(list(fine), list(fine.values())) if min(fine.values()) > 1e-9 else None


def loaded_rods(report: Report, quick: bool) -> None:
    """(g) Rods that twist while they bend and rods under tension: equilibria against the reference."""
    counts = (4, 6) if quick else LOADED_COUNTS
    table = Table(
        "(g) Rods that twist while they bend, and rods under tension: distance of the tip at rest, mm",
        ("case", *(f"N = {n}" for n in counts), "order"),
    )
    for case, loaded in tqdm(LOADED.items(), desc="twist and tension", leave=False):
        errors = {n: loaded_error(case, n) for n in counts if n >= len(loaded.scene.magnets)}
        order = fitted_order(errors)
        table.rows.append((case, *(errors.get(n) for n in counts), order))
        for n, limit in LOADED_LIMITS[case].items():
            if n in errors:
                report.checks.append(Check("g", f"{case}, N={n}: tip", errors[n], limit, "mm"))
        if case in LOADED_ORDERS and not quick:
            bound = LOADED_ORDERS[case]
            report.checks.append(Check("g", f"order in space, {case}", order, bound, "", at_least=True))
    about = "; ".join(f"{case}: {loaded.about}" for case, loaded in LOADED.items())
    table.note = f"{about}. Order in space: fitted for N >= 4. Where stability is lost on the way "
    table.note += "to the full load: the distance of the last stable shape."
    report.show("loaded_rods", table)


def twisting_motion(report: Report) -> None:
    """(g) Moving rods with a tilted magnet: errors, and the order where the motion is smooth."""
    counts = (3, 4, 6, 8, 12)
    smooth, sudden = (follow_finer(case, counts) for case in ("tilted_rotating_field", "tilted_swing"))
    table = Table(
        "(g) Rods that twist while they bend, moving: RMS, mm, step 20 µs, against the spectral solution",
        ("N", "tilted_rotating_field", "order from the row above", "tilted_swing"),
        list(zip(counts, smooth, successive_orders(counts, smooth), sudden)),
    )
    fitted = -slope(list(counts), smooth)
    table.note = (
        "The paper's rod of 1.48 MPa with a dipole of (10, 9, 0) mA m². tilted_rotating_field: no gravity, drag 5 /s, "
        f"field turning at 0.5 Hz, 1 s; fitted order: {fitted:.2f}. tilted_swing: undamped, released straight under "
        "gravity in a field of 5 mT upwards, 0.5 s."
    )
    report.show("twisting_motion", table)
    report.checks.append(Check("g", "order in space, tilted_rotating_field", fitted, 3.4, "", at_least=True))


def twist_and_tension(report: Report, quick: bool) -> None:
    """(g) Both tables; the moving rods take too long for a quick run."""
    loaded_rods(report, quick)
    if not quick:
        twisting_motion(report)


PARTS: dict[Part, Callable[[Report, bool], None]] = {
    "free_decay": free_decay,
    "driven": driven,
    "statics": statics,
    "energy": energy,
    "order_in_time": order_in_time,
    "order_in_space": lambda report, quick: None if quick else order_in_space(report),
    "arc": lambda report, quick: arc(report),
    "locking": locking,
    "twist_and_tension": twist_and_tension,
}


def measure(args: Args) -> Report:
    """Every table asked for, printed as it is ready."""
    report = Report("scripts.accuracy", args.quick)
    for part, show in PARTS.items():
        if not args.parts or part in args.parts:
            show(report, args.quick)
    return report


def main() -> None:
    """Measure and report."""
    args = tyro.cli(Args, description=__doc__)
    sys.exit(0 if measure(args).finish(args.json) else 1)


if __name__ == "__main__":
    main()
