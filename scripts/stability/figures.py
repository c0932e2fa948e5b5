"""Pictures of what the tables say."""

from __future__ import annotations

from collections import Counter
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes

from scripts.common.figure import figure
from scripts.common.report import Report
from scripts.stability.extreme import ELEMENTS, Line
from scripts.stability.judge import ENDINGS
from scripts.stability.long import Series
from scripts.stability.scenes import COURSES

COLOURS = dict(zip(ENDINGS, ("#2a9d8f", "#e9c46a", "#457b9d", "#9d8ec7", "#f4732a", "#d62828")))


def draw_bound(report: Report, path: Path) -> None:
    """Found over predicted steps, straight and bent."""
    with figure(path, (13, 6)) as drawn:
        left, right = drawn.subplots(1, 2)
        table = report.tables["straight_bounds"]
        elements = [int(name.split("=")[1]) for name in table.columns[4:]]
        for row in table.rows:
            pairs = [(n, ratio) for n, ratio in zip(elements, row[4:]) if ratio is not None]
            left.plot(*zip(*pairs), "o-" if row[1] == "helical" else "s--", alpha=0.5, markersize=4)
        left.set(xscale="log", xlabel="elements", ylabel="found / predicted step", ylim=(0.99, 1.01))
        left.set_title("straight rods")
        rows = [row for row in report.tables["state_bounds"].rows if row[3] is not None]
        at = np.arange(len(rows))
        words = {4: "found / linearised there", 6: "found / straight bound", 7: "default step / found"}
        for (column, label), mark in zip(words.items(), "o^x"):
            right.plot([row[column] for row in rows], at, mark, label=label, markersize=4)
        right.set_yticks(at, [f"{row[0]}, {row[1]}, N = {row[2]}" for row in rows], fontsize=5)
        right.axvline(1.0, color="grey", linewidth=0.8)
        right.legend(fontsize=7)
        right.set(title="rods in equilibrium")


def draw_long(kept: dict[str, Series], path: Path) -> None:
    """Errors over long runs: the worst rod at every sample."""
    names = ("energy", "axial momentum", "orthogonality")
    with figure(path, (13, 3.6)) as drawn:
        axes = drawn.subplots(1, len(names))
        for axis, name in zip(axes, names):
            for words, series in kept.items():
                worst = np.abs(series[name]).max(axis=1)
                axis.plot(np.linspace(0.0, 1.0, len(worst)), np.maximum(worst, 1e-17), label=words, linewidth=0.7)
            axis.set(yscale="log", xlabel="share of the run", title=name)
        axes[0].set(ylabel="error")
        axes[-1].legend(fontsize=7)


def draw_extreme(lines: list[Line], path: Path) -> None:
    """Endings over couple and slenderness, and their shares by course of the field and number of elements."""
    with figure(path, (15, 4.2)) as drawn:
        left, middle, right = drawn.subplots(1, 3)
        for ending in ENDINGS:
            ended = [x for x in lines if x["ending"] == ending]
            points = [(x["slenderness"], x["couple"]) for x in ended if x["couple"]]
            size, mark = (60, "*") if ending == "wrong and silent" else (5, "o")
            style = {"s": size, "marker": mark, "color": COLOURS[ending], "label": f"{ending} ({len(ended)})"}
            left.scatter(*(zip(*points) if points else ((), ())), **style)
        left.set(xscale="log", yscale="log", xlabel="L/D", ylabel="m B L / EI of the strongest magnet")
        left.legend(fontsize=7)
        _stack(middle, {course: [x for x in lines if x["course"] == course] for course in COURSES})
        names = {f"{a}-{b}" if a < b else f"{a}": (a, b) for a, b in ELEMENTS}
        _stack(right, {name: [x for x in lines if a <= x["elements"] <= b] for name, (a, b) in names.items()})
        right.set(xlabel="elements")


def _stack(axis: Axes, groups: dict[str, list[Line]]) -> None:
    base = np.zeros(len(groups))
    for ending in ENDINGS:
        counts = [Counter(x["ending"] for x in some)[ending] / max(len(some), 1) for some in groups.values()]
        axis.bar(list(groups), counts, bottom=base, color=COLOURS[ending])
        base += counts
    axis.tick_params(axis="x", rotation=30, labelsize=8)
    axis.set(ylabel="share of the scenes")


def draw_stiff(report: Report, path: Path) -> None:
    """Error against speed."""
    rows = report.tables["stiff"].rows
    with figure(path, (6.5, 4.5)) as drawn:
        axis = drawn.subplots()
        for task in dict.fromkeys(row[0] for row in rows):
            some = [row for row in rows if row[0] == task]
            (line,) = axis.plot([row[4] for row in some[:4]], [row[5] for row in some[:4]], "o-", label=task)
            for row, mark in zip(some[4:], "*sD"):
                axis.plot(row[4], row[5], mark, color=line.get_color(), markersize=12 if mark == "*" else 6)
        axis.axvline(1.0, color="grey", linewidth=0.8)
        axis.set(xscale="log", yscale="log", xlabel="simulated / run time", ylabel="tip RMS, mm")
        words = "dots: EA/1, 10, 100, 1000 from the left; stars: tolerance 0.1 mm; squares, diamonds: implicit, order"
        axis.set_title(f"{words} 2, 4", fontsize=7)
        axis.legend(fontsize=7)
