"""Goal-conditioned observations in Gymnasium-Robotics' form, for hindsight experience replay."""

from __future__ import annotations

import numpy as np
from gymnasium import spaces
from numpy.typing import ArrayLike

from magrod_env.envs.arguments import reals, told
from magrod_env.envs.core import SteeringCore
from magrod_env.envs.observing import Outcome


def goal_space(core: SteeringCore, observation: spaces.Box) -> spaces.Dict:
    """Observation as without goals; achieved and desired positions in metres, where a rod that is not lost may be."""
    bound = max(1.0, 1.5 * core.scene.rod.length)  # the watchdog loses a rod that is stretched by half
    positions = spaces.Box(-bound, bound, (3 * len(core.nodes),), np.float64)
    return spaces.Dict({"observation": observation, "achieved_goal": positions, "desired_goal": positions})


def goal_observation(out: Outcome) -> dict[str, np.ndarray]:
    """Observations of all environments."""
    return {
        "observation": out.observations.copy(),
        "achieved_goal": out.positions.reshape(len(out.positions), -1).copy(),
        "desired_goal": out.goals.reshape(len(out.goals), -1).copy(),
    }


def distance_reward(achieved: np.ndarray, desired: np.ndarray, success_distance: float) -> np.ndarray:
    """0 where the mean distance of the tracked points is within `success_distance` (m), else -1; (..., 3 P) each.

    A goal with an entry that is not finite is never reached.
    """
    first, second = (goal.reshape(*goal.shape[:-1], goal.shape[-1] // 3, 3) for goal in (achieved, desired))
    with np.errstate(invalid="ignore", over="ignore"):
        distance = np.linalg.norm(first - second, axis=-1).mean(axis=-1)
    return np.where(distance <= success_distance, 0.0, -1.0)[()]  # a number for a pair of goals


def reward_of_goals(achieved: ArrayLike, desired: ArrayLike, size: int, success_distance: float) -> np.ndarray:
    """`distance_reward` of goals that a user gives, of `size` entries each, one or batches that broadcast.

    Raises:
        ValueError: on anything but real numbers of such shapes.
    """
    goals = [_goal(name, value, size) for name, value in (("achieved_goal", achieved), ("desired_goal", desired))]
    try:
        np.broadcast_shapes(*(goal.shape for goal in goals))
    except ValueError:
        raise ValueError(
            f"achieved_goal and desired_goal must have shapes that fit, but got {goals[0].shape} and "
            f"{goals[1].shape}: give as many of one as of the other."
        ) from None
    return distance_reward(goals[0], goals[1], success_distance)


def _goal(name: str, value: ArrayLike, size: int) -> np.ndarray:
    goal = reals(value)
    if goal is None or goal.ndim == 0 or goal.shape[-1] != size:
        came = told(value) if goal is None else f"shape {goal.shape}"
        raise ValueError(
            f"{name} must be real numbers of shape (..., {size}), but got {came}: give positions in metres."
        )
    return goal


def sparse_reward(out: Outcome, success_distance: float, lost: np.ndarray) -> np.ndarray:
    """`distance_reward` of one step's outcome; a rod that is ``lost``, (num_envs,) bool, has not succeeded."""
    observed = goal_observation(out)
    rewards = distance_reward(observed["achieved_goal"], observed["desired_goal"], success_distance)
    return np.where(lost, -1.0, rewards)
