"""A field that changes in time, as samples: what a recorder or a planner gives."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike


@dataclass(frozen=True, kw_only=True, eq=False)
class FieldCourse:
    """Field samples with straight lines in between; before the first and after the last the field is constant.

    Args:
        times: increasing, s, shape (M,).
        fields: world field, T, shape (M, 3), or (M, num_rods, 3) for a batch.

    Raises:
        ValueError: if an entry is not finite, a shape does not fit or the times do not increase.
    """

    times: ArrayLike
    fields: ArrayLike

    def __post_init__(self) -> None:
        times, fields = np.asarray(self.times, float), np.asarray(self.fields, float)
        if times.ndim != 1 or not len(times) or not np.isfinite(times).all() or np.any(np.diff(times) <= 0.0):
            raise ValueError(
                f"times of the field's course must be finite and increasing of shape (M,), but got shape "
                f"{times.shape}: give seconds, in order, none twice."
            )
        if fields.shape[:1] != times.shape or fields.shape[-1:] != (3,) or fields.ndim > 3:
            raise ValueError(
                f"fields of the field's course must have shape ({len(times)}, 3) or ({len(times)}, num_rods, 3), "
                f"but got {fields.shape}: give one world vector in tesla for each time."
            )
        if not np.isfinite(fields).all():
            raise ValueError("fields of the field's course must be finite, but some are not: check the recording.")
        object.__setattr__(self, "times", times)
        object.__setattr__(self, "fields", fields)

    def sample(self, times: ArrayLike) -> np.ndarray:
        """Field (T) at times (K,) s: shape (K, 3) or (K, num_rods, 3)."""
        at, known, fields = np.asarray(times, float), np.asarray(self.times), np.asarray(self.fields)
        if len(known) == 1:
            return np.repeat(fields, len(at), axis=0)
        first = np.clip(np.searchsorted(known, at, side="right") - 1, 0, len(known) - 2)
        share = np.clip((at - known[first]) / (known[first + 1] - known[first]), 0.0, 1.0)
        share = share.reshape(-1, *(1,) * (fields.ndim - 1))
        return (1.0 - share) * fields[first] + share * fields[first + 1]

    def __call__(self, time: float) -> np.ndarray:
        """Field at one time (s), T, shape (3,) or (num_rods, 3)."""
        return self.sample([time])[0]
