"""Contracts: of what may replace the camera in the observations of a core, and of the estimators that it runs."""

from __future__ import annotations

from typing import TYPE_CHECKING, Protocol

import numpy as np
from numpy.typing import ArrayLike

from magrod_env.envs.observing import Outcome

if TYPE_CHECKING:  # only who estimates loads the filters
    from magrod_env.estimation.measurement import Measurement


class Estimates(Protocol):
    """Follows the episodes of a core and writes its observations again (see `magrod_env.envs.estimation_core`)."""

    def reset(self, which: np.ndarray, out: Outcome) -> None:
        """Begin anew in the environments ``which`` and write their first observations again."""

    def step(self, out: Outcome) -> None:
        """Follow one control step of all environments and write their observations again."""

    def info(self) -> dict[str, np.ndarray]:
        """What the environments add to their info; first axis num_envs."""


class Estimator(Protocol):
    """What estimates the rods of a batch, such as those of `magrod_env.estimation`. It may also have ``status``,
    (num_rods,), not 0 where an estimate has diverged.
    """

    @property
    def time(self) -> float:
        """Time that the estimates are of, s."""

    @property
    def positions(self) -> np.ndarray:
        """Estimated nodes, m, (num_rods, num_nodes, 3), world."""

    def reset(self, field: ArrayLike | None = None, mask: ArrayLike | None = None) -> None:
        """Begin in the nominal rods' equilibria in fields (num_rods, 3) T, or straight; ``mask`` (num_rods,) bool says
        which.
        """

    def predict(self, field: ArrayLike, duration: float) -> None:
        """Go on for a time, s, in fields (num_rods, 3) T."""

    def update(self, measurement: Measurement | None) -> None:
        """Take in what the cameras saw; None where they saw nothing."""
