"""Tables and checks of the twin experiments."""

from __future__ import annotations

from typing import Any

from magrod_env.scenes import ReportedError
from scripts import Check, Report, Table
from scripts.estimation.studies import POLYMER, WAYS, Figures
from scripts.estimation.twins import CASES, Case, Truth, model_start

AXES = ("x", "y", "z", "distance")
POINTS = ("tip", "middle")
TUNED = Truth(1.0).name
ACROSS_AND_ALONG = {3: {"E2": ("z",), "E3": ("x",)}, 4: {"E2": ("x",), "E3": ("z",)}}
"""Axes here of the paper's: whose range of motion Table 8 implies (docs/reproduction.md)."""


def rows_of_table_8(case: Case) -> list[tuple[str, str, float, float]]:
    """Point, axis here, and the largest and mean error of Table 8, mm.

    Where the paper does not say which axis is which (experiment 6), both get the smaller of its figures.
    """
    errors = case.record.reported_errors
    if case.number == 6:
        rows = []
        for point in POINTS:
            those = [error for error in errors if error.point == point]
            largest, mean = min(error.largest for error in those), min(error.mean for error in those)
            rows += [(point, axis, 1e3 * largest, 1e3 * mean) for axis in ("x", "z")]
        return rows
    return [(e.point, axis, 1e3 * e.largest, 1e3 * e.mean) for e in errors for axis in _axes(case, e)]


def _axes(case: Case, error: ReportedError) -> tuple[str, ...]:
    if error.direction == "distance":
        return ("distance",)
    if error.direction == "both":
        return ("y", "z")
    return ACROSS_AND_ALONG.get(case.number, {}).get(error.direction, ("z",))


Found = dict[tuple[int, str, str], Figures]


def over(found: Found, number: int, way: str, kind: str, point: str, axis: str, truths: str = "helical") -> Any:
    """A figure over the truths of an element, or of one by its name: mean of means, largest of all; None if unknown."""
    those = [
        run[kind][POINTS.index(point)][AXES.index(axis)]
        for (n, truth, w), run in found.items()
        if n == number and w == way and (truth == truths or truth.startswith(f"{truths},"))
    ]
    told = [value for value in those if value is not None]
    if len(told) < len(those) or not told:
        return None
    return max(told) if kind == "largest" else sum(told) / len(told)


def shown(*values: float | None) -> str:
    """Errors in one cell, mm."""
    return " / ".join("-" if value is None else f"{value:.3f}" if value < 10.0 else f"{value:.1f}" for value in values)


def table_8(report: Report, found: Found) -> None:
    """Errors beside the paper's, and whether the goals are met."""
    words = "mean at frames / mean / largest, mm"
    table = Table(
        f"Experiments 1 to 6: tip error, {words}",
        ("experiment", "point", "axis", "Table 8: mean / largest", *WAYS.values()),
        note="Over helical truths with 0.8, 1 and 1.2 times the modulus. The first figure is at the moments of frames, "
        "after they were taken in; the others at all instants, four from frame to frame. Noise of 0.05 mm has a mean "
        "size of 0.040 mm an axis and 0.080 mm in distance.",
    )
    for number in sorted({number for number, _, _ in found}):
        for point, axis, largest, mean in rows_of_table_8(CASES[number - 1]):
            cells = {}
            for way in WAYS:
                kinds = (over(found, number, way, kind, point, axis) for kind in ("frames", "mean", "largest"))
                cells[way] = shown(*kinds)
            table.rows.append((number, point, axis, f"{mean:.2f} / {largest:.2f}", *cells.values()))
            what = f"experiment {number}, {point}, {axis}: mean "
            for way, share, truth in (("paper", 1.0, "helical"), ("paper", 1.0, TUNED), ("ensemble", 0.5, "helical")):
                goal = WAYS[way] + (", right modulus" if truth == TUNED else "")
                for kind, when in (("frames", "at frames"), ("mean", "between frames too")):
                    value = over(found, number, way, kind, point, axis, truth)
                    report.checks.append(Check(goal, what + when, value, share * mean, "mm"))
    report.show("table_8", table)


def by_truth(report: Report, found: Found) -> None:
    """Mean error of the tip's place for every truth."""
    table = Table(
        "The same by truth: mean distance of the tip between frames too, mm",
        ("experiment", "truth", *WAYS.values(), "modulus found / true"),
        note="Modulus: the ensemble filter's at the end.",
    )
    for number, truth in dict.fromkeys((number, truth) for number, truth, _ in found):
        cells = [found[number, truth, way]["mean"][0][3] for way in WAYS]
        factor = float(truth.split("x ")[1])
        modulus = found[number, truth, "ensemble"]["parameters"]["modulus"] / factor
        table.rows.append((number, truth, *cells, f"{modulus:.3f}"))
    report.show("truths", table)


def unseen(report: Report, found: Found) -> None:
    """What frames do not tell: velocities, and the middle of the rod."""
    kinds = {"velocity": "RMS velocity error of the tip, mm/s", "middle": "mean error of the middle, mm"}
    table = Table(
        "What frames do not tell: velocity, and the middle of the rod",
        ("experiment", "", *WAYS.values()),
        note="Over the helical truths, between frames too. Velocity of frames alone: difference of the last two. The "
        "middle is seen in experiment 6 only, where it is the second magnet.",
    )
    for number in sorted({number for number, _, _ in found}):
        for kind, words in kinds.items():
            cells: list[float | None] = []
            for way in WAYS:
                if kind == "middle":
                    cells.append(over(found, number, way, "mean", "middle", "distance"))
                    continue
                those = [run["velocity"] for (n, t, w), run in found.items() if (n, w) == (number, way) and "hel" in t]
                cells.append(None if None in those else 1e3 * sum(those) / len(those))
            table.rows.append((number, words, *cells))
    report.show("unseen", table)


def metal(report: Report, found: list[tuple[Case, int, str, Figures]]) -> None:
    """Aluminium rods against the frame rate."""
    table = Table(
        "Aluminium rods against the frame rate: tip error across, z, mean at frames / mean / largest, mm",
        ("experiment", "frames a second", "frames a period", *dict.fromkeys(WAYS[way] for _, _, way, _ in found)),
        note="Modulus of the truth 20 % below the model's. The paper states no rate.",
    )
    for case, rate in dict.fromkeys((case, rate) for case, rate, _, _ in found):
        period = 1.0 / float(model_start(case).natural_frequencies()[0])
        cells = [
            shown(*(run[kind][0][2] for kind in ("frames", "mean", "largest")))
            for c, r, _, run in found
            if (c, r) == (case, rate)
        ]
        table.rows.append((case.number, rate, f"{rate * period:.1f}", *cells))
    report.show("metal", table)


def why(report: Report, found: list[Any]) -> None:
    """What the paper's filter reaches, and what against."""
    table = Table(
        "The paper's filter: mean error of the tip across, z, mm, with and without noise",
        (
            *("experiment", "modulus", "frames a second", "noise, mm", "law", "Table 8"),
            *("at frames, truth", "at frames, the frames", "between too", "largest"),
        ),
        note="Against the frames: estimate minus frame, as Table 8 compares; against the truth: what counts.",
    )
    for case, factor, rate, noise, way, run in found:
        printed = next(mean for point, axis, _, mean in rows_of_table_8(case) if (point, axis) == ("tip", "z"))
        residual = None if run["residual"] is None else run["residual"][2]
        figures = (run["frames"][0][2], residual, run["mean"][0][2], run["largest"][0][2])
        table.rows.append((case.number, factor, rate, 1e3 * (noise or 0.0), WAYS[way], printed, *figures))
    report.show("why", table)


def trouble(report: Report, found: list[tuple[Case, str, str, Figures]]) -> None:
    """Lost frames, late frames, a wrong start, a load."""
    table = Table(
        "Trouble: mean / largest distance of the tip, mm; in brackets the mean over the second half",
        ("experiment", "trouble", *WAYS.values()),
        note="True modulus, unknown damping, 100 frames a second, between frames too. The load comes halfway. "
        "Unknown: share of the time without an estimate, before the first frame or after a divergence.",
    )
    for case, name in dict.fromkeys((case, name) for case, name, _, _ in found):
        cells = []
        for c, n, _, run in found:
            if (c, n) == (case, name):
                lost = f", {100 * run['lost']:.0f} % unknown" if run["lost"] else ""
                cells.append(f"{shown(run['mean'][0][3], run['largest'][0][3])} ({shown(run['half'][0][3])}){lost}")
        table.rows.append((case.number, name, *cells))
    report.show("trouble", table)


def work(report: Report, found: list[tuple[Case, str, str, Any, Figures]]) -> None:
    """Error against run time of the filters."""
    table = Table(
        "Error against run time: one rod, one core, modulus 20 % off",
        ("experiment", "filter", "varied", "", "mean distance of the tip, mm", "largest", "simulated over wall time"),
        note="Else 64 members, 6 elements and 100 frames a second. Errors over 2 noises, between frames too; time of "
        "one filter that predicts once a frame.",
    )
    for case, way, what, value, run in found:
        name = {"unscented": "unscented filter"}.get(way) or WAYS[way]
        table.rows.append((case.number, name, what, value, run["mean"][0][3], run["largest"][0][3], run["speed"]))
    report.show("work", table)


def speed(report: Report, found: list[tuple[Case, str, float]]) -> None:
    """Simulated over wall time."""
    table = Table(
        "Speed of one filter on one core: simulated over wall time",
        ("experiment", "frames a second", *(WAYS[way] for way in dict.fromkeys(way for _, way, _ in found))),
        note="6 elements, 64 members in float64; experiments 1, 2 and 6 with conditioned models.",
    )
    for case in dict.fromkeys(case for case, _, _ in found):
        told = {way: value for c, way, value in found if c == case}
        table.rows.append((case.number, case.rate, *told.values()))
        if case.number in POLYMER:
            for way in ("paper", "ensemble"):
                what = f"experiment {case.number}: simulated over wall time"
                report.checks.append(Check(WAYS[way], what, told[way], 1.0, "", at_least=True, timing=True))
    report.show("speed", table)
