"""Strokes on a Pillow image: polylines, arrows, rings, text and shaded faces."""

from functools import lru_cache
from itertools import pairwise
from typing import Final

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw, ImageFont

from magrod_env.rendering.camera import Camera
from magrod_env.rendering.mesh import Mesh
from magrod_env.rendering.palette import PANE, Colour, blend

Array = NDArray[np.float64]
Box = tuple[int, int, int, int]

SUPERSAMPLING: Final = 3  # strokes are drawn this much larger and averaged down
_LIGHT: Final = np.array([-0.45, 0.72, 0.53])  # right, up, towards the viewer
_HALFWAY: Final = (_LIGHT + (0.0, 0.0, 1.0)) / np.linalg.norm(_LIGHT + (0.0, 0.0, 1.0))
_FADE_STEPS: Final = 40
_FAR: Final = 4000.0  # pixels


class Canvas:
    """A window on a frame: enlarged, drawn upon, and averaged back by `finish`; lengths are in frame pixels.

    frame: image that is drawn upon.
    box: left, top, right, bottom of the window in the frame, whole pixels.
    """

    def __init__(self, frame: Image.Image, box: Box) -> None:
        self._frame = frame
        self._origin = np.array(box[:2], dtype=float)
        self.size = (box[2] - box[0], box[3] - box[1])
        enlarged = (self.size[0] * SUPERSAMPLING, self.size[1] * SUPERSAMPLING)
        self._image = frame.resize(enlarged, Image.Resampling.NEAREST, box)
        self._draw = ImageDraw.Draw(self._image)

    def finish(self) -> None:
        """Put the window back into the frame."""
        left, top = self._origin.astype(int).tolist()
        self._frame.paste(self._image.reduce(SUPERSAMPLING), (left, top))

    def line(self, points: Array, colour: Colour, width: float) -> None:
        """A polyline (k, 2)."""
        self._draw.line(self._pixels(points).ravel().tolist(), colour, self._width(width))

    def fading_line(self, points: Array, colour: Colour, width: float) -> None:
        """A polyline (k, 2) that starts near the pane's colour and ends in `colour`."""
        marks = np.unique(np.linspace(0, len(points) - 1, _FADE_STEPS + 1).astype(int))
        for start, stop in pairwise(marks):
            strength = 0.25 + 0.75 * float(stop / marks[-1]) ** 1.5
            self.line(points[start : stop + 1], blend(PANE, colour, strength), width)

    def arrow(self, start: Array, stop: Array, colour: Colour, width: float) -> None:
        """An arrow between two points (2,); its head shrinks with very short arrows."""
        along = stop - start
        length = float(np.hypot(*along))
        if length < 1e-9:
            return
        along = along / length
        across = np.array([-along[1], along[0]])
        head = min(4.5 * width, 0.7 * length)
        neck = stop - head * along
        self.line(np.stack([start, neck + 0.3 * head * along]), colour, width)
        self.polygon(np.stack([stop, neck + 0.45 * head * across, neck - 0.45 * head * across]), colour)

    def polygon(self, points: Array, colour: Colour) -> None:
        self._draw.polygon(self._pixels(points).ravel().tolist(), fill=colour)

    def ring(self, centre: Array, radius: float, colour: Colour, width: float) -> None:
        self._draw.ellipse(self._box(centre, radius), outline=colour, width=self._width(width))

    def disc(self, centre: Array, radius: float, colour: Colour) -> None:
        self._draw.ellipse(self._box(centre, radius), fill=colour)

    def panel(self, box: Box, fill: Colour, outline: Colour, radius: float) -> None:
        """A rounded rectangle."""
        corners = self._pixels(np.array(box, dtype=float).reshape(2, 2)) - (0, 1)
        self._draw.rounded_rectangle(
            corners.ravel().tolist(), radius * SUPERSAMPLING, fill, outline, width=SUPERSAMPLING
        )

    def mesh(self, mesh: Mesh, camera: Camera) -> None:
        """Shaded faces, the far ones first."""
        normals = mesh.normals @ camera.axes.T
        shown = np.flatnonzero(normals[:, 2] > 0)
        depth = camera.depth(mesh.corners[shown]) @ np.full(4, 0.25) + mesh.lift[shown]
        shown = shown[np.argsort(depth, kind="stable")]
        pixels = self._pixels(camera.project(mesh.corners[shown])).reshape(-1, 8).tolist()
        colours = _shade(mesh.colours[shown], normals[shown]).tolist()
        for quad, colour in zip(pixels, colours, strict=True):
            self._draw.polygon(quad, fill=tuple(colour))

    def _pixels(self, points: Array) -> NDArray[np.int64]:
        """Enlarged pixels that hold the points, kept near the window so that no coordinate overflows."""
        near: Array = np.clip(points - self._origin, -_FAR, _FAR)
        return np.floor(near * SUPERSAMPLING).astype(np.int64)

    def _box(self, centre: Array, radius: float) -> list[int]:
        corners: list[int] = self._pixels(np.stack([centre - radius, centre + radius])).ravel().tolist()
        return corners

    @staticmethod
    def _width(width: float) -> int:
        return max(1, round(width * SUPERSAMPLING))


def _shade(colours: Array, normals: Array) -> NDArray[np.uint8]:
    """Colours (F, 3) lit from the upper left, with a soft highlight and a darker rim; normals as seen."""
    diffuse = 0.5 + 0.5 * normals @ _LIGHT
    rim = (1.0 - normals[:, 2]) ** 2
    highlight = np.maximum(normals @ _HALFWAY, 0.0) ** 24
    lit: Array = colours * (0.67 + 0.44 * diffuse - 0.18 * rim)[:, None] + 80.0 * highlight[:, None]
    return np.clip(lit, 0.0, 255.0).astype(np.uint8)


def write(frame: Image.Image, at: Array, words: str, colour: Colour, height: float, anchor: str = "left") -> float:
    """Write words of a letter height in pixels and return their width.

    at: (2,) pixel of the words' left end, middle or right end, as `anchor` says, at half their height.
    """
    mask, width = _words(words, height)
    left = at[0] - width * {"left": 0.0, "middle": 0.5, "right": 1.0}[anchor]
    frame.paste(colour, (round(left), round(at[1] - mask.height / 2)), mask)
    return width


@lru_cache(maxsize=256)
def _words(words: str, height: float) -> tuple[Image.Image, float]:
    """Coverage of a line of text, and its width in pixels; enlarged and averaged like the strokes."""
    font = _font(height * SUPERSAMPLING)
    width = float(font.getlength(words)) / SUPERSAMPLING
    lines = round(1.5 * height)
    mask = Image.new("L", ((int(width) + 2) * SUPERSAMPLING, lines * SUPERSAMPLING))
    ImageDraw.Draw(mask).text((0, mask.height / 2), words, 255, font, "lm")
    return mask.reduce(SUPERSAMPLING), width


@lru_cache(maxsize=32)
def _font(size: float) -> ImageFont.FreeTypeFont | ImageFont.ImageFont:
    return ImageFont.load_default(size)
