"""The style of all figures: colours by what is drawn, and how a picture is kept."""

from __future__ import annotations

import io
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

COLOURS = {
    "helical": "#0b4f8a",
    "planar": "#2a9d8f",
    "nodal": "#b00020",
    "shaped": "#d4737e",
    "flexibility": "#f2a65a",
    "batch": "#7b2cbf",
    "implicit": "#1b7f3b",
    "truth": "#111111",
    "model": "#999999",
    "frames": "#56b4e9",
    "printed law": "#e69f00",
    "paper": "#d55e00",
    "ensemble": "#0072b2",
    "unscented": "#009e73",
}


@contextmanager
def figure(path: Path, size: tuple[float, float]) -> Iterator[Figure]:
    """A figure of a size (inches) to draw on, kept as a small PNG where the block ends."""
    import matplotlib

    matplotlib.use("Agg")
    from matplotlib import pyplot
    from PIL import Image

    drawn = pyplot.figure(figsize=size, layout="constrained")
    yield drawn
    picture = io.BytesIO()
    drawn.savefig(picture, dpi=130)
    pyplot.close(drawn)
    path.parent.mkdir(parents=True, exist_ok=True)
    Image.open(picture).convert("RGB").quantize(256).save(path, optimize=True)


def legend_below(drawn: Figure, axes: Axes, columns: int) -> None:
    """One legend for all panels, from the lines of one of them."""
    lines, words = axes.get_legend_handles_labels()
    drawn.legend(lines, words, loc="outside lower center", ncols=columns, fontsize=8, frameon=False)
