"""The Gaussian update of an ensemble: deterministic square root, in the space of the measurements.

With anomalies A of the ensemble, C = R^-1/2 (Y - mean Y)/sqrt(M - 1) of its predicted measurements and the innovation
d = R^-1/2 (y - mean Y), the ensemble transform filter (Bishop, Etherton and Majumdar 2001; symmetric root of Wang,
Bishop and Julier 2004) moves the mean by A C^T (I + C C^T)^-1 d and the anomalies by (I + C^T C)^-1/2. With
C C^T = U s U^T both need only the eigenvectors of a matrix of the size of the measurement (docs/ensemble_filter.md).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

SURPRISE = 3.0  # standard deviations of the normalised innovation squared beyond its mean that are believed
HALVINGS = 20
FINEST = 1e-9  # m: no marker is taken to be seen better than this


@dataclass(frozen=True)
class Update:
    """How an ensemble of M members answers to measurements of p numbers, for each of `num_rods` rods."""

    anomalies: np.ndarray  # (num_rods, M, p), of the whitened predictions, over sqrt(M - 1)
    gain: np.ndarray  # (num_rods, p), what the mean moves by, per covariance with the whitened predictions
    root: np.ndarray  # (num_rods, p, p), and the anomalies
    growth: np.ndarray  # (num_rods,) factor on all anomalies before the update
    statistic: np.ndarray  # (num_rods,) normalised innovation squared e^T S^-1 e

    def apply(self, ensemble: np.ndarray) -> np.ndarray:
        """The updated ensemble: any quantity (num_rods, M, ...) of the members, at whatever time."""
        rods, members = ensemble.shape[:2]
        flat = ensemble.reshape(rods, members, -1)
        mean = flat.mean(axis=1, keepdims=True)
        spread = flat - mean
        cross = np.swapaxes(self.anomalies, 1, 2) @ spread  # C A^T
        moved = mean + self.gain[:, None] @ cross / np.sqrt(members - 1)
        left = self.growth[:, None, None] * (spread - self.anomalies @ (self.root @ cross))
        return (moved + left).reshape(ensemble.shape)


def whitener(covariances: np.ndarray) -> np.ndarray:
    """Symmetric R^-1/2 of covariances (..., 3, 3), m^2, none taken to be finer than `FINEST`."""
    values, vectors = np.linalg.eigh(covariances)
    return (vectors / np.sqrt(np.maximum(values, FINEST**2))[..., None, :]) @ np.swapaxes(vectors, -1, -2)


def ensemble_update(
    predictions: np.ndarray,
    innovation: np.ndarray,
    covariances: np.ndarray,
    seen: np.ndarray,
    relaxation: float,
    largest_growth: float,
) -> Update:
    """Update of an ensemble by what markers were seen, rod by rod.

    Args:
        predictions: of the members, m, (num_rods, M, num_markers, 3).
        innovation: measurement less mean prediction, m, (num_rods, num_markers, 3); anything where not seen.
        covariances: of the measurements, m^2, (num_rods, num_markers, 3, 3).
        seen: (num_rods, num_markers) bool.
        relaxation: share of the prior anomalies in the posterior ones (Zhang, Snyder and Sun 2004), 0 to 1.
        largest_growth: factor up to which the prior spread is taken to be larger than it is where it does not explain
            the innovation (`growth`); 1 never does.
    """
    rods, members, markers, _ = predictions.shape
    white = np.where(seen[..., None, None], whitener(covariances), 0.0)
    spread = predictions - predictions.mean(axis=1, keepdims=True)
    anomalies = np.einsum("rkij,rmkj->rmki", white, spread).reshape(rods, members, 3 * markers) / np.sqrt(members - 1)
    residual = np.einsum("rkij,rkj->rki", white, np.where(seen[..., None], innovation, 0.0)).reshape(rods, -1, 1)
    values, vectors = np.linalg.eigh(np.swapaxes(anomalies, 1, 2) @ anomalies)
    values = np.maximum(values, 0.0)
    turned = np.swapaxes(vectors, 1, 2)
    along = (turned @ residual)[..., 0]
    statistic = (along**2 / (1.0 + values)).sum(axis=1)
    spare = growth(values, along, 3 * seen.sum(axis=1), largest_growth)
    values = spare[:, None] * values
    grown = np.sqrt(1.0 + values)[:, None]
    gain = (vectors @ (spare[:, None] * along / (1.0 + values))[..., None])[..., 0]
    inner = (1.0 - relaxation) * spare[:, None, None] / (grown * (1.0 + grown))
    return Update(anomalies, gain, (vectors * inner) @ turned, np.sqrt(spare), statistic)


def growth(values: np.ndarray, along: np.ndarray, dof: np.ndarray, largest: float) -> np.ndarray:
    """Factor (num_rods,) on the prior variances, at least 1, that makes an innovation credible.

    Where the normalised innovation squared is beyond its mean plus three standard deviations, the model must have
    missed something: the factor brings it there, as a strong tracking filter does (Zhou and Frank 1996), but is at most
    `largest`**2.

    Args:
        values: (num_rods, p) eigenvalues of the whitened prior covariance of the predictions.
        along: (num_rods, p) whitened innovation along its eigenvectors.
        dof: (num_rods,) numbers measured.
        largest: factor on the spread, at least 1.
    """
    bound = dof + SURPRISE * np.sqrt(2.0 * dof)
    low, high = np.zeros(len(values)), np.full(len(values), 2.0 * np.log(largest))
    for _ in range(HALVINGS):
        middle = 0.5 * (low + high)
        beyond = (along**2 / (1.0 + np.exp(middle)[:, None] * values)).sum(axis=1) > bound
        low, high = np.where(beyond, middle, low), np.where(beyond, high, middle)
    surprised = (along**2 / (1.0 + values)).sum(axis=1) > bound
    return np.where(surprised, np.exp(high), 1.0)


def exact_draws(generator: np.random.Generator, members: int, columns: int) -> np.ndarray:
    """Standard normal draws (members, columns) whose sample mean is 0 and whose sample covariance is the identity.

    Second-order exact sampling (Pham 2001): an ensemble of so few has else a covariance that is off by
    sqrt(2/members). Without room for it (columns >= members) the mean is 0 and each column has unit variance.
    """
    draws = generator.standard_normal((members, columns))
    draws -= draws.mean(axis=0)
    if columns < members:
        draws, upper = np.linalg.qr(draws)
        return draws * np.sign(np.diag(upper)) * np.sqrt(members - 1)
    return draws / draws.std(axis=0, ddof=1)
