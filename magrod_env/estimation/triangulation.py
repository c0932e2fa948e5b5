"""World points from their pixels in several cameras, and how sure they are."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from magrod_env.estimation.pinhole import PinholeCamera

MOST_STEPS = 20
SETTLED = 1e-10  # m: the last Gauss-Newton step, which is far longer than the error that it leaves
CLOSE = 1e-9  # m: a point that still moves further after MOST_STEPS is refused
PARALLEL = 1e-12  # rays are parallel where the determinant is this share of the trace cubed
UNKNOWN = np.eye(3)  # m^2: covariance of a marker that was not seen, a metre each way; it says nothing


def triangulate(cameras: Sequence[PinholeCamera], pixels: np.ndarray, variance: float) -> tuple[np.ndarray, np.ndarray]:
    """Points that explain pixels best in the least-squares sense, and their covariance.

    Starts from the linear solution (Hartley and Zisserman, Multiple View Geometry, 2nd ed., 12.2, for finite points)
    and takes Gauss-Newton steps on the sum of squared reprojection errors. With J the Jacobian of all pixels that were
    seen, the covariance is variance (J^T J)^-1, to first order in the error of a pixel.

    Args:
        cameras: as they are believed to be, two or more.
        pixels: (num_cameras, ..., 2), NaN where a camera does not see the point.
        variance: of each pixel coordinate, pixels^2, the same in all cameras and independent.

    Returns:
        Points (..., 3), m, world, NaN where fewer than two cameras see it, the rays are parallel, or the point came out
        behind a camera; and covariances (..., 3, 3), m^2, which are `UNKNOWN` there.
    """
    pixels = np.asarray(pixels, float)
    batch = pixels.shape[1:-1]
    flat = pixels.reshape(len(cameras), -1, 2)
    seen = np.isfinite(flat).all(axis=-1)
    points = np.full((flat.shape[1], 3), np.nan)
    covariances = np.tile(UNKNOWN, (flat.shape[1], 1, 1))
    enough = seen.sum(axis=0) >= 2
    if enough.any():
        found, inverse, good = _solve(cameras, flat[:, enough], seen[:, enough])
        at = np.flatnonzero(enough)[good]
        points[at], covariances[at] = found[good], variance * inverse[good]
    return points.reshape(*batch, 3), covariances.reshape(*batch, 3, 3)


def _solve(
    cameras: Sequence[PinholeCamera], pixels: np.ndarray, seen: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Points (K, 3), (J^T J)^-1 (K, 3, 3), and which of them are good (K,), from pixels (C, K, 2)."""
    with np.errstate(all="ignore"):
        points = _linear(cameras, pixels, seen)
        for _ in range(MOST_STEPS):
            inverse, step, front = _step(cameras, pixels, seen, points)
            points = points + step
            moved = np.abs(step).max(axis=-1)
            if not (moved > SETTLED).any():
                break
        return points, inverse, front & (moved <= CLOSE) & np.isfinite(inverse).all(axis=(-2, -1))


def _linear(cameras: Sequence[PinholeCamera], pixels: np.ndarray, seen: np.ndarray) -> np.ndarray:
    """Least-squares solution of (n_x r_3 - r_1).(X - c) = 0 and (n_y r_3 - r_2).(X - c) = 0 over all cameras."""
    normal, right = np.zeros((pixels.shape[1], 3, 3)), np.zeros((pixels.shape[1], 3))
    for camera, image, visible in zip(cameras, pixels, seen):
        rows = camera.normalise(image)[..., None] * camera.rotation[2] - camera.rotation[:2]
        rows = np.where(visible[:, None, None], rows, 0.0)
        normal += np.swapaxes(rows, -1, -2) @ rows
        right += np.einsum("kni,knj,j->ki", rows, rows, camera.position)
    return np.einsum("kij,kj->ki", _inverse(normal), right)


def _step(
    cameras: Sequence[PinholeCamera], pixels: np.ndarray, seen: np.ndarray, points: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """(J^T J)^-1, the Gauss-Newton step, and whether each point is in front of all cameras that see it."""
    normal, gradient = np.zeros((len(points), 3, 3)), np.zeros((len(points), 3))
    front = np.ones(len(points), bool)
    for camera, image, visible in zip(cameras, pixels, seen):
        predicted, jacobian, depth = camera.linearise(points)
        jacobian = np.where(visible[:, None, None], jacobian, 0.0)
        error = np.where(visible[:, None], image - predicted, 0.0)
        normal += np.swapaxes(jacobian, -1, -2) @ jacobian
        gradient += np.einsum("kni,kn->ki", jacobian, error)
        front &= (depth > 0.0) | ~visible
    inverse = _inverse(normal)
    return inverse, np.einsum("kij,kj->ki", inverse, gradient), front


def _inverse(matrix: np.ndarray) -> np.ndarray:
    """Inverse of symmetric matrices (K, 3, 3) by cofactors; NaN where they are singular."""
    a, b, c = np.moveaxis(matrix, -2, 0)
    cofactors = np.stack([np.cross(b, c), np.cross(c, a), np.cross(a, b)], axis=-1)
    determinant = np.einsum("ki,ki->k", a, cofactors[..., 0])
    singular = determinant <= PARALLEL * np.trace(matrix, axis1=-2, axis2=-1) ** 3
    inverse = cofactors / np.where(singular, np.nan, determinant)[:, None, None]
    return 0.5 * (inverse + np.swapaxes(inverse, -1, -2))
