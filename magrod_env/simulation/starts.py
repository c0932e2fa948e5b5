"""Shapes that a user gives: positions and rotations of a rod's nodes, checked, as the kernels take them."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from magrod_env.rod.equilibrium import Equilibrium
from magrod_env.rotations import rotation_matrices

Shape = tuple[ArrayLike, ArrayLike] | Equilibrium
"""Positions (num_nodes, 3) m and rotations, body to world, of the nodes, as matrices (num_nodes, 3, 3) or quaternions
(num_nodes, 4), scalar first; or the same a rod; or an equilibrium."""

SKEWED = 1e-6  # largest departure of a rotation from an orthogonal matrix, and of the clamp from its place, in lengths


def checked_shape(
    shape: Any, num_rods: int, num_nodes: int, length: float, across: int | None, name: str = "shape"
) -> tuple[np.ndarray, np.ndarray]:
    """Positions (num_rods, num_nodes, 3) m and quaternions (num_rods, num_nodes, 4) of a shape.

    Args:
        shape: positions and rotations of the nodes, see `Shape`.
        num_rods, num_nodes: what it must fit.
        length: of the rod, m.
        across: world axis across the plane of planar motion, or None.
        name: of the argument, for messages.

    Raises:
        ValueError: if it is no such pair, is not finite, has matrices or quaternions that are no rotations, or leaves
            the clamp (the origin, not turned) or the plane.
    """
    if isinstance(shape, Equilibrium):
        shape = shape.positions, shape.quaternions
    if not isinstance(shape, (tuple, list)) or len(shape) != 2:
        raise ValueError(
            f"{name} must be a pair of positions and rotations, but got {type(shape).__name__}: give those of a "
            "simulation, (simulation.positions, simulation.rotations), or an equilibrium."
        )
    positions = _checked_array(f"positions of a {name}", shape[0], num_rods, (num_nodes, 3))
    rotations, quaternions = _checked_rotations(f"rotations of a {name}", shape[1], num_rods, num_nodes)
    off = max(np.abs(positions[:, 0]).max() / length, np.abs(rotations[:, 0] - np.eye(3)).max())
    if off > SKEWED:
        raise ValueError(
            f"{name} must be clamped at the origin along +x, but its first node is off by {off:.3g}: give positions "
            "and rotations relative to the clamp."
        )
    positions[:, 0], quaternions[:, 0] = 0.0, (1.0, 0.0, 0.0, 0.0)
    if across is not None:
        turned = np.abs(np.delete(rotations[..., across], across, -1)).max()
        out = max(np.abs(positions[..., across]).max() / length, turned)
        if out > SKEWED:
            raise ValueError(
                f"{name} must lie in the plane of the motion, but leaves it by {out:.3g} of the length: use plane=None."
            )
        positions[..., across] = 0.0
    return positions, _continuous(quaternions, across)


def _checked_rotations(name: str, value: Any, num_rods: int, num_nodes: int) -> tuple[np.ndarray, np.ndarray]:
    """Matrices (num_rods, num_nodes, 3, 3) and quaternions (num_rods, num_nodes, 4) of rotations given as either."""
    if _as_floats(value).shape in ((num_nodes, 4), (num_rods, num_nodes, 4)):
        quaternions = _checked_array(name, value, num_rods, (num_nodes, 4))
        norm = np.linalg.norm(quaternions, axis=-1)
        skew = np.abs(norm - 1.0).max()
        if skew > SKEWED:
            raise ValueError(
                f"{name} must be unit quaternions, but their length is off 1 by up to {skew:.3g}: normalise them."
            )
        return rotation_matrices(quaternions / norm[..., None]), quaternions
    rotations = _checked_array(name, value, num_rods, (num_nodes, 3, 3), f", or {(num_nodes, 4)} as quaternions")
    skew = np.abs(np.swapaxes(rotations, -1, -2) @ rotations - np.eye(3)).max()
    if skew > SKEWED or (np.linalg.det(rotations) < 0.0).any():
        raise ValueError(
            f"{name} must be rotation matrices, but O'O - 1 is up to {skew:.3g} or some reflect: orthogonalise them."
        )
    return rotations, _quaternions(rotations)


def check_one_start(field: Any, shape: Any, gradient: Any = None) -> None:
    """Refuse a start in a shape beside one in the equilibrium of a field or a gradient."""
    for name, value in (("field", field), ("gradient", gradient)):
        if value is not None and shape is not None:
            raise ValueError(
                f"shape must be None beside a {name}, whose equilibrium is the start, but got both: leave one out."
            )


def _as_floats(value: Any) -> np.ndarray:
    try:
        return np.asarray(value, float)
    except (TypeError, ValueError):  # ragged, or no numbers
        return np.zeros(0)


def _checked_array(name: str, value: Any, num_rods: int, each: tuple[int, ...], other: str = "") -> np.ndarray:
    array = _as_floats(value)
    if array.shape not in (each, (num_rods, *each)) or not np.isfinite(array).all():
        raise ValueError(
            f"{name} must be finite of shape {each} or {(num_rods, *each)}{other}, but got shape "
            f"{array.shape}: give one row a node, the clamp's first."
        )
    return np.array(np.broadcast_to(array, (num_rods, *each)))


def _quaternions(rotations: np.ndarray) -> np.ndarray:
    """Unit quaternions (..., nodes, 4), scalar first and of any sign, of rotation matrices (..., nodes, 3, 3).

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
    return rows / np.linalg.norm(rows, axis=-1, keepdims=True)


def _continuous(quaternions: np.ndarray, across: int | None) -> np.ndarray:
    """Unit quaternions (..., nodes, 4) whose signs do not jump along the rod, from a first that is 1.

    In a plane, they turn about the axis across it alone.
    """
    rows = quaternions.copy()
    if across is not None:
        rows[..., [1 + axis for axis in range(3) if axis != across]] = 0.0
    rows /= np.linalg.norm(rows, axis=-1, keepdims=True)
    jumps = (rows[..., 1:, :] * rows[..., :-1, :]).sum(axis=-1) < 0.0
    rows[..., 1:, :] *= np.cumprod(np.where(jumps, -1.0, 1.0), axis=-1)[..., None]
    return rows
