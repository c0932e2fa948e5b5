"""The reference cases: rods, magnets and loads."""

from dataclasses import replace
from itertools import pairwise

import numpy as np

from scripts.reference.spectral_rod import Case, Magnet

TIMES = np.linspace(0.0, 2.0, 201)
OWN_TIMES = {
    "aluminium": np.linspace(0.0, 0.5, 201),
    "niti": np.linspace(0.0, 1.0, 201),
    "tilted_rotating_field": np.linspace(0.0, 1.0, 201),
    "tilted_swing": np.linspace(0.0, 0.5, 201),
}
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


def constant(*field):
    """A field (T) that is there from t = 0 on."""
    return lambda t: np.array(field)


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
HALF = np.sqrt(0.5)
TILTED = replace(STIFFER, magnets=(Magnet(s=60.55e-3, mass=9.6e-5, dipole=(0.010, 0.009, 0.0)),))
THIN = Case(  # weightless
    length=60e-3,
    area=np.pi * 1e-3**2 / 4,
    second_moment=np.pi * 1e-3**4 / 64,
    density=1100.0,
    youngs_modulus=2e6,
    magnets=(Magnet(s=60e-3, mass=0.0, dipole=(2e-4 * HALF, 2e-4 * HALF, 0.0)),),
)
PULLED = replace(
    THIN,
    length=0.1,
    youngs_modulus=1e6,
    magnets=(Magnet(s=0.1, mass=0.0, dipole=(0.2, 0.0, 0.0)),),
    gradient=((0.2, 0.0, 0.0), (0.0, -0.1, 0.0), (0.0, 0.0, -0.1)),
)
SILICONE = Case(
    length=0.15,
    area=np.pi * 2e-3**2 / 4,
    second_moment=np.pi * 2e-3**4 / 64,
    density=1070.0,
    youngs_modulus=0.15e6,
    gravity=GRAVITY,
)
WEIGHTED = replace(
    NITI, drag=0.0, gravity=(9.81, 0.3, -0.4), magnets=(Magnet(s=0.1, mass=1.6, dipole=(0.0, 0.0, 0.0)),)
)
TWO_TILTED = replace(
    SQUARE,
    drag=0.0,
    magnets=(
        Magnet(s=85.5e-3, mass=7.2e-5, dipole=(0.007, 0.006, 0.004)),
        Magnet(s=49.4e-3, mass=7.2e-5, dipole=(-0.006, 0.007, 0.003)),
    ),
)

DYNAMIC = {
    "free_decay": ROUND,
    "rotating_field": replace(ROUND, gravity=(0.0, 0.0, 0.0), drag=5.0, field=rotating_field),
    "gravity_rotating_field": replace(STIFFER, drag=5.0, field=rotating_field),
    "two_magnet_free_decay": SQUARE,
    "fast_step": replace(STIFFER, drag=5.0, field=sudden_field),
    "aluminium": ALUMINIUM,
    "niti": NITI,
    "tilted_rotating_field": replace(TILTED, gravity=(0.0, 0.0, 0.0), drag=5.0, field=rotating_field),
    "tilted_swing": replace(TILTED, field=constant(0.0, 0.0, 5e-3)),
}
STATIC = {  # fields (T) on STIFFER under gravity
    "static_gravity": np.zeros(3),
    "static_field_z": np.array([0.0, 0.0, 14.5e-3]),
    "static_field_yz": np.array([0.0, 10e-3, 10e-3]),
}
TWIST_AND_TENSION = {  # rods that twist while they bend, and rods under tension; the loads are those of t = 0
    "static_twist": replace(THIN, field=constant(0.0, 0.0, 1.5 * THIN.c2[1] / (THIN.length * 2e-4))),
    "static_tilted_magnet": replace(TILTED, field=constant(3e-3, 8e-3, 10e-3)),
    "static_axial_magnet": replace(STIFFER, field=constant(3e-3, 8e-3, 10e-3)),
    "static_two_tilted_magnets": replace(TWO_TILTED, field=constant(4e-3, 6e-3, 8e-3)),
    "static_pull_slight": replace(
        PULLED, magnets=(Magnet(s=0.1, mass=0.0, dipole=(0.01345, 0.0, 0.0)),), field=constant(0.0, 0.0, 7.5e-6)
    ),
    "static_pull_straight": PULLED,
    "static_pull_aside": replace(PULLED, field=constant(0.0, 0.0, 2e-3)),
    "static_sagging": SILICONE,
    "static_hanging": replace(SILICONE, gravity=(9.81, 0.0, 0.0)),
    "static_wire_with_weight": WEIGHTED,
}
EQUILIBRIA = {name: replace(STIFFER, field=constant(*field)) for name, field in STATIC.items()} | TWIST_AND_TENSION
LAYERS = {  # inner cuts, m: bending under tension T fades within sqrt(EI / T) of an end that is held
    "static_pull_slight": (0.008, 0.02, 0.04, 0.06, 0.08, 0.092),
    "static_pull_aside": (0.002, 0.005, 0.009, 0.015, 0.025, 0.075, 0.085, 0.091, 0.095, 0.098),
    "static_sagging": (0.008, 0.02, 0.04, 0.075),
    "static_wire_with_weight": (0.003, 0.008, 0.015, 0.03),
}


def inner_cuts(case, elements):
    """Cuts (m) that share the elements out between the magnets, nearly equal in length."""
    ends = sorted({0.0, case.length, *(m.s for m in case.magnets)})
    cuts = [0.0]
    for start, stop in pairwise(ends):
        share = max(1, round(elements * (stop - start) / case.length))
        cuts.extend(start + (stop - start) * np.arange(1, share + 1) / share)
    return cuts[1:-1]
