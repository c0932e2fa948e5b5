"""Closed forms and transfer matrices of straight beams: the truth for small deflections and vibrations."""

import numpy as np
from scipy.linalg import expm
from scipy.optimize import brentq

from magrod_env import Magnet, Rod, Scene

CLAMPED_FREE = (1.8751040687119611, 4.694091132974175, 7.854757438237613)  # beta L: cos cosh = -1


def slender_rod(*, length=0.1, diameter=1e-3, density=1000.0, youngs_modulus=1e9):
    """A rod 100 times as long as wide, so shear and rotary inertia matter little."""
    return Rod.circular(
        length=length, diameter=diameter, density=density, youngs_modulus=youngs_modulus, poissons_ratio=0.3
    )


def weightless(rod, **magnet):
    """A scene of a rod of almost no mass, without gravity, with one magnet at its tip."""
    light = Rod.circular(
        length=rod.length,
        diameter=rod.width,
        density=1e-9,
        youngs_modulus=rod.youngs_modulus,
        poissons_ratio=rod.poissons_ratio,
    )
    return with_tip(light, **magnet)


def with_tip(rod, moment=0.0, **magnet):
    """A scene of a rod with one magnet at its tip; gravity is there and zero, so that scenes share compiled kernels."""
    magnets = (Magnet.dipole(position=rod.length, moment=moment, **magnet),)
    return Scene(rod=rod, magnets=magnets, gravity=(0.0, 0.0, 0.0))


def transverse_frequency(rod, mode, tip_mass=0.0):
    """Natural frequency (Hz) of the clamped-free Timoshenko beam with a point mass at its tip.

    State (w, theta, M, V) with w' = theta + V/GA, theta' = M/EI, M' = -V - rho I omega^2 theta, V' = -rho A omega^2 w.
    """
    EI, GA = rod.bending_stiffness, rod.shear_stiffness
    line, rotary = rod.mass_per_length, rod.rotary_inertia_per_length

    def condition(omega):
        rates = np.array(
            [
                [0.0, 1.0, 0.0, 1.0 / GA],
                [0.0, 0.0, 1.0 / EI, 0.0],
                [0.0, -rotary * omega**2, 0.0, -1.0],
                [-line * omega**2, 0.0, 0.0, 0.0],
            ]
        )
        scale = np.array([1.0, 1.0 / rod.length, EI / rod.length**2, EI / rod.length**3])
        across = expm(rates * rod.length * scale[None, :] / scale[:, None]) * scale[:, None] / scale[None, :]
        w, theta, moment, force = across[:, 2:]
        assert theta.shape == (2,)
        force = force - tip_mass * omega**2 * w  # the mass is driven by -V
        return (moment[0] * force[1] - moment[1] * force[0]) * rod.length

    unit = np.sqrt(EI / line) / rod.length**2
    grid = unit * np.linspace(0.05, (CLAMPED_FREE[mode] + 1.0) ** 2, 400)
    values = np.array([condition(omega) for omega in grid])
    change = np.flatnonzero(values[:-1] * values[1:] < 0)[mode]
    return brentq(condition, grid[change], grid[change + 1], xtol=1e-13 * grid[change]) / (2 * np.pi)
