"""Figures like the paper's: tip against time, paths in space, frequency against the number of elements."""

from __future__ import annotations

import io
from pathlib import Path

import numpy as np

from scripts.precision_figures import OURS
from scripts.reproduction.experiments import EXPERIMENTS, TENTH, TENTH_EFFECTIVE, last_turn
from scripts.reproduction.frequency import PERIODS, Frequencies, Scaled
from scripts.reproduction.runs import DAMPED, EFFECTIVE, NODAL, PRINTED, SHAPED, Run

COLOURS = {
    NODAL.name: OURS["nodal (paper)"][0],
    SHAPED.name: OURS["nodal, frequency shaping (paper)"][0],
    PRINTED.name: OURS["helical"][0],
    EFFECTIVE.name: OURS["helical, planar"][0],
    TENTH.name: OURS["helical, flexibility only"][0],
    TENTH_EFFECTIVE.name: OURS["helical, batch of 64, per rod"][0],
}
DASHES = {
    SHAPED.name: (4, 2),
    EFFECTIVE.name: (5, 2),
    TENTH_EFFECTIVE.name: (5, 2),
}  # where two curves lie on each other
TICKS_HZ = (2, 3, 5, 7, 10, 15, 20, 30)
TICKS_GAMMA = (0.7, 1, 2, 3, 5, 10, 20, 30, 50)
FIGURE_OF_PAPER = {1: "Fig. 6", 2: "Fig. 7", 3: "Fig. 9", 4: "Fig. 11", 5: "Fig. 13", 6: "Fig. 15"}


def _pyplot():
    import matplotlib

    matplotlib.use("Agg")
    from matplotlib import pyplot

    return pyplot


def _style(run: Run, **changes) -> dict:
    bare = run.model.name.removesuffix(", drag")
    style = dict(color=COLOURS[bare], lw=1.5, label=bare)
    return style | (dict(dashes=DASHES[bare]) if bare in DASHES else {}) | changes


def _lines(axes, some: list[Run], axis: int, *, point: int = 0, until: float = np.inf, **changes) -> None:
    for run in some:
        shown = run.times <= until + 1e-9
        axes.plot(run.times[shown], 1e3 * run.points[shown, point, axis], **_style(run, **changes))
    axes.set_xlabel("time, s")
    axes.grid(alpha=0.25)
    axes.margins(x=0.0)


def _save(figure, path: Path) -> Path:
    from PIL import Image

    path.parent.mkdir(parents=True, exist_ok=True)
    picture = io.BytesIO()
    figure.savefig(picture, dpi=130)
    Image.open(picture).convert("RGB").quantize(256).save(path, optimize=True)
    _pyplot().close(figure)
    return path


def _title(figure, number: int) -> None:
    experiment = EXPERIMENTS[number - 1]
    figure.suptitle(
        f"Experiment {number}: {experiment.title} (after the paper's {FIGURE_OF_PAPER[number]})", fontsize=11
    )


def _legend(figure, axes, columns: int) -> None:
    lines, words = axes.get_legend_handles_labels()
    figure.legend(lines, words, loc="outside lower center", ncols=columns, fontsize=8, frameon=False)


def _swing(some: list[Run]) -> float:
    """A time, s, in which the slow runs swing about three times."""
    return min(0.1, float(some[0].times[-1]))


def draw_in_plane(some: list[Run], path: Path) -> Path:
    """Experiment 1: the whole run and its beginning."""
    figure, (whole, start) = _pyplot().subplots(
        1, 2, figsize=(11.0, 3.6), layout="constrained", sharey=True, gridspec_kw={"width_ratios": (1, 1.4)}
    )
    slow = [run for run in some if run.model != NODAL]
    _lines(whole, slow, 2, lw=0.6)
    _lines(start, some, 2, until=_swing(some))
    whole.set(ylabel="tip across the rod (z), mm", title="whole run, without the locked rod")
    start.set(title="its beginning")
    _title(figure, 1)
    _legend(figure, start, 3)
    return _save(figure, path)


def draw_out_of_plane(some: list[Run], path: Path) -> Path:
    """Experiment 2: both coordinates, and the path in space."""
    pyplot = _pyplot()
    figure = pyplot.figure(figsize=(11.0, 5.6), layout="constrained")
    grid = figure.add_gridspec(2, 2, width_ratios=(1.25, 1.0))
    for row, (axis, letter) in enumerate(((1, "y"), (2, "z"))):
        axes = figure.add_subplot(grid[row, 0])
        _lines(axes, some, axis, until=2.0 * _swing(some))
        axes.set_ylabel(f"tip, {letter}, mm")
    space = figure.add_subplot(grid[:, 1], projection="3d")
    for run, width in zip(some, (4.0, 2.0, 0.8)):
        x, y, z = 1e3 * run.tip.T
        space.plot(y, z, x, **_style(run, lw=width))
    space.set(xlabel="y, mm", ylabel="z, mm", zlabel="x, mm")
    space.set_title("path of the tip, whole run", y=0.95)
    space.set(xticks=(-8, 0, 8), yticks=(-10, 0, 10))
    space.locator_params(axis="z", nbins=4)
    space.zaxis.labelpad = 10
    space.view_init(elev=22, azim=-60)
    space.set_box_aspect((1, 1, 0.8), zoom=0.9)
    _title(figure, 2)
    _legend(figure, axes, 3)
    return _save(figure, path)


def draw_released(number: int, some: list[Run], path: Path) -> Path:
    """Experiments 3 and 4: across and along the rod."""
    figure, panels = _pyplot().subplots(2, 1, figsize=(9.5, 5.8), layout="constrained", sharex=True)
    undamped, damped = ([run for run in some if (run.model == DAMPED) == flag] for flag in (False, True))
    for axes, (axis, words) in zip(panels, ((2, "tip across the rod (z), mm"), (0, "tip along the rod (x), mm"))):
        _lines(axes, undamped, axis)
        _lines(axes, damped, axis, color="#111111", lw=1.2, dashes=(1.5, 1.5), label=DAMPED.name)
        axes.set_ylabel(words)
    panels[0].set_xlabel("")
    _title(figure, number)
    _legend(figure, panels[0], 5)
    return _save(figure, path)


def draw_circle(some: list[Run], path: Path) -> Path:
    """Experiment 5: the path in space, and seen along the rod."""
    pyplot = _pyplot()
    figure = pyplot.figure(figsize=(11.0, 5.4), layout="constrained")
    space = figure.add_subplot(1, 2, 1, projection="3d")
    flat = figure.add_subplot(1, 2, 2)
    for run in some:
        x, y, z = 1e3 * last_turn(run).T
        space.plot(x, y, z, **_style(run))
        flat.plot(y, z, **_style(run))
        x, y, z = 1e3 * run.simulation.positions[0].T
        space.plot(x, y, z, marker="o", **_style(run, lw=0.8, ms=2.0, alpha=0.7, label=None))
    space.set(xlabel="x, mm", ylabel="y, mm", zlabel="z, mm", title="last turn, and the rod at its end")
    space.set_aspect("equal")
    space.view_init(elev=20, azim=-60)
    flat.set(xlabel="y, mm", ylabel="z, mm", title="seen along the rod", aspect="equal")
    flat.grid(alpha=0.25)
    _title(figure, 5)
    _legend(figure, flat, 4)
    return _save(figure, path)


def draw_two_magnets(some: list[Run], path: Path) -> Path:
    """Experiment 6: both magnets, across and along the rod, and the shapes of one rod."""
    figure, panels = _pyplot().subplots(2, 2, figsize=(11.0, 6.0), layout="constrained", sharex=True)
    for column, point in enumerate(("tip", "middle")):
        for row, (axis, letter) in enumerate(((2, "z"), (0, "x"))):
            _lines(panels[row, column], some, axis, point=column)
            panels[row, column].set_ylabel(f"{point} magnet, {letter}, mm")
    for axes in panels[0]:
        axes.set_xlabel("")
    _title(figure, 6)
    _legend(figure, panels[0, 0], 5)
    return _save(figure, path)


def draw_scaling(made: dict[str, Scaled], path: Path) -> Path:
    """Fig. 16: high, low, and their distance."""
    figure, (high, low, apart) = _pyplot().subplots(1, 3, figsize=(12.5, 3.8), layout="constrained")
    for name, one in made.items():
        style = _style(one.high)
        high.plot(one.high.times, 1e3 * one.high.tip[:, 2], **style)
        low.plot(one.low.times, 1e3 * one.low.tip[:, 2], **style)
        for run, words, width in ((one.low, "steps in the ratio", 1.5), (one.low_fine, "the same step", 0.8)):
            distance = 1e3 * np.linalg.norm(run.tip - one.high.tip, axis=1)
            label = f"{name.split(',')[0]}, {words}"
            apart.plot(one.high.times[1:], distance[1:], **style | dict(lw=width, label=label))
    high.set(title="(a) E = 5e7 Pa", ylabel="tip across the rod (z), mm", xlabel="time, s")
    low.set(title="(b) E = 5e5 Pa", xlabel="time, s")
    apart.set(title="(c) distance of the two", xlabel="time of (a), s", ylabel="distance of the tips, mm", yscale="log")
    for axes in (high, low, apart):
        axes.grid(alpha=0.25)
        axes.margins(x=0.0)
    apart.legend(fontsize=7)
    _legend(figure, high, 2)
    figure.suptitle("One motion at two moduli (after the paper's Fig. 16)", fontsize=11)
    return _save(figure, path)


def draw_frequencies(made: dict[str, Frequencies], path: Path) -> Path:
    """Frequency over the true one, and gamma, against the number of elements, for each rod."""
    figure, panels = _pyplot().subplots(2, len(made), figsize=(11.0, 7.4), layout="constrained", squeeze=False)
    marks = {NODAL.name: "^", SHAPED.name: ">", PRINTED.name: "o"}
    for (words, one), (top, bottom) in zip(made.items(), panels.T):
        fine = np.geomspace(one.counts[0], one.counts[-1], 100)
        closed = 1.0 + (one.closed[0] - 1.0) * (one.counts[0] / fine) ** 2
        for name, values in one.found.items():
            style = dict(color=COLOURS[name], lw=1.3, ms=5, label=name.replace(", printed E", ""))
            top.plot(one.counts, values, "-" + marks[name], **style)
            bottom.plot(one.counts, one.gammas(name), "-" + marks[name], **style)
        dashed = dict(ls="--", color="#555555", lw=1.0, label="closed form, 1 + GA h²/(4 EI)")
        top.plot(fine, one.true * np.sqrt(closed), **dashed)
        bottom.plot(fine, closed, **dashed)
        top.set(title=words, ylabel="frequency, Hz")
        bottom.set(ylabel="gamma of section 5: (f / f true)²", xlabel="elements")
        for axes, ticks in ((top, TICKS_HZ), (bottom, TICKS_GAMMA)):
            axes.set(xscale="log", yscale="log")
            low, high = axes.get_ylim()
            axes.set_xticks(one.counts, [str(count) for count in one.counts])
            axes.set_yticks(ticks, [f"{tick:g}" for tick in ticks])
            axes.set_ylim(low, high)
            axes.minorticks_off()
            axes.grid(alpha=0.25)
    _legend(figure, panels[0, 0], 4)
    figure.suptitle(f"Frequency against the number of elements, small swings over {PERIODS} periods", fontsize=11)
    return _save(figure, path)


def draw_experiments(made: dict[int, list[Run]], folder: Path) -> dict[str, Path]:
    """A figure for each experiment, by the key of its table."""
    paths = {number: folder / f"reproduction_{number}.png" for number in made}
    drawers = {1: draw_in_plane, 2: draw_out_of_plane, 5: draw_circle, 6: draw_two_magnets}
    for number, some in made.items():
        if number in drawers:
            drawers[number](some, paths[number])
        else:
            draw_released(number, some, paths[number])
    return {f"experiment_{number}": path for number, path in paths.items()}
