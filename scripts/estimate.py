"""The estimators on twins of the paper's experiments: `python -m scripts.estimate [--quick] [--json FILE]`.

Truths have three times the elements, damping that no model knows, and a modulus up to 20 % off; cameras add 0.05 mm.
Errors stand beside the paper's Table 8, without estimator, with the paper's filter and with the ensemble filter; then
error against run time, and what lost and late frames, a wrong start and a sudden load do. `--keep FILE` keeps every
run, and makes only what is not there yet.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from scripts.common.command import FigureOptions, main
from scripts.common.report import Report
from scripts.estimation import studies, tables


@dataclass
class Args(FigureOptions):
    """What to measure."""

    keep: Path | None = None
    """where finished runs are kept, one a line"""


def measure(args: Args) -> Report:
    """Measure, print and draw."""
    report, runs = Report("scripts.estimate", args.quick, "estimation.md"), studies.Runs(args.keep, args.quick)
    found = studies.experiments(runs)
    tables.table_8(report, found)
    tables.by_truth(report, found)
    tables.unseen(report, found)
    tables.why(report, studies.why(runs))
    tables.metal(report, studies.metal_rates(runs))
    troubles = studies.troubles(runs)
    tables.trouble(report, troubles)
    tables.speed(report, studies.speeds(runs))
    work = studies.work(runs)
    tables.work(report, work)
    if args.figures is not None:
        from scripts.estimation import figures  # matplotlib

        truth, folder = studies.HELICAL[0].name, args.figures
        report.figures["table_8"] = figures.errors(found, truth, folder / "estimate_errors.png")
        report.figures["trouble"] = figures.trouble(troubles, folder / "estimate_trouble.png")
        report.figures["work"] = figures.work(work, folder / "estimate_work.png")
    return report


if __name__ == "__main__":
    main(Args, measure, __doc__, strict="full runs")
