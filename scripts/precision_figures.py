"""Work-precision diagrams."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable
from pathlib import Path
from typing import Any

OURS = {
    "helical": ("#0b4f8a", "o"),
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


def draw(path: Path, title: str, outcomes: Iterable[Any]) -> None:
    """Tip error (mm) against wall time (ms a simulated second), both logarithmic, one line for each set-up."""
    import matplotlib

    matplotlib.use("Agg")
    from matplotlib import pyplot

    lines = defaultdict(list)
    for outcome in outcomes:
        if outcome.error is not None and outcome.line != "helical, default step":
            lines[outcome.who, outcome.line].append((1e3 * outcome.wall, outcome.error))
    figure, axes = pyplot.subplots(figsize=(9.5, 5.6), layout="constrained")
    for number, ((who, line), points) in enumerate(sorted(lines.items())):
        xs, ys = zip(*sorted(points))
        if line == "helical, conditioned":
            axes.plot(xs, ys, ".", color="#0b4f8a", alpha=0.35, label=line)
        elif who == "magrod":
            color, mark = OURS[line]
            axes.plot(xs, ys, "-" + mark, color=color, lw=1.4, ms=5, label=line)
        else:
            mark = MARKS[number % len(MARKS)]
            axes.plot(xs, ys, "--" + mark, color=PEERS[who], lw=0.9, ms=4, label=f"{who}: {line}")
    axes.set(xscale="log", yscale="log", xlabel="wall time, ms a simulated second, one core", title=title)
    axes.set_ylabel("RMS error of the tip, mm")
    axes.grid(which="both", alpha=0.2)
    axes.legend(fontsize=7, loc="center left", bbox_to_anchor=(1.0, 0.5))
    path.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(path, dpi=130)
    pyplot.close(figure)
