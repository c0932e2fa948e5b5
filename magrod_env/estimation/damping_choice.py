"""Which damping the nodes of a batch of rods get for one interval: sensitivities by the model, and the law on them."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from magrod_env.estimation.damping_law import bounded_share, damping_deviation, law_gain
from magrod_env.estimation.history import Piece, replay
from magrod_env.simulation import Simulation

LEAST_NOISE = 1e-6  # m: added, squared, to the variances of a measurement, which may be 0
NUDGE = 1e-4  # of m/T: the difference in K from which a sensitivity is taken


class Choice(NamedTuple):
    """What the law says of the rods that were told about, in their order."""

    damping: np.ndarray  # kg/s, (rods, dampings)
    deviation: np.ndarray  # of it, kg/s, where R and W are inverse covariances, (rods, dampings)
    followed: np.ndarray  # share of a marker's error that it takes away, (rods, num_markers, 3)


class DampingChoice:
    """The law for given nodes and axes, with sensitivities from copies of the model that have one K nudged each.

    Args:
        nudged: a batch of num_rods * (1 + dampings) rods; this turns its node damping on.
        num_rods: rods that are told apart; the copies of one rod lie side by side.
        nodes, axes: of each damping, (dampings,).
        marker_nodes: (num_markers,).
        W: weights of the dampings, (s/kg)^2, (dampings,).
        weight: R of every coordinate, 1/m^2, or None for the inverse covariance of the measurement.
        largest_change: bound on |K_a| T/m_a.
    """

    def __init__(
        self,
        nudged: Simulation,
        num_rods: int,
        *,
        nodes: np.ndarray,
        axes: np.ndarray,
        marker_nodes: np.ndarray,
        W: np.ndarray,
        weight: float | None,
        largest_change: float,
    ) -> None:
        self._nudged, self._nodes, self._axes, self._marker_nodes = nudged, nodes, axes, marker_nodes
        self._W, self._weight, self._largest = W, weight, largest_change
        self._masses = nudged.node_masses[0, nodes]
        self._shape = (num_rods, 1 + len(nodes), nudged.num_elements + 1, 3)
        nudged.rods.batch.use_node_damping()

    def sensitivity(
        self, rows: np.ndarray, pieces: Sequence[Piece], lengths: np.ndarray, born: np.ndarray | None = None
    ) -> tuple[np.ndarray, np.ndarray]:
        """Where K = 0 brings the markers, m, (num_rods, outputs), and M, m s/kg, (num_rods, outputs, dampings).

        Args:
            rows: states at the start of the interval, as `state_rows` gives them.
            pieces: the interval.
            lengths: of the interval for each rod, s, (num_rods,).
            born: as in `replay`.
        """
        nudge = NUDGE * self._masses / lengths[:, None]
        damping = np.zeros(self._shape)
        damping[:, 1 + np.arange(len(self._nodes)), self._nodes, self._axes] = nudge
        replay(self._nudged, rows, pieces, damping.reshape(-1, *self._shape[2:]), born)
        outputs = self._nudged.positions.reshape(self._shape)[:, :, self._marker_nodes].reshape(*self._shape[:2], -1)
        return outputs[:, 0], np.swapaxes((outputs[:, 1:] - outputs[:, :1]) / nudge[..., None], 1, 2)

    def choose(
        self,
        rows: np.ndarray,
        pieces: Sequence[Piece],
        goal: np.ndarray,
        covariance: np.ndarray,
        told: np.ndarray,
        lengths: np.ndarray,
        born: np.ndarray,
    ) -> Choice:
        """The law for the rods that are `told` (num_rods,) where their markers should be at the end of the interval.

        Args:
            goal: m, (num_rods, num_markers, 3), NaN where nothing is known.
            covariance: of the measurement, m^2, (num_rods, num_markers, 3, 3).
            rows, pieces, lengths, born: as in `sensitivity`.
        """
        reached, sensitivity = self.sensitivity(rows, pieces, np.where(told, lengths, 1.0), born)
        error = np.nan_to_num(reached[told] - goal[told].reshape(told.sum(), -1))
        R, M = self._weights(goal[told], covariance[told]), sensitivity[told]
        gain = law_gain(M, R, self._W)
        found = -np.einsum("rij,rj->ri", gain, error)
        share = bounded_share(found, self._largest * self._masses / lengths[told, None])[:, None]
        followed = share * np.einsum("rij,rji->ri", M, gain)
        return Choice(share * found, damping_deviation(M, R, self._W), followed.reshape(goal[told].shape))

    def _weights(self, goal: np.ndarray, covariance: np.ndarray) -> np.ndarray:
        """R, 1/m^2, (rods, outputs, outputs): 0 for what was not seen."""
        rods, markers = goal.shape[:2]
        seen = np.isfinite(goal)
        R = np.zeros((rods, markers, 3, markers, 3))
        for marker in range(markers):
            if self._weight is None:
                inverse = np.linalg.inv(covariance[:, marker] + LEAST_NOISE**2 * np.eye(3))
            else:
                inverse = np.tile(self._weight * np.eye(3), (rods, 1, 1))
            R[:, marker, :, marker, :] = inverse * seen[:, marker, :, None]
        return R.reshape(rods, 3 * markers, 3 * markers)
