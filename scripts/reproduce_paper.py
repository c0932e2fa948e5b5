"""The paper's experiments as simulations: `python -m scripts.reproduce_paper [--quick] [--figures DIR] [--page FILE]`.

Experiments 1 to 6 and Fig. 16 of Tariverdi et al. 2020 from the audited scenes, with the paper's element and with the
helical one; frequency against the number of elements; the audit's arithmetic. Exit status 1 where a check is not met.
"""

from __future__ import annotations

import time

from tqdm import tqdm

from scripts.common.command import FigureOptions, main
from scripts.common.report import Report
from scripts.reproduction import experiments, frequency
from scripts.reproduction.audit import audit
from scripts.reproduction.experiments import EXPERIMENTS
from scripts.reproduction.runs import Run

LONGEST = 600.0  # s, for all of it on two cores


def simulate(quick: bool) -> dict[int, list[Run]]:
    """Every model of every experiment."""
    made: dict[int, list[Run]] = {experiment.number: [] for experiment in EXPERIMENTS}
    bar = tqdm([(experiment, model) for experiment in EXPERIMENTS for model in experiment.models], desc="experiments")
    for experiment, model in bar:
        bar.set_postfix_str(f"{experiment.number}, {model.name}")
        made[experiment.number].append(experiment.run(model, quick))
    return made


def reproduce(args: FigureOptions) -> Report:
    """Every table, printed as it is ready, and the figures."""
    start, report = time.perf_counter(), Report("scripts.reproduce_paper", args.quick, "reproduction.md")
    made = simulate(args.quick)
    for experiment in EXPERIMENTS:
        experiments.show(report, experiment, made[experiment.number])
        if experiment.number == 4:
            experiments.show_readings(report)
    scaled = frequency.scaling(report, args.quick)
    counted = frequency.frequencies(report, args.quick)
    audit(report)
    experiments.show_steps(report, made)
    if args.figures is not None:
        from scripts.reproduction import figures  # matplotlib

        report.figures |= figures.draw_experiments(made, args.figures)
        report.figures["scaling"] = figures.draw_scaling(scaled, args.figures / "reproduction_scaling.png")
        drawn = figures.draw_frequencies(counted, args.figures / "reproduction_frequency.png")
        report.figures["frequency_section5"] = drawn
    wall = time.perf_counter() - start
    report.check("time", "run time, compilation included", wall, LONGEST, "s", timing=True)
    return report


if __name__ == "__main__":
    main(FigureOptions, reproduce, __doc__)
