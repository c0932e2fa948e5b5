"""A thin, stiff wire with a magnetic tip: the opposite end of the range from the paper's soft rods."""

from __future__ import annotations

from magrod_env.scene import Magnet, Rod, Scene


def niti_guidewire() -> Scene:
    """Return a superelastic guidewire of 0.35 mm with a magnetic tip, in water-like drag, weight left out."""
    rod = Rod.circular(length=0.100, diameter=0.35e-3, density=6450.0, youngs_modulus=60e9, poissons_ratio=0.33)
    return Scene(rod=rod, magnets=(Magnet.dipole(position=0.100, moment=4e-3),), drag_rate=5.0)
