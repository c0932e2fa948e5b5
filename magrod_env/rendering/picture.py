"""What is drawn and stays the same from frame to frame."""

from collections.abc import Sequence
from dataclasses import dataclass
from math import isfinite
from numbers import Real
from typing import Literal

import numpy as np

Vector = tuple[float, float, float]


@dataclass(frozen=True, kw_only=True, slots=True)
class Picture:
    """The constant part of a scene as a renderer sees it: sizes in metres, directions, a title.

    length: rod length, m.
    radius: rod radius, m; half the edge for a square section.
    section: shape of the rod's cross-section.
    magnet_nodes: node that each magnet sits on; negative numbers count from the tip.
    magnet_lengths: length of each magnet along its dipole, m.
    magnet_radii: radius of each magnet, m.
    magnet_directions: dipole direction of each magnet in the body frame, not zero; it points north.
    field_limit: field at which the arrow reaches the rim of its dial, T.
    gravity: gravity in the world frame, m/s^2; gives a small arrow and room below; None draws neither.
    plane: "xz" or "xy" for motion in that plane: the second view is a close-up of the tip; else "spatial".
    title: heading of the frame.
    """

    length: float
    radius: float
    section: Literal["circular", "square"] = "circular"
    magnet_nodes: tuple[int, ...] = ()
    magnet_lengths: tuple[float, ...] = ()
    magnet_radii: tuple[float, ...] = ()
    magnet_directions: tuple[Vector, ...] = ()
    field_limit: float = 45e-3
    gravity: Vector | None = None
    plane: Literal["spatial", "xz", "xy"] = "spatial"
    title: str = ""

    def __post_init__(self) -> None:
        _require_positive("length", (self.length,))
        _require_positive("radius", (self.radius,))
        _require_positive("field_limit", (self.field_limit,))
        _require_positive("magnet_lengths", self.magnet_lengths)
        _require_positive("magnet_radii", self.magnet_radii)
        for name in ("magnet_lengths", "magnet_radii", "magnet_directions"):
            if len(getattr(self, name)) != len(self.magnet_nodes):
                raise ValueError(
                    f"{name} must have one entry per magnet ({len(self.magnet_nodes)}), "
                    f"received {len(getattr(self, name))}."
                )
        for direction in self.magnet_directions:
            _require_vector("magnet_directions", direction)
        if self.gravity is not None:
            _require_vector("gravity", self.gravity)
        _require_choice("section", self.section, ("circular", "square"))
        _require_choice("plane", self.plane, ("spatial", "xz", "xy"))


def _require_positive(name: str, values: Sequence[float]) -> None:
    for value in values:
        if not (_is_number(value) and value > 0):
            raise ValueError(f"{name} must be positive and finite, received {value!r}.")


def _require_vector(name: str, vector: Sequence[float]) -> None:
    listed = isinstance(vector, (tuple, list)) or (isinstance(vector, np.ndarray) and vector.ndim == 1)
    if not listed or len(vector) != 3 or not all(map(_is_number, vector)) or not any(vector):
        raise ValueError(f"{name} must be finite non-zero 3-vectors, received {vector!r}.")


def _is_number(value: object) -> bool:
    return isinstance(value, Real) and not isinstance(value, bool) and isfinite(value)


def _require_choice(name: str, value: str, choices: Sequence[str]) -> None:
    if value not in choices:
        raise ValueError(f"{name} must be one of {', '.join(choices)}, received {value!r}.")
