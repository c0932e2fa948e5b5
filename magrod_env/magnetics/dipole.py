"""Point dipoles: moment of a permanent magnet, and its torque, force and energy in a magnetic field.

Vectors of one call share one frame. Leading shapes broadcast against each other as in numpy.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from magrod_env import _checks
from magrod_env.magnetics.constants import MU_0


def dipole_moment(remanence: float, volume: float) -> float:
    """Return the dipole moment (A m^2) of a uniformly magnetised permanent magnet, m = Br V / mu0.

    Not modelled: demagnetisation; for hard magnets such as NdFeB it takes a few per cent at most.

    Args:
        remanence: residual flux density Br, T (not mT: neodymium magnets have 1.0 to 1.5 T).
        volume: volume of the magnet, m^3.

    Raises:
        ValueError: if an argument is not a finite number above 0.
    """
    remanence = _checks.number("remanence", remanence, above=0.0, advice="give it in tesla, N45 has 1.345")
    volume = _checks.number("volume", volume, above=0.0, advice="give it in cubic metres, 1 mm^3 is 1e-9")
    return remanence * volume / MU_0


def dipole_torque(moment: ArrayLike, field: ArrayLike) -> np.ndarray:
    """Return the torque m x B (N m) on a dipole.

    Args:
        moment: dipole moment, A m^2, shape (..., 3).
        field: magnetic field at the dipole, T, shape (..., 3), in the frame of `moment`.

    Returns:
        Torque, shape (..., 3), in the same frame.

    Raises:
        ValueError: if the last axis of an argument is not of length 3.
    """
    return np.cross(_checks.points("moment", moment), _checks.points("field", field))


def dipole_force(moment: ArrayLike, gradient: ArrayLike) -> np.ndarray:
    """Return the force grad(m . B) (N) on a dipole of constant moment; it is zero in a uniform field.

    Args:
        moment: dipole moment, A m^2, shape (..., 3).
        gradient: field gradient at the dipole, T/m, shape (..., 3, 3), gradient[..., i, j] = dB_i / dx_j.

    Returns:
        Force, shape (..., 3): force_j = sum_i moment_i gradient_ij.

    Raises:
        ValueError: if the shapes are not (..., 3) and (..., 3, 3).
    """
    moment = _checks.points("moment", moment)
    gradient = _checks.points("gradient", gradient)
    if gradient.ndim < 2 or gradient.shape[-2] != 3:
        raise ValueError(f"gradient must have shape (..., 3, 3), but got shape {gradient.shape}: give dB_i/dx_j.")
    return np.einsum("...i,...ij->...j", moment, gradient)


def dipole_energy(moment: ArrayLike, field: ArrayLike) -> np.ndarray:
    """Return the potential energy -m . B (J) of a dipole of constant moment.

    Args:
        moment: dipole moment, A m^2, shape (..., 3).
        field: magnetic field at the dipole, T, shape (..., 3), in the frame of `moment`.

    Returns:
        Energy, shape (...).

    Raises:
        ValueError: if the last axis of an argument is not of length 3.
    """
    return -np.einsum("...i,...i->...", _checks.points("moment", moment), _checks.points("field", field))
