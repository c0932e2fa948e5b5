"""The one-step optimal damping law of Tariverdi et al. 2020 (section 3.2, eq. 19-21), as functions on arrays.

Derived in docs/prediction_filter.md, which also says where the printed equations differ.
"""

from __future__ import annotations

import numpy as np

GRAM_MILLIMETRE = 1e6  # 1/mm^2 in 1/m^2, and (s/g)^2 in (s/kg)^2


def paper_weights(R: float, W: float) -> tuple[float, float]:
    """The weights of the paper's tables in SI: R of a squared error, 1/m^2, and W of a squared damping, (s/kg)^2.

    The tables print no units. Read like their mass per length, in g, mm and s, both grow by 1e6.
    """
    return R * GRAM_MILLIMETRE, W * GRAM_MILLIMETRE


def law_gain(sensitivity: np.ndarray, R: np.ndarray, W: np.ndarray) -> np.ndarray:
    """Gain of the law, (M^T R M + W)^-1 M^T R, kg/(s m), (..., dampings, outputs).

    K = -gain e minimises (e + M K)^T R (e + M K) + K^T W K (eq. 19 with 20), where e is the error, predicted minus
    measured outputs (m), that K = 0 would leave at the end of the interval.

    Args:
        sensitivity: M, derivative of the outputs with respect to K, m s/kg, (..., outputs, dampings).
        R: weight of the error, 1/m^2, (..., outputs, outputs), positive semi-definite.
        W: weights of the dampings, (s/kg)^2, (dampings,), positive.
    """
    root = 1.0 / np.sqrt(W)  # K = root x: the numbers of x are of one size, and its weight is the identity
    scaled = sensitivity * root
    weighted = np.swapaxes(scaled, -1, -2) @ R
    return root[:, None] * np.linalg.solve(weighted @ scaled + np.eye(len(root)), weighted)


def damping_deviation(sensitivity: np.ndarray, R: np.ndarray, W: np.ndarray) -> np.ndarray:
    """Standard deviation of K, kg/s, (..., dampings): the root of the diagonal of (M^T R M + W)^-1.

    It holds where R is the inverse covariance of the measurement and W that of K before it.
    """
    root = 1.0 / np.sqrt(W)
    scaled = sensitivity * root
    inverse = np.linalg.inv(np.swapaxes(scaled, -1, -2) @ R @ scaled + np.eye(len(root)))
    return root * np.sqrt(np.diagonal(inverse, axis1=-2, axis2=-1))


def bounded_share(damping: np.ndarray, bound: np.ndarray) -> np.ndarray:
    """Largest share, 0 to 1, of a step K for which no |K_i| passes its bound, (...,).

    All of K shrinks together: along that line the cost, convex and least at K, falls from its value at K = 0.

    Args:
        damping: K, kg/s, (..., dampings).
        bound: kg/s, positive, of the same shape.
    """
    return 1.0 / np.maximum(1.0, np.max(np.abs(damping) / bound, axis=-1))
