"""Shapes that a user gives: positions and rotations of a rod's nodes, checked, as the kernels take them."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike

Shape = tuple[ArrayLike, ArrayLike]
"""Positions (num_nodes, 3) m and rotations (num_nodes, 3, 3), body to world, of the nodes; or the same a rod."""

SKEWED = 1e-6  # largest departure of a rotation from an orthogonal matrix, and of the clamp from its place, in lengths


def checked_shape(
    shape: Any, num_rods: int, num_nodes: int, length: float, across: int | None
) -> tuple[np.ndarray, np.ndarray]:
    """Positions (num_rods, num_nodes, 3) m and quaternions (num_rods, num_nodes, 4) of a shape.

    Args:
        shape: positions (num_nodes, 3) m and rotations (num_nodes, 3, 3) body to world, or the same a rod.
        num_rods, num_nodes: what it must fit.
        length: of the rod, m.
        across: world axis across the plane of planar motion, or None.

    Raises:
        ValueError: if it is no such pair, is not finite, has matrices that are no rotations, or leaves the clamp (the
            origin, not turned) or the plane.
    """
    if not isinstance(shape, (tuple, list)) or len(shape) != 2:
        raise ValueError(
            f"shape must be a pair of positions and rotations, but got {type(shape).__name__}: give those of a "
            "simulation, (simulation.positions, simulation.rotations)."
        )
    positions, rotations = (
        _checked_array(name, value, num_rods, (num_nodes, *ends))
        for name, value, ends in (("positions", shape[0], (3,)), ("rotations", shape[1], (3, 3)))
    )
    skew = np.abs(np.swapaxes(rotations, -1, -2) @ rotations - np.eye(3)).max()
    if skew > SKEWED or (np.linalg.det(rotations) < 0.0).any():
        raise ValueError(
            f"rotations of a shape must be rotation matrices, but O'O - 1 is up to {skew:.3g} or some reflect: "
            "orthogonalise them."
        )
    off = max(np.abs(positions[:, 0]).max() / length, np.abs(rotations[:, 0] - np.eye(3)).max())
    if off > SKEWED:
        raise ValueError(
            f"shape must be clamped at the origin along +x, but its first node is off by {off:.3g}: give positions and "
            "rotations relative to the clamp."
        )
    positions[:, 0], rotations[:, 0] = 0.0, np.eye(3)
    if across is not None:
        turned = np.abs(np.delete(rotations[..., across], across, -1)).max()
        out = max(np.abs(positions[..., across]).max() / length, turned)
        if out > SKEWED:
            raise ValueError(
                f"shape must lie in the plane of the motion, but leaves it by {out:.3g} of the length: use plane=None."
            )
        positions[..., across] = 0.0
    return positions, _quaternions(rotations, across)


def check_one_start(field: Any, shape: Any) -> None:
    """Refuse a start in a shape beside one in the equilibrium of a field."""
    if field is not None and shape is not None:
        raise ValueError(
            "shape must be None beside a field, whose equilibrium is the start, but got both: leave one out."
        )


def _checked_array(name: str, value: Any, num_rods: int, each: tuple[int, ...]) -> np.ndarray:
    array = np.asarray(value, float)
    if array.shape not in (each, (num_rods, *each)) or not np.isfinite(array).all():
        raise ValueError(
            f"{name} of a shape must be finite of shape {each} or {(num_rods, *each)}, but got shape "
            f"{array.shape}: give one row a node, the clamp's first."
        )
    return np.array(np.broadcast_to(array, (num_rods, *each)))


def _quaternions(rotations: np.ndarray, across: int | None) -> np.ndarray:
    """Unit quaternions (..., nodes, 4), scalar first, of rotation matrices (..., nodes, 3, 3).

    Signs do not jump along the rod, from a first that is 1. In a plane, they turn about the axis across it alone.

    Four times the products of the quaternion's entries stand in a symmetric matrix that is linear in the rotation
    (Shepperd 1978); its row of the largest diagonal entry is the quaternion but for a factor.
    """
    (a, b, c), (d, e, f), (g, h, i) = np.moveaxis(rotations, (-2, -1), (0, 1))
    products = np.array(
        [
            [1.0 + a + e + i, h - f, c - g, d - b],
            [h - f, 1.0 + a - e - i, b + d, c + g],
            [c - g, b + d, 1.0 - a + e - i, f + h],
            [d - b, c + g, f + h, 1.0 - a - e + i],
        ]
    )
    products = np.moveaxis(products, (0, 1), (-2, -1))
    largest = np.argmax(np.diagonal(products, axis1=-2, axis2=-1), axis=-1)
    rows = np.take_along_axis(products, largest[..., None, None], axis=-2)[..., 0, :]
    if across is not None:
        rows[..., [1 + axis for axis in range(3) if axis != across]] = 0.0
    rows = rows / np.linalg.norm(rows, axis=-1, keepdims=True)
    rows[..., 0, :] *= np.where(rows[..., 0, :1] < 0.0, -1.0, 1.0)
    jumps = (rows[..., 1:, :] * rows[..., :-1, :]).sum(axis=-1) < 0.0
    rows[..., 1:, :] *= np.cumprod(np.where(jumps, -1.0, 1.0), axis=-1)[..., None]
    return rows
