"""Moving rods: errors against the reference, energy, and the order of accuracy in time and space."""

from __future__ import annotations

import math
import time
from itertools import pairwise

import numpy as np
from tqdm import tqdm

from magrod_env import Simulation
from scripts.accuracy import follow
from scripts.common.cases import CASES, TIMES, reference, reference_error, stored
from scripts.common.report import Report
from scripts.common.run import follow as run
from scripts.common.run import least_time, rms, samples, slope, whole_steps

HELICAL = (3, 4, 5, 6, 10, 20)  # elements
DECAY_LIMITS = {6: 0.15, 10: 0.04, 20: 0.006}  # mm: acceptance figures by elements
FIELD_LIMITS = {4: 0.03, 6: 0.006}
INTERVAL = 0.01  # s, between samples
TIMING = "Times: one rod on one core, the least of several runs, in ms a simulated second."
DRIVEN = {
    "rotating_field": "no gravity, drag 5 /s, field turning at 0.5 Hz",
    "gravity_rotating_field": "the same under gravity, E = 1.48 MPa",
    "two_magnet_free_decay": "two opposite magnets, gravity, drag 5 /s, upward field",
}


def error(found: np.ndarray | None, truth: np.ndarray | None) -> float | None:
    """RMS over time and magnets of the distance, mm; None if one diverged."""
    return None if found is None or truth is None else rms(found, truth)


def worst(found: np.ndarray | None, truth: np.ndarray) -> float | None:
    """Largest distance, mm."""
    return None if found is None else 1e3 * float(np.linalg.norm(found - truth, axis=-1).max())


def used_step(simulation: Simulation) -> float:
    """The step, µs, that divides a sampling interval."""
    return 1e6 * INTERVAL / whole_steps(INTERVAL, simulation.time_step)


def milliseconds(simulation: Simulation) -> float:
    """Run time, ms a simulated second, without a field."""
    simulation.reset()
    return 1e3 * least_time(lambda: simulation.advance(0.05)) / 0.05


def free_decay(report: Report, quick: bool) -> None:
    """(a) The undamped rod falls from straight: errors against the spectral solution and our own finest one."""
    scene, _ = CASES["free_decay"]
    truth, fine = reference("free_decay"), {}
    for elements in (20,) if quick else (40, 80):
        step = 0.5 * Simulation(scene, num_elements=elements).time_step
        fine[elements] = follow(Simulation(scene, num_elements=elements, time_step=step), None)
    finest = fine[max(fine)]
    runs: list[tuple[str, int, float | None]] = [("helical", n, None) for n in ((3, 6, 10) if quick else HELICAL)]
    runs += [("helical", n, 0.5) for n in ((6,) if quick else (3, 4, 6, 10))]
    runs += [("nodal", n, None) for n in ((10,) if quick else (10, 20))]
    agree = ", ".join(f"N = {n}: {error(found, truth):.2g} mm" for n, found in fine.items())
    between = "" if quick else f"; N = 40 from N = 80: {error(fine[40], fine[80]):.2g} mm"
    with report.table(
        "free_decay",
        "(a) Free decay: undamped, released straight, gravity across, 2 s",
        "element | N | step, µs | RMS, mm | largest, mm | RMS against own finest, mm | ms/s",
        "Helical first at the default step, which allows for a sudden field of 45 mT, then at half the bound without "
        f"field. Own finest solutions, at half the step, from the spectral one, RMS: {agree}{between}. The spectral "
        f"solution from its own coarser runs, largest: {1e3 * reference_error('free_decay'):.1g} mm. {TIMING}",
    ) as table:
        for element, elements, share in tqdm(runs, desc="free decay", leave=False):
            simulation = Simulation(scene, num_elements=elements, element=element)
            if share is not None:
                simulation.time_step = share * simulation.stable_time_step
            found = follow(simulation, None)
            errors = error(found, truth), worst(found, truth), error(found, finest)
            table.add(element, elements, used_step(simulation), *errors, milliseconds(simulation))
            if element == "helical" and share is None and elements in DECAY_LIMITS:
                limit = DECAY_LIMITS[elements]
                report.check("a", f"free decay, N={elements}: tip RMS", errors[0], limit, "mm")


def driven(report: Report, quick: bool) -> None:
    """(b) Rods in a field that changes in time, sampled in the middle of every step."""
    about = "; ".join(f"{name}: {title}" for name, title in DRIVEN.items())
    with report.table(
        "driven",
        f"(b) Rods in changing fields, {0.5 if quick else 2} s",
        "case | element | N | step, µs | RMS, mm | largest, mm | ms/s, field held | ms/s, this run",
        f"{about}. {TIMING} This run, once, calls a Python function for the field at every step.",
    ) as table:
        for name in ("gravity_rotating_field",) if quick else DRIVEN:
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
                whole = 1e3 * (time.perf_counter() - start) / float(times[-1])
                errors = error(found, truth), worst(found, truth)
                speeds = milliseconds(simulation), whole
                table.add(name, element, elements, used_step(simulation), *errors, *speeds)
                if name == "rotating_field" and element == "helical" and elements in FIELD_LIMITS:
                    limit = FIELD_LIMITS[elements]
                    report.check("b", f"rotating field, N={elements}: tip RMS", errors[0], limit, "mm")


def watched(simulation: Simulation) -> np.ndarray:
    """Energy and its kinetic part, J, and how far the rotations are from orthogonal."""
    rotations = simulation.rotations[0]
    skew = np.abs(rotations.transpose(0, 2, 1) @ rotations - np.eye(3)).max()
    return np.array([simulation.energy()[0], simulation.energies()["kinetic"][0], skew])


def energy(report: Report, quick: bool) -> None:
    """(c) Energy of the undamped rod over many steps, and how orthogonal its rotations stay."""
    with report.table(
        "energy",
        "(c) Energy of the undamped falling rod, N = 6, step 100 µs",
        "precision | steps | largest error | slope, 1/s | its standard error, 1/s | slope x duration | orthogonality",
        "Energies in units of the largest kinetic energy. Slope: straight line through the means of one-second "
        "pieces (quick: tenths). Orthogonality: largest entry of O'O - 1 over all sections and samples.",
    ) as table:
        for precision, seconds in (("float64", 2),) if quick else (("float64", 100), ("float32", 20)):
            simulation = Simulation(CASES["free_decay"][0], num_elements=6, time_step=1e-4, precision=precision)
            total, kinetic, skew = run(simulation, samples(seconds, INTERVAL), see=watched).seen.T
            errors = (total[1:] - total[0]) / kinetic.max()
            pieces = errors.reshape(-1, 10 if quick else 100).mean(axis=1)
            middle = (np.arange(len(pieces)) + 0.5) * (seconds / len(pieces))
            (rate, _), covariance = np.polyfit(middle, pieces, 1, cov=True)
            largest, drift = float(np.abs(errors).max()), float(abs(rate) * seconds)
            scatter, skewed = float(np.sqrt(covariance[0, 0])), float(skew[1:].max())
            table.add(precision, 10_000 * seconds, largest, float(rate), scatter, drift, skewed)
            if precision == "float64":
                bound = 1e-6 if quick else 1e-7  # the shorter the fit, the more the swing itself is in it
                report.check("c", f"energy error over {seconds} s", largest, 1e-5, "of the kinetic")
                report.check("c", f"energy drift over {seconds} s", drift, bound, "of the kinetic")
                report.check("c", "orthogonality", skewed, 1e-12)


def order_in_time(report: Report, quick: bool) -> None:
    """(d) The step halved again and again at N = 6, against the same rod at a tiny step."""
    times = TIMES[: 11 if quick else 51]

    def found(count: int) -> np.ndarray | None:
        return follow(Simulation(CASES["free_decay"][0], num_elements=6, time_step=INTERVAL / count), None, times)

    truth, counts = found(3200), (50, 100, 200, 400)
    steps = [INTERVAL / count for count in counts]
    errors = [error(found(count), truth) or math.nan for count in tqdm(counts, desc="order in time", leave=False)]
    orders = [None, *(math.log2(before / after) for before, after in pairwise(errors))]
    fitted = slope(steps, errors)
    with report.table(
        "order_in_time",
        f"(d) Order in time: free decay, N = 6, {times[-1]:g} s, against the same rod at a step of 3.125 µs",
        "step, µs | RMS, mm | order from the row above",
        f"Fitted order: {fitted:.3f}.",
    ) as table:
        table.rows += zip((1e6 * step for step in steps), errors, orders)
    report.check("d", "distance of the order in time from 2", abs(fitted - 2.0), 0.1)


def follow_finer(case: str, counts: tuple[int, ...]) -> list[float]:
    """RMS over time, mm, of a moving rod with more and more elements at a step of 20 µs, against the reference."""
    (scene, field), truth, times = CASES[case], reference(case), stored()[f"{case}_time"]
    errors = []
    for elements in tqdm(counts, desc=case, leave=False):
        found = follow(Simulation(scene, num_elements=elements, time_step=2e-5), field, times)
        if found is None:
            raise RuntimeError(f"{case} diverged with {elements} elements")
        errors.append(rms(found, truth))
    return errors


def successive_orders(counts: tuple[int, ...], errors: list[float]) -> list[float | None]:
    """Order of each error from the one before."""
    pairs = zip(pairwise(counts), pairwise(errors))
    return [None, *(math.log(coarse / fine) / math.log(after / before) for (before, after), (coarse, fine) in pairs)]


def order_in_space(report: Report, quick: bool) -> None:
    """(d) More and more elements at a small step, rotating field, against the spectral solution; not if quick."""
    if quick:
        return
    counts = (3, 4, 6, 8, 12)
    errors = follow_finer("rotating_field", counts)
    fitted = -slope(list(counts), errors)
    with report.table(
        "order_in_space",
        "(d) Order in space: rotating field, step 20 µs, against the spectral solution",
        "N | RMS, mm | order from the row above",
        f"Fitted order: {fitted:.2f}.",
    ) as table:
        table.rows += zip(counts, errors, successive_orders(counts, errors))
    report.check("d", "order in space, rotating field", fitted, 3.5, at_least=True)


def twisting_motion(report: Report, quick: bool) -> None:
    """(g) Moving rods with a tilted magnet: errors, and the order where the motion is smooth; not if quick."""
    if quick:
        return
    counts = (3, 4, 6, 8, 12)
    smooth, sudden = (follow_finer(case, counts) for case in ("tilted_rotating_field", "tilted_swing"))
    fitted = -slope(list(counts), smooth)
    with report.table(
        "twisting_motion",
        "(g) Rods that twist while they bend, moving: RMS, mm, step 20 µs, against the spectral solution",
        "N | tilted_rotating_field | order from the row above | tilted_swing",
        "The paper's rod of 1.48 MPa with a dipole of (10, 9, 0) mA m². tilted_rotating_field: no gravity, drag 5 /s, "
        f"field turning at 0.5 Hz, 1 s; fitted order: {fitted:.2f}. tilted_swing: undamped, released straight under "
        "gravity in a field of 5 mT upwards, 0.5 s.",
    ) as table:
        table.rows += zip(counts, smooth, successive_orders(counts, smooth), sudden)
    report.check("g", "order in space, tilted_rotating_field", fitted, 3.4, at_least=True)
