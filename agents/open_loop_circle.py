"""Open-loop controllers for the circle: the paper's rotating field, and the field that holds the nominal rod on it.

`python -m agents.open_loop_circle` evaluates both on nominal and on randomised rods.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from agents.rollout import REAL_RODS, Envs, evaluate, table
from magrod_env.envs import attributes_of

MIDDLE = 0.5  # control steps: when, in the next one, the target is looked at


@dataclass
class RotatingField:
    """The paper's experiment 5: a constant field up against the sag plus one that turns across the rod.

    compensation, rotating: magnitudes, T (paper: 7.75 and 14.5 mT). lead: angle by which the field runs ahead, rad.
    """

    compensation: float = 7.75e-3
    rotating: float = 14.5e-3
    lead: float = 0.0

    def __call__(self, observations: np.ndarray, envs: Envs) -> np.ndarray:
        """Actions (num_envs, 2)."""
        rods = attributes_of(envs)
        angle = 2.0 * np.pi * rods.phase(MIDDLE) + self.lead
        field = self.rotating * np.stack([np.zeros_like(angle), np.cos(angle), np.sin(angle)], axis=1)
        field[:, 2] += self.compensation
        return rods.coils.fraction(field)


@dataclass
class InverseStatics:
    """The field in whose static equilibrium the nominal rod lies on its path; knows the model, sees nothing."""

    def __call__(self, observations: np.ndarray, envs: Envs) -> np.ndarray:
        """Actions (num_envs, num_axes)."""
        rods = attributes_of(envs)
        fields = rods.task.fields
        if fields is None:
            raise ValueError("task must follow a path for inverse statics, but reaches for a point: choose another.")
        at = (rods.phase(MIDDLE) % 1.0) * len(fields)
        first, share = at.astype(int) % len(fields), (at % 1.0)[:, None]
        return rods.coils.fraction((1.0 - share) * fields[first] + share * fields[(first + 1) % len(fields)])


def main() -> None:
    """Evaluate both controllers."""
    for title, rods in (("nominal rod", None), ("randomised rods", REAL_RODS)):
        results = [
            evaluate("rotating field", RotatingField(), "MagRod/Circle-v0", randomization=rods),
            evaluate("inverse statics", InverseStatics(), "MagRod/Circle-v0", randomization=rods),
        ]
        print(f"\n{title}: tip error, mm\n{table(results)}")


if __name__ == "__main__":
    main()
