"""What the filters that carry simulated rods have in common: how they are set up and what they tell."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from magrod_env import _checks
from magrod_env.estimation.arrivals import checked_field, checked_mask
from magrod_env.estimation.coordinates import strains_of
from magrod_env.estimation.members import Members
from magrod_env.scene import Scene
from magrod_env.simulation.scene_values import axis_across
from magrod_env.simulation.starts import Shape, check_one_start, checked_shape

MODES = {None: 4, "xy": 2, "xz": 2}  # two bending modes along each axis


class MemberFilter:
    """Base of `EnsembleFilter` and `UnscentedFilter`: members with weights, whose means are the estimate.

    A subclass has `reset`, `predict` and `update`, and keeps the lanes of `members` at the present estimate.
    """

    members: Members
    nodes: np.ndarray
    _mean_weights: np.ndarray  # (num_members,)
    _spread_weights: np.ndarray  # (num_members,)

    def __init__(
        self,
        scene: Scene,
        num_rods: int,
        tip_deviation: float | None,
        num_modes: int | None,
        history: float,
        plane: Any,
    ) -> None:
        if not isinstance(scene, Scene):
            raise ValueError(f"scene must be a Scene, but got {scene!r}: build one or use load_scene(name).")
        self.scene = scene
        self.num_rods = int(_checks.count("num_rods", num_rods, advice="give the number of rods in the batch"))
        self.tip_deviation = _checks.number(
            "tip_deviation",
            0.01 * scene.rod.length if tip_deviation is None else tip_deviation,
            at_least=0.0,
            advice="give it in metres",
        )
        self.num_modes = int(
            _checks.count("num_modes", MODES.get(plane, 4) if num_modes is None else num_modes, advice="4 is usual")
        )
        self.history = _checks.number("history", history, at_least=0.0, advice="give seconds, as late as frames come")
        self._time = self._last = 0.0
        self._started = np.zeros(self.num_rods)

    def _begin(
        self, field: ArrayLike | None, mask: ArrayLike | None, shape: Shape | None
    ) -> tuple[np.ndarray | None, np.ndarray, np.ndarray | None]:
        """Check a reset's arguments and set the clocks.

        Returns:
            field (num_rods, 3) or None; the rods that start again; strains (num_rods, N, 6) of the shape, or None.
        """
        chosen = checked_mask(mask, self.num_rods)
        fields = None if field is None else checked_field(field, self.num_rods)
        check_one_start(field, shape)
        bent = None if shape is None else self._bent(shape)
        if mask is None:
            self._time = self._last = 0.0
        self._started[chosen] = self._time
        self._forget()
        return fields, chosen, bent

    def _bent(self, shape: Shape) -> np.ndarray:
        model = self.members.simulation
        positions, quaternions = checked_shape(
            shape, self.num_rods, model.num_elements + 1, self.scene.rod.length, axis_across(model.plane)
        )
        still = np.zeros(positions.shape)
        return strains_of(positions, quaternions, still, still, self.members.lengths)[..., :6]

    def _forget(self) -> None:
        self._note(
            np.full((self.num_rods, len(self.nodes), 3), np.nan),
            np.zeros((self.num_rods, len(self.nodes)), bool),
            np.zeros(self.num_rods),
        )

    def _note(self, innovation: np.ndarray, seen: np.ndarray, statistic: np.ndarray) -> None:
        self._innovation = np.where(seen[..., None], innovation, np.nan)
        self._dof = 3 * seen.sum(axis=1)
        self._statistic = np.where(self._dof > 0, statistic, np.nan)

    def _mean(self, values: np.ndarray) -> np.ndarray:
        """Weighted mean over the members of values (num_rods, num_members, ...)."""
        return np.tensordot(self._mean_weights, values, axes=(0, 1))

    def _deviation(self, values: np.ndarray) -> np.ndarray:
        spread = values - self._mean(values)[:, None]
        return np.sqrt(np.maximum(np.tensordot(self._spread_weights, spread**2, axes=(0, 1)), 0.0))

    def _by_member(self, values: np.ndarray) -> np.ndarray:
        return values.reshape(*self.members.shape, *values.shape[1:])

    @property
    def time(self) -> float:
        """Time of the estimate, s."""
        return self._time

    @property
    def positions(self) -> np.ndarray:
        """Mean positions of the nodes, m, world, (num_rods, num_nodes, 3)."""
        return self._mean(self._by_member(self.members.simulation.positions))

    @property
    def velocities(self) -> np.ndarray:
        """Mean velocities of the nodes, m/s, world, (num_rods, num_nodes, 3)."""
        return self._mean(self._by_member(self.members.simulation.velocities))

    @property
    def tip_position(self) -> np.ndarray:
        """Mean position of the tip, m, world, (num_rods, 3)."""
        return self.positions[:, -1]

    @property
    def uncertainty(self) -> np.ndarray:
        """Standard deviation of the nodes' positions, m, (num_rods, num_nodes, 3)."""
        return self._deviation(self._by_member(self.members.simulation.positions))

    @property
    def innovation(self) -> np.ndarray:
        """Last measurement less what was expected, m, (num_rods, num_markers, 3); NaN where nothing was seen."""
        return self._innovation.copy()

    @property
    def normalised_innovation(self) -> np.ndarray:
        """Last normalised innovation squared e^T S^-1 e, (num_rods,); NaN where nothing was seen."""
        return self._statistic.copy()

    @property
    def innovation_dof(self) -> np.ndarray:
        """Its degrees of freedom, three for each marker seen, (num_rods,): its mean where the filter is consistent."""
        return self._dof.copy()

    @property
    def parameters(self) -> dict[str, np.ndarray]:
        """Estimates by name, (num_rods,): factors on the scene's values, rad, m/s^2."""
        return self._told()[0]

    @property
    def parameter_uncertainty(self) -> dict[str, np.ndarray]:
        """Standard deviations by name, (num_rods,)."""
        return self._told()[1]

    def _told(self) -> tuple[dict[str, np.ndarray], dict[str, np.ndarray]]:
        values = self.members.parameters
        return self.members.unknowns.told(self._mean(values), self._deviation(values))
