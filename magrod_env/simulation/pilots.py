"""Pilot runs: a batch of eight equal rods under eight loads, by which a resolution is judged before it is used.

What a coarser choice costs is the distance between its tip and that of a finer one. Every run is done once and logged,
at level INFO, before it starts. Reasons and limits are in docs/resolution.md.
"""

from __future__ import annotations

import logging
import math
from collections.abc import Callable
from typing import Any

import numpy as np

from magrod_env.simulation.integrators import cost_rate
from magrod_env.simulation.resolution import Resolution

LOGGER = logging.getLogger(__name__)
DURATION, CONTROL_TIME = 2.0, 0.01  # s: of a pilot, between its field's values
RISES = (0.4, 0.4, 0.4, 0.4, 0.15, 0.15, 0.1, 0.1)  # s: of each load
HELD = (1, 1, 1, 2, 2, 2, 2, 1)  # CONTROL_TIMEs for which each load's field is held: its steps ring higher modes
NUM_LOADS = 8
AGAINST, BELOW_BUCKLING = 0.5, 0.6  # largest field against the dipoles, of the magnitude and of EI/(m L)
PLUCK = 0.1  # of the length: the largest swing of the tip in the pilots of a rod that no field moves


class TooDear(Exception):
    """A pilot run would cost more than it may."""


def pilot_fields(magnitude: float, axes: tuple[int, ...], load: float) -> np.ndarray:
    """Fields of the pilots, T, (num_times, NUM_LOADS, 3): none, ramps, and fields that turn or swing.

    ``axes`` are the world axes of the motion, the first along the rod. A field against the dipoles makes the rod
    limp, and errors large: one load has a share of it, well below that at which a rod under ``load`` (moments of the
    magnets across the strongest field over EI/L) buckles.
    """
    count = round(DURATION / CONTROL_TIME)
    along, across = np.eye(3)[axes[0]], np.eye(3)[axes[1]]
    aside = np.eye(3)[axes[2]] if len(axes) > 2 else -across
    against = min(AGAINST, BELOW_BUCKLING / load) if load > 0.0 else AGAINST
    fields = np.zeros((count, NUM_LOADS, 3))
    for k in range(1, NUM_LOADS):
        time = CONTROL_TIME * HELD[k] * (np.arange(count) // HELD[k] + 0.5)
        share = np.clip(time / RISES[k], 0.0, 1.0)
        rise, angle = share * share * (3.0 - 2.0 * share), 2.0 * np.pi * time
        fields[:, k] = (
            magnitude
            * (
                np.outer(rise, across),
                np.outer(rise, -0.7 * aside),
                np.outer(rise * np.cos(1.3 * angle), 0.6 * across - against * along),
                np.outer(rise * np.cos(0.5 * angle), across) + np.outer(rise * np.sin(0.5 * angle), aside),
                0.7 * np.outer(rise * np.cos(angle), across) + 0.7 * np.outer(rise * np.sin(angle), aside),
                0.6 * np.outer(rise * np.sin(1.5 * angle), across) + 0.3 * np.outer(rise, along),
                np.outer(rise * np.cos(1.5 * angle), across),
            )[k - 1]
        )
    return fields


class Pilots:
    """Pilot runs of one scene.

    Args:
        simulate: makes the simulation of a batch: num_rods, and what a `Resolution` holds.
        fields: T, (num_times, NUM_LOADS, 3), each held over CONTROL_TIME; all zero: the rods swing freely instead.
        axes: world axes of the motion, the first along the rod.
        hanging: pilots start in equilibrium under gravity; else straight, so that gravity acts suddenly.
    """

    def __init__(
        self, simulate: Callable[..., Any], fields: np.ndarray, axes: tuple[int, ...], hanging: bool = False
    ) -> None:
        self.simulate, self.fields, self.axes, self.hanging = simulate, fields, axes, hanging
        self.limit = self.budget = math.inf  # of the cost of a run and of all; beyond them a run is refused as TooDear
        self.spent = 0.0  # costs of all runs, as `cost_rate`
        self.swing: float | None = None  # largest speed of the tip in a plucked pilot, lengths a second
        self.known: dict[Resolution, np.ndarray] = {}

    def simulation(self, resolution: Resolution, num_rods: int = 1) -> Any:
        """Rods at this resolution."""
        names = ("num_elements", "axial_softening", "rotary_scaling", "integrator", "time_step")
        return self.simulate(num_rods=num_rods, **{name: getattr(resolution, name) for name in names})

    def step(self, resolution: Resolution) -> float:
        """The step, s, that a simulation at this resolution takes."""
        return self.simulation(resolution).time_step

    def tips(self, resolution: Resolution) -> np.ndarray:
        """Tip of every pilot, m, (num_times, NUM_LOADS, 3); NaN from where one was lost.

        Raises:
            TooDear: if the run would be beyond the limit or the budget.
        """
        if resolution not in self.known:
            self.known[resolution] = self._run(resolution)
        return self.known[resolution]

    def _run(self, resolution: Resolution) -> np.ndarray:
        simulation = self.simulation(resolution, NUM_LOADS)
        cost = cost_rate(resolution.integrator, resolution.num_elements, simulation.time_step)
        if cost > self.limit or self.spent + cost > self.budget:
            raise TooDear
        self.spent += cost
        words = "pilot run: %s, %d elements, axial_softening %.4g, rotary_scaling %.4g, %.0f steps"
        told = (resolution.integrator, resolution.num_elements, resolution.axial_softening, resolution.rotary_scaling)
        LOGGER.info(words, *told, DURATION / simulation.time_step)
        simulation.reset(field=np.zeros(3) if self.hanging else None)
        if not self.fields.any():
            self._pluck(simulation)
        tips = np.empty((len(self.fields), NUM_LOADS, 3))
        for k, field in enumerate(self.fields):
            simulation.advance(CONTROL_TIME, field=field)
            tips[k] = np.where(simulation.status[:, None] == 0, simulation.tip_position, np.nan)
        return tips

    def _pluck(self, simulation: Any) -> None:
        """Start all but the first pilot with the velocities of a swing in the first bending mode, across the rod."""
        if self.swing is None:
            self.swing = 2.0 * math.pi * float(np.nanmin(simulation.natural_frequencies())) * PLUCK
        length = simulation.arc_lengths[-1]
        share = simulation.arc_lengths / length
        shape = (6.0 * share**2 - 4.0 * share**3 + share**4) / 3.0  # of a rod under its own weight
        slope = (12.0 * share - 12.0 * share**2 + 4.0 * share**3) / (3.0 * length)
        velocities, spins = (np.zeros((NUM_LOADS, len(share), 3)) for _ in range(2))
        for load in range(1, NUM_LOADS):
            speed = self.swing * length * load / (NUM_LOADS - 1)
            across = self.axes[1 + load % (len(self.axes) - 1)]
            velocities[load, :, across] = speed * shape
            spins[load, :, 3 - across] = speed * slope * (1.0 if across == 1 else -1.0)
        simulation.set_motion(velocities, spins)

    @staticmethod
    def distance(one: np.ndarray, other: np.ndarray) -> float:
        """Largest RMS distance of two runs in any pilot, m; infinite where one was lost."""
        rms = np.sqrt(((one - other) ** 2).sum(axis=2).mean(axis=0))
        return float(np.where(np.isnan(rms), np.inf, rms).max())
