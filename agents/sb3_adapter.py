"""Stable-Baselines3's vector environment on the native batch."""

from __future__ import annotations

import time
from typing import Any

import gymnasium
import numpy as np
from gymnasium.vector import AutoresetMode
from stable_baselines3.common.vec_env import VecEnv
from stable_baselines3.common.vec_env.base_vec_env import VecEnvIndices, VecEnvObs, VecEnvStepReturn

import magrod_env  # noqa: F401  (registers the ids)

_NOTHING: dict[str, object] = {}


class BatchedVecEnv(VecEnv):
    """A `MagRodVectorEnv` as Stable-Baselines3 wants it: same-step resets, `terminal_observation`, episode statistics.

    Args:
        env_id: a registered id.
        num_envs: number of environments in the batch.
        seed: environment i is seeded with seed + i.
        settings: arguments of the environment.
    """

    def __init__(self, env_id: str, num_envs: int, *, seed: int = 0, **settings: Any) -> None:
        self.env = gymnasium.make_vec(env_id, num_envs=num_envs, autoreset_mode=AutoresetMode.SAME_STEP, **settings)
        super().__init__(num_envs, self.env.single_observation_space, self.env.single_action_space)
        self.render_mode = None
        self._first_seed: int | None = seed
        self._started = time.time()

    def seed(self, seed: int | None = None) -> list[int | None]:
        """Seed environment i with seed + i at the next reset."""
        self._first_seed = seed
        return [None if seed is None else seed + i for i in range(self.num_envs)]

    def reset(self) -> VecEnvObs:
        """Begin new episodes in all environments."""
        observations, _ = self.env.reset(seed=self._first_seed)
        self._first_seed = None
        self._returns = np.zeros(self.num_envs)
        self._lengths = np.zeros(self.num_envs, np.int64)
        self._errors = np.zeros(self.num_envs)
        return observations

    def step_async(self, actions: np.ndarray) -> None:
        """Keep the actions for `step_wait`."""
        self._actions = actions

    def step_wait(self) -> VecEnvStepReturn:
        """Step the batch; only environments whose episode ended get an info of their own."""
        observations, rewards, terminated, truncated, info = self.env.step(self._actions)
        done = terminated | truncated
        last = info.get("final_info", info)
        self._returns += rewards
        self._lengths += 1
        self._errors += np.where(done, last["tip_error"], info["tip_error"])
        infos = [_NOTHING] * self.num_envs
        for i in np.flatnonzero(done):
            infos[i] = {
                "terminal_observation": info["final_obs"][i],
                "TimeLimit.truncated": bool(truncated[i] and not terminated[i]),
                "episode": {
                    "r": float(self._returns[i]),
                    "l": int(self._lengths[i]),
                    "t": time.time() - self._started,
                    "tip_error": float(self._errors[i] / self._lengths[i]),
                },
                "is_success": bool(last["is_success"][i]),
            }
        for sums in (self._returns, self._lengths, self._errors):
            sums[done] = 0
        return observations, rewards.astype(np.float32), done, infos

    def close(self) -> None:
        """Close the batch."""
        self.env.close()

    def get_attr(self, attr_name: str, indices: VecEnvIndices = None) -> list[Any]:
        """The batch's attribute, once for each environment asked for."""
        return [getattr(self.env, attr_name)] * len(self._indices(indices))

    def set_attr(self, attr_name: str, value: object, indices: VecEnvIndices = None) -> None:
        """Set an attribute of the batch."""
        setattr(self.env, attr_name, value)

    def env_method(
        self, method_name: str, *arguments: object, indices: VecEnvIndices = None, **keywords: object
    ) -> list[Any]:
        """Call a method of the batch once and repeat its result."""
        return [getattr(self.env, method_name)(*arguments, **keywords)] * len(self._indices(indices))

    def env_is_wrapped(self, wrapper_class: type[gymnasium.Wrapper], indices: VecEnvIndices = None) -> list[bool]:
        """No wrapper lies around a single environment of the batch."""
        return [False] * len(self._indices(indices))

    def _indices(self, indices: VecEnvIndices) -> list[int]:
        return list(self._get_indices(indices))
