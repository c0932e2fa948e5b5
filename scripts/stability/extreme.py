"""Thousands of random scenes, each run to one of six endings, and what became of them."""

from __future__ import annotations

import json
import math
import time
from collections import Counter
from pathlib import Path
from typing import Any

import numpy as np
from tqdm import tqdm

from scripts import Check, Report, Table
from scripts.stability.drawing import COURSES, Trial, draw, own_time
from scripts.stability.verdict import COARSE, ENDINGS, ENERGY_MADE, HALVED, TOLERANCE, Runs, Verdict, judge

SCENES = {False: 5000, True: 100}
BUDGET = {False: 0.2, True: 0.05}  # s, for the finer run
CHANCE = 1000  # scenes: with fewer, their share is left to chance
COARSE_SILENT = 0.03  # of all scenes: what the estimate before a run may miss
SHORT = 0.1  # own periods: in less, waves run along the rod and it has not begun to swing
ELEMENTS = ((1, 1), (2, 3), (4, 6), (7, 12), (13, 24), (25, 64))


def record(trial: Trial, verdict: Verdict, runs: Runs, wall: float) -> dict[str, Any]:
    """One line of the file: what was drawn and how it ended, as plain JSON types."""
    rod, plan = trial.scene.rod, runs.plan
    strongest = max([magnet.moment for magnet in trial.scene.magnets] or [0.0])

    def number(value):
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


def campaign(seeds: range, quick: bool, path: Path | None) -> list[dict[str, Any]]:
    """Records of all seeds; those that are in the file `path` already are taken from there, the others added."""
    known: dict[int, dict[str, Any]] = {}
    if path is not None and path.exists():
        known = {line["seed"]: line for line in map(json.loads, path.read_text().splitlines())}
    if path is not None:
        path.parent.mkdir(parents=True, exist_ok=True)
    for seed in tqdm([seed for seed in seeds if seed not in known], desc="extreme scenes", leave=False):
        start = time.perf_counter()
        trial = draw(seed, quick)
        verdict, runs = judge(trial, BUDGET[quick])
        known[seed] = record(trial, verdict, runs, time.perf_counter() - start)
        if path is not None:
            with path.open("a") as file:
                file.write(json.dumps(known[seed], allow_nan=False) + "\n")
    return [known[seed] for seed in seeds]


def counts(records: list[dict[str, Any]], title: str, key: str, groups: list[str], note: str = "") -> Table:
    """Endings, one row for each value of `key`."""
    table = Table(title, (key, "scenes", *ENDINGS), note=note)
    for group in [*groups, None]:
        some = [line for line in records if group in (None, line[key])]
        seen = Counter(line["ending"] for line in some)
        if some:
            table.rows.append(("all" if group is None else group, len(some), *(seen[ending] for ending in ENDINGS)))
    return table


def by_elements(records: list[dict[str, Any]]) -> Table:
    """How far the asked run is from the finer one, for runs that were not reported and not sensitive."""
    table = Table(
        "Extreme scenes: error by number of elements, helical element",
        ("elements", "scenes", "median error", "9 of 10 within", "correct, %", "median error of the step alone"),
        note="Error: RMS distance of the tip from that of a run with more elements and a smaller step, in the tip's "
        "largest distance from the straight rod's. Of the step alone (known where the error is above 5 %): the same "
        "from a run with as many elements and a quarter of the step.",
    )
    for low, high in ELEMENTS:
        some = [x for x in records if low <= x["elements"] <= high and x["ending"] in ("correct", *COARSE.values())]
        some = [x for x in some if "nodal" not in x["kind"]]
        if some:
            errors = np.array([math.inf if x["error"] is None else x["error"] for x in some])
            steps = [x["step_error"] for x in some if x["step_error"] is not None]
            share = 100.0 * sum(x["ending"] == "correct" for x in some) / len(some)
            name = f"{low}" if low == high else f"{low} to {high}"
            tenth = float(np.sort(errors)[min(len(errors) - 1, int(0.9 * len(errors)))])
            row = (name, len(some), float(np.median(errors)), tenth, share, float(np.median(steps)) if steps else None)
            table.rows.append(row)
    return table


def reasons(records: list[dict[str, Any]]) -> Table:
    """Why runs did not end as correct."""
    table = Table(
        "Extreme scenes: kinds of failure",
        ("ending", "reason", "scenes", "finer run well", "finer run well, default step told of the field"),
    )
    some = [line for line in records if line["ending"] != "correct"]
    for (ending, reason), number in Counter((x["ending"], x["reason"]) for x in some).most_common():
        these = [line for line in some if (line["ending"], line["reason"]) == (ending, reason)]
        fine = [line for line in these if not line["finer"]]
        default = sum(line["step"] == "default" and line["told"] for line in fine)
        table.rows.append((ending, reason, number, len(fine), default))
    table.rows.sort(key=lambda row: (ENDINGS.index(row[0]), -row[2]))
    return table


def silent(records: list[dict[str, Any]]) -> Table:
    """Every wrong and silent run, with its seed."""
    names = ("seed", "kind", "course", "elements", "step", "share", "couple", "slenderness", "error", "step_error")
    table = Table("Extreme scenes: wrong and silent", (*names, "energy_made", "reason"))
    for line in records:
        if line["ending"] == "wrong and silent":
            table.rows.append(tuple(line[name] for name in (*names, "energy_made", "reason")))
    table.note = "None." if not table.rows else "To see one again: --replay SEED."
    return table


def extreme(report: Report, quick: bool, path: Path | None, scenes: int | None = None) -> list[dict[str, Any]]:
    """All scenes, or the first so many, their tables and checks."""
    seeds = range(scenes or SCENES[quick])
    records = campaign(seeds, quick, path)
    kinds = sorted({line["kind"] for line in records})
    spread = np.quantile([line["periods"] for line in records if line["periods"] is not None], (0.1, 0.5, 0.9))
    risen = sum(line["ending"] == "correct" and line["energy_made"] > ENERGY_MADE for line in records)
    warned = sum(line["ending"] == "correct" and line["warned"] for line in records)
    untold = [line for line in records if line["ending"] == COARSE[False]]
    short = sum(line["periods"] < SHORT for line in untold)
    note = (
        f"Simulated: {spread[0]:.2g}, {spread[1]:.2g} and {spread[2]:.2g} own periods (first, middle and last tenth). "
        f"Of the correct ones, {risen} ended with a tip within {100 * TOLERANCE:g} % although the energy rose by more "
        f"than a tenth beyond what the field put in, and {warned} had a warning of too few elements. "
        f"Of the coarse, silent ones, {short} lasted less than {SHORT:g} own periods: a finer run could afford no more."
    )
    report.show("extreme_kinds", counts(records, "Extreme scenes: endings by kernel", "kind", kinds, note))
    report.show("extreme_courses", counts(records, "Extreme scenes: endings by field", "course", list(COURSES)))
    judges = sorted({line["judge"] for line in records})
    words = (
        "Integrator of the run, and of the one with more elements that judges it: the explicit one where it can follow."
    )
    report.show("extreme_judges", counts(records, "Extreme scenes: endings by integrator", "judge", judges, words))
    report.show("extreme_steps", counts(records, "Extreme scenes: endings by time step", "step", ["default", "given"]))
    report.show("extreme_elements", by_elements(records))
    report.show("extreme_reasons", reasons(records))
    report.show("extreme_silent", silent(records))
    wrong = sum(line["ending"] == "wrong and silent" for line in records)
    report.checks.append(Check("extreme", f"of {len(records)} random scenes, wrong and silent", float(wrong), 0.0, ""))
    what = f"of {len(records)} random scenes, share that is coarse without a warning"
    if len(records) >= CHANCE:
        report.checks.append(Check("extreme", what, len(untold) / len(records), COARSE_SILENT, ""))
    done = float(len(records))
    report.checks.append(Check("extreme", "random scenes with an ending", done, float(len(seeds)), "", at_least=True))
    return records


def replay(seed: int, quick: bool) -> None:
    """One seed again, with all of its runs."""
    trial = draw(seed, quick)
    print(trial)
    verdict, runs = judge(trial, BUDGET[quick])
    print(verdict)
    print(runs.integrators)
    for name in ("asked", "finer", "double", *HALVED[1:4], "disturbed quarter"):
        if runs.plan is None:
            break
        run = runs(name)
        where = run.tips[-1] if len(run.tips) else None
        print(
            f"{name:9s} step {run.time_step:.4g} s, {run.symptom or 'well'}, {len(run.tips)} samples, last tip {where},"
        )
        print(f"{'':9s} energy made {run.energy_made:.3g} of {run.inner:.3g} J")
