"""How uncertain an estimate is, told from how far its forecasts were from the frames (docs/prediction_filter.md)."""

from __future__ import annotations

import numpy as np

from magrod_env.estimation.measurement import SAME_PLACE

WINDOW = 20  # frames over which the spread of the innovations is averaged


class InnovationSpread:
    """Running mean square of the innovations of every rod, marker and axis, and what it says of the estimate.

    Args:
        num_rods: in the batch.
        places: arc lengths of the markers, m, (num_markers,).
        initial: standard deviation of a marker's position before any frame, m; it counts as one frame.
    """

    def __init__(self, num_rods: int, places: np.ndarray, initial: float) -> None:
        self._places, self._initial = places, initial
        shape = (num_rods, len(places), 3)
        self._square = np.zeros(shape)  # mean square of the innovations, m^2
        self._left = np.zeros(shape)  # variance of the estimate after the last frame, m^2
        self._forecast = np.zeros(shape)  # and of the forecast, one interval later, m^2
        self._frames = np.zeros(shape[:2])
        self._seen_at, self._interval = np.zeros(shape[:2]), np.ones(shape[:2])  # s
        self.reset(np.ones(num_rods, bool), 0.0)

    def reset(self, rods: np.ndarray, time: float) -> None:
        """Forget what was seen of some rods (num_rods,) bool; they start again at `time`, s."""
        self._square[rods] = self._left[rods] = self._forecast[rods] = self._initial**2
        self._frames[rods], self._seen_at[rods], self._interval[rods] = 0.0, time, 1.0

    def expected(self, noise: np.ndarray) -> np.ndarray:
        """Variance expected of the next innovation, m^2, (num_rods, num_markers, 3): never less than the noise's."""
        first = (self._frames == 0)[..., None]
        return np.maximum(self._square + np.where(first, noise, 0.0), noise)

    def take_in(self, innovation, noise, followed, exposure, lengths) -> None:
        """Learn from a frame.

        Args:
            innovation: m, (num_rods, num_markers, 3), NaN where nothing was seen.
            noise: variance of the measurements, m^2, of the same shape.
            followed: share of the innovation by which the estimate was moved, of the same shape.
            exposure: s.
            lengths: of the interval that ends there, s, (num_rods,).
        """
        seen = np.isfinite(innovation).all(axis=-1)
        self._square = np.where((self._frames == 0)[..., None], self._square + noise, self._square)
        self._frames += seen
        kept = np.minimum(self._frames + 1.0, WINDOW)[..., None]
        step = np.where(seen[..., None], np.nan_to_num(innovation) ** 2 - self._square, 0.0) / kept
        self._square += step
        doubt = np.sqrt(2.0 / kept) * noise  # a mean of so few squares cannot tell less
        forecast = np.maximum(self._square - noise, doubt)
        left = (1.0 - followed) ** 2 * forecast + followed**2 * noise
        self._forecast = np.where(seen[..., None], forecast, self._forecast)
        self._left = np.where(seen[..., None], left, self._left)
        self._seen_at = np.where(seen, exposure, self._seen_at)
        self._interval = np.where(seen & (lengths > 0.0)[:, None], lengths[:, None], self._interval)

    def deviation(self, arc_lengths: np.ndarray, time: float) -> np.ndarray:
        """Standard deviation of the nodes' positions at `time` (s), m, (num_rods, num_nodes, 3).

        At a marker the variance grows with the square of the time since it was seen, so that after one more interval
        it is that of the forecast. Other nodes have no less than the forecast's, since no frame has spoken of them:
        linear between markers; before the first and after the last with the square of the arc length, since the clamp's
        position and slope are known.
        """
        age = ((time - self._seen_at) / self._interval)[..., None]
        variance = self._left + np.maximum(self._forecast - self._left, 0.0) * age**2
        order = np.argsort(self._places)
        places, seen = self._places[order], np.sqrt(variance)[:, order]
        unseen = np.sqrt(np.maximum(variance, self._forecast))[:, order]
        slot = np.clip(np.searchsorted(places, arc_lengths * (1.0 - SAME_PLACE)), 0, len(places) - 1)
        low = np.maximum(slot - 1, 0)
        width = np.where(slot > low, places[slot] - places[low], 1.0)
        share = np.where(slot > low, (arc_lengths - places[low]) / width, 1.0).clip(0.0, 1.0)
        between = unseen[:, low] + share[:, None] * (unseen[:, slot] - unseen[:, low])
        outside = (arc_lengths < places[0]) | (arc_lengths > places[-1])
        along = between * np.where(outside, (arc_lengths / places[slot]) ** 2, 1.0)[:, None]
        at_marker = np.abs(arc_lengths - places[slot]) <= SAME_PLACE * arc_lengths[-1]
        return np.where(at_marker[:, None], seen[:, slot], along)
