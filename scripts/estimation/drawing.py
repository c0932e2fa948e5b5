"""Figures of the twin experiments."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from scripts.estimation.studies import WAYS, Figures
from scripts.estimation.tables import Found
from scripts.estimation.twins import CASES
from scripts.reproduction.experiments import EXPERIMENTS

COLOURS = {
    "model": "#999999",
    "held": "#56b4e9",
    "extended": "#56b4e9",
    "printed": "#e69f00",
    "paper": "#d55e00",
    "ensemble": "#0072b2",
    "unscented": "#009e73",
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


def _pyplot() -> Any:
    import matplotlib

    matplotlib.use("Agg")
    from matplotlib import pyplot

    return pyplot


def _save(figure: Any, path: Path) -> Path:
    path.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(path, dpi=120)
    _pyplot().close(figure)
    return path


def _smooth(run: Figures, windows: int = 50) -> tuple[np.ndarray, np.ndarray]:
    """Means of a course over short windows, NaN where it is not known."""
    times, tip = np.array(run["times"]), np.array([np.nan if v is None else v for v in run["tip"]], float)
    size = max(1, len(tip) // windows)
    count = len(tip) // size
    return times[: count * size].reshape(count, size).mean(axis=1), tip[: count * size].reshape(count, size).mean(
        axis=1
    )


def errors(found: Found, truth: str, folder: Path) -> Path:
    """Tip error against time, one panel an experiment."""
    pyplot = _pyplot()
    numbers = sorted({number for number, _, _ in found})
    columns = min(3, len(numbers))
    rows = -(-len(numbers) // columns)
    figure, axes = pyplot.subplots(rows, columns, figsize=(3.9 * columns, 2.7 * rows + 0.5), squeeze=False)
    for axis, number in zip(axes.ravel(), numbers):
        for way in SHOWN:
            axis.semilogy(*_smooth(found[number, truth, way]), color=COLOURS[way], label=WAYS[way], linewidth=1.4)
        case = CASES[number - 1]
        mean = 1e3 * max(error.mean for error in case.record.reported_errors if error.point == "tip")
        axis.axhline(mean, color="black", linestyle=":", linewidth=1.0, label="largest mean of Table 8, an axis")
        axis.axhline(0.080, color="black", linestyle="--", linewidth=0.8, label="a frame's own noise")
        axis.set_title(f"{number}: {EXPERIMENTS[number - 1].title}", fontsize=9)
        axis.set_xlabel("time, s")
        axis.set_ylabel("tip error, mm")
    handles, labels = axes[0, 0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="lower center", ncol=3, frameon=False, fontsize=8)
    figure.tight_layout(rect=(0, 0.14 if rows == 1 else 0.08, 1, 1))
    return _save(figure, folder / "estimate_errors.png")


def work(found: list[tuple[Any, str, str, Any, Figures]], folder: Path) -> Path:
    """Error against speed, one panel an experiment, a line for each quantity that is varied."""
    pyplot = _pyplot()
    cases = list(dict.fromkeys(case for case, *_ in found))
    figure, axes = pyplot.subplots(1, len(cases), figsize=(5.6 * len(cases), 5.8), squeeze=False)
    for axis, case in zip(axes[0], cases):
        for way, what in dict.fromkeys((way, what) for c, way, what, *_ in found if c == case):
            those = [(v, run) for c, w, k, v, run in found if (c, w, k) == (case, way, what)]
            speeds, tips = [run["speed"] for _, run in those], [run["mean"][0][3] for _, run in those]
            name = {"unscented": "unscented filter"}.get(way) or WAYS[way]
            label = f"{name}: {what}"
            mark, dashes, offset = VARIED[what]
            style = dict(marker=mark, linestyle=dashes, color=COLOURS[way], linewidth=1, markersize=5)
            axis.loglog(speeds, tips, label=label, markerfacecolor="none" if dashes == "--" else None, **style)
            for (value, _), x, y in zip(those, speeds, tips):
                if value not in USUAL:
                    axis.annotate(
                        str(value), (x, y), offset, textcoords="offset points", fontsize=7, ha="center", va="center"
                    )
        axis.axvline(1.0, color="black", linewidth=0.8, linestyle=":")
        axis.set(xlabel="simulated over wall time, one core", ylabel="mean tip error, mm")
        axis.set_title(f"experiment {case.number}: {EXPERIMENTS[case.number - 1].title}", fontsize=9)
    handles, labels = axes[0, 0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="lower center", ncol=2, frameon=False, fontsize=8)
    figure.tight_layout(rect=(0, 0.14, 1, 1))
    return _save(figure, folder / "estimate_work.png")


def trouble(found: list[tuple[Any, str, str, Figures]], folder: Path) -> Path:
    """Tip error against time under each trouble."""
    pyplot = _pyplot()
    cases, names = list(dict.fromkeys(c for c, *_ in found)), list(dict.fromkeys(n for _, n, *_ in found))
    names = [name for name in names if name != "none"] or names
    size = (3.2 * len(names) + 0.4, 2.4 * len(cases) + 0.7)
    figure, axes = pyplot.subplots(len(cases), len(names), figsize=size, squeeze=False, sharey="row")
    for row, case in zip(axes, cases):
        for axis, name in zip(row, names):
            for c, n, way, run in found:
                if (c, n) == (case, name) and way in SHOWN:
                    axis.semilogy(*_smooth(run), color=COLOURS[way], label=WAYS[way], linewidth=1.3)
            axis.set_title(f"{case.number}: {name}", fontsize=8)
            axis.set_xlabel("time, s", fontsize=8)
        row[0].set_ylabel("tip error, mm", fontsize=8)
    handles, labels = axes[0, 0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="lower center", ncol=4, frameon=False, fontsize=8)
    figure.tight_layout(rect=(0, 0.07, 1, 1))
    return _save(figure, folder / "estimate_trouble.png")
