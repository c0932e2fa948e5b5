"""Checks of what a user lets differ from rod to rod."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from magrod_env.simulation.model import RodModel
from magrod_env.simulation.scene_values import axis_across

_FACTORS = ("modulus", "density", "moment")  # above 0
_SCENE_HAS = {"drag": "drag_rate", "spin_drag": "spin_drag_rate", "internal_damping": "internal_damping"}
_LARGEST_FACTOR = 1e6
_LARGEST_ACCELERATION = 1e9  # m/s^2

Checked = tuple[dict[str, np.ndarray], "np.ndarray | None", "np.ndarray | None"]


def checked_rods(rods: Any, num_rods: int) -> np.ndarray:
    """Indices of rods, (M,), each once.

    Raises:
        ValueError: if they are none.
    """
    which = np.atleast_1d(np.asarray(rods))
    good = which.ndim == 1 and which.size > 0 and which.dtype.kind in "iu"
    if not good or which.min() < 0 or which.max() >= num_rods or len(np.unique(which)) != len(which):
        raise ValueError(
            f"rods must be different indices between 0 and {num_rods - 1}, but got {rods!r}: leave it None for all."
        )
    return which.astype(np.int64)


def checked_parameters(given: Mapping[str, Any], model: RodModel, count: int, plane: str | None) -> Checked:
    """Parameters of `count` rods as `Rods` takes them, rotation vectors and gains of the field; None for what is not
    given.

    Raises:
        ValueError: as `Simulation.set_parameters`.
    """
    values: dict[str, np.ndarray] = {}
    for name in _FACTORS:
        if given[name] is not None:
            values[name] = _numbers(name, given[name], count, above=0.0)
    for name, term in _SCENE_HAS.items():
        if given[name] is not None:
            values[name] = _numbers(name, given[name], count, above=None) * _rate(model, term, name)
    if given["magnet_shift"] is not None:
        values["magnet_shift"] = _shifts(given["magnet_shift"], model, count)
    if given["gravity"] is not None:
        values["gravity"] = _gravities(given["gravity"], model, count, plane)
    turns, gains = given["field_rotation"], given["field_gain"]
    return (
        values,
        None if turns is None else _turns(turns, count, plane),
        None if gains is None else _numbers("field_gain", gains, count, above=0.0),
    )


def _array(name: str, value: Any, shapes: tuple[tuple[int, ...], ...], what: str) -> np.ndarray:
    try:
        array = np.asarray(value, float)
    except (TypeError, ValueError):
        array = np.full((0,), np.nan)
    if array.shape not in shapes or not np.isfinite(array).all():
        raise ValueError(
            f"{name} must be finite of shape {' or '.join(map(str, shapes))}, but got "
            f"{repr(value) if array.size < 4 else 'shape ' + str(array.shape)}: give {what}."
        )
    return np.array(np.broadcast_to(array, shapes[-1]))


def _numbers(name: str, value: Any, count: int, *, above: float | None) -> np.ndarray:
    numbers = _array(name, value, ((), (count,)), "one factor for all, or one for each rod")
    least = numbers.min()
    if (least <= 0.0 if above is not None else least < 0.0) or numbers.max() > _LARGEST_FACTOR:
        bound = "above 0" if above is not None else "at least 0"
        raise ValueError(
            f"{name} must be {bound} and at most {_LARGEST_FACTOR:.0g}, but got {least:.6g} to {numbers.max():.6g}: "
            "1 leaves the scene's value."
        )
    return numbers


def _rate(model: RodModel, term: str, name: str) -> float:
    """The scene's value that a factor multiplies."""
    rate = model.terms[term]
    if rate is None:
        raise ValueError(
            f"{name} must be left out for a scene without {term}, which has nothing to scale: give the scene one."
        )
    return float(rate)


def _shifts(value: Any, model: RodModel, count: int) -> np.ndarray:
    shifts = _array("magnet_shift", value, ((), (count,)), "metres, one for all or one for each rod")
    ends = model.values.ends
    inner = ends[:-1]
    if len(inner) and (inner[0] + shifts.min() <= 0.0 or inner[-1] + shifts.max() >= ends[-1]):
        raise ValueError(
            f"magnet_shift must leave every magnet between clamp and tip, but got {shifts.min():.3g} to "
            f"{shifts.max():.3g} m: give less."
        )
    return shifts


def _gravities(value: Any, model: RodModel, count: int, plane: str | None) -> np.ndarray:
    if model.scene.gravity is None:
        raise ValueError(
            "gravity must be left out for a scene without it, whose kernel has no weights: "
            "give the scene gravity=(0, 0, 0)."
        )
    vectors = _array("gravity", value, ((3,), (count, 3)), "world vectors in m/s^2")
    if np.abs(vectors).max() > _LARGEST_ACCELERATION:
        raise ValueError(
            f"gravity must be at most {_LARGEST_ACCELERATION:.0g} m/s^2, but got {np.abs(vectors).max():.3g}: "
            "give world vectors in m/s^2."
        )
    across = axis_across(plane)
    if across is not None and vectors[:, across].any():
        raise ValueError(
            f"gravity must lie in the plane {plane!r} of this planar simulation, but got up to "
            f"{np.abs(vectors[:, across]).max():.3g} m/s^2 across it: leave that out, or use plane=None."
        )
    return vectors


def _turns(value: Any, count: int, plane: str | None) -> np.ndarray:
    turns = _array("field_rotation", value, ((3,), (count, 3)), "rotation vectors in rad")
    across = axis_across(plane)
    if across is not None and np.delete(turns, across, axis=1).any():
        raise ValueError(
            f"field_rotation must keep the field in the plane {plane!r} of this planar simulation, but some turn it "
            f"out: turn about {'xyz'[across]} only, or use plane=None."
        )
    return turns
