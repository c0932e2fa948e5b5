"""Rotations outside kernels: quaternions (scalar first), matrices (body to world) and rotation vectors."""

from __future__ import annotations

import numpy as np


def rotation_matrices(quaternions: np.ndarray) -> np.ndarray:
    """Rotation matrices (..., 3, 3) of unit quaternions (..., 4), scalar first."""
    w, x, y, z = np.moveaxis(quaternions, -1, 0)
    rows = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
        [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
        [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
    ]
    return np.moveaxis(np.array(rows), (0, 1), (-2, -1))


def rotation_matrices_of_vectors(vectors: np.ndarray) -> np.ndarray:
    """Rotation matrices (..., 3, 3) of rotation vectors (..., 3), rad (Rodrigues)."""
    angle = np.linalg.norm(vectors, axis=-1)[..., None, None]
    axis = vectors / np.where(angle[..., 0] > 0.0, angle[..., 0], 1.0)
    x, y, z = np.moveaxis(axis, -1, 0)
    zero = np.zeros_like(x)
    hat = np.moveaxis(np.array([[zero, -z, y], [z, zero, -x], [-y, x, zero]]), (0, 1), (-2, -1))
    across = axis[..., :, None] * axis[..., None, :] - np.where(angle > 0.0, np.eye(3), 0.0)
    return np.eye(3) + np.sin(angle) * hat + (1.0 - np.cos(angle)) * across


def rotate(matrices: np.ndarray, vectors: np.ndarray) -> np.ndarray:
    """Matrices (..., 3, 3) times vectors (..., 3), rounded alike for one and for many."""
    return (
        matrices[..., 0] * vectors[..., 0, None]
        + matrices[..., 1] * vectors[..., 1, None]
        + matrices[..., 2] * vectors[..., 2, None]
    )


def quaternions_of_vectors(vectors: np.ndarray) -> np.ndarray:
    """Unit quaternions (..., 4), scalar first, of rotation vectors (..., 3), rad."""
    half = 0.5 * np.linalg.norm(vectors, axis=-1, keepdims=True)
    return np.concatenate([np.cos(half), 0.5 * np.sinc(half / np.pi) * vectors], axis=-1)


def compose(first: np.ndarray, second: np.ndarray) -> np.ndarray:
    """Quaternions (..., 4) of the rotations ``first`` after ``second``: matrices multiply in this order."""
    a, b = first, second
    vector = a[..., :1] * b[..., 1:] + b[..., :1] * a[..., 1:] + np.cross(a[..., 1:], b[..., 1:])
    scalar = a[..., :1] * b[..., :1] - (a[..., 1:] * b[..., 1:]).sum(axis=-1, keepdims=True)
    return np.concatenate([scalar, vector], axis=-1)
