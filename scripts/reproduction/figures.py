"""Figures like the paper's: tip against time, paths in space, frequency against the number of elements."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, TypedDict

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from scripts.common.figure import COLOURS, figure, legend_below
from scripts.reproduction.experiments import EXPERIMENTS, TENTH, TENTH_EFFECTIVE, last_turn
from scripts.reproduction.frequency import PERIODS, Frequencies, Scaled
from scripts.reproduction.runs import DAMPED, EFFECTIVE, NODAL, PRINTED, SHAPED, Run

if TYPE_CHECKING:
    from typing_extensions import Unpack

LINES = {
    NODAL.name: COLOURS["nodal"],
    SHAPED.name: COLOURS["shaped"],
    PRINTED.name: COLOURS["helical"],
    EFFECTIVE.name: COLOURS["planar"],
    TENTH.name: COLOURS["flexibility"],
    TENTH_EFFECTIVE.name: COLOURS["batch"],
}
DASHES = {SHAPED.name: (4, 2), EFFECTIVE.name: (5, 2), TENTH_EFFECTIVE.name: (5, 2)}  # where two curves coincide
TICKS_HZ = (2, 3, 5, 7, 10, 15, 20, 30)
TICKS_GAMMA = (0.7, 1, 2, 3, 5, 10, 20, 30, 50)
FIGURE_OF_PAPER = {1: "Fig. 6", 2: "Fig. 7", 3: "Fig. 9", 4: "Fig. 11", 5: "Fig. 13", 6: "Fig. 15"}


class Style(TypedDict, total=False):
    """How a line is drawn."""

    color: str
    lw: float
    ms: float
    alpha: float
    label: str | None
    marker: str
    dashes: tuple[float, float]


def _style(run: Run, **changes: Unpack[Style]) -> Style:
    bare = run.model.name.removesuffix(", drag")
    style = Style(color=LINES[bare], lw=1.5, label=bare)
    if bare in DASHES:
        style["dashes"] = DASHES[bare]
    return {**style, **changes}


def _plot(axes: Axes, run: Run, axis: int, *, point: int = 0, until: float = np.inf, **changes: Unpack[Style]) -> None:
    """A coordinate of a point, mm, against time."""
    shown = run.times <= until + 1e-9
    axes.plot(run.times[shown], 1e3 * run.points[shown, point, axis], **_style(run, **changes))


def _finish(axes: Axes, words: str, xlabel: str = "time, s") -> None:
    axes.set(xlabel=xlabel, ylabel=words)
    axes.grid(alpha=0.25)
    axes.margins(x=0.0)


def _swing(some: list[Run]) -> float:
    """A time, s, in which the slow runs swing about three times."""
    return min(0.1, float(some[0].times[-1]))


def draw_in_plane(drawn: Figure, some: list[Run]) -> Axes:
    """Experiment 1: the whole run and its beginning."""
    whole, start = drawn.subplots(1, 2, sharey=True, width_ratios=(1, 1.4))
    for run in some:
        _plot(start, run, 2, until=_swing(some))
        if run.model != NODAL:
            _plot(whole, run, 2, lw=0.6)
    _finish(whole, "tip across the rod (z), mm")
    _finish(start, "")
    whole.set(title="whole run, without the locked rod")
    start.set(title="its beginning")
    return start


def draw_out_of_plane(drawn: Figure, some: list[Run]) -> Axes:
    """Experiment 2: both coordinates, and the path in space."""
    space = {"projection": "3d"}
    panels = drawn.subplot_mosaic("yp;zp", width_ratios=(1.25, 1.0), per_subplot_kw={"p": space})
    for axis, letter in ((1, "y"), (2, "z")):
        for run in some:
            _plot(panels[letter], run, axis, until=2.0 * _swing(some))
        _finish(panels[letter], f"tip, {letter}, mm")
    path = panels["p"]
    for run, width in zip(some, (4.0, 2.0, 0.8)):
        x, y, z = 1e3 * run.tip.T
        path.plot(y, z, x, **_style(run, lw=width))
    path.set(xlabel="y, mm", ylabel="z, mm", zlabel="x, mm", xticks=(-8, 0, 8), yticks=(-10, 0, 10))
    path.set_title("path of the tip, whole run", y=0.95)
    path.locator_params(axis="z", nbins=4)  # type: ignore[arg-type]
    path.zaxis.labelpad = 10  # type: ignore[attr-defined]
    path.view_init(elev=22, azim=-60)  # type: ignore[attr-defined]
    path.set_box_aspect((1, 1, 0.8), zoom=0.9)  # type: ignore[call-arg, arg-type]
    return panels["z"]


def draw_released(drawn: Figure, some: list[Run]) -> Axes:
    """Experiments 3 and 4: across and along the rod."""
    panels = drawn.subplots(2, 1, sharex=True)
    for axes, axis, words in zip(panels, (2, 0), ("across the rod (z)", "along the rod (x)")):
        for run in some:
            damped = Style(color=COLOURS["truth"], lw=1.2, dashes=(1.5, 1.5), label=DAMPED.name)
            _plot(axes, run, axis, **(damped if run.model == DAMPED else Style()))
        _finish(axes, f"tip {words}, mm", "time, s" if axis == 0 else "")
    return panels[0]


def draw_circle(drawn: Figure, some: list[Run]) -> Axes:
    """Experiment 5: the path in space, and seen along the rod."""
    panels = drawn.subplot_mosaic("sf", per_subplot_kw={"s": {"projection": "3d"}})
    space, flat = panels["s"], panels["f"]
    for run in some:
        x, y, z = 1e3 * last_turn(run).T
        space.plot(x, y, z, **_style(run))
        flat.plot(y, z, **_style(run))
        x, y, z = 1e3 * run.simulation.positions[0].T
        space.plot(x, y, z, **_style(run, marker="o", lw=0.8, ms=2.0, alpha=0.7, label=None))
    space.set(xlabel="x, mm", ylabel="y, mm", zlabel="z, mm", title="last turn, and the rod at its end")
    space.set_aspect("equal")
    space.view_init(elev=20, azim=-60)  # type: ignore[attr-defined]
    flat.set(xlabel="y, mm", ylabel="z, mm", title="seen along the rod", aspect="equal")
    flat.grid(alpha=0.25)
    return flat


def draw_two_magnets(drawn: Figure, some: list[Run]) -> Axes:
    """Experiment 6: both magnets, across and along the rod."""
    panels = drawn.subplots(2, 2, sharex=True)
    for column, point in enumerate(("tip", "middle")):
        for row, (axis, letter) in enumerate(((2, "z"), (0, "x"))):
            for run in some:
                _plot(panels[row, column], run, axis, point=column)
            _finish(panels[row, column], f"{point} magnet, {letter}, mm", "time, s" if row else "")
    return panels[0, 0]


PANELS: dict[int, tuple[Callable[[Figure, list[Run]], Axes], tuple[float, float], int]] = {
    1: (draw_in_plane, (11.0, 3.6), 3),
    2: (draw_out_of_plane, (11.0, 5.6), 3),
    3: (draw_released, (9.5, 5.8), 5),
    4: (draw_released, (9.5, 5.8), 5),
    5: (draw_circle, (11.0, 5.4), 4),
    6: (draw_two_magnets, (11.0, 6.0), 5),
}
"""What draws an experiment, the size of its figure, inches, and the columns of its legend."""


def draw_scaling(made: dict[str, Scaled], path: Path) -> Path:
    """Fig. 16: high, low, and their distance."""
    with figure(path, (12.5, 3.8)) as drawn:
        high, low, apart = drawn.subplots(1, 3)
        for name, one in made.items():
            _plot(high, one.high, 2)
            _plot(low, one.low, 2)
            for run, words, width in ((one.low, "steps in the ratio", 1.5), (one.low_fine, "the same step", 0.8)):
                distance = 1e3 * np.linalg.norm(run.tip - one.high.tip, axis=1)
                label = f"{name.split(',')[0]}, {words}"
                apart.plot(one.high.times[1:], distance[1:], **_style(one.high, lw=width, label=label))
        _finish(high, "tip across the rod (z), mm")
        _finish(low, "")
        _finish(apart, "distance of the tips, mm", "time of (a), s")
        apart.set(yscale="log")
        for axes, title in zip((high, low, apart), ("(a) E = 5e7 Pa", "(b) E = 5e5 Pa", "(c) distance of the two")):
            axes.set_title(title)
        apart.legend(fontsize=7)
        legend_below(drawn, high, 2)
        drawn.suptitle("One motion at two moduli (after the paper's Fig. 16)", fontsize=11)
    return path


def draw_frequencies(made: dict[str, Frequencies], path: Path) -> Path:
    """Frequency over the true one, and gamma, against the number of elements, for each rod."""
    marks = {NODAL.name: "^", SHAPED.name: ">", PRINTED.name: "o"}
    with figure(path, (11.0, 7.4)) as drawn:
        panels = drawn.subplots(2, len(made), squeeze=False)
        for (words, one), (top, bottom) in zip(made.items(), panels.T):
            fine = np.geomspace(one.counts[0], one.counts[-1], 100)
            closed = 1.0 + (one.closed[0] - 1.0) * (one.counts[0] / fine) ** 2
            for name, values in one.found.items():
                style = Style(color=LINES[name], lw=1.3, ms=5, label=name.replace(", printed E", ""))
                top.plot(one.counts, values, "-" + marks[name], **style)
                bottom.plot(one.counts, one.gammas(name), "-" + marks[name], **style)
            dashed = partial(Axes.plot, color="#555555", ls="--", lw=1.0, label="closed form, 1 + GA h²/(4 EI)")
            dashed(top, fine, one.true * np.sqrt(closed))
            dashed(bottom, fine, closed)
            top.set(title=words, ylabel="frequency, Hz")
            bottom.set(ylabel="gamma of section 5: (f / f true)²", xlabel="elements")
            _log_ticks(top, one.counts, TICKS_HZ)
            _log_ticks(bottom, one.counts, TICKS_GAMMA)
        legend_below(drawn, panels[0, 0], 4)
        title = f"Frequency against the number of elements, small swings over {PERIODS} periods"
        drawn.suptitle(title, fontsize=11)
    return path


def _log_ticks(axes: Axes, counts: tuple[int, ...], ticks: tuple[float, ...]) -> None:
    """Logarithmic axes with ticks in plain numbers."""
    axes.set(xscale="log", yscale="log")
    low, high = axes.get_ylim()
    axes.set_xticks(counts, [str(count) for count in counts])
    axes.set_yticks(ticks, [f"{tick:g}" for tick in ticks])
    axes.set_ylim(low, high)
    axes.minorticks_off()
    axes.grid(alpha=0.25)


def draw_experiments(made: dict[int, list[Run]], folder: Path) -> dict[str, Path]:
    """A figure for each experiment, by the key of its table."""
    paths = {}
    for number, some in made.items():
        draw, size, columns = PANELS[number]
        path = paths[f"experiment_{number}"] = folder / f"reproduction_{number}.png"
        with figure(path, size) as drawn:
            legend_below(drawn, draw(drawn, some), columns)
            words = (
                f"Experiment {number}: {EXPERIMENTS[number - 1].title} (after the paper's {FIGURE_OF_PAPER[number]})"
            )
            drawn.suptitle(words, fontsize=11)
    return paths
