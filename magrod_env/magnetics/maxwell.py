"""Field gradients that a user gives: checked against Maxwell's equations for a space without currents."""

from __future__ import annotations

from typing import Any

import numpy as np

LARGEST_GRADIENT = 1e9  # T/m, far beyond any magnet: its squares and its products with lengths stay finite
_SHARE = 1e-3  # of the largest entry: what a measured gradient, or one from differences, may be off
_ROUNDING = 1e-9  # T/m: the gradient at the centre of a Helmholtz pair is nothing but rounding


def checked_gradient(gradient: Any, num_rods: int) -> np.ndarray:
    """Return field gradients dB_i/dx_j, T/m, as floats of shape (3, 3) or (num_rods, 3, 3).

    Raises:
        ValueError: on another shape, entries that are not finite, or a field with curl (the gradient is not symmetric)
            or divergence (its trace is not zero) beyond a thousandth of the largest entry.
    """
    array = _as_floats(gradient)
    if array.shape not in ((3, 3), (num_rods, 3, 3)) or not np.abs(array).max() <= LARGEST_GRADIENT:
        shapes = "(3, 3)" if num_rods == 1 else f"(3, 3) or ({num_rods}, 3, 3)"
        got = f"shape {array.shape}" if array.shape[-2:] != (3, 3) or array.ndim > 2 else repr(array.tolist())
        raise ValueError(
            f"gradient must be finite of shape {shapes}, but got {got}: give dB_i/dx_j in T/m, at most "
            f"{LARGEST_GRADIENT:.0g}."
        )
    allowed = _SHARE * np.abs(array).max(axis=(-2, -1)) + _ROUNDING
    _check_curl(array, allowed)
    _check_divergence(array, allowed)
    return array


def _as_floats(value: Any) -> np.ndarray:
    try:
        return np.array(value, float)
    except (TypeError, ValueError):
        return np.full(0, np.nan)


def _check_curl(gradient: np.ndarray, allowed: np.ndarray) -> None:
    skew = np.abs(gradient - np.swapaxes(gradient, -2, -1))
    if np.any(skew.max(axis=(-2, -1)) > allowed):
        i, j = np.unravel_index(np.argmax(skew), skew.shape)[-2:]
        raise ValueError(
            f"gradient must be symmetric, as a field has no curl where no current flows, but dB_{'xyz'[i]}/d{'xyz'[j]} "
            f"and dB_{'xyz'[j]}/d{'xyz'[i]} differ by up to {skew.max():.3g} T/m: give both the same value."
        )


def _check_divergence(gradient: np.ndarray, allowed: np.ndarray) -> None:
    trace = np.trace(gradient, axis1=-2, axis2=-1)
    if np.any(np.abs(trace) > allowed):
        worst = np.ravel(trace)[np.argmax(np.abs(trace))]
        raise ValueError(
            f"gradient must have trace zero, as no magnetic field diverges, but its trace is {worst:.3g} T/m: take a "
            "third of it off each entry of the diagonal; g along one axis comes with -g/2 along the others."
        )
