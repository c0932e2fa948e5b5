"""Closed curves for tips to follow: shapes in the plane across the rod, spaced evenly along their length."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

SHAPES = ("circle", "figure_eight", "square", "letter_M", "letter_R")

_CORNERS = {
    "square": [(-1, -1), (1, -1), (1, 1), (-1, 1)],
    "letter_M": [(-0.8, -1), (-0.8, 1), (0, -0.2), (0.8, 1), (0.8, -1), (0.8, 1), (0, -0.2), (-0.8, 1)],
    "letter_R": [
        (-0.6, -1),
        (-0.6, 1),
        (0.3, 1),
        (0.6, 0.7),
        (0.6, 0.3),
        (0.3, 0),
        (-0.6, 0),
        (0, 0),
        (0.6, -1),
        (0, 0),
    ],
}


def shape(name: str, num_points: int = 240) -> np.ndarray:
    """A closed curve of a known shape within a circle of radius sqrt(2), (num_points, 2), evenly spaced.

    Raises:
        ValueError: if the name is unknown.
    """
    angle = np.linspace(0.0, 2.0 * np.pi, num_points, endpoint=False)
    if name == "circle":
        return np.stack([np.cos(angle), np.sin(angle)], axis=1)
    if name == "figure_eight":
        fine = np.linspace(0.0, 2.0 * np.pi, 4096, endpoint=False)
        return evenly_spaced(np.stack([np.sin(fine), np.sin(2.0 * fine)], axis=1), num_points)
    if name not in _CORNERS:
        raise ValueError(
            f"shape must be one of {', '.join(SHAPES)}, but got {name!r}: choose one, or give points (M, 2)."
        )
    return evenly_spaced(np.array(_CORNERS[name], float), num_points)


def evenly_spaced(corners: ArrayLike, num_points: int) -> np.ndarray:
    """A closed polygon through `corners` (M, D), sampled at equal distances, (num_points, D)."""
    points = np.asarray(corners, float)
    closed = np.concatenate([points, points[:1]])
    length = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(closed, axis=0), axis=1))])
    at = np.linspace(0.0, length[-1], num_points, endpoint=False)
    return np.stack([np.interp(at, length, column) for column in closed.T], axis=1)
