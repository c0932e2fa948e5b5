"""What moves with the task: the dial of the field, targets, path and trace."""

from math import hypot
from typing import Final

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from magrod_env.rendering import palette
from magrod_env.rendering.camera import Camera
from magrod_env.rendering.canvas import Box, Canvas, write

Array = NDArray[np.float64]

_MARGIN: Final = 14.0
_DIAL_RADIUS: Final = 42.0
_SYMBOL_RADIUS: Final = 8.0
_TICKS: Final = np.array([[1.0, 0.0], [-1.0, 0.0], [0.0, 1.0], [0.0, -1.0]])
_MOST_POINTS: Final = 400  # of a path or trace


def draw_field(frame: Image.Image, pane: Box, camera: Camera, field: Array, limit: float, unit: float) -> None:
    """The dial in the pane's upper right corner: the field's arrow in the picture plane, rim at `limit` (T).

    The ring beside it shows the part along the line of sight: a dot towards the viewer, a cross away from it.
    """
    radius = _DIAL_RADIUS * unit
    centre = np.array([pane[2] - radius - _MARGIN * unit, pane[1] + radius + _MARGIN * unit])
    canvas = Canvas(frame, _around(centre, radius + (2 * _SYMBOL_RADIUS + 8) * unit, pane))
    canvas.disc(centre, radius, palette.BACKGROUND)
    canvas.ring(centre, radius, palette.PANE_EDGE, 1.2 * unit)
    strength = hypot(*field)
    if np.isfinite(strength):
        right, up, towards = camera.axes @ field / max(limit, strength)
        canvas.disc(centre, 1.8 * unit, palette.FIELD)
        canvas.arrow(centre, centre + radius * np.array([right, -up]), palette.FIELD, 2.8 * unit)
        _draw_line_of_sight(canvas, centre + radius * np.array([-0.8, 0.8]), towards, unit)
    canvas.finish()
    below = centre + np.array([0.0, radius + 11 * unit])
    write(frame, below, f"{amount(1e3 * strength, 1)} mT", palette.FIELD, 13 * unit, "middle")


def _draw_line_of_sight(canvas: Canvas, centre: Array, towards: float, unit: float) -> None:
    """A ring with a dot or a cross that grows with the field along the line of sight, -1..1 of the dial."""
    if abs(towards) < 0.01:
        return
    colour = palette.blend(palette.PANE_EDGE, palette.FIELD, min(1.0, 3 * abs(towards)))
    reach = _SYMBOL_RADIUS * unit * np.sqrt(abs(towards))
    canvas.disc(centre, _SYMBOL_RADIUS * unit, palette.PANE)
    canvas.ring(centre, _SYMBOL_RADIUS * unit, colour, 1.4 * unit)
    if towards > 0:
        canvas.disc(centre, 0.7 * reach, colour)
        return
    for corner in np.array([[1.0, 1.0], [1.0, -1.0]]) * reach / np.sqrt(2):
        canvas.line(np.stack([centre - corner, centre + corner]), colour, 1.4 * unit)


def draw_path(canvas: Canvas, camera: Camera, path: Array, unit: float) -> None:
    """The desired path (M, 3), m, as a thin line."""
    if len(path) > 1:
        canvas.line(camera.project(path), palette.PATH, 1.5 * unit)


def draw_trace(canvas: Canvas, camera: Camera, trace: Array, unit: float) -> None:
    """Where the tip has been (T, 3), m, oldest first; the past fades."""
    if len(trace) > 1:
        canvas.fading_line(camera.project(trace), palette.TRACE, 2 * unit)


def draw_targets(canvas: Canvas, camera: Camera, targets: Array, radius: float, unit: float) -> None:
    """A ring with four ticks around each target (k, 3), m; `radius` is the ring's, pixels."""
    for centre in camera.project(targets):
        canvas.ring(centre, radius, palette.TARGET, 2 * unit)
        for tick in _TICKS:
            ends = centre + np.stack([tick * (radius - unit), tick * (radius + 4 * unit)])
            canvas.line(ends, palette.TARGET, 2 * unit)


def amount(value: float, digits: int) -> str:
    """A number with fixed digits, or with an exponent where those would run off the frame."""
    return f"{value:.{digits}f}" if abs(value) < 1e5 else f"{value:.1e}"


def thinned(points: Array) -> Array:
    """Points (M, 3) without those that are not finite or kilometres away, at most 400, the last one kept."""
    points = points[(np.abs(points) < 1e3).all(axis=1)]
    step = -(-len(points) // _MOST_POINTS) or 1
    return points[(len(points) - 1) % step :: step]


def _around(centre: Array, reach: float, pane: Box) -> Box:
    """The square of half edge `reach` around a point, cut at the pane."""
    left, top = np.floor(np.maximum(centre - reach, pane[:2])).astype(int).tolist()
    right, bottom = np.ceil(np.minimum(centre + reach, pane[2:])).astype(int).tolist()
    return left, top, right, bottom
