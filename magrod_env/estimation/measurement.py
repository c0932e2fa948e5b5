"""What cameras tell about a batch of rods, and which nodes of a rod they see."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from magrod_env import _checks
from magrod_env.scene import Scene

SAME_TIME = 1e-9  # s: times this close are one
SAME_PLACE = 1e-6  # of the rod's length: two arc lengths this close are one node


@dataclass(frozen=True, kw_only=True, eq=False)
class Measurement:
    """Positions of the markers on every rod at one instant.

    Args:
        positions: m, world, (num_rods, num_markers, 3); NaN where a marker was not seen.
        covariance: of the error of a marker's position, m^2, world: (3, 3) for all, or broadcastable to
            (num_rods, num_markers, 3, 3); symmetric and positive semi-definite.
        time: of exposure, s, on the clock of the estimator (0 at its reset); earlier than the estimator's own time
            where the camera is late.

    Raises:
        ValueError: on a wrong shape, an infinite position, a covariance that is none, or a time that is not finite.
    """

    positions: np.ndarray
    covariance: np.ndarray
    time: float

    def __post_init__(self) -> None:
        positions = np.array(self.positions, float)
        if positions.ndim != 3 or positions.shape[-1] != 3 or np.isinf(positions).any():
            raise ValueError(
                "positions must be finite, or NaN where unseen, of shape (num_rods, num_markers, 3), but got shape "
                f"{positions.shape}: give one world position in metres a marker."
            )
        time = _checks.number("time", self.time, advice="give the moment of exposure in seconds")
        object.__setattr__(self, "positions", positions)
        object.__setattr__(self, "covariance", checked_covariance(self.covariance, positions.shape[:2]))
        object.__setattr__(self, "time", time)

    @property
    def seen(self) -> np.ndarray:
        """Whether each marker was seen, (num_rods, num_markers)."""
        return np.isfinite(self.positions).all(axis=-1)


def checked_covariance(covariance: ArrayLike, batch: tuple[int, ...]) -> np.ndarray:
    """Covariances of shape (*batch, 3, 3), m^2.

    Raises:
        ValueError: if they do not broadcast to that shape, are not finite, not symmetric or have a negative eigenvalue.
    """
    array = np.asarray(covariance, float)
    try:
        array = np.array(np.broadcast_to(array, (*batch, 3, 3)))
    except ValueError:
        raise ValueError(
            f"covariance must have shape (3, 3) or broadcast to {(*batch, 3, 3)}, but got shape {array.shape}: give "
            "that of a marker's position in m^2."
        ) from None
    size = np.abs(array).max(initial=0.0)
    symmetric = np.isfinite(array).all() and np.abs(array - np.swapaxes(array, -1, -2)).max(initial=0.0) <= 1e-9 * size
    if not symmetric or (array.size and np.linalg.eigvalsh(array).min() < -1e-9 * size):
        raise ValueError(
            f"covariance must be finite, symmetric and without negative eigenvalues, but got {covariance!r}: give "
            "standard_deviation**2 * np.eye(3), in m^2."
        )
    return array


def marker_arc_lengths(scene: Scene, markers: Any) -> tuple[float, ...]:
    """Arc lengths, m, of markers that are told by "tip", "magnets" (every magnet) or arc lengths (m).

    Args:
        scene: whose rod they sit on.
        markers: "tip", "magnets", or a sequence of arc lengths in (0, length].

    Raises:
        ValueError: on another word, no marker, or one that is not on the rod.
    """
    length = scene.rod.length
    if isinstance(markers, str):
        if markers == "tip":
            return (length,)
        if markers == "magnets" and scene.magnets:
            return tuple(float(magnet.position) for magnet in scene.magnets)
        raise ValueError(
            f'markers must be "tip", "magnets" on a scene that has some, or arc lengths, but got {markers!r}: give '
            "their distances from the clamp in metres."
        )
    places = tuple(
        _checks.number("marker", place, above=0.0, at_most=length * (1 + SAME_PLACE), advice="give its arc length in m")
        for place in np.ravel(np.asarray(markers, float))
    )
    if not places:
        raise ValueError(f"markers must be at least one, but got {markers!r}: give their arc lengths in metres.")
    return places


def marker_nodes(arc_lengths: np.ndarray, places: tuple[float, ...]) -> np.ndarray:
    """Node at each marker, (num_markers,) int.

    Args:
        arc_lengths: of the nodes, m, (num_nodes,), from `Simulation.arc_lengths`.
        places: arc lengths of the markers, m.

    Raises:
        ValueError: if a marker sits at no node.
    """
    distances = np.abs(np.subtract.outer(np.asarray(places), arc_lengths))
    nodes = distances.argmin(axis=1)
    for place, node, distance in zip(places, nodes, distances.min(axis=1)):
        if distance > SAME_PLACE * arc_lengths[-1]:
            raise ValueError(
                f"marker must be at a node of the estimator's rod, but got {place:.6g} m where the nearest node is at "
                f"{arc_lengths[node]:.6g} m: move it there, or choose num_elements so that a node sits at it."
            )
    return nodes
