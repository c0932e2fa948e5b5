"""Orthographic views: world points in metres to pixels of a frame."""

from dataclasses import dataclass, replace
from typing import Final

import numpy as np
from numpy.typing import NDArray

from magrod_env.rendering.picture import Picture

Array = NDArray[np.float64]

_X, _Y, _Z = np.eye(3)
_TURN: Final = np.radians(35.0)
_TILT: Final = np.radians(22.0)
_SIDEWAYS = np.cos(_TURN) * _X + np.sin(_TURN) * _Y
_BACKWARDS = np.cos(_TURN) * _Y - np.sin(_TURN) * _X

# Label, unit vectors to the right and upwards on the screen; right x up points at the viewer.
_DIRECTIONS: Final[dict[str, tuple[str, Array, Array]]] = {
    "side": ("side view", _X, _Z),
    "front": ("end-on view", _Y, _Z),
    "top": ("top view", _X, _Y),
    "oblique": ("oblique view", _SIDEWAYS, np.cos(_TILT) * _Z + np.sin(_TILT) * _BACKWARDS),
    "tip": ("tip, close-up", _X, _Z),
}
_EXTENT: Final = 1.5  # least height and width of a view, in rod lengths
_MIDDLE: Final = 0.6  # of a view along the straight rod, in rod lengths
_SAG: Final = 0.18  # how far the middle of a view moves along gravity, in rod lengths
_CLOSE_UP: Final = 6.0
VIEWS: Final = tuple(_DIRECTIONS)


@dataclass(frozen=True, kw_only=True, slots=True)
class Camera:
    """A parallel projection onto a frame, whose pixel (0, 0) is the upper left corner.

    label: name of the view.
    axes: (3, 3), rows are the unit vectors right, up and towards the viewer in the world frame.
    centre: (3,) world point shown at `middle`, m.
    middle: pixel that shows `centre`.
    scale: pixels per metre.
    follows_tip: the view is a close-up that moves with the tip.
    """

    label: str
    axes: Array
    centre: Array
    middle: tuple[float, float]
    scale: float
    follows_tip: bool

    def project(self, points: Array) -> Array:
        """World points (..., 3) in m to pixels (..., 2)."""
        return self.scale * self.screen(points - self.centre) + self.middle

    def screen(self, directions: Array) -> Array:
        """World directions (..., 3) as seen on the screen (..., 2), right and down."""
        seen: Array = directions @ self.axes[:2].T * (1.0, -1.0)
        return seen

    def depth(self, points: Array) -> Array:
        """Height of world points (..., 3) above the picture plane, towards the viewer, m."""
        height: Array = points @ self.axes[2]
        return height

    def looking_at(self, point: Array) -> "Camera":
        """The same view with another world point (3,) at its middle."""
        return replace(self, centre=point)


def default_views(picture: Picture) -> tuple[str, str]:
    """Side and end-on for spatial motion; the plane and a close-up of the tip for planar motion."""
    return {"spatial": ("side", "front"), "xz": ("side", "tip"), "xy": ("top", "tip")}[picture.plane]


def make_camera(view: str, pane: tuple[int, int, int, int], picture: Picture) -> Camera:
    """The camera of a named view on a pane (left, top, right, bottom) of a frame, in pixels."""
    label, right, up = _DIRECTIONS[view]
    if view == "tip" and picture.plane == "xy":
        up = _Y
    centre = _MIDDLE * picture.length * _X
    if picture.gravity is not None:
        gravity = np.asarray(picture.gravity, dtype=float)
        centre = centre + _SAG * picture.length * gravity / np.linalg.norm(gravity)
    left, top, end, bottom = pane
    scale = min(end - left, bottom - top) / (_EXTENT * picture.length) * (_CLOSE_UP if view == "tip" else 1.0)
    return Camera(
        label=label,
        axes=np.stack([right, up, np.cross(right, up)]),
        centre=centre,
        middle=((left + end) / 2, (top + bottom) / 2),
        scale=scale,
        follows_tip=view == "tip",
    )
