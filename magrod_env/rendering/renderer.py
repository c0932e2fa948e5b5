"""Arrays in, frames out."""

from collections.abc import Sequence
from math import hypot
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray
from PIL import Image

from magrod_env.rendering import palette
from magrod_env.rendering.backdrop import draw_heading, draw_pane
from magrod_env.rendering.camera import VIEWS, Camera, default_views, make_camera
from magrod_env.rendering.canvas import Box, Canvas, write
from magrod_env.rendering.mesh import Mesh, build_mesh
from magrod_env.rendering.overlay import amount, draw_field, draw_path, draw_targets, draw_trace, thinned
from magrod_env.rendering.picture import Picture

Array = NDArray[np.float64]

_DESIGN_SIZE: Final = (960, 480)
_LEAST_SIZE: Final = (160, 120)
_LARGEST_EDGE: Final = 16384
_HEADING, _STATUS, _GAP = 40, 34, 10  # heights and spaces at the design size, pixels
_FARTHEST: Final = 1.5  # rod lengths from the clamp; no rod that is still sound gets there


class _Marks(NamedTuple):
    """Points (k, 3), m, world; empty where there is nothing to draw."""

    target: Array
    path: Array
    trace: Array


class Renderer:
    """Draws a rod with its magnets, field, targets, path and trace as an RGB image, without any window.

    picture: what stays the same.
    size: width and height of a frame, pixels.
    views: one to three of "side" (x right, z up), "front" (y right, z up, the rod comes towards the viewer),
        "top" (x right, y up), "oblique" and "tip" (close-up that follows the tip); None takes two that suit
        picture.plane.
    """

    def __init__(
        self, picture: Picture, *, size: tuple[int, int] = _DESIGN_SIZE, views: Sequence[str] | None = None
    ) -> None:
        views = default_views(picture) if views is None else _checked_views(views)
        size = _checked_size(size)
        self._picture = picture
        self._unit = min(size[0] / _DESIGN_SIZE[0], size[1] / _DESIGN_SIZE[1])
        self._panes = _panes(size, len(views), self._unit)
        self._cameras = [make_camera(*x, picture) for x in zip(views, self._panes, strict=True)]
        self._backdrop = Image.new("RGB", size, palette.BACKGROUND)
        draw_heading(self._backdrop, self._panes[0][1], picture, self._unit)
        for pane, camera in zip(self._panes, self._cameras, strict=True):
            draw_pane(self._backdrop, pane, camera, picture, self._unit)

    def draw(
        self,
        *,
        nodes: ArrayLike,
        rotations: ArrayLike,
        field: ArrayLike,
        target: ArrayLike | None = None,
        path: ArrayLike | None = None,
        trace: ArrayLike | None = None,
        time: float | None = None,
        tip_error: float | None = None,
        text: str | None = None,
    ) -> NDArray[np.uint8]:
        """One frame, a fresh uint8 array (height, width, 3).

        nodes: (num_nodes, 3) positions, m, world, from clamp to tip.
        rotations: (num_nodes, 3, 3) body to world, first column the tangent.
        field: (3,) magnetic field, T, world.
        target: (3,) or (k, 3) desired positions, m, world; None draws none.
        path: (M, 3) desired path, m, world; None draws none.
        trace: (T, 3) past tip positions, m, world, oldest first; None draws none.
        time: s. tip_error: m. text: a few words; each is left out of the status line when None.

        From the first node on that is not finite, or 1.5 rod lengths from the clamp, the rod is left out and
        the status line says "diverged". What leaves a view is cut at its edge.
        """
        nodes, rotations = _array("nodes", nodes, (-1, 3)), _array("rotations", rotations, (-1, 3, 3))
        if len(nodes) < 2 or len(nodes) != len(rotations):
            raise ValueError(
                f"nodes and rotations must have the same number, at least 2, of rows, "
                f"received {len(nodes)} and {len(rotations)}."
            )
        field = _array("field", field, (3,))
        sound = _sound_nodes(nodes, rotations, _FARTHEST * self._picture.length)
        diverged = sound < len(nodes)
        mesh = None
        if sound > 1:
            element_length = self._picture.length / (len(nodes) - 1)
            mesh = build_mesh(self._picture, nodes[:sound], rotations[:sound], element_length)
        marks = _Marks(_marks("target", target), _marks("path", path), _marks("trace", trace))
        frame = self._backdrop.copy()
        for pane, camera in zip(self._panes, self._cameras, strict=True):
            view = camera.looking_at(nodes[-1]) if camera.follows_tip and not diverged else camera
            if not camera.follows_tip:
                draw_field(frame, pane, camera, field, self._picture.field_limit, self._unit)
            self._draw_view(frame, pane, view, mesh, marks)
        self._write_status(frame, time, tip_error, field, text, diverged)
        return np.array(frame)

    def _draw_view(self, frame: Image.Image, pane: Box, camera: Camera, mesh: Mesh | None, marks: _Marks) -> None:
        """Rod and marks, in the smallest window that holds them."""
        ring = max(1.7 * self._picture.radius * camera.scale, 7 * self._unit)
        solids = np.empty((0, 3)) if mesh is None else mesh.corners.reshape(-1, 3)
        window = _window(camera.project(np.concatenate([*marks, solids])), pane, ring + 6 * self._unit)
        if window is None:
            return
        canvas = Canvas(frame, window)
        draw_path(canvas, camera, marks.path, self._unit)
        draw_trace(canvas, camera, marks.trace, self._unit)
        if mesh is not None:
            canvas.mesh(mesh, camera)
        draw_targets(canvas, camera, marks.target, ring, self._unit)
        canvas.finish()

    def _write_status(
        self,
        frame: Image.Image,
        time: float | None,
        tip_error: float | None,
        field: Array,
        text: str | None,
        diverged: bool,
    ) -> None:
        """The line under the panes: fixed columns, so that the numbers do not dance."""
        items = (
            ("time", 118, None if time is None else f"{amount(time, 2)} s"),
            ("tip error", 158, None if tip_error is None else f"{amount(1e3 * tip_error, 2)} mm"),
            ("field", 130, f"{amount(1e3 * hypot(*field), 1)} mT"),
        )
        unit = self._unit
        at = np.array([24 * unit, (self._panes[0][3] + frame.height) / 2])
        for label, column, value in items:
            if value is not None:
                width = write(frame, at, label, palette.TEXT_MUTED, 14 * unit)
                write(frame, at + (width + 7 * unit, 0), value, palette.TEXT, 14 * unit)
                at[0] += column * unit
        if diverged:
            at[0] += write(frame, at, "diverged", palette.ALARM, 14 * unit) + 30 * unit
        if text is not None:
            write(frame, at, text, palette.TEXT_MUTED, 14 * unit)


def _checked_views(views: Sequence[str]) -> tuple[str, ...]:
    chosen = tuple(views) if isinstance(views, (tuple, list)) else ()
    if not 1 <= len(chosen) <= 3 or not all(view in VIEWS for view in chosen):
        raise ValueError(f"views must be one to three of {', '.join(VIEWS)}, received {views!r}.")
    return chosen


def _checked_size(size: tuple[int, int]) -> tuple[int, int]:
    pair = isinstance(size, (tuple, list)) and len(size) == 2
    if not pair or not all(isinstance(edge, (int, np.integer)) and edge <= _LARGEST_EDGE for edge in size):
        raise ValueError(f"size must be width and height in whole pixels, at most {_LARGEST_EDGE}, received {size!r}.")
    if size[0] < _LEAST_SIZE[0] or size[1] < _LEAST_SIZE[1]:
        raise ValueError(f"size must be at least {_LEAST_SIZE} pixels, received {size!r}.")
    return int(size[0]), int(size[1])


def _panes(size: tuple[int, int], count: int, unit: float) -> list[Box]:
    """Boxes of equal panes side by side, between heading and status line."""
    gap, top, bottom = round(_GAP * unit), round(_HEADING * unit), size[1] - round(_STATUS * unit)
    width = (size[0] - gap * (count + 1)) // count
    lefts = [gap + i * (width + gap) for i in range(count)]
    return [(left, top, left + width, bottom) for left in lefts]


def _window(points: Array, pane: Box, margin: float) -> Box | None:
    """The smallest box in the pane with all points (k, 2) and a margin; None if they are all outside."""
    if len(points) == 0:
        return None
    low = np.clip(np.floor(points.min(axis=0) - margin), pane[:2], pane[2:])
    high = np.clip(np.ceil(points.max(axis=0) + margin), pane[:2], pane[2:])
    if np.any(high <= low):
        return None
    return int(low[0]), int(low[1]), int(high[0]), int(high[1])


def _marks(name: str, values: ArrayLike | None) -> Array:
    """Finite points (k, 3) of a mark, none for None."""
    if values is None:
        return np.empty((0, 3))
    return thinned(_array(name, np.atleast_2d(np.asarray(values, dtype=np.float64)), (-1, 3)))


def _sound_nodes(nodes: Array, rotations: Array, farthest: float) -> int:
    """Number of leading nodes that are near enough and have rotations no larger than such can be."""
    sound = (np.abs(rotations) <= 1.1).all(axis=(1, 2)) & (np.abs(nodes) <= farthest).all(axis=1)
    return len(nodes) if sound.all() else int(np.argmin(sound))


def _array(name: str, values: ArrayLike, shape: tuple[int, ...]) -> Array:
    """`values` as float64 of the wanted shape, -1 standing for any number."""
    array = np.asarray(values, dtype=np.float64)
    if array.ndim != len(shape) or any(w not in (-1, n) for w, n in zip(shape, array.shape, strict=True)):
        raise ValueError(f"{name} must have shape {shape} (-1: any), received {array.shape}.")
    return array
