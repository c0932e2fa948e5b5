"""Which markers a rod hides from a camera by standing in front of them."""

from __future__ import annotations

import numpy as np

NEAR = 2.0  # radii: the rod this close to its own marker does not hide it


def hidden_by_rod(markers: np.ndarray, eye: np.ndarray, centrelines: np.ndarray, radius: float) -> np.ndarray:
    """Whether the straight line from a marker to the eye passes through the marker's own rod.

    The rod is a polyline of `radius`. The first two radii of the line do not count: a marker sits on or in the rod, and
    what stands for it on the image is its near side. A straight rod therefore hides its inner markers when it is seen
    within 30 degrees of end-on. Rods of a batch do not see each other; coils and clamp hide nothing.

    Args:
        markers: m, world, (num_rods, num_markers, 3).
        eye: centre of projection, m, world, (3,).
        centrelines: nodes of the rods, m, world, (num_rods, num_nodes, 3).
        radius: of the rod, m.

    Returns:
        (num_rods, num_markers) bool.
    """
    towards = eye - markers
    distance = np.linalg.norm(towards, axis=-1, keepdims=True)
    towards = towards / distance
    start = markers + NEAR * radius * towards
    reach = np.maximum(distance - NEAR * radius, 0.0)
    gaps = _distances(
        start[:, :, None], towards[:, :, None], reach, centrelines[:, None, :-1], centrelines[:, None, 1:]
    )
    return np.asarray((gaps < radius).any(axis=-1))


def _distances(
    start: np.ndarray, direction: np.ndarray, reach: np.ndarray, ends: np.ndarray, others: np.ndarray
) -> np.ndarray:
    """Least distance, m, between segments start + [0, reach] direction and those from `ends` to `others`.

    C. Ericson, Real-Time Collision Detection (2005), 5.1.9; `direction` has length 1.
    """
    along, offset = others - ends, start - ends
    b, c = (along * direction).sum(axis=-1), np.maximum((along * along).sum(axis=-1), np.finfo(float).tiny)
    f, g = (along * offset).sum(axis=-1), (direction * offset).sum(axis=-1)
    skew = c - b * b
    first = np.clip(
        (b * f - c * g) / np.where(skew > 0.0, skew, 1.0), 0.0, reach
    )  # any will do where they are parallel
    second = np.clip((b * first + f) / c, 0.0, 1.0)
    first = np.clip(b * second - g, 0.0, reach)
    return np.linalg.norm(offset + first[..., None] * direction - second[..., None] * along, axis=-1)
