"""The independent solver behind tests/reference/reference.npz, and the package's scenes as it takes them."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from magrod_env import Scene
from scripts.reference.spectral_rod import Case, Magnet


def case_of(scene: Scene, field: Callable[[float], np.ndarray] | None = None) -> Case:
    """A round rod of the package, without internal damping or spin drag, in a field (3,) T of time (s)."""
    rod = scene.rod
    return Case(
        length=rod.length,
        area=rod.area,
        second_moment=rod.second_moment,
        density=rod.density,
        youngs_modulus=rod.youngs_modulus,
        poisson_ratio=rod.poissons_ratio,
        gravity=scene.gravity or (0.0, 0.0, 0.0),
        drag=scene.drag_rate or 0.0,
        magnets=tuple(Magnet(s=m.position, mass=m.mass, dipole=tuple(m.dipole_moment)) for m in scene.magnets),
        field=field or (lambda at: np.zeros(3)),
    )
