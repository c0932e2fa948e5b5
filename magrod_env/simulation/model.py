"""From a scene to the numbers of kernels: the nominal rod, its terms, its statics and the bounds on its time step."""

from __future__ import annotations

import numpy as np

from magrod_env.rod.equilibrium import StaticModel
from magrod_env.rod.layout import DAMPING
from magrod_env.rod.mesh import split_elements
from magrod_env.rod.parameters import RodParameters
from magrod_env.scene import Scene
from magrod_env.simulation.scene_values import locking_factor, rod_values, scene_terms, shaped

MOST_KEPT = 64  # rods at the bound, of different parameters


class RodModel:
    """One make of rod: a scene with elements.

    Args:
        scene: what is simulated.
        num_elements: elements along the rod.
        element: "helical" or "nodal".
        axial_softening, rotary_scaling: divide the axial stiffness, multiply the rotary inertia.
        frequency_shaping: divide E by the locking factor of the nodal element.
    """

    def __init__(
        self,
        scene: Scene,
        num_elements: int,
        *,
        element: str = "helical",
        axial_softening: float = 1.0,
        rotary_scaling: float = 1.0,
        frequency_shaping: bool = False,
    ) -> None:
        self.scene, self.num_elements, self.nodal = scene, num_elements, element == "nodal"
        self.values, self.segments = rod_values(scene, axial_softening, rotary_scaling)
        self.locking = locking_factor(self.values, num_elements) if self.nodal and not frequency_shaping else 1.0
        if frequency_shaping:
            self.values = shaped(self.values, element, num_elements)
        self.terms = scene_terms(scene, rotary_scaling)
        self.counts = split_elements(self.values.ends, num_elements)
        self.static = StaticModel(
            self.values, self.counts, self.segments, self.nodal, scene.gravity, scene.acting_loads
        )
        self.static.column[DAMPING] = self.terms["internal_damping"] or 0.0
        self._extremes: dict[tuple[float, ...], StaticModel] = {}

    def nominal(self, num_rods: int) -> RodParameters:
        """Parameters of rods that do not differ from the scene's."""
        one = np.ones(num_rods)
        return RodParameters(
            modulus=one.copy(),
            density=one.copy(),
            moment=one.copy(),
            magnet_shift=np.zeros(num_rods),
            gravity=np.tile(np.array(self.scene.gravity or (0.0, 0.0, 0.0)), (num_rods, 1)),
            drag=one * (self.terms["drag_rate"] or 0.0),
            spin_drag=one * (self.terms["spin_drag_rate"] or 0.0),
            internal_damping=one * (self.terms["internal_damping"] or 0.0),
        )

    def extreme(self, parameters: RodParameters) -> StaticModel:
        """Statics of a rod whose largest stable step is below that of every rod with these parameters: as stiff as the
        stiffest, as light as the lightest, with the strongest magnets, the shortest elements and the largest weight.
        """
        pull = float(np.linalg.norm(parameters.gravity, axis=1).max())
        own = float(np.linalg.norm(self.scene.gravity or (0.0, 0.0, 0.0)))
        return self.spread(
            modulus=float(parameters.modulus.max()),
            density=float(parameters.density.min()),
            moment=float(parameters.moment.max()),
            shift=float(np.abs(parameters.magnet_shift).max()),
            weight=pull / own if own > 0.0 else 1.0,
        )

    def spread(
        self,
        *,
        modulus: float = 1.0,
        density: float = 1.0,
        moment: float = 1.0,
        shift: float = 0.0,
        weight: float = 1.0,
    ) -> StaticModel:
        """Statics of a rod with these factors of stiffness, mass, magnets' moments and gravity, and magnets that are
        moved by up to `shift` (m), in whichever direction is worse.
        """
        key = (modulus, density, moment, shift, max(weight, 1.0))
        if key not in self._extremes:
            if len(self._extremes) >= MOST_KEPT:
                self._extremes.clear()
            self._extremes[key] = self._make_extreme(*key)
        return self._extremes[key]

    def _make_extreme(self, modulus: float, density: float, moment: float, shift: float, weight: float) -> StaticModel:
        if (modulus, density, moment, shift, weight) == (1.0, 1.0, 1.0, 0.0, 1.0):
            return self.static
        values = self.values
        ends = values.ends.copy()
        ends[:-1] += shift  # the elements of both neighbours change alike
        values = values._replace(
            ends=ends,
            axial=values.axial * modulus,
            shear=values.shear * modulus,
            bending=values.bending * modulus,
            torsion=values.torsion * modulus,
            mass_per_length=values.mass_per_length * density,
            rotary=values.rotary * density,
            polar=values.polar * density,
            magnet_moments=values.magnet_moments * moment,
        )
        gravity = None if self.scene.gravity is None else weight * np.array(self.scene.gravity)
        model = StaticModel(values, self.counts, self.segments, self.nodal, gravity, self.scene.acting_loads)
        model.column[DAMPING] = self.static.column[DAMPING]
        return model
