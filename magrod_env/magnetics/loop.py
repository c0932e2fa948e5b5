"""Field and field gradient of a circular current loop, exact anywhere off the wire.

With a the radius, z and rho the coordinates along and off the axis of the loop, d(phi) the distance to the
wire, alpha and beta the largest and the smallest distance (alpha^2, beta^2 = (a +- rho)^2 + z^2), the
Biot-Savart law gives

    B_rho = k a z C1,    B_z = k a (a C0 - rho C1),    k = mu0 I / (4 pi),
    C0, C1 = integral over phi of (1, cos phi) / d^3,    T0, T1 = the same with d^5.

The first two follow from complete elliptic integrals, C1/rho without a division that becomes 0/0 on the axis,
the other two from linear identities between the four. As the field has no curl and no divergence off the
wire, its gradient tensor is symmetric with trace zero, and three of its cylindrical components give the rest.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from magrod_env import _checks
from magrod_env.magnetics.constants import MU_0
from magrod_env.magnetics.elliptic import complete_integrals

_WIRE = 1e-9  # points closer to the wire than this share of the radius are refused


class _Integrals(NamedTuple):
    """What the field and its gradient are made of, each of shape (...)."""

    c1_over_rho: np.ndarray
    c_axial: np.ndarray  # a C0 - rho C1
    t1: np.ndarray
    t_axial: np.ndarray  # a T0 - rho T1


@dataclass(frozen=True, kw_only=True, slots=True)
class CircularLoop:
    """Circular loop of thin wire; the current turns about the normal by the right-hand rule.

    Not modelled: the cross-section of the winding. `turns` wires lie on one circle.

    Args:
        radius: radius of the loop, m.
        center: centre of the loop in the world frame, m.
        normal: direction of the field at the centre for a positive current, world frame; any length but zero.
        turns: number of windings.

    Raises:
        ValueError: if the radius or the turns are not positive or a vector is not made of three finite
            numbers.
    """

    radius: float
    center: _checks.Vector
    normal: _checks.Vector
    turns: float = 1

    def __post_init__(self) -> None:
        radius = _checks.number("radius of the loop", self.radius, above=0.0, advice="give it in metres")
        center = _checks.vector("center of the loop", self.center, advice="give x, y, z in metres")
        normal = _checks.unit_vector("normal of the loop", self.normal, advice="give its axis in the world frame")
        turns = _checks.count("turns of the loop", self.turns, advice="reverse the normal to reverse the field")
        for name, value in (("radius", radius), ("center", center), ("normal", normal), ("turns", turns)):
            object.__setattr__(self, name, value)

    def field(self, points: ArrayLike, current: ArrayLike) -> np.ndarray:
        """Return the magnetic field (T), world frame, shape (..., 3).

        Args:
            points: where to evaluate, world frame, m, shape (..., 3).
            current: current in the wire, A; a number or an array that broadcasts against the leading shape of
                `points`.

        Raises:
            ValueError: if a point lies on the wire or the last axis of `points` is not of length 3.
        """
        z, offset, rho = self._cylindrical(points)
        integrals = _integrals(self.radius, rho, z)
        strength = self._strength(current)
        radial_over_rho = strength * z * integrals.c1_over_rho
        axial = strength * integrals.c_axial
        return radial_over_rho[..., None] * offset + axial[..., None] * np.array(self.normal)

    def gradient(self, points: ArrayLike, current: ArrayLike) -> np.ndarray:
        """Return the gradient of the field (T/m), shape (..., 3, 3), entry [i, j] = dB_i / dx_j, world frame.

        Args and errors are those of `field`.
        """
        z, offset, rho = self._cylindrical(points)
        integrals = _integrals(self.radius, rho, z)
        strength = self._strength(current)
        across = strength * z * integrals.c1_over_rho  # B_rho / rho, the derivative across the meridian plane
        axial = -3.0 * strength * z * integrals.t_axial  # dB_z / dz
        # dB_rho / dz, which is dB_z / drho
        mixed = strength * (rho * integrals.c1_over_rho - 3.0 * z**2 * integrals.t1)
        return self._assemble(across, axial, mixed, _directions(offset, rho))

    def _cylindrical(self, points: ArrayLike) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return z, the vector from the axis to the point (shape (..., 3)) and its length rho."""
        normal = np.array(self.normal)
        relative = _checks.points("points", points) - np.array(self.center)
        z = relative @ normal
        offset = relative - z[..., None] * normal
        return z, offset, np.linalg.norm(offset, axis=-1)

    def _strength(self, current: ArrayLike) -> np.ndarray:
        """Return k a of the module's docstring for all turns, T m^2."""
        return MU_0 / (4.0 * np.pi) * self.turns * self.radius * np.asarray(current, dtype=float)

    def _assemble(self, across: np.ndarray, axial: np.ndarray, mixed: np.ndarray, radial: np.ndarray) -> np.ndarray:
        """Return the tensor from its cylindrical components and the unit vector off the axis."""
        normal = np.array(self.normal)
        along_axis = np.outer(normal, normal)
        along_radius = radial[..., :, None] * radial[..., None, :]
        symmetric = radial[..., :, None] * normal + normal[:, None] * radial[..., None, :]
        return (
            across[..., None, None] * (np.eye(3) - along_axis)
            - (2.0 * across + axial)[..., None, None] * along_radius  # from trace zero: dB_rho/drho - across
            + axial[..., None, None] * along_axis
            + mixed[..., None, None] * symmetric
        )


def _integrals(radius: float, rho: np.ndarray, z: np.ndarray) -> _Integrals:
    """Return combinations of the four integrals of the module's docstring at (rho, z), shape (...)."""
    largest = np.hypot(radius + rho, z)
    smallest = np.hypot(radius - rho, z)
    if np.any(smallest <= _WIRE * radius):
        raise ValueError("points must lie off the wire, but one lies on it, where the field is infinite: move it away.")
    first_kind, second_kind, sigma = complete_integrals(smallest / largest)
    m = 4.0 * radius * rho / largest**2
    c0 = 4.0 * second_kind / (largest * smallest**2)
    c1_over_rho = 16.0 * radius * first_kind * (0.5 - (2.0 - m) * sigma) / (largest**3 * smallest**2)
    c1 = rho * c1_over_rho
    c0_minus_c1 = 8.0 * first_kind * (0.5 + m * sigma) / largest**3
    # the two axial differences are written such that they lose no digits near the wire or far away
    c_axial = (radius - rho) * c1 + radius * c0_minus_c1
    product = (largest * smallest) ** 2
    t1 = ((radius**2 + rho**2 + z**2) * c1 / 3.0 + 2.0 * radius * rho * c0) / product
    inner = (radius - rho) * (radius + rho)
    t_axial = (radius * c0 * (inner + z**2) + rho * c1 / 3.0 * (inner - z**2)) / product
    return _Integrals(c1_over_rho, c_axial, t1, t_axial)


def _directions(offset: np.ndarray, rho: np.ndarray) -> np.ndarray:
    """Return unit vectors off the axis, shape (..., 3); zero on it, where every term they enter vanishes."""
    return offset / np.where(rho > 0.0, rho, 1.0)[..., None]
