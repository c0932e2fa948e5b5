"""Error against run time, beside other simulators: `python -m scripts.error_vs_runtime [--quick] [--json FILE]`.

For every scene: the tip's RMS error, mm, against the wall time of a simulated second on one core, for this package's
elements and options and for PyElastica, MuJoCo and SoRoMoX where they are installed (`pip install -e '.[peers]'`). A
run that diverges is an outcome and listed. Finished runs are kept in `--keep` as they come, and not done again.
"""

from __future__ import annotations

import dataclasses
import math
import time
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from tqdm import tqdm

from magrod_env.rod.threads import usable_cores
from scripts.common import run
from scripts.common.command import FigureOptions, main
from scripts.common.report import Report
from scripts.common.run import Options, rms
from scripts.common.store import Store
from scripts.peers import Problem, mujoco_chain, pyelastica, soromox
from scripts.precision import spectral, trials
from scripts.precision.outcomes import Outcome, cheapest, draw, front, key
from scripts.precision.trials import SHARES, Setup, Trial, build, independent, own_finest, setups, trace, wall

PEERS = (mujoco_chain, pyelastica, soromox)
LEVELS = (0.35, 0.06, 0.01)  # mm, at which run times are compared
RUN_COLUMNS = "simulator | set-up | resolution | error, mm | ms a simulated second"
BATCH_COLUMNS = "simulator | set-up | resolution | rods | error of one rod, mm | control steps/s"
BATCHES = ((2, 4.0, 9.0), (2, 16.0, 33.0), (3, 1.0, 16.0), (3, 4.0, 9.0), (3, 16.0, 33.0), (4, 4.0, 9.0), (6, 1.0, 4.0))
"""Elements, axial softening and rotary scaling of batches."""
OURS = (
    "helical",
    "helical, conditioned",
    "helical, planar",
    "helical, float32",
    "helical, implicit",
    "helical, implicit, order 4",
)


@dataclass
class Args(FigureOptions):
    """What to compare."""

    scene: tuple[str, ...] = ()
    """names of scenes; all where none is given, and two if quick"""
    peers: bool = True
    """run the other simulators that are installed"""
    keep: Path = Path("runs/error_vs_runtime.jsonl")
    """where finished runs are kept, one a line"""


Outcomes = Store[Outcome]


def of(outcomes: Outcomes, trial: Trial) -> list[Outcome]:
    """Those of one scene."""
    return [outcome for outcome in outcomes.results.values() if outcome.scene == trial.name]


def run_ours(trial: Trial, truth: np.ndarray, outcomes: Outcomes, quick: bool) -> None:
    """Every set-up of this package; a step that diverges is listed, and a shorter one tried."""
    for first in tqdm(list(setups(trial, quick)), desc=trial.name, leave=False):
        shares: Iterable[float | None] = (None,) if first.step_share is None else SHARES
        for share in shares:
            setup = dataclasses.replace(first, step_share=share)
            name = key(trial.name, "magrod", setup.line, setup.resolution)
            if outcomes.get(name, lambda: outcome_of(trial, setup, truth, quick)).error is not None:  # noqa: B023
                break


def outcome_of(trial: Trial, setup: Setup, truth: np.ndarray, quick: bool) -> Outcome:
    """Run a set-up of this package."""
    nothing = Outcome(trial.name, "magrod", setup.line, setup.resolution, None, None)
    try:
        simulation = build(trial, setup)
    except ValueError:  # a tolerance out of reach
        return nothing
    tips = trace(simulation, trial)
    spent = None if tips is None else wall(simulation, trial, 1 if quick else 5)
    return (
        nothing if tips is None or spent is None else dataclasses.replace(nothing, error=rms(tips, truth), wall=spent)
    )


def run_peers(trial: Trial, truth: np.ndarray, outcomes: Outcomes, quick: bool) -> None:
    """The other simulators, in their best set-ups; absent ones are named."""
    problem = Problem(trial.scene, trial.field)
    for peer in PEERS:
        if why := peer.available():
            print(f"{peer.NAME} is left out: {why}", flush=True)
            continue
        for setting in tqdm(peer.settings(problem, quick), desc=f"{trial.name}, {peer.NAME}", leave=False):
            words = (trial.name, peer.NAME, setting.label, setting.resolution)
            if key(*words) not in outcomes.results:
                done = peer.run(problem, setting, trial.times, 1 if quick else 2)
                spent = None if done.diverged else done.wall_per_second
                outcomes.keep(key(*words), Outcome(*words, done.error(truth), spent))


def run_spectral(trial: Trial, truth: np.ndarray, outcomes: Outcomes, quick: bool) -> None:
    """A high-order element, the reference's own, at growing degree: in all, and what its loads alone take."""
    if trial.name not in spectral.SCENES or any(o.who == spectral.NAME for o in of(outcomes, trial)):
        return
    for one in tqdm(spectral.runs(trial, quick), desc=f"{trial.name}, spectral", leave=False):
        for line, spent in ((spectral.WHOLE, one.wall), (spectral.LOADS, one.wall_of_loads)):
            done = Outcome(trial.name, spectral.NAME, line, one.resolution, rms(one.tip, truth), spent)
            outcomes.keep(done.key, done)


def show_scene(report: Report, trial: Trial, outcomes: list[Outcome], note: str) -> None:
    """Tables of one scene: every line's points, the diverged ones too, and those that nothing beats."""
    with report.table(trial.name, f"{trial.title}: every run", RUN_COLUMNS, note) as table:
        for each in sorted(outcomes, key=lambda o: (o.who != "magrod", o.who, o.line)):
            error = "diverged" if each.error is None else each.error
            table.add(each.who, each.line, each.resolution, error, each.milliseconds)
    alone = [o for o in outcomes if o.line not in ("helical, batch of 64, per rod", spectral.LOADS)]
    with report.table(f"{trial.name}_front", f"{trial.title}: what nothing beats", RUN_COLUMNS, note) as table:
        table.rows += [(o.who, o.line, o.resolution, o.error, o.milliseconds) for o in front(alone)]


def ours_within(outcomes: list[Outcome], level: float) -> Outcome | None:
    """Our quickest run of one rod within an error (mm)."""
    return cheapest((o for o in outcomes if o.who == "magrod" and o.line in OURS), level)


def compare(report: Report, tried: list[Trial], outcomes: Outcomes) -> None:
    """Run times at equal error, for every peer."""
    rows: list[tuple] = []
    for trial in tried:
        peers = [o for o in of(outcomes, trial) if o.who not in ("magrod", spectral.NAME)]
        for level in LEVELS:
            ours, other = ours_within(of(outcomes, trial), level), cheapest(peers, level)
            if ours is None or not peers:
                continue
            row = (trial.title, level, ours.milliseconds, f"{ours.line}, {ours.resolution}")
            if other is None:
                rows.append((*row, None, "-", None))
                continue
            name = f"{other.who} {other.line}, {other.resolution}"
            rows.append((*row, other.milliseconds, name, other.point[0] / ours.point[0]))
    if rows:
        title = "One rod on one core: least wall time, ms a simulated second, of runs within an error"
        columns = "scene | error, mm | magrod | with | best peer | with | peer over magrod"
        with report.table("equal_error", title, columns) as table:
            table.rows = rows


def high_order(report: Report, tried: list[Trial], outcomes: Outcomes) -> None:
    """Where the error of a high-order element costs less than the same error of the low-order ones."""
    rows = []
    for trial in tried:
        every = of(outcomes, trial)
        loads = {o.resolution: o for o in every if o.line == spectral.LOADS}
        for whole in [o for o in every if o.who == spectral.NAME and o.line != spectral.LOADS]:
            ours = ours_within(every, whole.point[1])
            told = (None, "-") if ours is None else (ours.milliseconds, f"{ours.line}, {ours.resolution}")
            row = (trial.title, whole.resolution, whole.error, whole.milliseconds)
            rows.append((*row, loads[whole.resolution].milliseconds, *told))
    if rows:
        with report.table(
            "high_order",
            "One spectral element against many helical ones, ms a simulated second",
            "scene | spectral element | error, mm | spectral | its loads alone | helical, as good | with",
            "Spectral: the reference solver with one element, compiled loads in SciPy's time loop, DOP853; its loads "
            "alone are what a compiled loop could come down to. Helical: the least wall time of runs within that "
            "error.",
        ) as table:
            table.rows = rows


def batches(report: Report, trial: Trial, truth: np.ndarray, quick: bool) -> None:
    """Control steps a second of many rods on all cores."""
    with report.table(
        "batches",
        "Many rods, rotating field, all cores: control steps a second (20 ms each)",
        BATCH_COLUMNS,
        "Between steps the field is set and the positions can be read.",
    ) as table:
        for n, axial, rotary in BATCHES[2:3] if quick else BATCHES:
            for precision in ("float32",) if quick else ("float32", "float64"):
                settings: Options = {"num_elements": n, "axial_softening": axial, "rotary_scaling": rotary}
                setup = Setup("helical, " + precision, {**settings, "precision": precision}, 0.7)
                single, rods = outcome_of(trial, setup, truth, True), 512 if quick else 8192
                many = dataclasses.replace(setup, settings={**setup.settings, "num_rods": rods})
                table.add("magrod", setup.line, single.resolution, rods, single.error, control_steps(trial, many))


def batches_of_peers(report: Report, trial: Trial, outcomes: Outcomes, rods: int = 256) -> None:
    """The same for the peers that can run many rods."""
    rows, problem = [], Problem(trial.scene, trial.field)
    for peer in PEERS:
        if peer.available() is not None:
            continue
        for setting in tqdm(peer.settings(problem, False), desc=f"batches, {peer.NAME}", leave=False):
            known = outcomes.results.get(key(trial.name, peer.NAME, setting.label, setting.resolution))
            if known is None or known.point[0] > 0.25 or known.point[1] > 0.6:
                continue
            try:
                speed = peer.run_batch(problem, setting, rods, 2)
            except (ValueError, NotImplementedError):
                continue
            rows.append((peer.NAME, setting.label, setting.resolution, rods, known.error, float(speed)))
    if rows:
        title = "Many rods of other simulators, rotating field, two threads: control steps a second (20 ms each)"
        with report.table("batches_of_peers", title, BATCH_COLUMNS) as table:
            table.rows = rows


def control_steps(trial: Trial, setup: Setup) -> float:
    """Control steps a second of a batch, the field set before each."""
    assert trial.field is not None and setup.step_share is not None
    simulation = run.build(trial.scene, setup.settings, num_threads=usable_cores())
    simulation.time_step = setup.step_share * simulation.stable_time_step_in(trial.magnitude)
    fields, least = [trial.field(0.02 * k) for k in range(1, 51)], math.inf
    for _ in range(5):
        simulation.reset()
        start = time.perf_counter()
        for field in fields:
            simulation.advance(0.02, field)
        least = min(least, time.perf_counter() - start)
    return len(fields) * simulation.num_rods / least


def truth_of(trial: Trial) -> tuple[np.ndarray, str]:
    """The reference of a trial and what it is worth."""
    truth = independent(trial.name)
    gap = f"our own run with {trial.finest} elements lies {rms(own_finest(trial), truth):.2g} mm (RMS) from it."
    return truth, f"Reference: independent spectral solver; {gap}"


def measure(args: Args) -> Report:
    """Every scene."""
    report = Report(
        "scripts.error_vs_runtime", args.quick, "precision.md", unlisted=tuple(trial.name for trial in trials())
    )
    outcomes: Outcomes = Store(None if args.quick else args.keep, Outcome)
    names = args.scene or (("free_decay", "rotating_field") if args.quick else ())
    tried = [trial for trial in trials() if not names or trial.name in names]
    for trial in tqdm(tried, desc="scenes"):
        truth, note = truth_of(trial)
        run_ours(trial, truth, outcomes, args.quick)
        run_spectral(trial, truth, outcomes, args.quick)
        if args.peers and trial.peers:
            run_peers(trial, truth, outcomes, args.quick)
        show_scene(report, trial, of(outcomes, trial), note)
        if args.figures is not None:
            path = args.figures / f"precision_{trial.name}.png"
            report.figures[f"{trial.name}_front"] = draw(path, trial.title, of(outcomes, trial))
    compare(report, tried, outcomes)
    high_order(report, tried, outcomes)
    for trial in tried:
        if trial.name == "rotating_field":
            batches(report, trial, truth_of(trial)[0], args.quick)
            if args.peers and not args.quick:
                batches_of_peers(report, trial, outcomes)
    return report


if __name__ == "__main__":
    main(Args, measure, __doc__, strict="never")
