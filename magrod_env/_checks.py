"""Checks on user input: each returns plain floats or raises ValueError with one clear sentence."""

from __future__ import annotations

import math
from numbers import Real
from typing import Any

import numpy as np

Vector = tuple[float, float, float]

_UNIT_NORM = 4.0 * np.finfo(float).eps  # a vector this close to unit length is kept as it is


def number(
    what: str,
    value: Any,
    *,
    advice: str,
    above: float | None = None,
    at_least: float | None = None,
    at_most: float | None = None,
) -> float:
    """Return `value` as a float within the bounds; bool, str, NaN, infinity and arrays are refused."""
    result = _real(value)
    low_enough = at_most is None or result <= at_most
    high_enough = (above is None or result > above) and (at_least is None or result >= at_least)
    if not (math.isfinite(result) and low_enough and high_enough):
        bounds = _bounds(above, at_least, at_most)
        raise ValueError(f"{what} must be a finite number{bounds}, but got {value!r}: {advice}.")
    return result


def bounded(
    what: str,
    value: Any,
    *,
    advice: str,
    most: float,
    least: float = 0.0,
    above: float | None = None,
    at_least: float | None = None,
) -> float:
    """Return `value` as `number` does, and refuse one beyond what can be built: products of such numbers overflow."""
    result = number(what, value, advice=advice, above=above, at_least=at_least)
    if not least <= result <= most:
        raise ValueError(f"{what} must be between {least:g} and {most:g}, but got {value!r}: {advice}.")
    return result


def count(what: str, value: Any, *, advice: str) -> float:
    """Return `value`, a positive and finite whole number, as a float."""
    result = _real(value)
    if not (math.isfinite(result) and result >= 1.0 and result == round(result)):
        raise ValueError(f"{what} must be a whole number of 1 or more, but got {value!r}: {advice}.")
    return result


def vector(what: str, value: Any, *, advice: str) -> Vector:
    """Return `value`, anything with three finite numbers, as a tuple of floats."""
    entries = [_real(entry) for entry in value] if _is_listing(value) else []
    if len(entries) != 3 or not all(math.isfinite(entry) for entry in entries):
        raise ValueError(f"{what} must be three finite numbers, but got {value!r}: {advice}.")
    return entries[0], entries[1], entries[2]


def unit_vector(what: str, value: Any, *, advice: str) -> Vector:
    """Return `value` scaled to length 1; the zero vector is refused."""
    x, y, z = vector(what, value, advice=advice)
    if abs(math.hypot(x, y, z) - 1.0) <= _UNIT_NORM:
        return x, y, z
    largest = max(abs(x), abs(y), abs(z))
    if largest == 0.0:
        raise ValueError(f"{what} must be a vector that is not zero, but got {value!r}: {advice}.")
    x, y, z = x / largest, y / largest, z / largest  # no overflow or underflow below
    norm = math.hypot(x, y, z)
    return x / norm, y / norm, z / norm


def points(what: str, value: Any) -> np.ndarray:
    """Return `value` as a float array of shape (..., 3)."""
    array = np.asarray(value, dtype=float)
    if array.ndim == 0 or array.shape[-1] != 3:
        raise ValueError(f"{what} must have shape (..., 3), but got shape {array.shape}: put x, y, z on the last axis.")
    return array


def _is_listing(value: Any) -> bool:
    return isinstance(value, (tuple, list)) or (isinstance(value, np.ndarray) and value.ndim == 1)


def _real(value: Any) -> float:
    """Return `value` as a float, or NaN where it is no real number."""
    if isinstance(value, np.ndarray) and value.ndim == 0:
        value = value.item()
    if isinstance(value, bool) or not isinstance(value, Real):
        return math.nan
    try:
        return float(value)
    except OverflowError:
        return math.inf


def _bounds(above: float | None, at_least: float | None, at_most: float | None) -> str:
    limits = ((">", above), (">=", at_least), ("<=", at_most))
    return " and".join(f" {sign} {limit:.12g}" for sign, limit in limits if limit is not None)
