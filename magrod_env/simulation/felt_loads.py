"""What loads rods have felt since their reset, and whether what resolves them is enough for these."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

from magrod_env.simulation.resolution import LARGEST_ROUNDING, elements_for, rounding_share
from magrod_env.simulation.rods import Rods
from magrod_env.simulation.scene_values import relative_load

RESOLVING = 0.25  # of an implicit step that is left to us: resolves the second vibration, which a sudden field excites
SMALL_LOAD = 0.1  # moments of magnets over EI/L: sudden fields below it bend the rod by some hundredths of its length
LARGEST_LOCKING = 1.05  # of bending stiffness by the paper's element, before a warning
THIRD_MODE = 17.55  # times the first frequency of a cantilever


class FeltLoads:
    """The strongest field and the sudden changes of it that a batch has felt, against its elements and its step.

    Args:
        rods: the batch.
        integrator: its scheme.
        chosen_for: T, strongest field for which a tolerance has chosen the elements; -1 for none.
        default_step: says the step, s, that would be taken where nothing is said.
    """

    def __init__(self, rods: Rods, integrator: str, chosen_for: float, default_step: Callable[[], float]) -> None:
        self.rods, self.integrator, self.chosen_for, self.default_step = rods, integrator, chosen_for, default_step
        scene = rods.model.scene
        third = THIRD_MODE * 2.0 * math.pi * scene.first_frequency
        self._fading = 0.5 * (scene.drag_rate or 0.0) + 0.5 * (scene.damping_time or 0.0) * third**2  # 1/s
        self._weight_load = relative_load(scene, 0.0)
        self._load_per_tesla = relative_load(scene, 1.0) - self._weight_load
        self._longest_element = float(np.diff(rods.arc_lengths).max()) / scene.rod.length
        self.strongest = 0.0  # T, since the reset
        self.calm()

    def calm(self) -> None:
        """Forget sudden changes: the rods are at rest."""
        self._driven = self._shaking = self._shaken_at = 0.0

    def feel(self, changes: np.ndarray, times: np.ndarray) -> None:
        """Add sudden changes of the field, by more than half of the strongest, to what keeps the rods swinging.

        Their squares add up, since each finds the rod at another point of its swing, and die with the damping of a
        vibration three modes up: `_driven` is the field, T, of one step that would excite the rod as much.

        Args:
            changes: T, (K, num_rods, 3), of the field.
            times: when they act, s, (K,).
        """
        sizes = np.linalg.norm(changes, axis=-1).max(axis=-1)
        for k in np.flatnonzero(sizes > 0.5 * self.strongest):
            fade = math.exp(-2.0 * self._fading * max(times[k] - self._shaken_at, 0.0))
            self._shaking = fade * self._shaking + float(sizes[k]) ** 2
            self._shaken_at = float(times[k])
            self._driven = max(self._driven, math.sqrt(self._shaking))

    def coarse(self, time_step: float) -> bool:
        """Whether elements, precision or a step (s) may be too coarse; see `Simulation.coarse`."""
        if self._rounding(time_step) > LARGEST_ROUNDING:
            return True
        if max(self.strongest, self._driven) <= self.chosen_for:
            return False
        few = self._elements_needed > self.rods.model.num_elements
        locks = bool(self.rods.model.locking > LARGEST_LOCKING)
        return locks or few or time_step > self._longest_resolving_step

    def advice(self, time_step: float) -> str:
        """What is too coarse, and what to take instead."""
        model = self.rods.model
        if model.locking > LARGEST_LOCKING:
            stiffer = f"the rod bends as if EI were {model.locking:.3g} times"
            problem = f"{model.num_elements} nodal elements lock: {stiffer}"
            advice = 'use element="helical", or frequency_shaping'
        elif self._rounding(time_step) > LARGEST_ROUNDING:
            problem = "float32 rounds away slow motion of a rod as thin and damped as this one"
            advice = 'use precision="float64", or more elements'
        elif self._elements_needed <= model.num_elements:
            problem = f"implicit steps of {time_step:.3g} s may not resolve what a sudden field excites"
            advice = f'use {self._longest_resolving_step:.2g} s or less, slow fields, or integrator="explicit"'
        else:
            sudden = " that changes suddenly" if self._driven > 1.01 * self.strongest else ""
            weight = "weight, loads" if model.scene.loads else "weight"
            loads = f"{weight} and a field of {self.strongest:.3g} T{sudden}"
            problem = f"{model.num_elements} elements may be too few for {loads}"
            advice = f"use {self._elements_needed} or more, or a tolerance, or slow fields"
        return f"{problem}: {advice} (docs/resolution.md)."

    def _rounding(self, time_step: float) -> float:
        model = self.rods.model
        damping = model.scene.damping_time
        if self.rods.precision != "float32" or damping is None:
            return 0.0
        slenderness = model.scene.rod.length * math.sqrt(model.values.axial / model.values.bending)
        return rounding_share(slenderness, damping / time_step, model.num_elements)

    @property
    def _longest_resolving_step(self) -> float:
        """Longest implicit step, s, that resolves what sudden changes of the field have excited."""
        load = self._load_per_tesla * self._driven * self.rods.softness
        if self.integrator == "explicit" or load < SMALL_LOAD or self._driven < 0.5 * self.strongest:
            return math.inf
        return RESOLVING * self.default_step() / math.sqrt(1.0 + load)

    @property
    def _elements_needed(self) -> int:
        load = self._weight_load + self._load_per_tesla * max(self.strongest, self._driven)
        return math.ceil(self.rods.model.num_elements * elements_for(load * self.rods.softness, self._longest_element))
