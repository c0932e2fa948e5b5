"""The field that a controller expects of its own commands: a drive as specified, coils without error."""

from __future__ import annotations

import math

import numpy as np

from magrod_env.envs.core import SteeringCore

PIECE = 5e-3  # s: for so long a field that changes is taken to be constant
FINE = 1e-3  # s: steps of the drive


class NominalCoils:
    """Dead time, slew limit and lag of a core's actuator, without gain error and misalignment.

    Args:
        core: the `SteeringCore` whose commands these are; saturation is already in them.
    """

    def __init__(self, core: SteeringCore) -> None:
        self.core = core
        self.asked = np.zeros((core.num_envs, 3))  # T, behind the slew limit
        self.field = np.zeros((core.num_envs, 3))  # T, now

    def reset(self, which: np.ndarray) -> None:
        """Hold the field that the episodes of some environments start in."""
        self.asked[which] = self.field[which] = self.core.commands[0, which]

    def step(self) -> list[tuple[np.ndarray, float]]:
        """Fields of the control step that the core has just made, in order: mean (num_envs, 3) T and duration, s."""
        core = self.core
        split = core.late_steps * core.time_step
        pieces = self._follow(core.commands[core.late_controls + 1], split) if split > 0.0 else []
        return pieces + self._follow(core.commands[core.late_controls], core.control_time - split)

    def _follow(self, command: np.ndarray, duration: float) -> list[tuple[np.ndarray, float]]:
        if not self.core.follows:
            self.field = command.copy()
            return [(self.field, duration)]
        count = math.ceil(duration / PIECE - 1e-9)
        return [(self._mean(command, duration / count), duration / count) for _ in range(count)]

    def _mean(self, command: np.ndarray, duration: float) -> np.ndarray:
        """Run the drive for a while; the mean of its field."""
        actuator, steps = self.core.actuator, math.ceil(duration / FINE - 1e-9)
        step, total = duration / steps, np.zeros(self.field.shape)
        for _ in range(steps):
            asked, before = command, self.field
            if actuator.slew_limit is not None:
                largest = actuator.slew_limit * step
                asked = self.asked + np.clip(command - self.asked, -largest, largest)
            if actuator.lag is None:
                self.field = asked
            else:  # towards the middle of the ramp
                goal = command if actuator.slew_limit is None else 0.5 * (self.asked + asked)
                self.field = goal + (before - goal) * math.exp(-step / actuator.lag)
            self.asked = asked
            total += 0.5 * (before + self.field)
        return total / steps
