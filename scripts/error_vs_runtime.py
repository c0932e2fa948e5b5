"""Error against run time, beside other simulators: `python -m scripts.error_vs_runtime [--quick] [--json FILE]`.

For every scene: the tip's RMS error, mm, against the wall time of a simulated second on one core, for this package's
elements and options and for PyElastica, MuJoCo and SoRoMoX where they are installed (`pip install -e '.[peers]'`). A
run that diverges is an outcome and listed. Finished runs are kept in `--keep` as they come, and not done again.
"""

from __future__ import annotations

import json
import math
from collections.abc import Iterable
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
import tyro
from tqdm import tqdm

from magrod_env import Simulation
from magrod_env.rod.threads import usable_cores
from scripts import Report, Table, spectral
from scripts import precision as pr
from scripts.peers import mujoco_chain, pyelastica, soromox
from scripts.precision_figures import draw, front

PEERS = (mujoco_chain, pyelastica, soromox)
LEVELS = (0.35, 0.06, 0.01)  # mm, at which run times are compared
BATCH_COLUMNS = ("simulator", "set-up", "resolution", "rods", "error of one rod, mm", "control steps/s")
BATCH = "helical, batch of 64, per rod"
OURS = (
    "helical",
    "helical, conditioned",
    "helical, planar",
    "helical, float32",
    "helical, implicit",
    "helical, implicit, order 4",
)


PAGE = """# Error against run time

How far the tip is from the truth, and what that costs, for this package and for the simulators that one would else
pick. Every point is a run of the same rod from the same state under the same field: RMS distance of the tip from the
reference over the run, in mm, against the wall time of a simulated second on one core, model building and compilation
left out, the least of several runs. Lower left is better.

Each simulator has the best set-up that we found for it: see the notes at the head of `scripts/peers/*.py`.
"Corrected" set-ups of MuJoCo and PyElastica use this package's own corrections (residual bending flexibility, end-
corrected masses) and are not what their users have by default. The step of "longest" runs is 0.9 of the stability
bound, 0.7 or 0.5 where that diverged. The field is known beforehand to all of them, as a table. The lines: *helical*
is the default element; *no corrections*, *flexibility only* and *masses only* leave out its two corrections;
*conditioned* points have softened axial stiffness and scaled rotary inertia; *implicit* lines use the implicit
integrators with steps that are parts of the time between two samples; *tolerance* lets the package choose. Where a
line has two settings (conditioning; elements and implicit step), dots are all runs and the line joins those that no
other of them beats.

Finished runs are kept as they come (`--keep`) and not done again, so that a page may gather several processes of a
day, at more than one commit; batches are timed anew each time.

One spectral element of high degree, the reference's own kind, does not overtake the helical element at any error that
both reach: at 8e-5 mm in the rotating field it takes some fifty times as long, explicit in time and with compiled loads
in a loop of SciPy's. The curve of its error is steeper, so they would cross; where, these runs do not show. The floor
of the helical lines at 5e-5 mm there is that of the field's table, which has a value every millisecond.

Other work ran on the machine's other core while the page of 25 November 2026 was made. Beside the element before it
(the page of 22 November, on an AMD EPYC, where the two runs of other simulators that both pages list took 0.85 and
0.88 of the time): from 0.1 mm down in free decay, and nearly everywhere with two magnets, the same error takes less
time. It does not where two or three conditioned elements were enough (errors above 0.1 mm in the rotating field, on
the circle and under the sudden field), nor with 10 elements and more on the circle: there errors are about what they
were, and a run takes 1.1 to 1.3 times as long after allowing for the machine.
"""


@dataclass
class Args:
    """What to compare."""

    quick: bool = False
    """two scenes, few resolutions, no peer's long runs"""
    scene: tuple[str, ...] = ()
    """names of scenes; all where none is given"""
    peers: bool = True
    """run the other simulators that are installed"""
    keep: Path = Path("runs/error_vs_runtime.jsonl")
    """where finished runs are kept, one a line"""
    figures: Path | None = None
    """folder for the figures"""
    page: Path | None = None
    """where to write the page of documentation"""
    json: Path | None = None
    """where to write the numbers as JSON"""


@dataclass
class Outcome:
    """One point of a diagram; error in mm, wall time in s a simulated second and rod; both None if it diverged."""

    scene: str
    who: str
    line: str
    resolution: str
    error: float | None
    wall: float | None

    @property
    def key(self) -> tuple[str, ...]:
        """What was run."""
        return self.scene, self.who, self.line, self.resolution


class Record:
    """Outcomes, kept in a file as they come."""

    def __init__(self, path: Path | None) -> None:
        self.path, self.outcomes = path, {}
        if path is not None and path.exists():
            for line in path.read_text().splitlines():
                outcome = Outcome(**json.loads(line))
                self.outcomes[outcome.key] = outcome

    def add(self, outcome: Outcome) -> None:
        """Keep one more."""
        self.outcomes[outcome.key] = outcome
        if self.path is not None:
            self.path.parent.mkdir(parents=True, exist_ok=True)
            with self.path.open("a") as file:
                file.write(json.dumps(asdict(outcome)) + "\n")

    def of(self, scene: str) -> list[Outcome]:
        """Those of one scene."""
        return [outcome for outcome in self.outcomes.values() if outcome.scene == scene]


def error(tips: np.ndarray, truth: np.ndarray) -> float:
    """RMS distance, mm."""
    return 1e3 * float(np.sqrt(np.mean(np.sum((tips - truth) ** 2, axis=-1))))


def run_ours(trial: pr.Trial, truth: np.ndarray, record: Record, quick: bool) -> None:
    """Every set-up of this package; a step that diverges is listed, and a shorter one tried."""
    for first in tqdm(list(pr.setups(trial, quick)), desc=trial.name, leave=False):
        shares: Iterable[float | None] = (None,) if first.step_share is None else pr.SHARES
        for share in shares:
            setup = pr.Setup(first.line, first.settings, share, first.without)
            key = (trial.name, "magrod", setup.line, setup.resolution)
            if key not in record.outcomes:
                record.add(_outcome(trial, setup, truth, quick))
            if record.outcomes[key].error is not None:
                break


def _outcome(trial: pr.Trial, setup: pr.Setup, truth: np.ndarray, quick: bool) -> Outcome:
    where = (trial.name, "magrod", setup.line, setup.resolution)
    try:
        simulation: Simulation = pr.build(trial, setup)
    except ValueError:  # a tolerance out of reach
        return Outcome(*where, None, None)
    tips = pr.trace(simulation, trial)
    if tips is None:
        return Outcome(*where, None, None)
    wall = pr.wall(simulation, trial, 1 if quick else 5)
    return Outcome(*where, None if wall is None else error(tips, truth), wall)


def run_peers(trial: pr.Trial, truth: np.ndarray, record: Record, quick: bool) -> None:
    """The other simulators, in their best set-ups; absent ones are named."""
    for peer in PEERS:
        why = peer.available()
        if why is not None:
            print(f"{peer.NAME} is left out: {why}", flush=True)
            continue
        problem = pr.problem(trial)
        for setting in tqdm(peer.settings(problem, quick), desc=f"{trial.name}, {peer.NAME}", leave=False):
            key = (trial.name, peer.NAME, setting.label, setting.resolution)
            if key not in record.outcomes:
                done = peer.run(problem, setting, trial.times, 1 if quick else 2)
                walls = None if done.diverged else done.wall_per_second
                record.add(Outcome(*key, done.error(truth), walls))


def run_spectral(trial: pr.Trial, truth: np.ndarray, record: Record, quick: bool) -> None:
    """A high-order element, the reference's own, at growing degree: in all, and what its loads alone take."""
    if trial.name not in spectral.SCENES or any(o.who == spectral.NAME for o in record.of(trial.name)):
        return
    for run in tqdm(spectral.runs(trial, quick), desc=f"{trial.name}, spectral", leave=False):
        for line, wall in ((spectral.WHOLE, run.wall), (spectral.LOADS, run.wall_of_loads)):
            record.add(Outcome(trial.name, spectral.NAME, line, run.resolution, error(run.tip, truth), wall))


def cheapest(outcomes: Iterable[Outcome], level: float) -> Outcome | None:
    """The quickest run whose error is at most ``level`` (mm)."""
    good = [outcome for outcome in outcomes if outcome.error is not None and outcome.error <= level]
    return min(good, key=lambda outcome: outcome.wall) if good else None


def show_scene(report: Report, trial: pr.Trial, outcomes: list[Outcome], note: str) -> None:
    """Tables of one scene: every line's points, the diverged ones too."""
    table = Table(
        f"{trial.title}: every run", ("simulator", "set-up", "resolution", "error, mm", "ms a simulated second")
    )
    for outcome in sorted(outcomes, key=lambda o: (o.who != "magrod", o.who, o.line)):
        shown = "diverged" if outcome.error is None else outcome.error
        table.rows.append((outcome.who, outcome.line, outcome.resolution, shown, _milliseconds(outcome)))
    table.note = note
    report.tables[trial.name] = table
    best = Table(f"{trial.title}: what nothing beats", table.columns, note=note)
    for outcome in front(o for o in outcomes if o.line not in (BATCH, spectral.LOADS)):
        best.rows.append((outcome.who, outcome.line, outcome.resolution, outcome.error, _milliseconds(outcome)))
    report.show(f"{trial.name}_front", best)


def _milliseconds(outcome: Outcome) -> float | None:
    return None if outcome.wall is None else 1e3 * outcome.wall


def compare(report: Report, tried: list[pr.Trial], record: Record) -> None:
    """Run times at equal error, for every peer."""
    table = Table(
        "One rod on one core: least wall time, ms a simulated second, of runs within an error",
        ("scene", "error, mm", "magrod", "with", "best peer", "with", "peer over magrod"),
    )
    for trial in tried:
        outcomes = record.of(trial.name)
        for level in LEVELS:
            ours = cheapest((o for o in outcomes if o.who == "magrod" and o.line in OURS), level)
            peers = [o for o in outcomes if o.who not in ("magrod", spectral.NAME)]
            other = cheapest(peers, level)
            if ours is None or not peers:
                continue
            names = [
                "-" if o is None else f"{o.who if o.who != 'magrod' else ''} {o.line}, {o.resolution}".strip()
                for o in (ours, other)
            ]
            ratio = None if other is None else other.wall / ours.wall
            table.rows.append(
                (trial.title, level, _milliseconds(ours), names[0], other and _milliseconds(other), names[1], ratio)
            )
    if table.rows:
        report.show("equal_error", table)


def high_order(report: Report, tried: list[pr.Trial], record: Record) -> None:
    """Where the error of a high-order element costs less than the same error of the low-order ones."""
    table = Table(
        "One spectral element against many helical ones, ms a simulated second",
        ("scene", "spectral element", "error, mm", "spectral", "its loads alone", "helical, as good", "with"),
        note="Spectral: the reference solver with one element, compiled loads in SciPy's time loop, DOP853; its loads "
        "alone are what a compiled loop could come down to. Helical: the least wall time of runs within that error.",
    )
    for trial in tried:
        outcomes = record.of(trial.name)
        loads = {o.resolution: o for o in outcomes if o.line == spectral.LOADS}
        for whole in [o for o in outcomes if o.who == spectral.NAME and o.line != spectral.LOADS]:
            ours = cheapest((o for o in outcomes if o.who == "magrod" and o.line in OURS), whole.error)
            row = (trial.title, whole.resolution, whole.error, _milliseconds(whole))
            told = (None, "-") if ours is None else (_milliseconds(ours), f"{ours.line}, {ours.resolution}")
            table.rows.append((*row, _milliseconds(loads[whole.resolution]), *told))
    if table.rows:
        report.show("high_order", table)


def batches(report: Report, tried: list[pr.Trial], record: Record, quick: bool) -> None:
    """Control steps a second of many rods on all cores, rotating field."""
    trial = next((each for each in tried if each.name == "rotating_field"), None)
    if trial is None:
        return
    table = Table(
        "Many rods, rotating field, all cores: control steps a second (20 ms each)",
        BATCH_COLUMNS,
        note="Between steps the field is set and the positions can be read.",
    )
    threads = usable_cores()
    for n, axial, rotary in (
        ((3, 1.0, 16.0),)
        if quick
        else (
            (2, 4.0, 9.0),
            (2, 16.0, 33.0),
            (3, 1.0, 16.0),
            (3, 4.0, 9.0),
            (3, 16.0, 33.0),
            (4, 4.0, 9.0),
            (6, 1.0, 4.0),
        )
    ):
        settings = {"num_elements": n, "axial_softening": axial, "rotary_scaling": rotary}
        for precision in ("float32",) if quick else ("float32", "float64"):
            setup = pr.Setup("helical, " + precision, settings | {"precision": precision}, 0.7)
            single = _outcome(trial, setup, _truth(trial)[0], True)
            setup.settings["num_rods"] = rods = 512 if quick else 8192
            table.rows.append(
                ("magrod", setup.line, single.resolution, rods, single.error, _control_steps(trial, setup, threads))
            )
    report.show("batches", table)


def batches_of_peers(report: Report, tried: list[pr.Trial], record: Record) -> None:
    """The same for the peers that can run many rods."""
    trial = next((each for each in tried if each.name == "rotating_field"), None)
    if trial is None:
        return
    table = Table(
        "Many rods of other simulators, rotating field, two threads: control steps a second (20 ms each)",
        BATCH_COLUMNS,
    )
    problem, rods = pr.problem(trial), 256
    for peer in PEERS:
        if peer.available() is not None:
            continue
        for setting in tqdm(peer.settings(problem, False), desc=f"batches, {peer.NAME}", leave=False):
            known = record.outcomes.get((trial.name, peer.NAME, setting.label, setting.resolution))
            if known is None or known.error is None or known.wall > 0.25 or known.error > 0.6:
                continue
            try:
                speed = peer.run_batch(problem, setting, rods, 2)
            except (ValueError, NotImplementedError):
                continue
            table.rows.append((peer.NAME, setting.label, setting.resolution, rods, known.error, float(speed)))
    if table.rows:
        report.show("batches_of_peers", table)


def _control_steps(trial: pr.Trial, setup: pr.Setup, threads: int) -> float:
    simulation = Simulation(trial.scene, num_threads=threads, **setup.settings)
    simulation.time_step = (setup.step_share or 0.7) * simulation.stable_time_step_in(trial.magnitude)
    fields = [trial.field(0.02 * k) for k in range(1, 51)]
    least = math.inf
    for _ in range(5):
        simulation.reset()
        start = pr.time.perf_counter()
        for field in fields:
            simulation.advance(0.02, field)
        least = min(least, pr.time.perf_counter() - start)
    return len(fields) * simulation.num_rods / least


def _truth(trial: pr.Trial) -> tuple[np.ndarray, str]:
    """The reference of a trial and what it is worth."""
    own, other = pr.own_finest(trial), pr.independent(trial.name)
    if other is None:
        return own, f"Reference: our own run with {trial.finest} elements."
    gap = error(own, other)
    return other, (
        f"Reference: independent spectral solver; our own run with {trial.finest} elements lies {gap:.2g} mm (RMS) "
        "from it."
    )


def measure(args: Args) -> Report:
    """Every scene."""
    report = Report("scripts.error_vs_runtime", args.quick)
    record = Record(None if args.quick else args.keep)
    tried = [trial for trial in pr.trials() if not args.scene or trial.name in args.scene]
    if args.quick:
        tried = [trial for trial in tried if trial.name in ("free_decay", "rotating_field")][:2]
    notes: dict[str, Any] = {}
    for trial in tqdm(tried, desc="scenes"):
        truth, notes[trial.name] = _truth(trial)
        run_ours(trial, truth, record, args.quick)
        run_spectral(trial, truth, record, args.quick)
        if args.peers and trial.peers:
            run_peers(trial, truth, record, args.quick)
        show_scene(report, trial, record.of(trial.name), notes[trial.name])
        if args.figures is not None:
            draw(args.figures / f"precision_{trial.name}.png", trial.title, record.of(trial.name))
    compare(report, tried, record)
    high_order(report, tried, record)
    batches(report, tried, record, args.quick)
    if args.peers and not args.quick:
        batches_of_peers(report, tried, record)
    return report


def main() -> None:
    """Measure and report."""
    args = tyro.cli(Args, description=__doc__)
    report = measure(args)
    if args.page is not None:
        figures = {} if args.figures is None else {path.stem[10:] + "_front": path for path in figure_paths(args)}
        report.write_page(args.page, PAGE, figures, tuple(trial.name for trial in pr.trials()))
    report.finish(args.json)


def figure_paths(args: Args) -> list[Path]:
    """Files of the figures."""
    return sorted(args.figures.glob("precision_*.png")) if args.figures is not None else []


if __name__ == "__main__":
    main()
