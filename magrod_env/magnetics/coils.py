"""Real coils: Helmholtz pairs of thin circular loops, and systems of several pairs."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from magrod_env import _checks
from magrod_env.magnetics.constants import MU_0
from magrod_env.magnetics.loop import CircularLoop

_REACHABLE = 1e-9  # share of a wanted field that may be missing before it counts as out of reach


@dataclass(frozen=True, kw_only=True, slots=True)
class HelmholtzPair:
    """Two equal coaxial loops in series; at a distance of one radius the field is uniform to fourth order.

    Not modelled: the cross-section of the windings.

    Args:
        radius: radius of both loops, m.
        turns: windings of each loop.
        axis: direction of the field at the centre for a positive current, world frame; any length but zero.
        separation: distance between the loops, m; None for the Helmholtz spacing, one radius.
        center: point midway between the loops, world frame, m.

    Raises:
        ValueError: if a length or the turns are not positive or a vector is not made of three finite numbers.
    """

    radius: float
    turns: float
    axis: _checks.Vector
    separation: float | None = None
    center: _checks.Vector = (0.0, 0.0, 0.0)

    def __post_init__(self) -> None:
        radius = _checks.number("radius of the coil pair", self.radius, above=0.0, advice="give it in metres")
        turns = _checks.count("turns of the coil pair", self.turns, advice="reverse the axis to reverse the field")
        axis = _checks.unit_vector("axis of the coil pair", self.axis, advice="give it in the world frame")
        center = _checks.vector("center of the coil pair", self.center, advice="give x, y, z in metres")
        for name, value in (("radius", radius), ("turns", turns), ("axis", axis), ("center", center)):
            object.__setattr__(self, name, value)
        if self.separation is not None:
            advice = "give it in metres, or None for one radius"
            separation = _checks.number("separation of the coil pair", self.separation, above=0.0, advice=advice)
            object.__setattr__(self, "separation", separation)

    @property
    def loops(self) -> tuple[CircularLoop, CircularLoop]:
        """The two loops, the one on the negative side of the axis first."""
        half = 0.5 * self._distance * np.array(self.axis)
        center = np.array(self.center)
        low, high = (
            CircularLoop(radius=self.radius, center=place, normal=self.axis, turns=self.turns)
            for place in (tuple(center - half), tuple(center + half))
        )
        return low, high

    @property
    def field_per_ampere(self) -> float:
        """Field at the centre along the axis, T/A: (4/5)^1.5 mu0 turns / radius at the Helmholtz spacing."""
        distance_to_wire = math.hypot(self.radius, 0.5 * self._distance)
        return MU_0 * self.turns * self.radius**2 / distance_to_wire**3

    def field(self, points: ArrayLike, current: ArrayLike) -> np.ndarray:
        """Return the magnetic field (T), world frame, shape (..., 3).

        Args:
            points: where to evaluate, world frame, m, shape (..., 3).
            current: current of the pair, A; a number or an array that broadcasts against the leading shape of
                `points`.

        Raises:
            ValueError: if a point lies on a wire or the last axis of `points` is not of length 3.
        """
        low, high = self.loops
        return low.field(points, current) + high.field(points, current)

    def gradient(self, points: ArrayLike, current: ArrayLike) -> np.ndarray:
        """Return the gradient (T/m), shape (..., 3, 3), entry [i, j] = dB_i / dx_j; otherwise as `field`."""
        low, high = self.loops
        return low.gradient(points, current) + high.gradient(points, current)

    @property
    def _distance(self) -> float:
        return self.radius if self.separation is None else self.separation


@dataclass(frozen=True, slots=True)
class CoilSystem:
    """Several coil pairs around one centre, driven by one current each; their fields add.

    Not modelled: iron, mutual induction and the dynamics of the currents.

    Args:
        pairs: the pairs, at least one, all with the same centre.

    Raises:
        ValueError: if there is no pair, an entry is no pair or the centres differ.
    """

    pairs: tuple[HelmholtzPair, ...]

    def __post_init__(self) -> None:
        pairs = tuple(self.pairs) if isinstance(self.pairs, (tuple, list)) else ()
        if not pairs or not all(isinstance(pair, HelmholtzPair) for pair in pairs):
            raise ValueError(f"pairs must be one or more HelmholtzPair, but got {self.pairs!r}: give a tuple or list.")
        if len({pair.center for pair in pairs}) > 1:
            raise ValueError(
                f"pairs must share one center, but got {[pair.center for pair in pairs]}: nest them around one point."
            )
        object.__setattr__(self, "pairs", pairs)

    @property
    def center(self) -> _checks.Vector:
        """The common centre, world frame, m."""
        return self.pairs[0].center

    @property
    def field_per_ampere(self) -> np.ndarray:
        """World field at the centre per ampere in each pair, T/A, shape (3, num_pairs)."""
        return np.stack([pair.field_per_ampere * np.array(pair.axis) for pair in self.pairs], axis=-1)

    def currents_for(self, field_at_center: ArrayLike) -> np.ndarray:
        """Return the smallest currents (A), shape (..., num_pairs), that make a field at the centre.

        Args:
            field_at_center: wanted field, world frame, T, shape (..., 3).

        Raises:
            ValueError: if the pairs cannot make the field, as when it has a part along an axis without coils.
        """
        wanted = _checks.points("field_at_center", field_at_center)
        matrix = self.field_per_ampere
        currents = wanted @ np.linalg.pinv(matrix).T
        missing = np.linalg.norm(currents @ matrix.T - wanted, axis=-1)
        if not np.all(missing <= _REACHABLE * np.linalg.norm(wanted, axis=-1)):
            axes = [pair.axis for pair in self.pairs]
            raise ValueError(
                f"field_at_center must be finite and within reach of the coil axes {axes}, "
                f"but got {field_at_center!r}: leave out its part along other directions or add a pair."
            )
        return currents

    def field(self, points: ArrayLike, currents: ArrayLike) -> np.ndarray:
        """Return the magnetic field (T), world frame, shape (..., 3).

        Args:
            points: where to evaluate, world frame, m, shape (..., 3).
            currents: one current per pair, A, shape (..., num_pairs); leading shapes broadcast.

        Raises:
            ValueError: if a shape does not fit or a point lies on a wire.
        """
        split = self._split(currents)
        return sum((pair.field(points, amps) for pair, amps in split), start=np.zeros(3))

    def gradient(self, points: ArrayLike, currents: ArrayLike) -> np.ndarray:
        """Return the gradient (T/m), shape (..., 3, 3), entry [i, j] = dB_i / dx_j; otherwise as `field`."""
        split = self._split(currents)
        return sum((pair.gradient(points, amps) for pair, amps in split), start=np.zeros((3, 3)))

    def linear_field(self, point: ArrayLike, currents: ArrayLike) -> tuple[np.ndarray, np.ndarray]:
        """Return the field at the origin (T), shape (..., 3), and the gradient (T/m), shape (..., 3, 3), of the linear
        field that agrees with the coils' in value and gradient at a point: what a `Simulation` takes.

        Beside the point it errs by the curvature of the coils' field, half the second derivative times the distance
        squared; so expand about the place of the magnet, or midway between magnets.

        Args:
            point: where to expand, world frame, m, shape (..., 3), one for each rod of a batch for instance.
            currents: as in `field`.

        Raises:
            ValueError: as in `field`.
        """
        gradient = self.gradient(point, currents)
        return self.field(point, currents) - np.einsum("...ij,...j->...i", gradient, np.asarray(point, float)), gradient

    def _split(self, currents: ArrayLike) -> list[tuple[HelmholtzPair, np.ndarray]]:
        array = np.asarray(currents, dtype=float)
        if array.ndim == 0 or array.shape[-1] != len(self.pairs):
            raise ValueError(
                f"currents must have shape (..., {len(self.pairs)}), but got shape {array.shape}: "
                "give one current for each coil pair."
            )
        return [(pair, array[..., index]) for index, pair in enumerate(self.pairs)]
