"""Snapshots of a simulation: whether one can go on from them."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

Snapshot = dict[str, Any]
"""What changes in time: "made_with" says of what simulation, "blocks" holds the rods, the rest what acts on them."""

_MAY_BE_LOST = ("blocks",)  # those of a rod that has failed hold NaN


def check_snapshot(snapshot: Any, own: Snapshot) -> None:
    """Refuse what is no snapshot of a simulation like the one whose state is `own`.

    Raises:
        ValueError: if it is no snapshot, a part is missing, of another shape or type or not finite, or it comes from a
            simulation of another scene or other settings.
    """
    missing = [name for name in own if name not in snapshot] if isinstance(snapshot, dict) else list(own)
    if missing:
        what = (
            f"lacks {', '.join(map(repr, missing))}" if isinstance(snapshot, dict) else f"is {type(snapshot).__name__}"
        )
        raise ValueError(f"snapshot must be what snapshot() returned, but {what}: take one of this simulation.")
    _check_origin(snapshot["made_with"], own["made_with"])
    for name, value in own.items():
        if name != "made_with" and not _fits(snapshot[name], value, name):
            raise ValueError(
                f"{name!r} of a snapshot must be {_described(value)}, but got {_described(snapshot[name])}: "
                "do not change a snapshot, and take another one."
            )


def _check_origin(made_with: Any, own: dict[str, Any]) -> None:
    if not isinstance(made_with, dict) or made_with.keys() != own.keys():
        raise ValueError("snapshot must say what it was made with, but does not: take one of this simulation.")
    different = [name for name, value in own.items() if made_with[name] != value]
    if different:
        name = different[0]
        values = "" if name == "scene" else f" ({made_with[name]!r}, here {own[name]!r})"
        raise ValueError(
            f"snapshot must come from a simulation of the same scene and settings, but its {name} differs{values}: "
            "take one of this simulation, or give both the same arguments."
        )


def _fits(value: Any, own: Any, name: str) -> bool:
    if isinstance(own, np.ndarray):
        if not isinstance(value, np.ndarray) or value.shape != own.shape or value.dtype != own.dtype:
            return False
        return name in _MAY_BE_LOST or bool(np.isfinite(value).all())
    if isinstance(own, bool):
        return isinstance(value, bool)
    return isinstance(value, float) and math.isfinite(value) and value >= 0.0  # NumPy's float64 is a float


def _described(value: Any) -> str:
    if isinstance(value, np.ndarray):
        lost = value.dtype.kind == "f" and not np.isfinite(value).all()
        return f"a {value.dtype} array of shape {value.shape}" + (" that is not finite" if lost else "")
    if isinstance(value, bool):
        return "True or False"
    return "a finite time" if isinstance(value, float) and math.isfinite(value) else repr(value)
