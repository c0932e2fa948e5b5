"""Twin experiments with the paper's prediction filter: the figures of docs/prediction_filter.md.

    python -m scripts.prediction_filter [--quick] [--json FILE]

The truth is a rod of three times the elements with Kelvin-Voigt damping, and in half of the rows a modulus 10 % higher,
of both of which the filter knows nothing. Cameras see it with noise of 0.05 mm. About four minutes.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import cache
from typing import TYPE_CHECKING, NamedTuple, TypedDict

import numpy as np
from tqdm import tqdm

from magrod_env import Scene, Simulation, load_scene
from magrod_env.estimation import Measurement, PredictionFilter
from magrod_env.estimation.damping_law import GRAM_MILLIMETRE, paper_weights
from scripts.common import run
from scripts.common.cases import smoothstep
from scripts.common.command import Options, main
from scripts.common.report import Report
from scripts.common.track import track
from scripts.estimation.twins import FINER, NOISE, stiffer

if TYPE_CHECKING:
    from typing_extensions import Unpack

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
    size = 14.5e-3 * smoothstep(2.0 * t)
    return np.array([0.0, size * np.sin(2 * np.pi * t), 7.75e-3 + size * np.cos(2 * np.pi * t)])


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


def fields_of(motion: str, duration: float) -> np.ndarray:
    """Field of every tick, (ticks, 3) T."""
    return np.array([MOTIONS[motion].field((tick + 0.5) * TICK) for tick in range(round(duration / TICK))])


@cache
def truth(motion: str, factor: float, duration: float) -> np.ndarray:
    """Positions at the nodes of the filter's rod, m, (ticks + 1, num_nodes, 3)."""
    _, start, plane = MOTIONS[motion]
    simulation = Simulation(true_scene(factor), num_elements=FINER * NUM_ELEMENTS, plane=plane)
    simulation.reset(start)
    fields, times = fields_of(motion, duration), run.samples(duration, TICK)
    return run.follow(simulation, times, fields, see=lambda rod: rod.positions[0, ::FINER]).seen


class FilterOptions(TypedDict, total=False):
    """Arguments of `PredictionFilter`."""

    law: str
    damped: str
    markers: tuple[float, ...]
    hold: bool
    measurement_weight: float
    damping_weight: float
    damping_spread: float
    largest_change: float


class Ways(FilterOptions, total=False):
    """How frames come, and what the filter makes of them.

    Args:
        every: ticks from frame to frame; 0 for no frames.
        late: ticks from exposure to the filter.
        noise: standard deviation of a coordinate, m.
    """

    every: int
    late: int
    noise: float


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


def follow(motion: str, unknown: str, *, duration: float, noises: int, **ways: Unpack[Ways]) -> Outcome:
    """One truth followed over a duration (s) by a batch of filters whose cameras differ in their noise.

    `motion` and `unknown` say which truth, `noises` how many filters.
    """
    every, late, noise = ways.pop("every", 2), ways.pop("late", 0), ways.pop("noise", NOISE)
    _, start, plane = MOTIONS[motion]
    seen, rng = truth(motion, UNKNOWN[unknown], duration), np.random.default_rng(0)
    options: run.Options = {"num_elements": NUM_ELEMENTS, "plane": plane, "num_threads": 1, "on_failure": "report"}
    estimator = PredictionFilter(SCENE, num_rods=noises, **options, **ways)  # type: ignore[misc]
    estimator.reset(start)
    nodes = np.rint(estimator.places / SCENE.rod.length * NUM_ELEMENTS).astype(int)
    inside = np.ones(3, bool) if plane is None else np.array([True, False, True])
    masses = estimator.node_masses[0, 1:, None]
    errors, claims, forecasts, scatter, dampings = [], [], [], [], []

    def frames(tick: int) -> list[Measurement]:
        exposed = tick - late
        if tick == 0 or not every or tick % every or exposed <= 0:
            return []
        positions = seen[exposed, nodes] + noise * rng.normal(size=(noises, len(nodes), 3))
        return [Measurement(positions=positions, covariance=noise**2 * np.eye(3), time=exposed * TICK)]

    def watch(tick: int, arrived: Sequence[Measurement] | None) -> None:
        if tick == 0 or tick % max(every, 2):
            return
        if arrived is None:
            forecasts.append(np.linalg.norm(estimator.tip_position - seen[tick, -1], axis=-1))
            return
        if arrived:
            scatter.append(np.mean(estimator.normalised_innovation / estimator.innovation_dof))
            dampings.append(estimator.damping[:, 1:, inside] / masses * every * TICK)
        errors.append(estimator.positions - seen[tick])
        claims.append(estimator.uncertainty)

    spent = track(estimator, fields_of(motion, duration), TICK, frames, watch)
    distance, warm, half = np.linalg.norm(errors, axis=-1), len(errors) // 8, NUM_ELEMENTS // 2
    rms, claimed = (
        np.sqrt(np.sum(np.square(values)[..., inside], axis=-1)[warm:].mean(axis=(0, 1))) for values in (errors, claims)
    )
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


Run = Callable[..., Outcome]
WORST = list(UNKNOWN)[-1]
WAYS: dict[str, Ways] = {
    "no frames": {"every": 0},
    "paper's law, extrapolated": {"law": "extrapolated"},
    "replay, K of the seen node": {"damped": "seen"},
    "replay, K of all nodes": {},
    "the same, tip and middle seen": {"markers": MIDDLE_TOO},
    "the same, all nodes seen": {"markers": EVERY},
}


def estimators(report: Report, run: Run) -> None:
    """What each way of using the law does to the tip's error."""
    found = {
        (motion, unknown): [run(motion, unknown, **ways) for ways in WAYS.values()]
        for motion in tqdm(MOTIONS, desc="estimators", leave=False)
        for unknown in UNKNOWN
    }
    columns = f"motion | unknown | {' | '.join(WAYS)}"
    with report.table("tips", "Tip error, mean / max, mm, at 100 Hz", columns, TABLE_8) as table:
        table.rows += [(*key, *(one.both for one in outcomes)) for key, outcomes in found.items()]
    with report.table("middle", "Mean error half way along the rod, mm, at 100 Hz", columns) as table:
        table.rows += [(*key, *(one.middle for one in outcomes)) for key, outcomes in found.items()]
    title = "Honesty of the uncertainty, tip seen at 100 Hz"
    columns = "motion | unknown | NIS/dof | tip: RMS error/claim | middle: RMS error/claim"
    with report.table("honesty", title, columns) as table:
        for key, outcomes in found.items():
            one = outcomes[list(WAYS).index("replay, K of all nodes")]
            table.add(*key, one.scatter, one.tip_claim, one.middle_claim)


def rates(report: Report, run: Run) -> None:
    """Frame rate, latency and what runs between frames."""
    columns = "rate, Hz | motion | replay | extrapolated"
    with report.table("rates", "Tip error against frame rate, mean / max, mm", columns) as table:
        for every in (2, 4, 8):
            for motion in MOTIONS:
                both = (run(motion, WORST, every=every, law=law).both for law in ("replay", "extrapolated"))
                table.add(round(1 / (every * TICK)), motion, *both)
    with report.table(
        "latency",
        "Tip error with late frames, mean / max, mm, at 100 Hz",
        "latency, ms | motion | K = 0 after the frame | last K held",
        "At the moment at which the frame arrives, after it was taken in.",
    ) as table:
        for late in (0, 2, 4):
            for motion in MOTIONS:
                both = (run(motion, WORST, late=late, hold=hold).both for hold in (False, True))
                table.add(round(1e3 * late * TICK), motion, *both)


def weights(report: Report, run: Run) -> None:
    """The weights, the paper's among them, and the bound."""
    R, W = paper_weights(1e5, 1e-1)
    sets: dict[str, Ways] = {
        "paper's, read in g, mm, s": {"measurement_weight": R, "damping_weight": W},
        "paper's, read in mg, mm, s": {"measurement_weight": R, "damping_weight": W * GRAM_MILLIMETRE},
        **{f"noise, {spread} /s": Ways(damping_spread=spread) for spread in (1.0, 5.0, 20.0, 100.0)},
        "no noise, 20 /s": {"noise": 0.0},
        "noise, 20 /s, bound 0.5": {"largest_change": 0.5},
        "noise, 20 /s, bound 2": {"largest_change": 2.0},
        "noise, 20 /s, no bound": {"largest_change": 1e9},
    }
    title = "Weights and bound: tip error, mean / max, mm, at 100 Hz"
    with report.table("weights", title, f"weights | {' | '.join(MOTIONS)} | K beyond m/T | K negative") as table:
        for name, ways in tqdm(sets.items(), desc="weights", leave=False):
            outcomes = [run(motion, WORST, **ways) for motion in MOTIONS]
            beyond, negative = ([getattr(one, kind) for one in outcomes] for kind in ("beyond", "negative"))
            table.add(name, *(one.both for one in outcomes), float(np.mean(beyond)), float(np.mean(negative)))


def rest(report: Report) -> None:
    """Hanging at rest with a modulus 10 % off: nothing moves, so nothing is corrected."""
    tip = Simulation(true_scene(1.1), num_elements=FINER * NUM_ELEMENTS).equilibrium().tip_position
    estimator, rng = PredictionFilter(SCENE, num_elements=NUM_ELEMENTS, plane="xz"), np.random.default_rng(0)
    estimator.reset((0.0, 0.0, 0.0))
    title, columns = "At rest under gravity, E 10 % off: tip error, mm", "frames | tip error | largest |K| T/m"
    with report.table("rest", title, columns) as table:

        def frames(k: int) -> list[Measurement]:
            if k == 0:
                return []
            seen = (tip + NOISE * rng.normal(size=3))[None, None]
            return [Measurement(positions=seen, covariance=NOISE**2 * np.eye(3), time=estimator.time)]

        def watch(k: int, arrived: Sequence[Measurement] | None) -> None:
            if arrived is not None and k % 50 == 0:
                off = 1e3 * float(np.linalg.norm(estimator.tip_position[0] - tip))
                share = np.abs(estimator.damping[0, 1:] / estimator.node_masses[0, 1:, None]).max()
                table.add(k, off, float(share * 2 * TICK))

        track(estimator, np.zeros((200, 3)), 2 * TICK, frames, watch)


def speeds(report: Report, duration: float) -> None:
    """Simulated time over wall time of one filter on one core."""

    def best(motion: str, damped: str) -> float:
        return max(follow(motion, WORST, duration=duration, noises=1, damped=damped).speed for _ in range(3))

    title = "Speed of one filter, simulated over wall time, at 100 Hz"
    with report.table("speeds", title, "motion | K of all nodes | K of the tip") as table:
        for motion in MOTIONS:
            table.add(motion, *(best(motion, damped) for damped in ("all", "seen")))


def measure(args: Options) -> Report:
    """All experiments; a fifth of a second and two noises if quick."""
    report = Report("scripts.prediction_filter", args.quick)
    duration, noises = (0.2, 2) if args.quick else (2.0, 8)

    def run(motion: str, unknown: str, **ways: Unpack[Ways]) -> Outcome:
        return follow(motion, unknown, duration=duration, noises=noises, **ways)

    estimators(report, run)
    rates(report, run)
    weights(report, run)
    rest(report)
    speeds(report, duration)
    return report


if __name__ == "__main__":
    main(Options, measure, __doc__, strict="never")
