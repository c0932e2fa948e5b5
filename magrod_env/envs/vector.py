"""The native vector environment: one batch of rods, stepped by compiled code."""

from __future__ import annotations

from typing import Any

import numpy as np
from gymnasium import spaces
from gymnasium.error import ResetNeeded
from gymnasium.vector import AutoresetMode, VectorEnv
from gymnasium.vector.utils import batch_space
from numpy.typing import ArrayLike

from magrod_env.envs.arguments import (
    MOST_ENVS,
    choice,
    episode_limit,
    flag,
    reals,
    reset_options,
    seed_number,
    success_radius,
    told,
    whole,
)
from magrod_env.envs.attributes import RodAttributes
from magrod_env.envs.core import SteeringCore
from magrod_env.envs.goals import goal_observation, goal_space, sparse_reward
from magrod_env.envs.observing import Outcome
from magrod_env.envs.options import make_core
from magrod_env.envs.pictures import Painter
from magrod_env.envs.state import EnvState, checked_state, put_state, take_state
from magrod_env.envs.tasks import TASKS

OBSERVATION_BOUND = 100.0


def action_space_of(core: SteeringCore) -> spaces.Box:
    """Share of each coil pair's limit."""
    return spaces.Box(-1.0, 1.0, (core.coils.num_axes,), np.float32)


def observation_space_of(core: SteeringCore) -> spaces.Box:
    """Dimensionless numbers of order one; see the table of each environment."""
    return spaces.Box(-OBSERVATION_BOUND, OBSERVATION_BOUND, (core.observation_size,), np.float32)


class MagRodVectorEnv(RodAttributes, VectorEnv):
    """`num_envs` independent environments in one batch; made by `gymnasium.make_vec(id, num_envs=...)`.

    Row i of a batch that is reset with seed s does what a single environment reset with seed s + i does, bit for bit.
    The batch truncates by itself after `max_episode_steps`.

    Args:
        task: one of `magrod_env.envs.tasks.TASKS`.
        num_envs: number of environments.
        max_episode_steps: control steps after which an episode is truncated; None, or -1 as in `gymnasium.make`, for
            never.
        autoreset_mode: gymnasium's `AutoresetMode` or its value: "NextStep" (default), "SameStep" or "Disabled";
            with the last, an environment whose episode has ended must be reset, with a `reset_mask`, before it steps.
        goal: goal-conditioned observations and sparse rewards, for hindsight replay.
        success_distance: error, m, below which `info["is_success"]` is true; None for the task's own.
        render_mode: None or "rgb_array": `render()` then gives a tuple with a frame of every environment.
        settings: the arguments of `MagRodEnv`.

    Raises:
        ValueError: on an unknown or bad argument, or an action that is not finite or of the wrong shape.
        ResetNeeded: on a step or a frame before the first reset, or a step of an ended episode without autoreset.
    """

    def __init__(
        self,
        task: str = "circle",
        num_envs: int = 1,
        *,
        max_episode_steps: int | None = None,
        autoreset_mode: AutoresetMode | str = AutoresetMode.NEXT_STEP,
        goal: bool = False,
        success_distance: float | None = None,
        render_mode: str | None = None,
        **settings: Any,
    ) -> None:
        self.num_envs = whole("num_envs", num_envs, at_most=MOST_ENVS, advice="give the number of environments")
        self.render_mode = choice("render_mode", render_mode, (None, "rgb_array"))
        self.goal, self.max_episode_steps = flag("goal", goal), episode_limit(max_episode_steps)
        self.core = make_core(task, self.num_envs, settings)
        try:
            self.autoreset_mode = AutoresetMode(autoreset_mode)
        except ValueError:
            raise ValueError(
                f"autoreset_mode must be one of {', '.join(mode.value for mode in AutoresetMode)}, "
                f"but got {told(autoreset_mode)}: choose one of them."
            ) from None
        self.metadata = {
            "render_modes": ["rgb_array"],
            "render_fps": self.core.control_rate,
            "autoreset_mode": self.autoreset_mode,
        }
        self.success_distance = success_radius(success_distance, TASKS[task].success_distance, self.scene.rod.length)
        box = observation_space_of(self.core)
        self.single_observation_space = goal_space(self.core, box) if self.goal else box
        self.single_action_space = action_space_of(self.core)
        self.observation_space = batch_space(self.single_observation_space, self.num_envs)
        self.action_space = batch_space(self.single_action_space, self.num_envs)
        self._over = np.zeros(self.num_envs, bool)
        self._seeded = np.zeros(self.num_envs, bool)
        self._painter = Painter(self.core) if render_mode == "rgb_array" else None

    def reset(
        self, *, seed: int | list[int | None] | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Any, dict[str, Any]]:
        """Begin new episodes.

        Args:
            seed: s seeds environment i with s + i; a list gives each its own; None goes on with the present streams.
            options: {"reset_mask": (num_envs,) bool} resets only some environments. Another key is refused.
        """
        mask = self._mask(reset_options(options, ("reset_mask",)))
        which = np.arange(self.num_envs) if mask is None else np.flatnonzero(mask)
        self._seed(seed, which)
        if mask is None:
            self._out = self.core.new_outcome()
        else:
            self._out = type(self._out)(*(array.copy() for array in self._out))
        self.core.reset(which, self._out)
        self._over[which] = False
        chosen = np.zeros(self.num_envs, bool)
        chosen[which] = True
        return self._observation(self._out), self._info(self._out, None, chosen)

    def _mask(self, options: dict[str, Any]) -> np.ndarray | None:
        if "reset_mask" not in options:
            return None
        self._need_reset()
        mask = options["reset_mask"]
        if not (isinstance(mask, np.ndarray) and mask.shape == (self.num_envs,) and mask.dtype == bool and mask.any()):
            raise ValueError(
                f"reset_mask must be a boolean array of shape ({self.num_envs},) with a True, but got {told(mask)}: "
                "mark the environments to reset."
            )
        return mask

    def _need_reset(self) -> None:
        if not self._seeded.all():
            raise ResetNeeded(
                "environments must be reset before their first step or frame, but were not: call reset()."
            )

    def _need_running(self) -> None:
        """Without autoreset, refuse to step an environment whose episode has ended."""
        self._need_reset()
        ended = np.flatnonzero(self._over)
        if self.autoreset_mode == AutoresetMode.DISABLED and len(ended):
            raise ResetNeeded(
                f"environments must be reset at the end of their episodes, but {told(ended.tolist())} were not: call "
                'reset(options={"reset_mask": mask}) with their entries True.'
            )

    def _seed(self, seed: int | list[int | None] | None, which: np.ndarray) -> None:
        """Seed the environments `which`: as given, else anew those that never were."""
        given = [None] * self.num_envs if seed is None else self._seeds(seed)
        entropy = np.random.SeedSequence().generate_state(self.num_envs)
        seeds: list[int | None] = [None] * self.num_envs
        for i in which:
            seeds[i] = given[i] if given[i] is not None or self._seeded[i] else int(entropy[i])
        self._seeded[which] = True
        self.core.seed_all(seeds)

    def _seeds(self, seed: int | list[int | None]) -> list[int | None]:
        if not (isinstance(seed, (list, tuple)) or (isinstance(seed, np.ndarray) and seed.ndim == 1)):
            first = seed_number(seed)
            return [None if first is None else first + i for i in range(self.num_envs)]
        if len(seed) != self.num_envs:
            raise ValueError(
                f"seed must be one number or {self.num_envs}, but got {len(seed)}: one for each environment."
            )
        return [seed_number(one) for one in seed]

    def step(self, actions: ArrayLike) -> tuple[Any, np.ndarray, np.ndarray, np.ndarray, dict[str, Any]]:
        """One control step of every environment."""
        self._need_running()
        actions = self._checked(actions)
        fresh = self._over.copy() if self.autoreset_mode == AutoresetMode.NEXT_STEP else np.zeros(self.num_envs, bool)
        out = self.core.new_outcome()
        streams = self.core.episodes.streams[fresh]
        self.core.step(actions, out)
        if fresh.any():
            self.core.episodes.streams[fresh] = streams
            self.core.reset(np.flatnonzero(fresh), out)
        terminated = (self.core.batch.status != 0) & ~fresh
        truncated = np.zeros(self.num_envs, bool)
        if self.max_episode_steps is not None:
            truncated = (self.core.episodes.steps >= self.max_episode_steps) & ~fresh
        self._over = terminated | truncated
        info = self._info(out, np.where(fresh[:, None], 0.0, actions))
        rewards = sparse_reward(out, self.success_distance, self.core.batch.status != 0) if self.goal else out.rewards
        rewards = np.where(fresh, 0.0, rewards)
        self._out = out
        if self.autoreset_mode == AutoresetMode.SAME_STEP and self._over.any():
            info = self._reset_in_place(info)
        return self._observation(self._out), rewards, terminated, truncated, info

    def _reset_in_place(self, info: dict[str, Any]) -> dict[str, Any]:
        """Same-step autoreset: the last observations and infos of finished episodes go into the info."""
        over, last = self._over, self._observation(self._out)
        final = np.full(self.num_envs, None, dtype=object)
        for i in np.flatnonzero(over):
            final[i] = (
                {name: value[i].copy() for name, value in last.items()} if isinstance(last, dict) else last[i].copy()
            )
        self._out = type(self._out)(*(array.copy() for array in self._out))
        self.core.reset(np.flatnonzero(over), self._out)
        ended = {name: value for name, value in info.items() if not name.startswith("_")}
        ended.update({f"_{name}": over.copy() for name in list(ended)})
        fresh = self._info(self._out, None)
        merged = {
            name: np.where(over.reshape(-1, *(1,) * (value.ndim - 1)), fresh[name], value)
            for name, value in info.items()
        }
        self._over = np.zeros(self.num_envs, bool)
        return merged | {
            "final_obs": final,
            "_final_obs": over.copy(),
            "final_info": ended,
            "_final_info": over.copy(),
        }

    def _checked(self, actions: ArrayLike) -> np.ndarray:
        array = reals(actions)
        if array is None or array.shape != self.action_space.shape:
            came = told(actions) if array is None else f"shape {array.shape}"
            raise ValueError(
                f"actions must be numbers of shape {self.action_space.shape}, but got {came}: one row an environment."
            )
        if not np.isfinite(array).all():
            row = int(np.flatnonzero(~np.isfinite(array).all(axis=1))[0])
            raise ValueError(
                f"actions must be finite, but environment {row} got {array[row].tolist()}: check what computed it."
            )
        return array

    def _observation(self, out: Outcome) -> np.ndarray | dict[str, np.ndarray]:
        return goal_observation(out) if self.goal else out.observations.copy()

    def _info(self, out: Outcome, actions: np.ndarray | None, chosen: np.ndarray | None = None) -> dict[str, Any]:
        info = self.core.info(out, actions, self.success_distance)
        if self.goal:
            info = {name: value for name, value in info.items() if not name.startswith("reward_")}
        chosen = np.ones(self.num_envs, bool) if chosen is None else chosen
        return info | {f"_{name}": chosen.copy() for name in info}

    def render(self) -> tuple[np.ndarray, ...] | None:
        """A frame of every environment, (height, width, 3) uint8 each; None without a render mode."""
        self._need_reset()
        if self._painter is None:
            return None
        return tuple(self._painter.paint(i, self._out) for i in range(self.num_envs))

    def get_state(self) -> EnvState:
        """Everything that the environments go on from, random streams included; see `EnvState`.

        Raises:
            ResetNeeded: before the first reset.
        """
        self._need_reset()
        return take_state(self.core, self._out, self._over)

    def set_state(self, state: EnvState, envs: ArrayLike | None = None) -> None:
        """Put environments into states of environments made alike, single or vector; they go on bit for bit.

        Args:
            state: of one environment, for all, or of as many as there are in `envs`.
            envs: indices (M,); None for all.

        Raises:
            ValueError: if it is no state, or does not fit.
            ResetNeeded: before the first reset, for some environments only.
        """
        state, which = checked_state(state, self.core, envs)
        if envs is not None:
            self._need_reset()
        out = self.core.new_outcome() if envs is None else type(self._out)(*(array.copy() for array in self._out))
        self._over = self._over.copy()
        put_state(self.core, state, which, out, self._over)
        self._out, self._seeded[which] = out, True

    def close_extras(self, **kwargs: Any) -> None:
        """Nothing is held open."""
