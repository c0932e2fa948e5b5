"""From what a user says about a load to its rows: checks, planes, one value for all rods or one for each."""

from __future__ import annotations

from typing import Any

import numpy as np

from magrod_env import _checks
from magrod_env.rod.planes import PLANE_AXES

Vector = _checks.Vector
"""Three floats."""

LARGEST = 1e12  # N, N m, N/m: far beyond what a rod bears


def checked_load(what: str, value: Any, unit: str, most: float = LARGEST) -> Vector:
    """Three finite numbers of a size that can be computed with."""
    advice = f"give a vector in {unit}"
    vector = _checks.vector(what, value, advice=advice)
    for part in vector:
        _checks.bounded(f"an entry of the {what}", part, least=-most, most=most, advice=advice)
    return vector


def checked_amount(what: str, value: Any, unit: str, most: float) -> float:
    """A number from 0 to ``most``."""
    return _checks.bounded(what, value, at_least=0.0, most=most, advice=f"give it in {unit}")


def checked_length(what: str, value: Any, advice: str) -> float:
    """A length, m, above 0."""
    return _checks.number(what, value, above=0.0, advice=advice)


def checked_flag(what: str, value: Any) -> bool:
    """True or False, nothing else."""
    if not isinstance(value, (bool, np.bool_)):
        raise ValueError(f"{what} must be True or False, but got {value!r}: say which.")
    return bool(value)


def for_rods(what: str, value: Any, shape: tuple[int, ...], least: float = -LARGEST) -> np.ndarray:
    """A value of ``shape`` for all rods, or one for each of K: (1 or K, *shape), finite."""
    array = np.asarray(value, float)
    if array.shape[array.ndim - len(shape) :] != shape or array.ndim > len(shape) + 1:
        raise ValueError(f"{what} must have shape {shape}, or one more axis for the rods, but got {array.shape}.")
    if not (np.isfinite(array).all() and (array >= least).all() and (np.abs(array) <= LARGEST).all()):
        raise ValueError(
            f"{what} must be finite and from {least:g} to {LARGEST:g}, but got {value!r}: check the units."
        )
    return array.reshape(-1, *shape)


def put_vectors(rows: np.ndarray, first: int, what: str, vectors: np.ndarray, plane: str | None) -> None:
    """Write vectors (1 or K, 3) into rows (K, num_rows), the plane's two axes first."""
    axes = PLANE_AXES[plane]
    if np.delete(vectors, axes, axis=1).any():
        raise ValueError(out_of_plane(what, "lie in", vectors, plane))
    rows[:, first : first + len(axes)] = vectors[:, axes]


def put_moments(rows: np.ndarray, first: int, what: str, moments: np.ndarray, plane: str | None) -> None:
    """Write moments (1 or K, 3) into rows (K, num_rows); in a plane the one number that turns from its first axis to
    its second.
    """
    if plane is None:
        rows[:, first : first + 3] = moments
        return
    if moments[:, PLANE_AXES[plane]].any():
        raise ValueError(out_of_plane(what, "be across", moments, plane))
    rows[:, first] = moments[:, 2] if plane == "xy" else -moments[:, 1]


def out_of_plane(what: str, how: str, value: Any, plane: str | None) -> str:
    """What to tell of a load that would move a rod out of its plane."""
    shown = np.asarray(value, float)
    shown = shown if shown.ndim == 1 or len(shown) > 1 else shown[0]
    return (
        f"{what} must {how} the plane {plane!r} of a planar simulation, but got {tuple(shown.tolist())!r}: "
        "turn it, or leave plane=None."
    )
