"""What stands still behind the rod: title and legend, and the panes with grid, scale bar and axes."""

from typing import Final

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from magrod_env.rendering import palette
from magrod_env.rendering.camera import Camera
from magrod_env.rendering.canvas import Box, Canvas, write
from magrod_env.rendering.palette import Colour
from magrod_env.rendering.picture import Picture

Array = NDArray[np.float64]

_MARGIN: Final = 14.0
_ARROW: Final = 28.0
_TASK_LEGEND: Final = (("tip trace", palette.TRACE), ("path", palette.PATH), ("target", palette.TARGET))
_MAGNET_LEGEND: Final = (("south", palette.SOUTH), ("north", palette.NORTH))


def draw_heading(frame: Image.Image, height: int, picture: Picture, unit: float) -> None:
    """Title on the left and legend on the right of the frame's first `height` pixels.

    Here and below `unit` is the size of the drawing relative to a frame of 960 x 480.
    """
    at = np.array([frame.width - 24 * unit, height / 2 + unit])
    for name, colour in _TASK_LEGEND + (_MAGNET_LEGEND if picture.magnet_nodes else ()):
        at[0] -= write(frame, at, name, palette.TEXT_MUTED, 13 * unit, "right") + 15 * unit
        _draw_swatch(frame, at, name, colour, unit)
        at[0] -= 26 * unit
    write(frame, np.array([24 * unit, at[1]]), picture.title, palette.TEXT, 18 * unit)


def _draw_swatch(frame: Image.Image, centre: Array, name: str, colour: Colour, unit: float) -> None:
    canvas = Canvas(frame, (0, 0, frame.width, round(2 * centre[1])))
    if name in ("path", "tip trace"):
        half = np.array([8 * unit, 0.0])
        canvas.line(np.stack([centre - half, centre + half]), colour, 2.5 * unit)
    elif name == "target":
        canvas.ring(centre, 5.5 * unit, colour, 2 * unit)
    else:
        canvas.disc(centre, 5 * unit, colour)
    canvas.finish()


def draw_pane(frame: Image.Image, pane: Box, camera: Camera, picture: Picture, unit: float) -> None:
    """Panel, grid, label, scale bar and axes of one view."""
    step = _round_length(60 * unit / camera.scale)
    canvas = Canvas(frame, pane)
    canvas.panel(pane, palette.PANE, palette.PANE_EDGE, 8 * unit)
    if not camera.follows_tip:
        _draw_grid(canvas, pane, camera, step)
    canvas.finish()
    label = np.array([pane[0] + _MARGIN * unit, pane[1] + 18 * unit])
    write(frame, label, camera.label, palette.TEXT, 14 * unit)
    _draw_scale_bar(frame, pane, camera.scale, step, unit)
    corner = np.array([pane[0] + 24 * unit, pane[3] - 24 * unit])
    for name, axis in zip("xyz", np.eye(3), strict=True):
        _draw_direction(frame, pane, camera, corner, axis, name, unit)
    if picture.gravity is not None:
        gravity = np.asarray(picture.gravity) / np.linalg.norm(picture.gravity)
        start = corner + (84 * unit, -14 * unit) - 14 * unit * camera.screen(gravity)
        _draw_direction(frame, pane, camera, start, gravity, "g", unit)


def _draw_grid(canvas: Canvas, pane: Box, camera: Camera, step: float) -> None:
    """Lines every `step` metres along the two axes of the picture, through the origin."""
    left, top, right, bottom = pane
    origin, spacing = camera.project(np.zeros(3)), step * camera.scale
    for x in np.arange(left + (origin[0] - left) % spacing, right, spacing):
        colour = palette.GRID_ORIGIN if abs(x - origin[0]) < 1 else palette.GRID
        canvas.line(np.array([[x, top + 1.25], [x, bottom - 1.5]]), colour, 1)
    for y in np.arange(top + (origin[1] - top) % spacing, bottom, spacing):
        colour = palette.GRID_ORIGIN if abs(y - origin[1]) < 1 else palette.GRID
        canvas.line(np.array([[left + 1.25, y], [right - 1.5, y]]), colour, 1)


def _draw_scale_bar(frame: Image.Image, pane: Box, scale: float, length: float, unit: float) -> None:
    right, bottom = pane[2] - _MARGIN * unit, pane[3] - _MARGIN * unit
    left, tick = right - length * scale, 4 * unit
    canvas = Canvas(frame, pane)
    canvas.line(np.array([[left, bottom], [right, bottom]]), palette.TEXT, 1.5 * unit)
    for x in (left, right):
        canvas.line(np.array([[x, bottom - tick], [x, bottom + tick]]), palette.TEXT, 1.5 * unit)
    canvas.finish()
    above = np.array([(left + right) / 2, bottom - 11 * unit])
    write(frame, above, f"{1e3 * length:g} mm", palette.TEXT, 12 * unit, "middle")


def _draw_direction(
    frame: Image.Image, pane: Box, camera: Camera, start: Array, direction: Array, name: str, unit: float
) -> None:
    """A labelled arrow for a world direction (3,), unless it points along the line of sight."""
    along = camera.screen(direction)
    if np.hypot(*along) < 0.1:
        return
    canvas = Canvas(frame, pane)
    canvas.arrow(start, start + _ARROW * unit * along, palette.TEXT_MUTED, 1.5 * unit)
    canvas.finish()
    end = start + unit * along * (_ARROW + 10 / np.hypot(*along))
    write(frame, end, name, palette.TEXT_MUTED, 13 * unit, "middle")


def _round_length(least: float) -> float:
    """The smallest of 1, 2, 5 times a power of ten that is not below `least`, m."""
    power = 10.0 ** np.floor(np.log10(least))
    return float(power * next(factor for factor in (1, 2, 5, 10) if factor * power >= least * (1 - 1e-9)))
