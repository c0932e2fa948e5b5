"""A pinhole camera with lens distortion: world points to pixels and back to rays."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from magrod_env import _checks

NEWTON_STEPS = 20  # at most, to undo the distortion
ROUNDING = 1e-12  # of normalised coordinates, about 1e-9 of a pixel


@dataclass(frozen=True, kw_only=True, eq=False)
class PinholeCamera:
    """A camera that maps a world point X to K d(n): n = (x/z, y/z) of R (X - position), d the lens, K focal length and
    principal point (Hartley and Zisserman, Multiple View Geometry, 2nd ed., ch. 6).

    Camera axes are right, down and forward. Pixel (0, 0) is the centre of the upper left pixel, so that an image covers
    -0.5 to width - 0.5. The lens is Brown's: d(n) = n (1 + k1 r^2 + k2 r^4 + k3 r^6) + (2 p1 x y + p2 (r^2 + 2 x^2),
    p1 (r^2 + 2 y^2) + 2 p2 x y) with r = |n| (D. C. Brown, Photogrammetric Engineering 37, 1971).

    Not modelled: depth of field, motion blur, a rolling shutter, the size and look of a marker.

    Args:
        position: of the centre of projection, m, world, (3,).
        rotation: from world to camera axes, (3, 3): its rows are right, down and forward in the world.
        focal_length: pixels, (2,) along right and down, or one for both.
        image_size: width and height, whole pixels.
        principal_point: where the optical axis meets the image, pixels, (2,); None for the middle.
        distortion: (k1, k2, p1, p2, k3) as above; None for a lens without any.

    Raises:
        ValueError: on a number that is not finite or positive, a wrong shape, or a rotation that is none.
    """

    position: Any
    rotation: Any
    focal_length: Any
    image_size: Any
    principal_point: Any = None
    distortion: Any = None

    def __post_init__(self) -> None:
        advice = "give the centre of projection in metres"
        object.__setattr__(
            self, "position", np.array(_checks.vector("position of the camera", self.position, advice=advice))
        )
        object.__setattr__(self, "rotation", _checked_rotation(self.rotation))
        focal = np.broadcast_to(self.focal_length, 2) if np.ndim(self.focal_length) == 0 else self.focal_length
        focal = _numbers("focal_length of the camera", focal, 2, "give pixels along right and down")
        size = _numbers("image_size of the camera", self.image_size, 2, "give width and height in pixels")
        if (focal <= 0.0).any():
            raise ValueError(
                f"focal_length of the camera must be positive, but got {self.focal_length!r}: give pixels."
            )
        for value in size:
            _checks.count("image_size of the camera", value, advice="give width and height in pixels")
        middle = 0.5 * (size - 1.0) if self.principal_point is None else self.principal_point
        middle = _numbers("principal_point of the camera", middle, 2, "give a pixel, or None for the middle")
        object.__setattr__(self, "focal_length", focal)
        object.__setattr__(self, "image_size", (int(size[0]), int(size[1])))
        object.__setattr__(self, "principal_point", middle)
        if self.distortion is not None:
            lens = _numbers("distortion of the camera", self.distortion, 5, "give k1, k2, p1, p2, k3, or None")
            object.__setattr__(self, "distortion", lens)

    @classmethod
    def looking_at(
        cls, target: ArrayLike, *, position: ArrayLike, up: ArrayLike = (0.0, 0.0, 1.0), **lens: Any
    ) -> PinholeCamera:
        """A camera at `position` (m) whose optical axis goes through `target` (m), with `up` upwards in the image.

        Args:
            target, position: m, world, (3,).
            up: world direction, (3,), not along the optical axis.
            lens: focal_length, image_size, principal_point, distortion.

        Raises:
            ValueError: also if the target is the position, or `up` is along the axis.
        """
        place = np.array(_checks.vector("position of the camera", position, advice="give metres"))
        aim = np.array(_checks.vector("target of the camera", target, advice="give metres"))
        forward = _checks.unit_vector("target - position of the camera", aim - place, advice="look at another point")
        right = np.cross(forward, _checks.unit_vector("up of the camera", up, advice="give a direction"))
        if np.linalg.norm(right) < 1e-6:
            raise ValueError(f"up of the camera must not lie along its optical axis, but got {up!r}: choose another.")
        right /= np.linalg.norm(right)
        return cls(position=place, rotation=np.stack([right, np.cross(forward, right), forward]), **lens)

    def moved(self, shift: ArrayLike = (0.0, 0.0, 0.0), turn: ArrayLike = (0.0, 0.0, 0.0)) -> PinholeCamera:
        """The same camera shifted (m, world, (3,)) and turned about its own centre (rotation vector, rad, world, (3,)):
        what a calibration that is wrong by as much believes.
        """
        shift = np.array(_checks.vector("shift of the camera", shift, advice="give metres"))
        x, y, z = _checks.vector("turn of the camera", turn, advice="give a rotation vector in radians")
        cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
        angle = np.sqrt(x * x + y * y + z * z)
        rotation = np.eye(3) + np.sinc(angle / np.pi) * cross + 0.5 * np.sinc(0.5 * angle / np.pi) ** 2 * cross @ cross
        return replace(self, position=self.position + shift, rotation=self.rotation @ rotation.T)

    @cached_property
    def projection_matrix(self) -> np.ndarray:
        """P = K [R | -R position], (3, 4): homogeneous world points (m) to homogeneous pixels, without
        distortion.
        """
        intrinsic = np.diag([*self.focal_length, 1.0])
        intrinsic[:2, 2] = self.principal_point
        return intrinsic @ self.rotation @ np.column_stack([np.eye(3), -self.position])

    def project(self, points: ArrayLike) -> np.ndarray:
        """Pixels (..., 2) of world points (..., 3), m; NaN behind the camera, outside the image, or NaN points.

        Outside counts also where the distortion folds the image over: its Jacobian is no longer positive definite.
        """
        points = _checks.points("points", points)
        with np.errstate(all="ignore"):
            normalised, depth = self._normalised(points)
            distorted, slope = self._distort(normalised)
            pixels = distorted * self.focal_length + self.principal_point
            inside = ((pixels >= -0.5) & (pixels <= np.array(self.image_size) - 0.5)).all(axis=-1)
            seen = (depth > 0.0) & inside & _one_to_one(slope)
        return np.where(seen[..., None], pixels, np.nan)

    def linearise(self, points: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Pixels (..., 2), their Jacobian (..., 2, 3) in pixels per metre, and the depth (...) in m of world points
        (..., 3), whether or not they are in the image.
        """
        normalised, depth = self._normalised(points)
        distorted, slope = self._distort(normalised)
        # dn = (dx - n dz)/z, with dx, dy, dz the rows of R
        first = (self.rotation[:2] - normalised[..., None] * self.rotation[2]) / depth[..., None, None]
        return (
            distorted * self.focal_length + self.principal_point,
            self.focal_length[:, None] * (slope @ first),
            depth,
        )

    def normalise(self, pixels: ArrayLike) -> np.ndarray:
        """Coordinates n (..., 2) of pixels (..., 2): inverse of lens and intrinsic matrix; NaN where there is none."""
        pixels = np.asarray(pixels, float)
        if pixels.ndim == 0 or pixels.shape[-1] != 2:
            raise ValueError(f"pixels must have shape (..., 2), but got shape {pixels.shape}: put right and down last.")
        wanted = (pixels - self.principal_point) / self.focal_length
        if self.distortion is None:
            return wanted
        normalised = wanted.copy()
        with np.errstate(all="ignore"):
            for _ in range(NEWTON_STEPS):
                distorted, slope = self._distort(normalised)
                error = wanted - distorted
                if not (np.abs(error) > ROUNDING).any():
                    break
                (a, b), (c, d) = np.moveaxis(slope, (-2, -1), (0, 1))
                step = np.stack([d * error[..., 0] - b * error[..., 1], a * error[..., 1] - c * error[..., 0]], axis=-1)
                normalised = normalised + step / _determinant(slope)[..., None]
            distorted, slope = self._distort(normalised)
            found = (np.abs(wanted - distorted) < 1e3 * ROUNDING).all(axis=-1) & _one_to_one(slope)
        return np.where(found[..., None], normalised, np.nan)

    def ray(self, pixels: ArrayLike) -> np.ndarray:
        """Unit vectors (..., 3), world, from `position` towards what pixels (..., 2) show; NaN where nothing can."""
        normalised = self.normalise(pixels)
        direction = normalised @ self.rotation[:2] + self.rotation[2]
        return direction / np.linalg.norm(direction, axis=-1, keepdims=True)

    def _normalised(self, points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Coordinates n (..., 2) and depth (...) in m of world points."""
        inside = (points - self.position) @ self.rotation.T
        depth = inside[..., 2]
        return inside[..., :2] / depth[..., None], depth

    def _distort(self, normalised: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """d(n) (..., 2) and its Jacobian (..., 2, 2)."""
        if self.distortion is None:
            return normalised, np.broadcast_to(np.eye(2), (*normalised.shape, 2))
        k1, k2, p1, p2, k3 = self.distortion
        x, y = normalised[..., 0], normalised[..., 1]
        r2 = x * x + y * y
        radial = 1.0 + r2 * (k1 + r2 * (k2 + r2 * k3))
        slope = 2.0 * (k1 + r2 * (2.0 * k2 + r2 * 3.0 * k3))  # d radial = slope (x dx + y dy)
        distorted = np.stack(
            [
                x * radial + 2.0 * p1 * x * y + p2 * (r2 + 2.0 * x * x),
                y * radial + p1 * (r2 + 2.0 * y * y) + 2.0 * p2 * x * y,
            ],
            axis=-1,
        )
        across = slope * x * y + 2.0 * p1 * x + 2.0 * p2 * y
        right = radial + slope * x * x + 2.0 * p1 * y + 6.0 * p2 * x
        down = radial + slope * y * y + 6.0 * p1 * y + 2.0 * p2 * x
        return distorted, np.stack([np.stack([right, across], axis=-1), np.stack([across, down], axis=-1)], axis=-2)


def _determinant(matrix: np.ndarray) -> np.ndarray:
    """Of (..., 2, 2)."""
    return matrix[..., 0, 0] * matrix[..., 1, 1] - matrix[..., 0, 1] * matrix[..., 1, 0]


def _one_to_one(slope: np.ndarray) -> np.ndarray:
    """Whether the Jacobian of a lens, (..., 2, 2) and symmetric, is positive definite."""
    return (_determinant(slope) > 0.0) & (slope[..., 0, 0] > 0.0)


def _numbers(what: str, value: Any, size: int, advice: str) -> np.ndarray:
    """Finite numbers, (size,)."""
    try:
        array = np.array(value, float)
    except (TypeError, ValueError):
        array = np.array(np.nan)
    if array.shape != (size,) or not np.isfinite(array).all():
        raise ValueError(f"{what} must be {size} finite numbers, but got {value!r}: {advice}.")
    return array


def _checked_rotation(rotation: Any) -> np.ndarray:
    try:
        array = np.array(rotation, float)
    except (TypeError, ValueError):
        array = np.empty(0)
    proper = array.shape == (3, 3) and np.isfinite(array).all()
    if not proper or np.abs(array @ array.T - np.eye(3)).max() > 1e-9 or np.linalg.det(array) < 0.0:
        raise ValueError(
            f"rotation of the camera must be a rotation matrix of shape (3, 3), but got {rotation!r}: give right, down "
            "and forward as rows, or use PinholeCamera.looking_at."
        )
    return array
