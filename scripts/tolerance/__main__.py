"""Whether `tolerance` keeps its promise, and at what price: `python -m scripts.tolerance [--quick] [--json FILE]`.

Random rods of four makes under random smooth fields that no pilot has seen. Tip errors are against a finer run; costs
are elements times steps, against the cheapest setting of a grid that a user could have found by hand. `--resume FILE`
keeps every result as a line of JSON and measures only what is not there yet.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from tqdm import tqdm

from scripts.common.command import FigureOptions, main
from scripts.common.figure import figure
from scripts.common.report import Report
from scripts.common.store import Store
from scripts.tolerance import trial as one
from scripts.tolerance.scenes import FAMILIES, make_trial
from scripts.tolerance.trial import Record

PROMISED = 0.95  # share of the scenes that must be within their tolerance
FOLLOWED = 0.1  # a tolerance is not tried where the reference at ten times the tolerance took this share of the budget


@dataclass
class Args(FigureOptions):
    """What to measure."""

    scenes: int | None = None
    """how many; 60, or 4 if quick, where nothing is said"""
    seed: int = 0
    """of the scenes and fields"""
    tolerances: tuple[float, ...] | None = None
    """m; 1e-3, 1e-4 and, unless quick, 1e-5 where nothing is said"""
    budget: float = 2e8
    """element-steps (of one rod, 2 s) that a reference may take; 1e8 are about half a minute"""
    resume: Path | None = None
    """where to keep results as lines of JSON, and what is measured already"""


def collect(args: Args) -> list[Record]:
    """Every scene at every tolerance, the loosest tolerance first."""
    scenes = args.scenes or (4 if args.quick else 60)
    tolerances = sorted(args.tolerances or ((1e-3, 1e-4) if args.quick else (1e-3, 1e-4, 1e-5)), reverse=True)
    store, found = Store(args.resume, Record), []
    for tolerance, index in tqdm([(each, index) for each in tolerances for index in range(scenes)], desc="scenes"):
        key = f"{args.seed}/{index}/{tolerance:g}"
        found.append(store.get(key, lambda: _measured(args, index, tolerance, store)))  # noqa: B023
    return found


def _measured(args: Args, index: int, tolerance: float, store: Store[Record]) -> Record:
    trial = make_trial(args.seed, index)
    known = [each for each in store.results.values() if (each.seed, each.index) == (args.seed, index)]
    looser = [each for each in known if each.tolerance > tolerance]
    last = min(looser, key=lambda record: record.tolerance, default=None)
    if last is not None and (last.reference_cost or 0.0) > FOLLOWED * args.budget:
        return one.untried(trial, tolerance)
    return one.measure(trial, tolerance, args.budget)


def groups(records: list[Record]) -> Iterable[tuple[float, str, list[Record]]]:
    """Tolerance, the loosest first, family or "all", and its records."""
    for tolerance in sorted({record.tolerance for record in records}, reverse=True):
        for family in (*FAMILIES, "all"):
            yield tolerance, family, [r for r in records if r.tolerance == tolerance and family in (r.family, "all")]


def quantiles(values: Sequence[float] | np.ndarray, *shares: float) -> list[float | None]:
    """Quantiles that were met; None where one is infinite, or there are no values."""
    found = [float(np.quantile(values, share, method="higher")) if len(values) else np.inf for share in shares]
    return [each if np.isfinite(each) else None for each in found]


def promises(report: Report, records: list[Record]) -> None:
    """How often the error was within the tolerance."""
    with report.table(
        "promises",
        "Promise: error of the tip over the tolerance, largest of eight rods",
        "tolerance, m | family | scenes | refused | too dear | sensitive | within | rods within | 10 % | 50 % | 90 % | "
        "95 % | largest",
        "Within: share of the scenes that were measured and are not sensitive; rods: the same, rod by rod. "
        "Too dear: a reference beyond the budget. Sensitive: reference and finer reference differ by more than the "
        "tolerance. Percentages: quantiles over the scenes.",
    ) as table:
        for tolerance, family, those in groups(records):
            told = [each for each in those if each.outcome == "measured" and not each.sensitive]
            refused = sum(each.outcome == "refused" for each in those)
            dear = sum(each.outcome in ("too dear", "not tried") for each in those)
            row = (tolerance, family, len(those), refused, dear, sum(each.sensitive for each in those))
            if not told:
                table.add(*row, *[None] * 7)
                continue
            ratios = np.array([each.error / tolerance for each in told])
            rods = np.concatenate([each.ratios for each in told])
            share = float(np.mean(ratios <= 1.0))
            table.add(*row, share, float(np.mean(rods <= 1.0)), *quantiles(ratios, 0.1, 0.5, 0.9, 0.95, 1.0))
            if family == "all":
                what = f"share of {len(told)} scenes within {tolerance:g} m"
                report.check("promise", what, share, PROMISED, at_least=True)


def broken(report: Report, records: list[Record]) -> None:
    """Every promise that was not kept, and the sensitive scenes."""
    with report.table(
        "broken",
        "Broken promises and sensitive scenes",
        "tolerance, m | seed | scene | family | magnets | load | elements | step, s | softening | scaling | "
        "integrator | estimate / tolerance | error / tolerance | reference's doubt / tolerance | rods beyond",
        "Load: sum of moments * field * length / bending stiffness. No error: a rod was lost. Estimate: what the "
        "pilots said. Doubt: distance of the reference to a finer one.",
    ) as table:
        for each in records:
            if each.outcome == "measured" and (each.sensitive or each.error > each.tolerance):
                told = (each.estimate, each.error if np.isfinite(each.error) else None, each.doubt)
                table.add(
                    *(each.tolerance, each.seed, each.index, each.family, each.num_magnets, each.load),
                    *(each.num_elements, each.time_step, each.axial_softening, each.rotary_scaling, each.integrator),
                    *(None if value is None else value / each.tolerance for value in told),
                    int((each.ratios > 1.0).sum()),
                )


def prices(report: Report, records: list[Record]) -> None:
    """What the choices cost, and choosing itself."""
    with report.table(
        "prices",
        "Price: cost of the choice over that of the best setting of a grid",
        "tolerance, m | family | implicit | priced | median | 90 % | largest | grid not cheaper | "
        "choosing, s: median | 90 % | largest | choosing / running: median",
        "Cost: elements times steps, where an implicit midpoint step counts as twenty explicit ones. Implicit: "
        "scenes that got such steps. The grid has the ladder's elements up to the choice's, and for each eight "
        "conditionings at their default steps and implicit schemes at eighteen steps; grid not cheaper: nothing in it "
        "was good enough at up to twice the cost. Running: the eight rods, 2 s.",
    ) as table:
        for tolerance, family, those in groups(records):
            ratios = [each.cost / each.best_cost for each in those if each.cost and each.best_cost]
            unmatched = sum(each.priced and each.best_cost is None for each in those)
            times = [each.choosing_time for each in those if each.outcome != "not tried"]
            relative = [each.choosing_time / each.run_time for each in those if each.run_time]
            implicit, three = sum("implicit" in (each.integrator or "") for each in those), (0.5, 0.9, 1.0)
            row = (tolerance, family, implicit, len(ratios) + unmatched, *quantiles(ratios, *three), unmatched)
            table.add(*row, *quantiles(times, *three), *quantiles(relative, 0.5))


def references(report: Report, records: list[Record]) -> None:
    """How far the references themselves may be off."""
    with report.table(
        "references",
        "References: RMS distance of the tip to a better one",
        "tolerance, m | scene | family | against | distance, m | over the tolerance",
        "Finer: half as many elements more, a quarter of the conditioning or half the implicit step. Explicit: "
        "as many elements, with explicit steps and no conditioning, against implicit ones.",
    ) as table:
        for each in records:
            for name, off in (("finer", each.doubt), ("explicit", each.apart)):
                if off is not None:
                    table.add(each.tolerance, each.index, each.family, name, off, off / each.tolerance)


def draw(records: list[Record], path: Path) -> Path:
    """Histograms of error over tolerance, one a tolerance."""
    tolerances = sorted({record.tolerance for record in records}, reverse=True)
    bins = np.geomspace(1e-3, 10.0, 33)
    with figure(path, (3.4 * len(tolerances), 2.8)) as drawn:
        axes = drawn.subplots(1, len(tolerances), squeeze=False, sharey=True)[0]
        for axis, tolerance in zip(axes, tolerances):
            told = [each for each in records if each.tolerance == tolerance and each.outcome == "measured"]
            ratios = [[each.error / tolerance for each in told if each.family == family] for family in FAMILIES]
            axis.hist([np.clip(some, bins[0], bins[-1]) for some in ratios], bins, stacked=True, label=list(FAMILIES))
            axis.axvline(1.0, color="black", linewidth=0.8)
            axis.set(xscale="log", xlabel="error / tolerance", title=f"tolerance {tolerance:g} m")
        axes[0].set_ylabel("scenes")
        axes[0].legend(frameon=False, fontsize=8)
    return path


def measure(args: Args) -> Report:
    """Every table, printed as it is ready."""
    report, records = Report("scripts.tolerance", args.quick, "tolerance.md"), collect(args)
    promises(report, records)
    broken(report, records)
    prices(report, records)
    references(report, records)
    if args.figures is not None:
        report.figures["promises"] = draw(records, args.figures / "tolerance.png")
    return report


if __name__ == "__main__":
    main(Args, measure, __doc__)
