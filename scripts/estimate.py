"""The estimators on twins of the paper's experiments: `python -m scripts.estimate [--quick] [--json FILE]`.

Truths have three times the elements, damping that no model knows, and a modulus up to 20 % off; cameras add 0.05 mm.
Errors stand beside the paper's Table 8, without estimator, with the paper's filter and with the ensemble filter; then
error against run time, and what lost and late frames, a wrong start and a sudden load do. `--keep FILE` keeps every
run, and makes only what is not there yet.
"""

from __future__ import annotations

import sys
from dataclasses import dataclass
from pathlib import Path

import tyro

from scripts import Report
from scripts.estimation import drawing, studies, tables
from scripts.estimation.page import PAGE


@dataclass
class Args:
    """What to measure."""

    quick: bool = False
    """two experiments, fractions of a second, one noise"""
    keep: Path | None = None
    """where finished runs are kept, one a line"""
    figures: Path | None = None
    """folder for the figures"""
    page: Path | None = None
    """where to write the page of documentation"""
    json: Path | None = None
    """where to write the numbers as JSON"""


def run(args: Args) -> Report:
    """Measure, print and draw."""
    report, runs = Report("scripts.estimate", args.quick), studies.Runs(args.keep, args.quick)
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
    figures = {}
    if args.figures is not None:
        figures = {
            "table_8": drawing.errors(found, studies.HELICAL[0].name, args.figures),
            "trouble": drawing.trouble(troubles, args.figures),
            "work": drawing.work(work, args.figures),
        }
    if args.page is not None:
        report.write_page(args.page, PAGE, figures)
    return report


def main() -> None:
    """Measure and report."""
    args = tyro.cli(Args, description=__doc__)
    report = run(args)
    sys.exit(0 if report.finish(args.json) or args.quick else 1)


if __name__ == "__main__":
    main()
