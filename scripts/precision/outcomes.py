"""Points of the diagrams: what was run, its error and its run time; the best of them; the diagrams."""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

from scripts.common.figure import COLOURS, figure

OURS = {
    "helical": (COLOURS["helical"], "o"),
    "helical, conditioned": ("#4a90c2", "."),
    "helical, planar": (COLOURS["planar"], "s"),
    "helical, float32": ("#6fa8dc", "v"),
    "helical, batch of 64, per rod": (COLOURS["batch"], "D"),
    "helical, implicit": (COLOURS["implicit"], "^"),
    "helical, implicit, order 4": ("#0a4d1f", "P"),
    "helical, no corrections": ("#e07a5f", "x"),
    "helical, flexibility only": (COLOURS["flexibility"], "+"),
    "helical, masses only": ("#c9a227", "1"),
    "nodal (paper)": (COLOURS["nodal"], "^"),
    "nodal, frequency shaping (paper)": (COLOURS["shaped"], ">"),
    "tolerance": (COLOURS["truth"], "*"),
}
PEERS = {"MuJoCo": "#4d4d4d", "PyElastica": "#7a7a7a", "SoRoMoX": "#a0a0a0", "spectral": "#386641"}
MARKS = "PdhpX8<>"
SCATTERED = ("helical, conditioned", "helical, implicit", "helical, implicit, order 4")  # two settings: a cloud


@dataclass(frozen=True)
class Outcome:
    """One point of a diagram; error in mm, wall time in s a simulated second and rod; both None if it diverged."""

    scene: str
    who: str
    line: str
    resolution: str
    error: float | None
    wall: float | None

    @property
    def key(self) -> str:
        """What was run."""
        return key(self.scene, self.who, self.line, self.resolution)

    @property
    def milliseconds(self) -> float | None:
        """Wall time, ms a simulated second."""
        return None if self.wall is None else 1e3 * self.wall

    @property
    def point(self) -> tuple[float, float]:
        """Wall time (s) and error (mm), infinite if it diverged."""
        return (math.inf if self.wall is None else self.wall, math.inf if self.error is None else self.error)


def key(*words: str) -> str:
    """What was run, as a store's key: scene, who, line, resolution."""
    return "/".join(words)


def front(outcomes: Iterable[Outcome]) -> list[Outcome]:
    """Those that no other beats in both error and time, the quickest first."""
    best, kept = math.inf, []
    for outcome in sorted(outcomes, key=lambda outcome: outcome.point):
        if outcome.point[1] < best:
            best = outcome.point[1]
            kept.append(outcome)
    return kept


def cheapest(outcomes: Iterable[Outcome], level: float) -> Outcome | None:
    """The quickest run whose error is at most ``level`` (mm)."""
    good = (outcome for outcome in outcomes if outcome.error is not None and outcome.error <= level)
    return min(good, key=lambda outcome: outcome.point[0], default=None)


def draw(path: Path, title: str, outcomes: Iterable[Outcome]) -> Path:
    """Tip error (mm) against wall time (ms a simulated second), both logarithmic, one line for each set-up."""
    lines = defaultdict(list)
    for outcome in outcomes:
        if outcome.error is not None and outcome.line != "helical, default step":
            lines[outcome.who, outcome.line].append(outcome)
    with figure(path, (9.5, 5.6)) as drawn:
        axes = drawn.subplots()
        for number, ((who, line), points) in enumerate(sorted(lines.items())):
            color, mark = OURS[line] if who == "magrod" else (PEERS[who], MARKS[number % len(MARKS)])
            if line in SCATTERED:
                axes.plot(*_coordinates(points), ".", color=color, alpha=0.25)
                points = front(points)
            dashes, width, size = ("-", 1.4, 5.0) if who == "magrod" else ("--", 0.9, 4.0)
            label = line if who == "magrod" else f"{who}: {line}"
            (drawn_line,) = axes.plot(*_coordinates(points), color=color, label=label, lw=width, ls=dashes)
            drawn_line.set(marker=mark, markersize=size)
        axes.set(xscale="log", yscale="log", xlabel="wall time, ms a simulated second, one core", title=title)
        axes.set_ylabel("RMS error of the tip, mm")
        axes.grid(which="both", alpha=0.2)
        axes.legend(fontsize=7, loc="center left", bbox_to_anchor=(1.0, 0.5))
    return path


def _coordinates(outcomes: Iterable[Outcome]) -> tuple[list[float], list[float]]:
    """Wall times, ms, in order, and errors, mm."""
    points = sorted(outcome.point for outcome in outcomes)
    return [1e3 * wall for wall, _ in points], [error for _, error in points]
