"""Twin experiments with the paper's prediction filter: the figures of docs/prediction_filter.md.

    python -m scripts.prediction_filter [--quick] [--json FILE]

The truth is a rod of three times the elements with Kelvin-Voigt damping, and in half of the rows a modulus 10 % higher,
of both of which the filter knows nothing. Cameras see it with noise of 0.05 mm. About four minutes.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from tqdm import tqdm

from magrod_env import Scene, Simulation, load_scene
from magrod_env.estimation import Measurement, PredictionFilter
from magrod_env.estimation.damping_law import GRAM_MILLIMETRE, paper_weights
from scripts import Report, Table
from scripts.estimation.twins import FINER, NOISE, stiffer

SCENE = load_scene("paper4_pdms_tip_magnet", modulus="effective")
TICK = 5e-3  # s: the truth is kept, and the field changes, this often
NUM_ELEMENTS = 6
UNKNOWN = {"damping": 1.0, "damping, E 10 % off": 1.1}
INTERNAL_DAMPING = 1e-3  # s
MIDDLE_TOO = (SCENE.rod.length / 2, SCENE.rod.length)
EVERY = tuple(SCENE.rod.length * k / NUM_ELEMENTS for k in range(1, NUM_ELEMENTS + 1))
TABLE_8 = "Table 8 of the paper, same rod (mean / max): 0.13-0.14 / 0.55-0.61 mm an axis; circle 0.59 / 1.20 mm."


class Motion(NamedTuple):
    """Field (3,) T against time, the field of the equilibrium at the start, and the plane of the motion."""

    field: Callable[[float], np.ndarray]
    start: tuple[float, float, float]
    plane: str | None


def circling(t: float) -> np.ndarray:
    """The paper's circle, one turn a second, raised over half a second."""
    share = min(t / 0.5, 1.0)
    turn = 14.5e-3 * share**2 * (3.0 - 2.0 * share)
    return np.array([0.0, turn * np.sin(2 * np.pi * t), 7.75e-3 + turn * np.cos(2 * np.pi * t)])


def jumping(t: float) -> np.ndarray:
    """Another field across the rod every quarter of a second, up to 20 mT."""
    return np.array([0.0, 0.0, np.random.default_rng(int(t / 0.25)).uniform(-20e-3, 20e-3)])


MOTIONS = {
    "release": Motion(lambda t: np.zeros(3), (0.0, 0.0, 25e-3), "xz"),
    "circle": Motion(circling, (0.0, 0.0, 7.75e-3), None),
    "sudden fields": Motion(jumping, (0.0, 0.0, 0.0), "xz"),
}


def true_scene(factor: float) -> Scene:
    """The truth: another modulus, and internal damping."""
    return stiffer(SCENE, factor).replace(internal_damping=INTERNAL_DAMPING)


@cache
def truth(motion: str, factor: float, duration: float) -> np.ndarray:
    """Positions at the nodes of the filter's rod, m, (ticks + 1, num_nodes, 3)."""
    field, start, plane = MOTIONS[motion]
    simulation = Simulation(true_scene(factor), num_elements=FINER * NUM_ELEMENTS, plane=plane)
    simulation.reset(start)
    seen = [simulation.positions[0, ::FINER]]
    for tick in range(round(duration / TICK)):
        simulation.advance(TICK, field=field((tick + 0.5) * TICK))
        seen.append(simulation.positions[0, ::FINER])
    return np.array(seen)


class Outcome(NamedTuple):
    """Distances in mm over all frames and noises; shares without unit."""

    mean: float
    largest: float
    forecast: float  # before the frame
    middle: float  # of the node half way
    scatter: float  # mean normalised innovation over its degrees of freedom
    tip_claim: float  # RMS error over the RMS standard deviation claimed
    middle_claim: float
    beyond: float  # share of the components of K that lie beyond m/T
    negative: float
    speed: float  # simulated over wall time, one rod

    @property
    def both(self) -> str:
        """Mean and largest, for a table."""
        return f"{self.mean:.2f} / {self.largest:.2f}"


def follow(
    motion: str,
    unknown: str,
    *,
    duration: float,
    noises: int,
    every: int = 2,
    late: int = 0,
    noise: float = NOISE,
    **options: Any,
) -> Outcome:
    """One truth followed by a batch of filters whose cameras differ in their noise.

    Args:
        motion, unknown: which truth.
        duration: s.
        noises: filters in the batch.
        every: ticks from frame to frame; 0 for no frames.
        late: ticks from exposure to the filter.
        noise: standard deviation of a coordinate, m.
        options: of the filter.
    """
    field, start, plane = MOTIONS[motion]
    seen, rng = truth(motion, UNKNOWN[unknown], duration), np.random.default_rng(0)
    options = {"num_elements": NUM_ELEMENTS, "plane": plane, "num_threads": 1, "on_failure": "report", **options}
    estimator = PredictionFilter(SCENE, num_rods=noises, **options)
    estimator.reset(start)
    nodes = np.rint(estimator.places / SCENE.rod.length * NUM_ELEMENTS).astype(int)
    inside = np.ones(3, bool) if plane is None else np.array([True, False, True])
    masses = estimator.node_masses[0, 1:, None]
    errors, claims, forecasts, scatter, dampings, spent = [], [], [], [], [], 0.0
    for tick in range(1, len(seen)):
        began = time.perf_counter()
        estimator.predict(field((tick - 0.5) * TICK), TICK)
        spent += time.perf_counter() - began
        if tick % max(every, 2):
            continue
        forecasts.append(np.linalg.norm(estimator.tip_position - seen[tick, -1], axis=-1))
        exposed = tick - late
        if every and exposed > 0:
            positions = seen[exposed, nodes] + noise * rng.normal(size=(noises, len(nodes), 3))
            frame = Measurement(positions=positions, covariance=noise**2 * np.eye(3), time=exposed * TICK)
            began = time.perf_counter()
            estimator.update(frame)
            spent += time.perf_counter() - began
            scatter.append(np.mean(estimator.normalised_innovation / estimator.innovation_dof))
            dampings.append(estimator.damping[:, 1:, inside] / masses * every * TICK)
        errors.append(estimator.positions - seen[tick])
        claims.append(estimator.uncertainty)
    distance, warm = np.linalg.norm(errors, axis=-1), len(errors) // 8
    half = NUM_ELEMENTS // 2
    rms = np.sqrt(np.sum(np.square(errors)[..., inside], axis=-1)[warm:].mean(axis=(0, 1)))
    claimed = np.sqrt(np.sum(np.square(claims)[..., inside], axis=-1)[warm:].mean(axis=(0, 1)))
    found = np.array(dampings) if dampings else np.zeros(1)
    return Outcome(
        1e3 * float(distance[..., -1].mean()),
        1e3 * float(distance[..., -1].max()),
        1e3 * float(np.mean(forecasts)),
        1e3 * float(distance[..., half].mean()),
        float(np.mean(scatter[warm:])) if scatter else 0.0,
        float(rms[-1] / claimed[-1]),
        float(rms[half] / claimed[half]),
        float(np.mean(np.abs(found) > 1.0 + 1e-9)),
        float(np.mean(found[found != 0.0] < 0.0)) if np.any(found) else 0.0,
        (len(seen) - 1) * TICK / spent,
    )


def estimators(report: Report, run: Callable[..., Outcome]) -> None:
    """What each way of using the law does to the tip's error."""
    ways = {
        "no frames": dict(every=0),
        "paper's law, extrapolated": dict(law="extrapolated"),
        "replay, K of the seen node": dict(damped="seen"),
        "replay, K of all nodes": dict(),
        "the same, tip and middle seen": dict(markers=MIDDLE_TOO),
        "the same, all nodes seen": dict(markers=EVERY),
    }
    columns = ("motion", "unknown", *ways)
    tips = Table("Tip error, mean / max, mm, at 100 Hz", columns, note=TABLE_8)
    middle = Table("Mean error half way along the rod, mm, at 100 Hz", columns)
    honest = Table(
        "Honesty of the uncertainty, tip seen at 100 Hz",
        ("motion", "unknown", "NIS/dof", "tip: RMS error/claim", "middle: RMS error/claim"),
    )
    for motion in tqdm(MOTIONS, desc="estimators", leave=False):
        for unknown in UNKNOWN:
            outcomes = {name: run(motion, unknown, **options) for name, options in ways.items()}
            tips.rows.append((motion, unknown, *(outcome.both for outcome in outcomes.values())))
            middle.rows.append((motion, unknown, *(outcome.middle for outcome in outcomes.values())))
            one = outcomes["replay, K of all nodes"]
            honest.rows.append((motion, unknown, one.scatter, one.tip_claim, one.middle_claim))
    for name, table in (("tips", tips), ("middle", middle), ("honesty", honest)):
        report.show(name, table)


def rates(report: Report, run: Callable[..., Outcome], worst: str) -> None:
    """Frame rate, latency and what runs between frames."""
    table = Table("Tip error against frame rate, mean / max, mm", ("rate, Hz", "motion", "replay", "extrapolated"))
    for every in (2, 4, 8):
        for motion in MOTIONS:
            both = (run(motion, worst, every=every, law=law).both for law in ("replay", "extrapolated"))
            table.rows.append((round(1 / (every * TICK)), motion, *both))
    report.show("rates", table)
    table = Table(
        "Tip error with late frames, mean / max, mm, at 100 Hz",
        ("latency, ms", "motion", "K = 0 after the frame", "last K held"),
        note="At the moment at which the frame arrives, after it was taken in.",
    )
    for late in (0, 2, 4):
        for motion in MOTIONS:
            both = (run(motion, worst, late=late, hold=hold).both for hold in (False, True))
            table.rows.append((round(1e3 * late * TICK), motion, *both))
    report.show("latency", table)


def weights(report: Report, run: Callable[..., Outcome], worst: str) -> None:
    """The weights, the paper's among them, and the bound."""
    R, W = paper_weights(1e5, 1e-1)
    sets: dict[str, dict[str, Any]] = {
        "paper's, read in g, mm, s": dict(measurement_weight=R, damping_weight=W),
        "paper's, read in mg, mm, s": dict(measurement_weight=R, damping_weight=W * GRAM_MILLIMETRE),
        **{f"noise, {spread} /s": dict(damping_spread=spread) for spread in (1.0, 5.0, 20.0, 100.0)},
        "no noise, 20 /s": dict(noise=0.0),
        "noise, 20 /s, bound 0.5": dict(largest_change=0.5),
        "noise, 20 /s, bound 2": dict(largest_change=2.0),
        "noise, 20 /s, no bound": dict(largest_change=1e9),
    }
    title = "Weights and bound: tip error, mean / max, mm, at 100 Hz"
    table = Table(title, ("weights", *MOTIONS, "K beyond m/T", "K negative"))
    for name, options in tqdm(sets.items(), desc="weights", leave=False):
        outcomes = [run(motion, worst, **options) for motion in MOTIONS]
        shares = (float(np.mean([getattr(one, kind) for one in outcomes])) for kind in ("beyond", "negative"))
        table.rows.append((name, *(one.both for one in outcomes), *shares))
    report.show("weights", table)


def rest(report: Report) -> None:
    """Hanging at rest with a modulus 10 % off: nothing moves, so nothing is corrected."""
    table = Table("At rest under gravity, E 10 % off: tip error, mm", ("frames", "tip error", "largest |K| T/m"))
    tip = Simulation(true_scene(1.1), num_elements=FINER * NUM_ELEMENTS).equilibrium().tip_position
    estimator, rng = PredictionFilter(SCENE, num_elements=NUM_ELEMENTS, plane="xz"), np.random.default_rng(0)
    estimator.reset((0.0, 0.0, 0.0))
    for frame in range(201):
        if frame % 50 == 0:
            off = 1e3 * float(np.linalg.norm(estimator.tip_position[0] - tip))
            largest = float(np.abs(estimator.damping[0, 1:] / estimator.node_masses[0, 1:, None]).max() * 2 * TICK)
            table.rows.append((frame, off, largest))
        estimator.predict((0.0, 0.0, 0.0), 2 * TICK)
        seen = (tip + NOISE * rng.normal(size=3))[None, None]
        estimator.update(Measurement(positions=seen, covariance=NOISE**2 * np.eye(3), time=estimator.time))
    report.show("rest", table)


def speeds(report: Report, duration: float, worst: str) -> None:
    """Simulated time over wall time of one filter on one core."""
    table = Table(
        "Speed of one filter, simulated over wall time, at 100 Hz", ("motion", "K of all nodes", "K of the tip")
    )
    for motion in MOTIONS:
        best = []
        for damped in ("all", "seen"):
            best.append(max(follow(motion, worst, duration=duration, noises=1, damped=damped).speed for _ in range(3)))
        table.rows.append((motion, *best))
    report.show("speeds", table)


def main(arguments: list[str] | None = None) -> None:
    """Run all experiments."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--quick", action="store_true", help="a fifth of a second and two noises")
    parser.add_argument("--json", type=Path, metavar="FILE", help="write the figures there")
    options = parser.parse_args(arguments)
    report = Report("scripts.prediction_filter", options.quick)
    duration, noises = (0.2, 2) if options.quick else (2.0, 8)

    def run(motion: str, unknown: str, **chosen: Any) -> Outcome:
        return follow(motion, unknown, duration=duration, noises=noises, **chosen)

    worst = list(UNKNOWN)[-1]
    estimators(report, run)
    rates(report, run, worst)
    weights(report, run, worst)
    rest(report)
    speeds(report, duration, worst)
    report.finish(options.json)


if __name__ == "__main__":
    main()
