"""Motion in a plane as motion in space, and back: what leaves the plane is zero, or is left out."""

import numpy as np

PLANE_AXES = {None: (0, 1, 2), "xy": (0, 1), "xz": (0, 2)}
"""World axes of the motion."""


def vectors_in_space(vectors: np.ndarray, plane: str | None) -> np.ndarray:
    """World vectors (..., 3) from their components along the axes of the motion."""
    if plane is None:
        return vectors
    full = np.zeros((*vectors.shape[:-1], 3))
    full[..., list(PLANE_AXES[plane])] = vectors
    return full


def vectors_in_plane(vectors: np.ndarray, plane: str | None) -> np.ndarray:
    """Components of world vectors (..., 3) along the axes of the motion."""
    return vectors if plane is None else vectors[..., list(PLANE_AXES[plane])]


def quaternions_in_space(rotations: np.ndarray, plane: str | None) -> np.ndarray:
    """Quaternions (..., 4), scalar first, from a kernel's rotations: these, or half-angle pairs (..., 2)."""
    if plane is None:
        return rotations
    w, z = np.moveaxis(rotations, -1, 0)
    zero = np.zeros_like(w)
    return np.stack((w, zero, zero, z) if plane == "xy" else (w, zero, -z, zero), axis=-1)


def quaternions_in_plane(quaternions: np.ndarray, plane: str | None) -> np.ndarray:
    """The inverse of `quaternions_in_space`."""
    if plane is None:
        return quaternions
    return quaternions[..., [0, 3]] if plane == "xy" else quaternions[..., [0, 2]] * (1, -1)


def spins_in_space(spins: np.ndarray, plane: str | None) -> np.ndarray:
    """Body vectors (..., 3) of rotation from a kernel's: these, or the component (..., 1) across the plane."""
    if plane is None:
        return spins
    across, zero = spins[..., 0], np.zeros_like(spins[..., 0])
    return np.stack((zero, zero, across) if plane == "xy" else (zero, -across, zero), axis=-1)


def spins_in_plane(spins: np.ndarray, plane: str | None) -> np.ndarray:
    """The inverse of `spins_in_space`."""
    if plane is None:
        return spins
    return spins[..., [2]] if plane == "xy" else -spins[..., [1]]
