"""The paper's experiments as simulations: `python -m scripts.reproduce_paper [--quick] [--figures DIR] [--page FILE]`.

Experiments 1 to 6 and Fig. 16 of Tariverdi et al. 2020 from the audited scenes, with the paper's element and with the
helical one; frequency against the number of elements; the audit's arithmetic. Exit status 1 where a check is not met.
"""

from __future__ import annotations

import sys
import time
from dataclasses import dataclass
from pathlib import Path

import tyro
from tqdm import tqdm

from scripts import Check, Report
from scripts.reproduction import experiments, figures, frequency
from scripts.reproduction.audit import audit
from scripts.reproduction.experiments import EXPERIMENTS
from scripts.reproduction.runs import Run

PAGE = """# The paper, reproduced

Experiments 1 to 6 and Fig. 16 of Tariverdi et al. 2020 (PLoS ONE 15(7): e0236121) as simulations, from the audited
scenes (`load_scene`, `paper_scene`). Axes: the rod lies along x, z is up in experiments 3 to 6. "The paper" in a table
is what it prints, with the place; its ranges of motion are not printed but follow from Table 8, which gives the
largest error in mm and in per cent of them.

The models, all with the paper's number of elements:

- *nodal*: the paper's element, modulus as in its tables. It locks: bending is too stiff by 1 + GA h²/(4 EI).
- *nodal, shaped*: the same with E divided by that factor (`frequency_shaping=True`; section 5 of the paper).
- *helical, printed E*: this project's element with the same modulus: the rod that the tables describe, converged.
- *helical, effective E*: with E times the factor: the converged rod that bends like the paper's locked one. Refused
  for aluminium, whose modulus is known, and for the square rod ([audit](audit.md#what-follows-for-the-moduli)).

## What comes out

- **The locked element fits experiments 3 to 5, the shaped one 1 and 2.** Clearest is experiment 4: a rod of the printed
  modulus that does not lock hangs so low under its weight that the printed start is nearly its rest, and it hardly
  moves. The locked rod, or the helical one of effective modulus, moves as far as Table 8 implies. The aluminium rods
  are the other way round: their modulus is known, locked they swing 8 and 16 times too fast, shaped like the closed
  form. The paper does not say where it shaped.
- **The printed time steps fit the shaped element.** Those of Tables 3, 4 and 7 lie beyond the bound of the element
  with the moduli of the tables, but within it once E is shaped (first audit table below). That would explain them;
  nothing in the paper says so.
- **Experiment 4: the printed angle fits the chord, downwards.** Started there, the rod of effective modulus with drag
  covers what Table 8 implies, across and along the rod; read as the tangent's, the angle gives little more than half.
- **Experiment 5** has two circles, that of the locked rod and a larger one, not quite round, of the rod that does not
  lock. The paper prints no radius.
- **Experiment 6.** With the modulus of Table 7 the locked rod hardly moves; the shaped one moves by tens of mm, as
  Table 8 asks for. With a tenth of it, the PDMS of section 4.2, the locked rod moves too, by half as much, and the
  printed time step is inside its bound. The field's path is ours, so this cannot tell which of the two was meant.
- **Fig. 16** is a property of the equations: with loads in proportion to E, time scales with the root of E. With time
  steps in the same ratio the two runs differ by rounding.
- **Frequency against elements.** The frequency of the nodal element falls with N as the closed form says; that of the
  helical one is there with three elements. gamma as section 5 prints it, (frequency with N elements over the true
  one)², is the factor by which the element is too stiff, above 1; what E must be multiplied by is its reciprocal.

## What cannot be reproduced

- The measured curves: they exist as pictures only. So no error against an experiment is given here, and the errors of
  Table 8 are not repeated. The paper's own simulated curves exist as pictures only, too.
- The damping: estimated along the run by the filters from those measurements, no value printed. Undamped here, or
  with a drag of 5 /s of our choice.
- How the rods were held before release. Experiments 1, 2: at rest, bent in the first mode; 4: at the turning point
  of a swing. In experiment 2 this keeps a round rod in one oblique plane; the paper's Fig. 7 is captioned "non-planar",
  which needs a push aside or a section that is not quite round.
- The ranges of experiments 1 to 3 that follow from Table 8. They are below those of a release from the printed start
  (1, 2) and do not fit together (3: 11.5 mm across would come with about 1 mm along the rod, not with 5.7 mm).
- The field's course in experiments 5 (speed, rise) and 6 (direction): ours. The directions of the dipoles in 6: ours.
- gamma: the paper prints its definition and no value.
- Loads and start of Fig. 16.

`python -m scripts.reproduce_paper --figures docs/figures --page docs/reproduction.md` makes this page.
"""
LONGEST = 600.0  # s, for all of it on two cores


@dataclass
class Args:
    """What to reproduce."""

    quick: bool = False
    """the same tables from shorter runs and fewer elements, in less than a minute once everything is compiled"""
    figures: Path | None = None
    """folder for the figures (needs matplotlib)"""
    page: Path | None = None
    """where to write the page of documentation"""
    json: Path | None = None
    """where to write the numbers as JSON"""


def simulate(quick: bool) -> dict[int, list[Run]]:
    """Every model of every experiment."""
    made: dict[int, list[Run]] = {experiment.number: [] for experiment in EXPERIMENTS}
    wanted = [(experiment, model) for experiment in EXPERIMENTS for model in experiment.models]
    bar = tqdm(wanted, desc="experiments")
    for experiment, model in bar:
        bar.set_postfix_str(f"{experiment.number}, {model.name}")
        made[experiment.number].append(experiment.run(model, quick))
    return made


def reproduce(args: Args) -> tuple[Report, dict[str, Path]]:
    """Every table, printed as it is ready, and the figures by the key of their table."""
    start = time.perf_counter()
    report, drawn = Report("scripts.reproduce_paper", args.quick), {}
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
        drawn = figures.draw_experiments(made, args.figures)
        drawn["scaling"] = figures.draw_scaling(scaled, args.figures / "reproduction_scaling.png")
        drawn["frequency_section5"] = figures.draw_frequencies(counted, args.figures / "reproduction_frequency.png")
        print("\nFigures: " + ", ".join(map(str, drawn.values())))
    wall = time.perf_counter() - start
    report.checks.append(Check("time", "run time, compilation included", wall, LONGEST, "s", timing=True))
    return report, drawn


def main() -> None:
    """Reproduce and report."""
    args = tyro.cli(Args, description=__doc__)
    report, drawn = reproduce(args)
    met = report.finish(args.json)
    if args.page is not None:
        report.write_page(args.page, PAGE, drawn, without=("checks",))
    sys.exit(0 if met else 1)


if __name__ == "__main__":
    main()
