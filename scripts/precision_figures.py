"""Work-precision diagrams."""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Iterable
from pathlib import Path
from typing import Any

OURS = {
    "helical": ("#0b4f8a", "o"),
    "helical, conditioned": ("#4a90c2", "."),
    "helical, planar": ("#2a9d8f", "s"),
    "helical, float32": ("#6fa8dc", "v"),
    "helical, batch of 64, per rod": ("#7b2cbf", "D"),
    "helical, implicit": ("#1b7f3b", "^"),
    "helical, implicit, order 4": ("#0a4d1f", "P"),
    "helical, no corrections": ("#e07a5f", "x"),
    "helical, flexibility only": ("#f2a65a", "+"),
    "helical, masses only": ("#c9a227", "1"),
    "nodal (paper)": ("#b00020", "^"),
    "nodal, frequency shaping (paper)": ("#d4737e", ">"),
    "tolerance": ("#111111", "*"),
}
PEERS = {"MuJoCo": "#4d4d4d", "PyElastica": "#7a7a7a", "SoRoMoX": "#a0a0a0", "spectral": "#386641"}
MARKS = "PdhpX8<>"
SCATTERED = ("helical, conditioned", "helical, implicit", "helical, implicit, order 4")  # two settings: a cloud


def front(outcomes: Iterable[Any]) -> list[Any]:
    """Those that no other beats in both error and time, the quickest first."""
    best, kept = math.inf, []
    for outcome in sorted((o for o in outcomes if o.error is not None), key=lambda o: (o.wall, o.error)):
        if outcome.error < best:
            best = outcome.error
            kept.append(outcome)
    return kept


def draw(path: Path, title: str, outcomes: Iterable[Any]) -> None:
    """Tip error (mm) against wall time (ms a simulated second), both logarithmic, one line for each set-up."""
    import matplotlib

    matplotlib.use("Agg")
    from matplotlib import pyplot

    lines = defaultdict(list)
    for outcome in outcomes:
        if outcome.error is not None and outcome.line != "helical, default step":
            lines[outcome.who, outcome.line].append(outcome)
    figure, axes = pyplot.subplots(figsize=(9.5, 5.6), layout="constrained")
    for number, ((who, line), points) in enumerate(sorted(lines.items())):
        color, mark = OURS[line] if who == "magrod" else (PEERS[who], MARKS[number % len(MARKS)])
        if line in SCATTERED:
            axes.plot(*_coordinates(points), ".", color=color, alpha=0.25)
            points = front(points)
        style = {"ls": "-", "lw": 1.4, "ms": 5} if who == "magrod" else {"ls": "--", "lw": 0.9, "ms": 4}
        label = line if who == "magrod" else f"{who}: {line}"
        axes.plot(*_coordinates(points), marker=mark, color=color, label=label, **style)
    axes.set(xscale="log", yscale="log", xlabel="wall time, ms a simulated second, one core", title=title)
    axes.set_ylabel("RMS error of the tip, mm")
    axes.grid(which="both", alpha=0.2)
    axes.legend(fontsize=7, loc="center left", bbox_to_anchor=(1.0, 0.5))
    path.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(path, dpi=130)
    pyplot.close(figure)


def _coordinates(outcomes: Iterable[Any]) -> tuple[list[float], list[float]]:
    """Wall times, ms, in order, and errors, mm."""
    points = sorted((1e3 * outcome.wall, outcome.error) for outcome in outcomes)
    return [wall for wall, _ in points], [error for _, error in points]
