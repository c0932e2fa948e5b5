"""Thousands of random scenes, each run to one of six endings, and what became of them."""

from __future__ import annotations

import math
import time
from collections import Counter
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from tqdm import tqdm

from scripts.common.report import Report
from scripts.common.store import Store
from scripts.stability.judge import COARSE, ENDINGS, ENERGY_MADE, HALVED, TOLERANCE, Runs, Verdict, judge
from scripts.stability.scenes import COURSES, Trial, draw, own_time

Line = dict[str, Any]  # plain JSON types: what was drawn and how it ended

SCENES = {False: 5000, True: 100}
BUDGET = {False: 0.2, True: 0.05}  # s, for the finer run
CHANCE = 1000  # scenes: with fewer, their share is left to chance
COARSE_SILENT = 0.03  # of all scenes: what the estimate before a run may miss
SHORT = 0.1  # own periods: in less, waves run along the rod and it has not begun to swing
ELEMENTS = ((1, 1), (2, 3), (4, 6), (7, 12), (13, 24), (25, 64))


def record(trial: Trial, verdict: Verdict, runs: Runs, wall: float) -> Line:
    """One line of the file."""
    rod, plan = trial.scene.rod, None if runs.refused else runs.plan
    strongest = max([magnet.moment for magnet in trial.scene.magnets] or [0.0])

    def number(value: float | None) -> float | None:
        return None if value is None or not math.isfinite(value) else float(f"{value:.4g}")

    return {
        "seed": trial.seed,
        "ending": verdict.ending,
        "reason": verdict.reason,
        "error": number(verdict.error),
        "step_error": number(verdict.step_error),
        "energy_made": number(verdict.energy_made),
        "finer": verdict.finer,
        "kind": trial.kind.name,
        "judge": runs.integrators,
        "course": trial.course,
        "changes": len(trial.changes) if plan is None else int((trial.changes < plan.duration).sum()),
        "elements": trial.num_elements,
        "step": "default" if trial.share is None else "given",
        "share": number(trial.share),
        "told": trial.told,
        "warned": "asked" in runs.known and runs("asked").warned,
        "hanging": trial.hanging,
        "axial_softening": number(trial.axial_softening),
        "rotary_scaling": number(trial.rotary_scaling),
        "youngs_modulus": number(rod.youngs_modulus),
        "slenderness": number(rod.length / rod.width),
        "field": number(trial.field),
        "couple": number(strongest * trial.field * rod.length / rod.bending_stiffness),
        "steps": None if plan is None else math.ceil(plan.duration / runs.coarse.time_step),
        "periods": None if plan is None else number(plan.duration / own_time(trial.scene, trial.field)),
        "wall": number(wall),
    }


def campaign(seeds: range, quick: bool, path: Path | None) -> list[Line]:
    """Records of all seeds; those that are in the file `path` already are taken from there, the others added."""
    store = Store[Line](path, dict)
    bar = tqdm(seeds, desc="extreme scenes", leave=False)
    return [store.get(f"{'quick ' if quick else ''}{seed}", lambda: judged(seed, quick)) for seed in bar]  # noqa: B023


def judged(seed: int, quick: bool) -> Line:
    """Run and judge one seed."""
    start = time.perf_counter()
    trial = draw(seed, quick)
    verdict, runs = judge(trial, BUDGET[quick])
    return record(trial, verdict, runs, time.perf_counter() - start)


def counts(report: Report, lines: list[Line], by: str, key: str, groups: Sequence[str], note: str = "") -> None:
    """Endings, one row for each value of `key`."""
    title, columns = f"Extreme scenes: endings by {by}", f"{key} | scenes | {' | '.join(ENDINGS)}"
    with report.table(f"extreme_{key}s", title, columns, note) as table:
        for group in (*groups, "all"):
            some = [line for line in lines if group in ("all", line[key])]
            seen = Counter(line["ending"] for line in some)
            if some:
                table.add(group, len(some), *(seen[ending] for ending in ENDINGS))


def by_elements(report: Report, lines: list[Line]) -> None:
    """How far the asked run is from the finer one, for runs that were not reported and not sensitive."""
    with report.table(
        "extreme_elements",
        "Extreme scenes: error by number of elements, helical element",
        "elements | scenes | median error | 9 of 10 within | correct, % | median error of the step alone",
        "Error: RMS distance of the tip from that of a run with more elements and a smaller step, in the tip's "
        "largest distance from the straight rod's. Of the step alone (known where the error is above 5 %): the same "
        "from a run with as many elements and a quarter of the step.",
    ) as table:
        told = [x for x in lines if x["ending"] in ("correct", *COARSE.values()) and "nodal" not in x["kind"]]
        for low, high in ELEMENTS:
            some = [x for x in told if low <= x["elements"] <= high]
            if some:
                errors = np.sort([math.inf if x["error"] is None else x["error"] for x in some])
                steps = [x["step_error"] for x in some if x["step_error"] is not None]
                share = 100.0 * sum(x["ending"] == "correct" for x in some) / len(some)
                tenth = float(errors[min(len(errors) - 1, int(0.9 * len(errors)))])
                row = (f"{low}" if low == high else f"{low} to {high}", len(some), float(np.median(errors)), tenth)
                table.add(*row, share, float(np.median(steps)) if steps else None)


def reasons(report: Report, lines: list[Line]) -> None:
    """Why runs did not end as correct."""
    some = [line for line in lines if line["ending"] != "correct"]
    with report.table(
        "extreme_reasons",
        "Extreme scenes: kinds of failure",
        "ending | reason | scenes | finer run well | finer run well, default step told of the field",
    ) as table:
        for (ending, reason), number in Counter((x["ending"], x["reason"]) for x in some).most_common():
            fine = [x for x in some if (x["ending"], x["reason"]) == (ending, reason) and not x["finer"]]
            table.add(ending, reason, number, len(fine), sum(x["step"] == "default" and x["told"] for x in fine))
        table.rows.sort(key=lambda row: (ENDINGS.index(row[0]), -row[2]))


def silent(report: Report, lines: list[Line]) -> None:
    """Every wrong and silent run, with its seed."""
    columns = "seed | kind | course | elements | step | share | couple | slenderness | error | step_error"
    columns += " | energy_made | reason"
    wrong = [line for line in lines if line["ending"] == "wrong and silent"]
    note = "To see one again: --replay SEED." if wrong else "None."
    with report.table("extreme_silent", "Extreme scenes: wrong and silent", columns, note) as table:
        table.rows += [tuple(line[name] for name in table.columns) for line in wrong]
    what = f"of {len(lines)} random scenes, wrong and silent"
    report.check("extreme", what, float(len(wrong)), 0.0)


def summary(lines: list[Line], untold: list[Line]) -> str:
    """How long the runs were, and what correct and coarse ones did."""
    spread = np.quantile([line["periods"] for line in lines if line["periods"] is not None], (0.1, 0.5, 0.9))
    risen = sum(line["ending"] == "correct" and line["energy_made"] > ENERGY_MADE for line in lines)
    warned = sum(line["ending"] == "correct" and line["warned"] for line in lines)
    short = sum(line["periods"] < SHORT for line in untold)
    return (
        f"Simulated: {spread[0]:.2g}, {spread[1]:.2g} and {spread[2]:.2g} own periods (first, middle and last tenth). "
        f"Of the correct ones, {risen} ended with a tip within {100 * TOLERANCE:g} % although the energy rose by more "
        f"than a tenth beyond what the field put in, and {warned} had a warning of too few elements. "
        f"Of the coarse, silent ones, {short} lasted less than {SHORT:g} own periods: a finer run could afford no more."
    )


def extreme(report: Report, quick: bool, path: Path | None, scenes: int | None = None) -> list[Line]:
    """All scenes, or the first so many, their tables and checks."""
    seeds = range(scenes or SCENES[quick])
    lines = campaign(seeds, quick, path)
    untold = [line for line in lines if line["ending"] == COARSE[False]]
    judges = "Integrator of the run, and of the one with more elements that judges it: the explicit one where it can"
    counts(report, lines, "kernel", "kind", sorted({line["kind"] for line in lines}), summary(lines, untold))
    counts(report, lines, "field", "course", COURSES)
    counts(report, lines, "integrator", "judge", sorted({line["judge"] for line in lines}), f"{judges} follow.")
    counts(report, lines, "time step", "step", ("default", "given"))
    by_elements(report, lines)
    reasons(report, lines)
    silent(report, lines)
    if len(lines) >= CHANCE:
        what = f"of {len(lines)} random scenes, share that is coarse without a warning"
        report.check("extreme", what, len(untold) / len(lines), COARSE_SILENT)
    report.check("extreme", "random scenes with an ending", float(len(lines)), float(len(seeds)), at_least=True)
    return lines


def replay(seed: int, quick: bool) -> None:
    """One seed again, with all of its runs."""
    trial = draw(seed, quick)
    print(trial)
    verdict, runs = judge(trial, BUDGET[quick])
    print(verdict)
    print(runs.integrators)
    for name in ("asked", "finer", "double", *HALVED[1:4], "disturbed quarter"):
        if runs.refused:
            break
        run = runs(name)
        where = run.tips[-1] if len(run.tips) else None
        print(
            f"{name:9s} step {run.time_step:.4g} s, {run.symptom or 'well'}, {len(run.tips)} samples, last tip {where},"
        )
        print(f"{'':9s} energy made {run.energy_made:.3g} of {run.inner:.3g} J")
