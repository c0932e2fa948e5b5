"""Goal-conditioned observations in Gymnasium-Robotics' form, for hindsight experience replay."""

from __future__ import annotations

from typing import Any

import numpy as np
from gymnasium import spaces


def goal_space(core: Any, observation: spaces.Box) -> spaces.Dict:
    """Observation as without goals; achieved and desired positions in metres."""
    positions = spaces.Box(-1.0, 1.0, (3 * len(core.nodes),), np.float64)
    return spaces.Dict({"observation": observation, "achieved_goal": positions, "desired_goal": positions})


def goal_observation(out: Any) -> dict[str, np.ndarray]:
    """Observations of all environments; positions of a diverged rod count as the clamp's."""
    achieved = out.positions.reshape(len(out.positions), -1)
    return {
        "observation": out.observations.copy(),
        "achieved_goal": np.clip(np.nan_to_num(achieved, nan=0.0, posinf=1.0, neginf=-1.0), -1.0, 1.0),
        "desired_goal": out.goals.reshape(len(out.goals), -1).copy(),
    }


def distance_reward(achieved: np.ndarray, desired: np.ndarray, success_distance: float) -> np.ndarray:
    """0 where the mean distance of the tracked points is within `success_distance` (m), else -1; (..., 3 P) each."""
    first, second = (np.reshape(goal, (*np.shape(goal)[:-1], -1, 3)) for goal in (achieved, desired))
    distance = np.linalg.norm(first - second, axis=-1).mean(axis=-1)
    return -(distance > success_distance).astype(np.float64)


def sparse_reward(out: Any, success_distance: float) -> np.ndarray:
    """`distance_reward` of one step's outcome."""
    observed = goal_observation(out)
    return distance_reward(observed["achieved_goal"], observed["desired_goal"], success_distance)
