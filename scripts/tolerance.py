"""Whether `tolerance` keeps its promise, and at what price: `python -m scripts.tolerance [--quick] [--json FILE]`.

Random rods of four makes under random smooth fields that no pilot has seen. Tip errors are against a finer run; costs
are elements times steps, against the cheapest setting of a grid that a user could have found by hand. `--resume FILE`
keeps every result as a line of JSON and measures only what is not there yet.
"""

from __future__ import annotations

import json
import sys
from collections.abc import Iterable
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np
import tyro
from tqdm import tqdm

from scripts import Check, Report, Table
from scripts.tolerance_scenes import FAMILIES, make_trial
from scripts.tolerance_trial import Record, finer, measure, simulate, spectral_distance, tips

PROMISED = 0.95  # share of the scenes that must be within their tolerance
PAGE = """# Does a tolerance keep its promise?

How `tolerance` chooses is in [resolution](resolution.md#what-a-tolerance-does). Here it chooses for random scenes of
four families, from soft PDMS to NiTi wire, with one to three magnets, in a plane or in space; each has eight random
smooth fields that are held over control steps of 20 ms, none of them a pilot's load. The error is the RMS distance of
the tip over two seconds to a finer run: twice the elements, and an eighth of the conditioning or a quarter of the
implicit step by the scheme of order 4. A scene counts as within its tolerance if all of its eight rods are.

References are checked in turn (the last table): every seventh by a still finer run, and every implicit one that is not
too dear by explicit steps without conditioning, another integrator.

The price is the cost of the choice over that of the best setting of a grid, found with the truth at hand. A choice must
hold for eight loads of which some are harsher than the fields of a scene (they swing against the dipoles, where the rod
is limp); that, and control steps of 10 ms in the pilots, is most of the price.

Results are kept as they are measured (`--resume`): this page gathers several processes of a day, at commits between
which the choice did not change; the machine had other work meanwhile, which the times of choosing show.
"""
FOLLOWED = 0.1  # a tolerance is not tried where the reference at ten times the tolerance took this share of the budget
QUANTILES = (0.1, 0.5, 0.9, 0.95, 1.0)


@dataclass
class Args:
    """What to measure."""

    quick: bool = False
    """four scenes and two tolerances, in less than a minute once everything is compiled"""
    scenes: int | None = None
    """how many; 60 where nothing is said"""
    seed: int = 0
    """of the scenes and fields"""
    tolerances: tuple[float, ...] | None = None
    """m; 1e-3, 1e-4 and 1e-5 where nothing is said"""
    budget: float = 2e8
    """element-steps (of one rod, 2 s) that a reference may take; 1e8 are about half a minute"""
    spectral: int = 0
    """references at 1e-4 m to check by the independent solver of tests/reference, minutes each; needs SciPy"""
    json: Path | None = None
    """where to write the numbers as JSON"""
    resume: Path | None = None
    """where to keep results as lines of JSON, and what is measured already"""
    figures: Path | None = None
    """folder for histograms of error over tolerance"""
    page: Path | None = None
    """where to write the page of documentation"""


Key = tuple[int, int, float]


def collect(args: Args) -> list[Record]:
    """Every scene at every tolerance, the loosest tolerance first."""
    scenes = args.scenes or (4 if args.quick else 60)
    tolerances = args.tolerances or ((1e-3, 1e-4) if args.quick else (1e-3, 1e-4, 1e-5))
    wanted = [(args.seed, index, each) for each in sorted(tolerances, reverse=True) for index in range(scenes)]
    known = {(each.seed, each.index, each.tolerance): each for each in _stored(args.resume)}
    for key in tqdm(wanted, desc="scenes and tolerances"):
        if key not in known:
            known[key] = _measured(key, known, args.budget)
            if args.resume is not None:
                with args.resume.open("a") as lines:
                    lines.write(json.dumps(asdict(known[key]), allow_nan=False) + "\n")
    return [known[key] for key in wanted]


def _stored(path: Path | None) -> Iterable[Record]:
    if path is not None and path.exists():
        yield from (Record(**json.loads(line)) for line in path.read_text().splitlines())


def _measured(key: Key, known: dict[Key, Record], budget: float) -> Record:
    seed, index, tolerance = key
    trial = make_trial(seed, index)
    looser = [record for (s, i, each), record in known.items() if (s, i) == (seed, index) and each > tolerance]
    last = min(looser, key=lambda record: record.tolerance, default=None)
    if last is not None and (last.reference_cost or 0.0) > FOLLOWED * budget:
        facts = {name: getattr(last, name) for name in ("family", "plane", "num_magnets", "load", "magnitude")}
        return Record(seed=seed, index=index, tolerance=tolerance, outcome="not tried", choosing_time=0.0, **facts)
    return measure(trial, tolerance, budget)


def promises(report: Report, records: list[Record]) -> None:
    """How often the error was within the tolerance."""
    table = Table(
        "Promise: error of the tip over the tolerance, largest of eight rods",
        (
            "tolerance, m",
            "family",
            "scenes",
            "refused",
            "too dear",
            "sensitive",
            "within",
            "rods within",
            *("largest" if q == 1.0 else f"{100 * q:g} %" for q in QUANTILES),
        ),
        note="Within: share of the scenes that were measured and are not sensitive; rods: the same, rod by rod. "
        "Too dear: a reference beyond the budget. Sensitive: reference and finer reference differ by more than the "
        "tolerance. Percentages: quantiles over the scenes.",
    )
    for tolerance, family, those in _groups(records):
        told = [each for each in those if each.outcome == "measured" and not each.sensitive]
        refused = sum(each.outcome == "refused" for each in those)
        dear = sum(each.outcome in ("too dear", "not tried") for each in those)
        row = (tolerance, family, len(those), refused, dear, sum(each.sensitive for each in those))
        if not told:
            table.rows.append((*row, *[None] * (2 + len(QUANTILES))))
            continue
        ratios = np.array([each.error / tolerance for each in told])
        rods = np.concatenate([_ratios(each) for each in told])
        share = float(np.mean(ratios <= 1.0))
        shown = (_quantile(ratios, q) for q in QUANTILES)
        table.rows.append((*row, share, float(np.mean(rods <= 1.0)), *shown))
        if family == "all":
            what = f"share of {len(told)} scenes within {tolerance:g} m"
            report.checks.append(Check("promise", what, share, PROMISED, "", at_least=True))
    report.show("promises", table)


def _groups(records: list[Record]) -> Iterable[tuple[float, str, list[Record]]]:
    """Tolerance, the loosest first, family or "all", and its records."""
    for tolerance in sorted({record.tolerance for record in records}, reverse=True):
        for family in (*FAMILIES, "all"):
            yield tolerance, family, [r for r in records if r.tolerance == tolerance and family in (r.family, "all")]


def _ratios(record: Record) -> np.ndarray:
    """Errors over the tolerance, rod by rod."""
    return np.array([np.inf if each is None else each for each in record.errors or []]) / record.tolerance


def _quantile(values: np.ndarray, share: float) -> float | None:
    """A quantile that was met; None where that is infinite."""
    found = float(np.quantile(values, share, method="higher"))
    return found if np.isfinite(found) else None


def broken(report: Report, records: list[Record]) -> None:
    """Every promise that was not kept, and the sensitive scenes."""
    table = Table(
        "Broken promises and sensitive scenes",
        (
            *("tolerance, m", "seed", "scene", "family", "magnets", "load", "elements", "step, s", "softening"),
            *(
                "scaling",
                "integrator",
                "estimate / tolerance",
                "error / tolerance",
                "reference's doubt / tolerance",
                "rods beyond",
            ),
        ),
        note="Load: sum of moments * field * length / bending stiffness. No error: a rod was lost. Estimate: what the "
        "pilots said. Doubt: distance of the reference to a finer one.",
    )
    for each in records:
        if each.outcome == "measured" and (each.sensitive or each.error > each.tolerance):
            table.rows.append(
                (
                    *(each.tolerance, each.seed, each.index, each.family, each.num_magnets, each.load),
                    *(each.num_elements, each.time_step, each.axial_softening, each.rotary_scaling, each.integrator),
                    None if each.estimate is None else each.estimate / each.tolerance,
                    each.error / each.tolerance if np.isfinite(each.error) else None,
                    None if each.doubt is None else each.doubt / each.tolerance,
                    int((_ratios(each) > 1.0).sum()),
                )
            )
    report.show("broken", table)


def prices(report: Report, records: list[Record]) -> None:
    """What the choices cost, and choosing itself."""
    table = Table(
        "Price: cost of the choice over that of the best setting of a grid",
        (
            *("tolerance, m", "family", "implicit", "priced", "median", "90 %", "largest", "grid not cheaper"),
            *("choosing, s: median", "90 %", "largest", "choosing / running: median"),
        ),
        note="Cost: elements times steps, where an implicit midpoint step counts as twenty explicit ones. Implicit: "
        "scenes that got such steps. The grid has the ladder's elements up to the choice's, and for each eight "
        "conditionings at their default steps and implicit schemes at eighteen steps; grid not cheaper: nothing in it "
        "was good enough at up to twice the cost. Running: the eight rods, 2 s.",
    )
    for tolerance, family, those in _groups(records):
        ratios = [each.cost / each.best_cost for each in those if each.cost and each.best_cost]
        unmatched = sum(each.priced and each.best_cost is None for each in those)
        times = [each.choosing_time for each in those if each.outcome != "not tried"]
        relative = [each.choosing_time / each.run_time for each in those if each.run_time]
        table.rows.append(
            (
                *(tolerance, family, sum("implicit" in (each.integrator or "") for each in those)),
                len(ratios) + unmatched,
                *(_quantile(np.array(ratios), q) if ratios else None for q in (0.5, 0.9, 1.0)),
                unmatched,
                *(_quantile(np.array(times), q) if times else None for q in (0.5, 0.9, 1.0)),
                _quantile(np.array(relative), 0.5) if relative else None,
            )
        )
    report.show("prices", table)


def references(report: Report, records: list[Record], spectral: int) -> None:
    """How far the references themselves may be off."""
    table = Table(
        "References: RMS distance of the tip to a better one",
        ("tolerance, m", "scene", "family", "against", "distance, m", "over the tolerance"),
        note="Finer: half as many elements more, a quarter of the conditioning or half the implicit step. Explicit: "
        "as many elements, with explicit steps and no conditioning, against implicit ones. Independent: spectral "
        "elements.",
    )
    table.rows += [
        (each.tolerance, each.index, each.family, name, distance, distance / each.tolerance)
        for each in records
        for name, distance in (("finer", each.doubt), ("explicit", each.apart))
        if distance is not None
    ]
    for each in [each for each in records if _simple(each)][:spectral]:
        trial = make_trial(each.seed, each.index)
        reference = finer(trial, simulate(trial, tolerance=each.tolerance))
        distance = spectral_distance(trial, tips(reference, trial.fields)[:, 0])
        row = (each.tolerance, each.index, each.family, "independent", distance, distance / each.tolerance)
        table.rows.append(row)
    report.show("references", table)


def _simple(record: Record) -> bool:
    """Whether the independent solver has all that the scene has, and is not too slow."""
    scene = make_trial(record.seed, record.index).scene
    known = record.num_magnets == 1 and scene.spin_drag_rate is None
    return known and record.outcome == "measured" and record.tolerance == 1e-4 and scene.rod.youngs_modulus < 20e6


def draw(records: list[Record], folder: Path) -> Path:
    """Histograms of error over tolerance, one a tolerance."""
    import matplotlib

    matplotlib.use("Agg")
    from matplotlib import pyplot

    tolerances = sorted({record.tolerance for record in records}, reverse=True)
    figure, axes = pyplot.subplots(1, len(tolerances), figsize=(3.4 * len(tolerances), 2.8), squeeze=False, sharey=True)
    bins = np.geomspace(1e-3, 10.0, 33)
    for axis, tolerance in zip(axes[0], tolerances):
        told = [each for each in records if each.tolerance == tolerance and each.outcome == "measured"]
        ratios = [
            [np.clip(each.error / tolerance, bins[0], bins[-1]) for each in told if each.family == family]
            for family in FAMILIES
        ]
        axis.hist(ratios, bins, stacked=True, label=list(FAMILIES))
        axis.axvline(1.0, color="black", linewidth=0.8)
        axis.set(xscale="log", xlabel="error / tolerance", title=f"tolerance {tolerance:g} m")
    axes[0, 0].set_ylabel("scenes")
    axes[0, 0].legend(frameon=False, fontsize=8)
    figure.tight_layout()
    folder.mkdir(parents=True, exist_ok=True)
    path = folder / "tolerance.png"
    figure.savefig(path, dpi=130)
    pyplot.close(figure)
    return path


def summarise(args: Args, records: list[Record]) -> Report:
    """Every table, printed as it is ready."""
    report = Report("scripts.tolerance", args.quick)
    promises(report, records)
    broken(report, records)
    prices(report, records)
    references(report, records, args.spectral)
    shown = {}
    if args.figures is not None:
        shown["promises"] = draw(records, args.figures)
        print(f"\nFigure: {shown['promises']}")
    if args.page is not None:
        report.write_page(args.page, PAGE, shown)
    return report


def main() -> None:
    """Measure and report."""
    args = tyro.cli(Args, description=__doc__)
    sys.exit(0 if summarise(args, collect(args)).finish(args.json) else 1)


if __name__ == "__main__":
    main()
