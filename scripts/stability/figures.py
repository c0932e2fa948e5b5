"""Pictures of what the tables say."""

from __future__ import annotations

from collections import Counter
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np

from scripts import Report
from scripts.stability.drawing import COURSES
from scripts.stability.verdict import ENDINGS

COLOURS = dict(zip(ENDINGS, ("#2a9d8f", "#e9c46a", "#457b9d", "#9d8ec7", "#f4732a", "#d62828")))


def _save(figure, folder: Path, name: str) -> None:
    folder.mkdir(parents=True, exist_ok=True)
    path = folder / f"stability_{name}.png"
    figure.savefig(path, dpi=130, bbox_inches="tight")
    print(f"- figure: {path}")


def draw_bound(report: Report, folder: Path) -> None:
    """Found over predicted steps, straight and bent."""
    import matplotlib.pyplot as plt

    figure, (left, right) = plt.subplots(1, 2, figsize=(13, 6), gridspec_kw={"wspace": 0.7})
    table = report.tables["straight_bounds"]
    elements = [int(name.split("=")[1]) for name in table.columns[4:]]
    for row in table.rows:
        pairs = [(n, ratio) for n, ratio in zip(elements, row[4:]) if ratio is not None]
        left.plot(*zip(*pairs), "o-" if row[1] == "helical" else "s--", alpha=0.5, markersize=4)
    left.set(xscale="log", xlabel="elements", ylabel="found / predicted step", ylim=(0.99, 1.01), title="straight rods")
    table = report.tables["state_bounds"]
    labels = [f"{row[0]}, {row[1]}, N = {row[2]}" for row in table.rows if row[3] is not None]
    rows = [row for row in table.rows if row[3] is not None]
    at = np.arange(len(rows))
    for column, mark, words in ((4, "o", "linearised there"), (6, "^", "straight bound")):
        right.plot([row[column] for row in rows], at, mark, label=f"found / {words}", markersize=4)
    right.plot([row[7] for row in rows], at, "x", label="default step / found", markersize=4)
    right.set_yticks(at, labels, fontsize=5)
    right.axvline(1.0, color="grey", linewidth=0.8)
    right.legend(fontsize=7)
    right.set(title="rods in equilibrium")
    _save(figure, folder, "bound")
    plt.close(figure)


def draw_long(kept: dict[str, dict[str, np.ndarray]], folder: Path) -> None:
    """Errors over long runs: the worst rod at every sample."""
    import matplotlib.pyplot as plt

    names = ("energy", "axial momentum", "orthogonality")
    figure, axes = plt.subplots(1, len(names), figsize=(13, 3.6))
    for axis, name in zip(axes, names):
        for words, series in kept.items():
            worst = np.abs(series[name]).max(axis=1)
            axis.plot(np.linspace(0.0, 1.0, len(worst)), np.maximum(worst, 1e-17), label=words, linewidth=0.7)
        axis.set(yscale="log", xlabel="share of the run", title=name)
    axes[0].set(ylabel="error")
    axes[-1].legend(fontsize=7)
    _save(figure, folder, "long")
    plt.close(figure)


def draw_extreme(records: list[dict[str, Any]], folder: Path) -> None:
    """Endings over couple and slenderness, and their shares by course of the field and number of elements."""
    import matplotlib.pyplot as plt

    figure, (left, middle, right) = plt.subplots(1, 3, figsize=(15, 4.2))
    for ending in ENDINGS:
        some = [x for x in records if x["ending"] == ending and x["couple"]]
        large = ending == "wrong and silent"
        left.scatter(
            [x["slenderness"] for x in some],
            [x["couple"] for x in some],
            s=60 if large else 5,
            marker="*" if large else "o",
            color=COLOURS[ending],
            label=f"{ending} ({sum(x['ending'] == ending for x in records)})",
        )
    left.set(xscale="log", yscale="log", xlabel="L/D", ylabel="m B L / EI of the strongest magnet")
    left.legend(fontsize=7)
    groups = [(course, [x for x in records if x["course"] == course]) for course in COURSES]
    _stack(middle, groups)
    edges = (1, 2, 4, 7, 13, 25, 65)
    names = [str(a) if b == a + 1 else f"{a}-{b - 1}" for a, b in pairwise(edges)]
    parts = [[x for x in records if a <= x["elements"] < b] for a, b in pairwise(edges)]
    _stack(right, list(zip(names, parts)))
    right.set(xlabel="elements")
    _save(figure, folder, "extreme")
    plt.close(figure)


def _stack(axis, groups: list[tuple[str, list[dict[str, Any]]]]) -> None:
    base = np.zeros(len(groups))
    for ending in ENDINGS:
        shares = np.array([Counter(x["ending"] for x in some)[ending] / max(len(some), 1) for _, some in groups])
        axis.bar([name for name, _ in groups], shares, bottom=base, color=COLOURS[ending])
        base += shares
    axis.tick_params(axis="x", rotation=30, labelsize=8)
    axis.set(ylabel="share of the scenes")


def draw_stiff(report: Report, folder: Path) -> None:
    """Error against speed."""
    import matplotlib.pyplot as plt

    figure, axis = plt.subplots(figsize=(6.5, 4.5))
    rows = report.tables["stiff"].rows
    for task in dict.fromkeys(row[0] for row in rows):
        some = [row for row in rows if row[0] == task]
        (line,) = axis.plot([row[4] for row in some[:4]], [row[5] for row in some[:4]], "o-", label=task)
        for row, marker in zip(some[4:], "*sD"):
            axis.plot(row[4], row[5], marker, color=line.get_color(), markersize=12 if marker == "*" else 6)
    axis.axvline(1.0, color="grey", linewidth=0.8)
    axis.set(xscale="log", yscale="log", xlabel="simulated / run time", ylabel="tip RMS, mm")
    words = "dots: EA/1, 10, 100, 1000 from the left; stars: tolerance 0.1 mm; squares, diamonds: implicit, order 2, 4"
    axis.set_title(words, fontsize=7)
    axis.legend(fontsize=7)
    _save(figure, folder, "stiff")
    plt.close(figure)
