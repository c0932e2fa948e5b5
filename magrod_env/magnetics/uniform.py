"""Ideal coils: a uniform field along fixed world axes, limited per axis."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from magrod_env import _checks


@dataclass(frozen=True, kw_only=True, slots=True)
class UniformCoils:
    """Coils whose field is the same everywhere, one independent component per world axis.

    The default is the set-up of the paper (section 4.3): two nested Helmholtz pairs, 45 mT each, across the
    rod, which points along +x. Not modelled: the gradient of real coils, and with it the force on a magnet;
    see `CoilSystem`.

    Args:
        limit: largest field along an axis, T; one number for all axes or one per axis. Stored as one per
            axis.
        axes: world axes with a coil pair, distinct letters out of "xyz"; their order is the order of the
            fractions.

    Raises:
        ValueError: if a limit is not positive, the axes are unknown or repeated, or their numbers differ.
    """

    limit: float | tuple[float, ...] = 45e-3
    axes: str = "yz"

    def __post_init__(self) -> None:
        axes = self.axes
        if not isinstance(axes, str) or not axes or len(set(axes)) != len(axes) or set(axes) - set("xyz"):
            raise ValueError(
                f'axes of the coils must be distinct letters out of "xyz", but got {axes!r}: '
                'write for instance "yz" for two pairs across a rod along x.'
            )
        object.__setattr__(self, "limit", _limit_per_axis(self.limit, axes))

    @property
    def num_axes(self) -> int:
        """Number of axes, and of entries of a fraction."""
        return len(self.axes)

    @property
    def directions(self) -> np.ndarray:
        """World field (T) of each axis at its limit, shape (num_axes, 3)."""
        return np.diag(self.limit) @ np.eye(3)[["xyz".index(letter) for letter in self.axes]]

    def field(self, fraction: ArrayLike) -> np.ndarray:
        """Return the world field (T), shape (..., 3); entries of `fraction` beyond -1 or 1 give the limit.

        Args:
            fraction: share of the limit per axis, shape (..., num_axes).

        Raises:
            ValueError: if the last axis is not of length num_axes or an entry is NaN.
        """
        return np.clip(self._checked(fraction), -1.0, 1.0) @ self.directions

    def saturates(self, fraction: ArrayLike) -> np.ndarray:
        """Return whether `field` meets a limit of the coils, bool of shape (...); arguments as in `field`."""
        return np.any(np.abs(self._checked(fraction)) > 1.0, axis=-1)

    def fraction(self, field: ArrayLike) -> np.ndarray:
        """Return the fractions that make a world field, shape (..., num_axes), beyond 1 where it exceeds a
        limit.

        Args:
            field: wanted field, world frame, T, shape (..., 3); its part along an axis without coils is left
                out.

        Raises:
            ValueError: if the last axis is not of length 3.
        """
        return _checks.points("field", field) @ self.directions.T / np.square(self.limit)

    def _checked(self, fraction: ArrayLike) -> np.ndarray:
        array = np.asarray(fraction, dtype=float)
        if array.ndim == 0 or array.shape[-1] != self.num_axes:
            raise ValueError(
                f"fraction must have shape (..., {self.num_axes}), but got shape {array.shape}: "
                f'give one entry for each of the axes "{self.axes}".'
            )
        if np.any(np.isnan(array)):
            raise ValueError(f"fraction must hold no NaN, but got {fraction!r}: check what computed the command.")
        return array


def _limit_per_axis(limit: float | tuple[float, ...], axes: str) -> tuple[float, ...]:
    many = isinstance(limit, (tuple, list)) or (isinstance(limit, np.ndarray) and limit.ndim > 0)
    limits = tuple(limit) if many else (limit,) * len(axes)  # type: ignore[arg-type]
    if len(limits) != len(axes):
        raise ValueError(
            f'limit of the coils must be one number or one for each of the axes "{axes}", but got {limit!r}: '
            f"give {len(axes)} numbers in tesla."
        )
    return tuple(
        _checks.number("limit of the coils", entry, above=0.0, advice="give it in tesla, 45 mT is 45e-3")
        for entry in limits
    )
