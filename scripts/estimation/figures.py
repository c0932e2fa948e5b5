"""Figures of the twin experiments."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from scripts.common.figure import COLOURS, figure, legend_below
from scripts.estimation.studies import WAYS, Figures
from scripts.estimation.tables import Found, numbers
from scripts.estimation.twins import CASES, Case
from scripts.reproduction.experiments import EXPERIMENTS

OF_WAYS = {
    "model": COLOURS["model"],
    "extended": COLOURS["frames"],
    "printed": COLOURS["printed law"],
    "paper": COLOURS["paper"],
    "ensemble": COLOURS["ensemble"],
    "unscented": COLOURS["unscented"],
}
VARIED: dict[str, tuple[str, str, tuple[int, int]]] = {
    "members": ("o", "-", (0, 9)),
    "elements": ("s", "--", (0, -10)),
    "frames a second": ("^", ":", (11, 0)),
    "float32, members": ("D", "-", (0, 9)),
    "sigma points": ("*", "-", (0, 9)),
}
"""Mark, dashes, and place of the numbers of what is varied."""
USUAL = (64, 6, 100)  # not written: they are on all lines
SHOWN = ("model", "extended", "paper", "ensemble")


def _smooth(run: Figures, windows: int = 50) -> tuple[np.ndarray, np.ndarray]:
    """Means of a course over short windows, NaN where it is not known."""
    tip = np.array([np.nan if value is None else value for value in run["tip"]], float)
    size = max(1, len(tip) // windows)
    count = len(tip) // size
    times, errors = (values[: count * size].reshape(count, size) for values in (np.array(run["times"]), tip))
    return times.mean(axis=1), errors.mean(axis=1)


def errors(found: Found, truth: str, path: Path) -> Path:
    """Tip error against time, one panel an experiment."""
    shown = numbers(found)
    columns, rows = min(3, len(shown)), -(-len(shown) // 3)
    with figure(path, (3.9 * columns, 2.7 * rows + 0.5)) as drawn:
        axes = drawn.subplots(rows, columns, squeeze=False)
        for axis, number in zip(axes.ravel(), shown):
            for way in SHOWN:
                axis.semilogy(*_smooth(found[number, truth, way]), color=OF_WAYS[way], label=WAYS[way], linewidth=1.4)
            reported = CASES[number - 1].record.reported_errors
            mean = 1e3 * max(error.mean for error in reported if error.point == "tip")
            axis.axhline(mean, color="black", linestyle=":", linewidth=1.0, label="largest mean of Table 8, an axis")
            axis.axhline(0.080, color="black", linestyle="--", linewidth=0.8, label="a frame's own noise")
            axis.set_title(f"{number}: {EXPERIMENTS[number - 1].title}", fontsize=9)
            axis.set(xlabel="time, s", ylabel="tip error, mm")
        legend_below(drawn, axes[0, 0], 3)
    return path


def work(found: list[tuple[Case, str, str, int | str, Figures]], path: Path) -> Path:
    """Error against speed, one panel an experiment, a line for each quantity that is varied."""
    cases = list(dict.fromkeys(case for case, *_ in found))
    with figure(path, (5.6 * len(cases), 5.8)) as drawn:
        axes = drawn.subplots(1, len(cases), squeeze=False)[0]
        for axis, case in zip(axes, cases):
            for way, what in dict.fromkeys((way, what) for c, way, what, *_ in found if c == case):
                those = [(v, run) for c, w, k, v, run in found if (c, w, k) == (case, way, what)]
                speeds, tips = [run["speed"] for _, run in those], [run["mean"][0][3] for _, run in those]
                label, (mark, dashes, offset) = f"{WAYS.get(way, 'unscented filter')}: {what}", VARIED[what]
                (line,) = axis.loglog(speeds, tips, linestyle=dashes, color=OF_WAYS[way], label=label, linewidth=1)
                line.set(marker=mark, markersize=5, markerfacecolor="none" if dashes == "--" else None)
                for (value, _), x, y in zip(those, speeds, tips):
                    if value not in USUAL:
                        place = {"textcoords": "offset points", "ha": "center", "va": "center"}
                        axis.annotate(str(value), (x, y), offset, fontsize=7, **place)
            axis.axvline(1.0, color="black", linewidth=0.8, linestyle=":")
            axis.set(xlabel="simulated over wall time, one core", ylabel="mean tip error, mm")
            axis.set_title(f"experiment {case.number}: {EXPERIMENTS[case.number - 1].title}", fontsize=9)
        legend_below(drawn, axes[0], 2)
    return path


def trouble(found: list[tuple[Case, str, str, Figures]], path: Path) -> Path:
    """Tip error against time under each trouble."""
    cases, names = list(dict.fromkeys(c for c, *_ in found)), list(dict.fromkeys(n for _, n, *_ in found))
    names = [name for name in names if name != "none"] or names
    with figure(path, (3.2 * len(names) + 0.4, 2.4 * len(cases) + 0.7)) as drawn:
        axes = drawn.subplots(len(cases), len(names), squeeze=False, sharey="row")
        for row, case in zip(axes, cases):
            for axis, name in zip(row, names):
                for c, n, way, run in found:
                    if (c, n) == (case, name) and way in SHOWN:
                        axis.semilogy(*_smooth(run), color=OF_WAYS[way], label=WAYS[way], linewidth=1.3)
                axis.set_title(f"{case.number}: {name}", fontsize=8)
                axis.set_xlabel("time, s", fontsize=8)
            row[0].set_ylabel("tip error, mm", fontsize=8)
        legend_below(drawn, axes[0, 0], 4)
    return path
