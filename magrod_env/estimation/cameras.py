"""What sees the markers of a rod: pinhole cameras that triangulate, or plain Gaussian noise."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any, Protocol

import numpy as np

from magrod_env import _checks
from magrod_env.estimation.occlusion import hidden_by_rod
from magrod_env.estimation.pinhole import PinholeCamera
from magrod_env.estimation.triangulation import UNKNOWN, triangulate

WORKSPACE = (0.03, 0.0, 0.0)  # m: middle of the paper's rod, straight
DISTANCE = 0.4  # m, from there to each camera
FOCAL_LENGTH = 2500.0  # pixels
IMAGE_SIZE = (1280, 1024)  # pixels


class Cameras(Protocol):
    """Something that measures markers, without memory: `StereoCameras`, `GaussianCameras`, or your own."""

    def measure(
        self, positions: np.ndarray, generator: np.random.Generator, centrelines: np.ndarray | None = None
    ) -> tuple[np.ndarray, np.ndarray]:
        """Measured markers (num_rods, num_markers, 3), m, NaN where not seen, and the covariance of their errors, m^2,
        (num_rods, num_markers, 3, 3).

        Args:
            positions: true markers, m, world, (num_rods, num_markers, 3); NaN where there is nothing to see.
            generator: of the noise.
            centrelines: nodes of the rods, m, world, (num_rods, num_nodes, 3), for rods that hide their own markers.
        """
        ...


def default_cameras() -> tuple[PinholeCamera, PinholeCamera]:
    """Two cameras 0.4 m from the middle of the paper's rod (60 mm, clamped at the origin along +x): one at the side, on
    the negative y axis with z up in its image, and one above, with y up in its image.

    Each has 1280 x 1024 pixels and a focal length of 2500 pixels: 0.16 mm a pixel at that distance, and all points
    within 60 mm of the clamp are in both images. The paper says only that it had two; the places are ours.
    """
    lens: Any = dict(focal_length=FOCAL_LENGTH, image_size=IMAGE_SIZE)
    x, y, z = WORKSPACE
    side = PinholeCamera.looking_at(WORKSPACE, position=(x, y - DISTANCE, z), up=(0.0, 0.0, 1.0), **lens)
    above = PinholeCamera.looking_at(WORKSPACE, position=(x, y, z + DISTANCE), up=(0.0, 1.0, 0.0), **lens)
    return side, above


@dataclass(frozen=True, kw_only=True, eq=False)
class StereoCameras:
    """Two or more pinhole cameras: markers become noisy pixels, and pixels that two cameras see become points again.

    Pixel errors are independent and white. Rounding counts with the variance of a uniform error, quantisation^2/12,
    which holds over a moving marker; that of a marker at rest with little noise repeats itself. Which marker is which
    is known. The covariance knows of pixel noise and rounding, not of a wrong calibration.

    Args:
        cameras: those that take the pictures; `default_cameras()` if not given.
        noise: standard deviation of each pixel coordinate, pixels; None for none.
        quantisation: pixels, or the fraction of one, that coordinates are rounded to; None for not rounded.
        occlusion_probability: that a camera does not see a marker in a frame, independently of all else.
        rod_radius: m; a marker is then hidden also where its rod stands in front of it (`occlusion.hidden_by_rod`),
            which needs centrelines; None for rods that hide nothing.
        calibration: the cameras as triangulation believes them, in the same order; None for as they are.

    Raises:
        ValueError: on a bad number, fewer than two cameras, two at one place, or a calibration of another length.
    """

    cameras: Sequence[PinholeCamera] = field(default_factory=default_cameras)
    noise: float | None = 0.3
    quantisation: float | None = None
    occlusion_probability: float = 0.0
    rod_radius: float | None = None
    calibration: Sequence[PinholeCamera] | None = None

    def __post_init__(self) -> None:
        object.__setattr__(self, "cameras", _checked_cameras("cameras", self.cameras))
        if self.calibration is not None:
            object.__setattr__(self, "calibration", _checked_cameras("calibration", self.calibration))
            if len(self.calibration) != len(self.cameras):
                raise ValueError(
                    f"calibration must have {len(self.cameras)} cameras, but got {len(self.calibration)}: give one for "
                    "each camera."
                )
        for name, unit in (("noise", "pixels"), ("quantisation", "pixels"), ("rod_radius", "metres")):
            object.__setattr__(self, name, _positive_or_none(f"{name} of the cameras", getattr(self, name), unit))
        _check_probability("occlusion_probability of the cameras", self.occlusion_probability)

    @property
    def pixel_variance(self) -> float:
        """Variance of a pixel coordinate, noise and rounding together, pixels^2."""
        return (self.noise or 0.0) ** 2 + (self.quantisation or 0.0) ** 2 / 12.0

    def photograph(
        self, positions: np.ndarray, generator: np.random.Generator, centrelines: np.ndarray | None = None
    ) -> np.ndarray:
        """Measured pixels (num_cameras, num_rods, num_markers, 2), NaN where not seen; arguments as `Cameras.measure`.

        Raises:
            ValueError: on a wrong shape, or without the centrelines that `rod_radius` needs.
        """
        positions = checked_positions("positions", positions)
        pixels = np.stack([camera.project(positions) for camera in self.cameras])
        if self.noise is not None:
            pixels = pixels + self.noise * generator.standard_normal(pixels.shape)
        if self.quantisation is not None:
            pixels = self.quantisation * np.round(pixels / self.quantisation)
        if self.occlusion_probability > 0.0:
            pixels[generator.random(pixels.shape[:-1]) < self.occlusion_probability] = np.nan
        if self.rod_radius is not None:
            if centrelines is None:
                raise ValueError("centrelines must be given with a rod_radius, but got None: give the rods' nodes.")
            centrelines = checked_positions("centrelines", centrelines, num_rods=len(positions))
            for image, camera in zip(pixels, self.cameras):
                image[hidden_by_rod(positions, camera.position, centrelines, self.rod_radius)] = np.nan
        return pixels

    def triangulate(self, pixels: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Points (..., 3), m, and covariances (..., 3, 3), m^2, of pixels (num_cameras, ..., 2); see `triangulate`."""
        return triangulate(self.calibration or self.cameras, pixels, self.pixel_variance)

    def measure(
        self, positions: np.ndarray, generator: np.random.Generator, centrelines: np.ndarray | None = None
    ) -> tuple[np.ndarray, np.ndarray]:
        """See `Cameras.measure`; where fewer than two cameras see a marker it is NaN, with a covariance of 1 m^2."""
        return self.triangulate(self.photograph(positions, generator, centrelines))


@dataclass(frozen=True, kw_only=True, eq=False)
class GaussianCameras:
    """Markers with white noise of the same size along every axis, without any geometry: the cheap variant.

    Args:
        noise: standard deviation of each coordinate, m; None for none.
        occlusion_probability: that a marker is not seen in a frame, independently of all else.

    Raises:
        ValueError: on a noise that is not positive, or a probability outside [0, 1].
    """

    noise: float | None = 5e-5
    occlusion_probability: float = 0.0

    def __post_init__(self) -> None:
        object.__setattr__(self, "noise", _positive_or_none("noise of the cameras", self.noise, "metres"))
        _check_probability("occlusion_probability of the cameras", self.occlusion_probability)

    def measure(
        self, positions: np.ndarray, generator: np.random.Generator, centrelines: np.ndarray | None = None
    ) -> tuple[np.ndarray, np.ndarray]:
        """See `Cameras.measure`; the centrelines do not matter, and an unseen marker has a covariance of 1 m^2."""
        measured = checked_positions("positions", positions)
        covariance = np.tile((self.noise or 0.0) ** 2 * np.eye(3), (*measured.shape[:2], 1, 1))
        if self.noise is not None:
            measured = measured + self.noise * generator.standard_normal(measured.shape)
        if self.occlusion_probability > 0.0:
            measured[generator.random(measured.shape[:2]) < self.occlusion_probability] = np.nan
        covariance[np.isnan(measured).any(axis=-1)] = UNKNOWN
        return measured, covariance


def checked_positions(what: str, positions: np.ndarray, num_rods: int | None = None) -> np.ndarray:
    """A new array (num_rods, n, 3), m, in which what is not finite (a rod that diverged) is NaN.

    Raises:
        ValueError: on another shape.
    """
    array = np.array(positions, float)
    if array.ndim != 3 or array.shape[-1] != 3 or num_rods not in (None, len(array)):
        rods = "num_rods" if num_rods is None else num_rods
        raise ValueError(
            f"{what} must have shape ({rods}, n, 3), but got shape {array.shape}: give world positions in metres, rod "
            "by rod."
        )
    array[~np.isfinite(array).all(axis=-1)] = np.nan
    return array


def _checked_cameras(what: str, cameras: Sequence[PinholeCamera]) -> tuple[PinholeCamera, ...]:
    found = tuple(cameras)
    if len(found) < 2 or not all(isinstance(camera, PinholeCamera) for camera in found):
        raise ValueError(f"{what} must be two PinholeCameras or more, but got {cameras!r}: a single one sees no depth.")
    places = {tuple(camera.position) for camera in found}
    if len(places) < len(found):
        raise ValueError(f"{what} must be at different places, but got {sorted(places)}: move one of them.")
    return found


def _positive_or_none(what: str, value: float | None, unit: str) -> float | None:
    if value is None:
        return None
    return _checks.number(what, value, above=0.0, advice=f"give it in {unit}, or None to leave it out")


def _check_probability(what: str, value: float) -> None:
    _checks.number(what, value, at_least=0.0, at_most=1.0, advice="give a probability")
