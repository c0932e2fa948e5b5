"""What an estimator says to a frame that does not fit: shape, and a time out of order."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from magrod_env import _checks
from magrod_env.estimation.measurement import SAME_TIME, Measurement


def check_arrival(measurement: Measurement, shape: tuple[int, int], time: float, last: float, oldest: float) -> None:
    """Refuse a frame of another shape than (num_rods, num_markers), or exposed after `time`, before the frame taken in
    `last`, or before the `oldest` state kept (s).

    Raises:
        ValueError: with which of these it was.
    """
    if not isinstance(measurement, Measurement):
        raise ValueError(f"measurement must be a Measurement or None, but got {measurement!r}: build one.")
    if measurement.positions.shape[:2] != shape:
        raise ValueError(
            f"positions of the measurement must have shape {(*shape, 3)}, but got {measurement.positions.shape}: give "
            "one row a marker of the estimator, NaN where it was not seen."
        )
    exposed = measurement.time
    if exposed > time + SAME_TIME:
        raise ValueError(
            f"time of the measurement must be at most {time:.6g} s, the estimator's, but got {exposed:.6g} s: predict "
            "to the moment of exposure first."
        )
    if exposed < last - SAME_TIME:
        raise ValueError(
            f"time of the measurement must be at least {last:.6g} s, that of the last update, but got {exposed:.6g} s: "
            "give the frames in the order of their exposure."
        )
    if exposed < oldest - SAME_TIME:
        raise ValueError(
            f"time of the measurement must be at least {oldest:.6g} s, the oldest state kept, but got {exposed:.6g} s: "
            "drop the frame, or build the estimator with a longer history."
        )


def checked_field(field: ArrayLike, num_rods: int) -> np.ndarray:
    """Field of every rod, T, (num_rods, 3).

    Raises:
        ValueError: if it is not finite or has another shape than (3,) or (num_rods, 3).
    """
    array = np.asarray(field, float)
    if array.shape not in ((3,), (num_rods, 3)) or not np.isfinite(array).all():
        raise ValueError(
            f"field must be finite of shape (3,) or ({num_rods}, 3), but got {array.tolist()!r}: give world vectors in "
            "tesla."
        )
    return np.array(np.broadcast_to(array, (num_rods, 3)))


def checked_mask(mask: ArrayLike | None, num_rods: int) -> np.ndarray:
    """Rods to start again, (num_rods,) bool; all where `mask` is None.

    Raises:
        ValueError: on another shape or kind.
    """
    if mask is None:
        return np.ones(num_rods, bool)
    array = np.asarray(mask)
    if array.shape != (num_rods,) or array.dtype != bool:
        raise ValueError(
            f"mask must be bool of shape ({num_rods},), but got {array.dtype} of shape {array.shape}: give one entry a "
            "rod."
        )
    return array


def checked_duration(duration: float) -> float:
    """A duration, s.

    Raises:
        ValueError: if it is negative or not finite.
    """
    return _checks.number("duration", duration, at_least=0.0, advice="give it in seconds")
