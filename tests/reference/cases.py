"""The reference cases: rods, magnets and loads."""

from dataclasses import replace
from itertools import pairwise

import numpy as np

from .spectral_rod import Case, Magnet

TIMES = np.linspace(0.0, 2.0, 201)
OWN_TIMES = {"aluminium": np.linspace(0.0, 0.5, 201), "niti": np.linspace(0.0, 1.0, 201)}
GRAVITY = (0.0, 0.0, -9.81)
MU0 = 4e-7 * np.pi


def ramp(t):
    """Smoothstep from 0 at t = 0 to 1 at t = 0.5 s."""
    x = min(t / 0.5, 1.0)
    return x * x * (3 - 2 * x)


def rotating_field(t):
    """14.5 mT turning about x at 0.5 Hz, with 7.75 mT along x."""
    angle = 2 * np.pi * 0.5 * t
    return ramp(t) * np.array([7.75e-3, 14.5e-3 * np.cos(angle), 14.5e-3 * np.sin(angle)])


def vertical_field(t):
    return ramp(t) * np.array([0.0, 0.0, 10e-3])


def sudden_field(t):
    return np.array([0.0, 0.0, 10e-3])


def guiding_field(t):
    """20 mT turning about x at 1 Hz, rising from 0 at t = 0 to its strength at t = 0.25 s."""
    angle = 2 * np.pi * t
    return ramp(2 * t) * np.array([0.0, 20e-3 * np.cos(angle), 20e-3 * np.sin(angle)])


def sag(x):
    """Deflection of a cantilever under uniform load, 1 at its tip x = 1."""
    return (6 * x**2 - 4 * x**3 + x**4) / 3


def sag_slope(x):
    return 4 * (3 * x - 3 * x**2 + x**3) / 3


def dipole(remanence, diameter, length):
    """Moment of a cylindrical magnet, A m^2."""
    return remanence * np.pi * diameter**2 / 4 * length / MU0


ROUND = Case(
    length=60.55e-3,
    area=np.pi * 4e-3**2 / 4,
    second_moment=np.pi * 4e-3**4 / 64,
    density=1101.0,
    youngs_modulus=365.12e3,
    gravity=GRAVITY,
    magnets=(Magnet(s=60.55e-3, mass=9.6e-5, dipole=(dipole(1.345, 2e-3, 4e-3), 0.0, 0.0)),),
)
STIFFER = replace(ROUND, youngs_modulus=1.48e6)
SQUARE = Case(
    length=85.5e-3,
    area=2e-3**2,
    second_moment=2e-3**4 / 12,
    density=1101.0,
    youngs_modulus=3.65e6,
    gravity=GRAVITY,
    drag=5.0,
    magnets=(
        Magnet(s=85.5e-3, mass=7.2e-5, dipole=(dipole(1.345, 2e-3, 3e-3), 0.0, 0.0)),
        Magnet(s=49.4e-3, mass=7.2e-5, dipole=(-dipole(1.345, 2e-3, 3e-3), 0.0, 0.0)),
    ),
    field=vertical_field,
)
ALUMINIUM = Case(
    length=0.2,
    area=np.pi * 2e-3**2 / 4,
    second_moment=np.pi * 2e-3**4 / 64,
    density=2690.0,
    youngs_modulus=75e9,
    poisson_ratio=0.33,
    gravity=(-9.81, 0.0, 0.0),
    velocity=lambda s: np.outer(2.3 * sag(s / 0.2), (0.0, 0.0, 1.0)),
    spin=lambda s: np.outer(2.3 / 0.2 * sag_slope(s / 0.2), (0.0, -1.0, 0.0)),
)
NITI = Case(
    length=0.1,
    area=np.pi * 0.35e-3**2 / 4,
    second_moment=np.pi * 0.35e-3**4 / 64,
    density=6450.0,
    youngs_modulus=60e9,
    poisson_ratio=0.33,
    drag=5.0,
    magnets=(Magnet(s=0.1, mass=0.0, dipole=(4e-3, 0.0, 0.0)),),
    field=guiding_field,
)

DYNAMIC = {
    "free_decay": ROUND,
    "rotating_field": replace(ROUND, gravity=(0.0, 0.0, 0.0), drag=5.0, field=rotating_field),
    "gravity_rotating_field": replace(STIFFER, drag=5.0, field=rotating_field),
    "two_magnet_free_decay": SQUARE,
    "fast_step": replace(STIFFER, drag=5.0, field=sudden_field),
    "aluminium": ALUMINIUM,
    "niti": NITI,
}
STATIC = {  # fields (T) on STIFFER under gravity
    "static_gravity": np.zeros(3),
    "static_field_z": np.array([0.0, 0.0, 14.5e-3]),
    "static_field_yz": np.array([0.0, 10e-3, 10e-3]),
}


def inner_cuts(case, elements):
    """Cuts (m) that share the elements out between the magnets, nearly equal in length."""
    ends = sorted({0.0, case.length, *(m.s for m in case.magnets)})
    cuts = [0.0]
    for start, stop in pairwise(ends):
        share = max(1, round(elements * (stop - start) / case.length))
        cuts.extend(start + (stop - start) * np.arange(1, share + 1) / share)
    return cuts[1:-1]
