"""The list of cases: scenes, fields and loads whose truth the reference solver knows, and that truth."""

from __future__ import annotations

import dataclasses
import math
from dataclasses import dataclass
from functools import cache

import numpy as np

from magrod_env import Magnet, Rod, Scene, load_scene
from scripts.common import ROOT
from scripts.common.run import Field

REFERENCE = ROOT / "tests" / "reference" / "reference.npz"
TIMES = np.linspace(0.0, 2.0, 201)
GRAVITY = 9.81  # m/s^2


# ---- fields, T, of time, s


def smoothstep(x: float) -> float:
    """From 0 at x = 0 to 1 at x = 1 and beyond, without a jump of the slope."""
    x = min(x, 1.0)
    return x * x * (3.0 - 2.0 * x)


def turning(size: float, angle: float, along: float = 0.0) -> np.ndarray:
    """A field across the rod at an angle (rad) from y, and one along it, T."""
    return np.array([along, size * math.cos(angle), size * math.sin(angle)])


def rotating_field(at: float) -> np.ndarray:
    """14.5 mT turning about x at 0.5 Hz, with 7.75 mT along x, after a rise of 0.5 s."""
    return smoothstep(2.0 * at) * turning(14.5e-3, math.pi * at, 7.75e-3)


def vertical_field(at: float) -> np.ndarray:
    """10 mT upwards, after a rise of 0.5 s."""
    return smoothstep(2.0 * at) * np.array([0.0, 0.0, 10e-3])


def sudden_field(at: float) -> np.ndarray:
    """10 mT upwards from the start."""
    return np.array([0.0, 0.0, 10e-3])


def guiding_field(at: float) -> np.ndarray:
    """20 mT turning about x at 1 Hz, after a rise of 0.25 s."""
    return smoothstep(4.0 * at) * turning(20e-3, 2.0 * math.pi * at)


def upward_field(at: float) -> np.ndarray:
    """5 mT upwards from the start."""
    return np.array([0.0, 0.0, 5e-3])


# ---- rods in motion


def magnet(position: float, dipole: tuple[float, float, float], mass: float = 0.0) -> Magnet:
    """A magnet (kg, at a position in m) with a dipole moment (A m^2, body frame) in any direction."""
    moment = math.hypot(*dipole)
    return Magnet.dipole(position=position, moment=moment, mass=mass, direction=dipole if moment else (1.0, 0.0, 0.0))


ROUND = load_scene("paper4_pdms_tip_magnet")
STIFFER = load_scene("paper4_pdms_tip_magnet", modulus=1.48e6)
_TWO = load_scene("paper6_two_magnets", modulus=3.65e6)
_TILTED = STIFFER.replace(magnets=(magnet(STIFFER.rod.length, (0.010, 0.009, 0.0), 9.6e-5),))
CASES: dict[str, tuple[Scene, Field | None]] = {
    "free_decay": (ROUND.replace(drag_rate=None), None),
    "rotating_field": (ROUND.replace(gravity=None, drag_rate=5.0), rotating_field),
    "gravity_rotating_field": (STIFFER.replace(drag_rate=5.0), rotating_field),
    "two_magnet_free_decay": (_TWO.replace(drag_rate=5.0), vertical_field),
    "fast_step": (STIFFER.replace(drag_rate=5.0), sudden_field),
    "aluminium": (load_scene("paper1_aluminium_in_plane"), None),
    "niti": (load_scene("niti_guidewire"), guiding_field),
    "tilted_rotating_field": (_TILTED.replace(gravity=None, drag_rate=5.0), rotating_field),
    "tilted_swing": (_TILTED.replace(drag_rate=None), upward_field),
}

# ---- rods at rest

STATICS = {  # T, on STIFFER under gravity
    "static_gravity": (0.0, 0.0, 0.0),
    "static_field_z": (0.0, 0.0, 14.5e-3),
    "static_field_yz": (0.0, 10e-3, 10e-3),
}
_SOFT = Rod.circular(length=0.1, diameter=1e-3, density=1100.0, youngs_modulus=1e6, poissons_ratio=0.5)
_THIN = dataclasses.replace(_SOFT, length=60e-3, youngs_modulus=2e6)
_SILICONE = Rod.circular(length=0.15, diameter=2e-3, density=1070.0, youngs_modulus=0.15e6, poissons_ratio=0.5)
_PULL = Scene(rod=_SOFT, magnets=(magnet(0.1, (0.2, 0.0, 0.0)),))
_PULLING = np.diag([0.2, -0.1, -0.1])  # T/m
_TWO_TILTED = (magnet(85.5e-3, (0.007, 0.006, 0.004), 7.2e-5), magnet(49.4e-3, (-0.006, 0.007, 0.003), 7.2e-5))
_DIAGONAL = magnet(60e-3, (2e-4 * math.sqrt(0.5), 2e-4 * math.sqrt(0.5), 0.0))
_WIRE = Scene(
    rod=load_scene("niti_guidewire").rod, magnets=(magnet(0.1, (0.0, 0.0, 0.0), 1.6),), gravity=(9.81, 0.3, -0.4)
)


@dataclass(frozen=True)
class Loaded:
    """An equilibrium to find, described in words: field (3,) T at the clamp and gradient (3, 3) T/m.

    limits: largest error of the tip, mm, by number of elements: 1.3 times the errors of a prototype of the element,
    in NumPy.
    """

    scene: Scene
    about: str
    limits: dict[int, float]
    field: tuple[float, float, float] = (0.0, 0.0, 0.0)
    gradient: np.ndarray | None = None


LOADED = {
    "static_twist": Loaded(
        Scene(rod=_THIN, magnets=(_DIAGONAL,)),
        "weightless rod of 60 x 1 mm, 2 MPa, magnet at 45 degrees to it, field across both",
        {1: 0.118, 2: 0.0077, 4: 4.8e-4, 8: 3e-5, 16: 1.9e-6},
        (0.0, 0.0, 1.5 * _THIN.bending_stiffness / (_THIN.length * 2e-4)),
    ),
    "static_tilted_magnet": Loaded(
        _TILTED,
        "the paper's rod of 1.48 MPa, gravity, tilted magnet, field (3, 8, 10) mT",
        {4: 0.016, 6: 0.0034, 10: 5.1e-4, 20: 5.2e-5},
        (3e-3, 8e-3, 10e-3),
    ),
    "static_axial_magnet": Loaded(
        STIFFER,
        "the same with the paper's magnet, along the rod",
        {4: 0.0165, 6: 0.0035, 10: 5.1e-4, 20: 5e-5},
        (3e-3, 8e-3, 10e-3),
    ),
    "static_two_tilted_magnets": Loaded(
        _TWO.replace(magnets=_TWO_TILTED),
        "the paper's square rod, gravity, two tilted magnets, field (4, 6, 8) mT",
        {4: 0.129, 6: 0.0286, 10: 0.0028, 20: 2.9e-4},
        (4e-3, 6e-3, 8e-3),
    ),
    "static_pull_slight": Loaded(
        _PULL.replace(magnets=(magnet(0.1, (0.01345, 0.0, 0.0)),)),
        "weightless rod of 100 x 1 mm, 1 MPa, magnet pulled by 0.2 T/m, stretch 0.3 %, 7.5 µT aside",
        {4: 0.0037, 6: 0.0016, 10: 4.2e-4},
        (0.0, 0.0, 7.5e-6),
        _PULLING,
    ),
    "static_pull_straight": Loaded(
        _PULL,
        "the same, stretch 5 %, nothing aside",
        {1: 1e-9, 4: 1e-9, 20: 1e-9},  # exact
        gradient=_PULLING,
    ),
    "static_pull_aside": Loaded(
        _PULL, "the same, 2 mT aside", {4: 2.1, 6: 1.32, 10: 0.67, 20: 0.2}, (0.0, 0.0, 2e-3), _PULLING
    ),
    "static_sagging": Loaded(
        Scene(rod=_SILICONE, gravity=(0.0, 0.0, -GRAVITY)),
        "silicone, 150 x 2 mm, 0.15 MPa, sagging from horizontal",
        {4: 9.5, 6: 4.8, 10: 1.65, 20: 0.23},
    ),
    "static_hanging": Loaded(
        Scene(rod=_SILICONE, gravity=(GRAVITY, 0.0, 0.0)),
        "the same, hanging straight down",
        {4: 0.0107, 6: 0.0047, 10: 0.0017, 20: 4.3e-4},
    ),
    "static_wire_with_weight": Loaded(
        _WIRE,
        "nitinol wire of 100 x 0.35 mm with a weight of 1.6 kg, 3 degrees off the wire",
        {4: 0.24, 6: 0.135, 10: 0.056, 20: 0.0118},
    ),
}

# ---- the truth


@cache
def stored() -> dict[str, np.ndarray]:
    """All arrays of tests/reference/reference.npz."""
    return dict(np.load(REFERENCE))


def reference(name: str) -> np.ndarray:
    """Magnets' positions of a reference case, the tip's first, (times, magnets, 3) m."""
    return np.stack([stored()[f"{name}_{key}"] for key in ("tip", "middle") if f"{name}_{key}" in stored()], axis=1)


def reference_error(name: str) -> float:
    """Largest distance between the reference and its own coarser runs, m."""
    return max(float(stored()[f"{name}_error_{kind}"]) for kind in ("space", "time"))
