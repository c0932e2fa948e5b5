"""The single environment: a batch of one behind gymnasium.Env."""

from __future__ import annotations

import copy
import dataclasses
from typing import Any

import gymnasium
import numpy as np
from gymnasium.error import ResetNeeded
from numpy.typing import ArrayLike

from magrod_env.envs.arguments import choice, flag, reals, reset_options, seed_number, success_radius, told
from magrod_env.envs.attributes import RodAttributes
from magrod_env.envs.goals import goal_observation, goal_space, reward_of_goals, sparse_reward
from magrod_env.envs.observing import Outcome
from magrod_env.envs.options import make_core
from magrod_env.envs.pictures import Painter
from magrod_env.envs.state import EnvState, checked_state, put_state, take_state
from magrod_env.envs.tasks import TASKS
from magrod_env.envs.vector import action_space_of, observation_space_of


class MagRodEnv(RodAttributes, gymnasium.Env):
    """A magnetic rod steered by the field of Helmholtz coils.

    ## Description
    An elastic rod is clamped at the origin, lies along +x when unloaded and carries one or two small permanent magnets.
    The action is the field of the coils; the field turns the magnets and bends the rod. `task` says what its magnets
    shall do; each is a file of `magrod_env.envs.tasks`, with ids and a scene of its own, and has a page for each id
    under docs/environments. What a controller may read beside the observation is in `RodAttributes`.

    ## Action Space
    `Box(-1, 1, (num_axes,), float32)`: the field along each coil axis, in the order of `axes`, as a share of the coils'
    limit. Beyond 1 the coils saturate, which `info["saturated"]` tells. It acts for one control step, 20 ms by default.

    ## Observation Space
    `Box(-100, 100, (size,), float32)`. P points are tracked: the magnets, from the tip inwards. L is the rod's length.
    `env.unwrapped.observation_layout.table()` has the entries of an environment and their places.

    | name | entries | what | unit |
    |---|---|---|---|
    | position | 3 P | position of the tracked points as the camera sees them, world | L |
    | velocity | 3 P | their velocity: difference of the last two frames | L/s |
    | field | num_axes | field of the coils by their own sensors | coils' limit |
    | target | 3 P | target minus position | L/10 |
    | preview | 9 P (paths only) | target in 0.04, 0.1 and 0.2 s minus target now | L/10 |
    | state | 13 a node (observe="state") | position (L), quaternion w x y z, velocity (L/s), body spin (10 rad/s) | |
    | state | 7 a node (the same, planar) | position, half-angle cosine and sine, velocity, spin | |

    ## Rewards
    The sum of four terms, each in `info["reward_<term>"]`; d is the mean distance of the tracked points from their
    targets.

    | term | value |
    |---|---|
    | tracking | -min(d / (0.1 L), 10) |
    | precision | exp(-d / 1 mm) |
    | effort | -0.01 \\|action\\|^2 |
    | smoothness | -0.05 \\|action - last action\\|^2 |

    ## Starting State
    At rest in static equilibrium: on a random point of the path, in the field that holds the nominal rod there
    (`random_start=False`: its first point); for reaching, in zero field.

    ## Episode End
    Terminates when the rod leaves the range in which its numbers mean anything (`info["diverged"]`; it then counts as
    lying at the clamp, and info stays finite); truncated by the time limit of the id.

    ## Arguments
    | argument | default | meaning |
    |---|---|---|
    | scene | the id's own | a `Scene` or a name for `load_scene` |
    | num_elements | the task's own; 5 with a scene of yours | elements of the rod |
    | axial_softening, rotary_scaling | 1, 8 | conditioning of stiff modes, see `Simulation`; 1, 1 where scene or \
num_elements is given |
    | time_step | None | s; None: 0.4 of the stability bound of the stiffest rod that may be drawn |
    | tolerance | None | m; chooses the four above for this tip error in the fields that the targets need |
    | precision | "float64" | or "float32" |
    | plane | the task's own | None: motion in space; or in a plane, "xz" or "xy" |
    | axes | the task's own | axes with coils, up to "xyz" |
    | actuator | the task's own | limit, slew limit, lag, dead time of the coils |
    | control_rate | 50 | Hz, 1 to 10,000 |
    | camera | Camera() | noise, rate, delay |
    | observe | "camera" | or "state"; or "estimate": in the camera's place, see `EstimateState` |
    | randomization | None | a `Randomization` |
    | success_distance | the task's own | m, for `info["is_success"]`; at most half of the rod's length |
    | num_threads | one for each usable core | threads that share a batch |

    Those of the task itself, such as the radius of a circle, are in `magrod_env.envs.tasks.TASKS[task].arguments` and
    on its page.

    ## Vectorized use
    `gymnasium.make_vec(id, num_envs=256)` gives `MagRodVectorEnv`: one batch, the same numbers bit for bit.

    ## Version History
    v0: first release.

    Raises:
        ValueError: on an unknown or bad argument, or an action that is not finite or of the wrong shape.
        ResetNeeded: on a step or a frame before the first reset.
    """

    metadata = {"render_modes": ["rgb_array"], "render_fps": 50}

    def __init__(
        self,
        task: str = "circle",
        *,
        goal: bool = False,
        success_distance: float | None = None,
        render_mode: str | None = None,
        **settings: Any,
    ) -> None:
        self.render_mode = choice("render_mode", render_mode, (None, "rgb_array"))
        self.goal = flag("goal", goal)
        self.core = make_core(task, 1, settings)
        self.success_distance = success_radius(success_distance, TASKS[task].success_distance, self.scene.rod.length)
        self.metadata = self.metadata | {"render_fps": self.core.control_rate}
        box = observation_space_of(self.core)
        self.observation_space = goal_space(self.core, box) if self.goal else box
        self.action_space = action_space_of(self.core)
        self._first = np.zeros(1, np.int64)
        if self.goal:
            self.compute_reward = self._compute_reward
        self._seeded_from: np.random.Generator | None = None
        self._out: Outcome | None = None  # until the first reset
        self._painter = Painter(self.core) if render_mode == "rgb_array" else None

    def reset(self, *, seed: int | None = None, options: dict[str, Any] | None = None) -> tuple[Any, dict[str, Any]]:
        """Begin a new episode; `seed` as in Gymnasium. There are no options: a key in them is refused."""
        reset_options(options)
        super().reset(seed=seed_number(seed))
        if self._seeded_from is not self.np_random:
            self._seeded_from = self.np_random
            self.core.seed(self._first, [self.np_random])
        self._out = out = self.core.new_outcome()
        self.core.reset(self._first, out)
        if self._painter is not None:
            self._painter.begin()
        return self._observation(out), self._info(out, None)

    def step(self, action: ArrayLike) -> tuple[Any, float, bool, bool, dict[str, Any]]:
        """One control step."""
        self._need_reset()
        array = reals(action)
        if array is None or array.shape != self.action_space.shape or not np.isfinite(array).all():
            raise ValueError(
                f"action must be finite numbers of shape {self.action_space.shape}, but got {told(action)}: "
                "give the share of each coil pair's limit."
            )
        self._out = out = self.core.new_outcome()
        self.core.step(array[None], out)
        info = self._info(out, array[None])
        reward = out.rewards[0]
        if self.goal:
            reward = sparse_reward(out, self.success_distance, self.core.batch.status != 0)[0]
        if self._painter is not None:
            self._painter.follow(out)
        return self._observation(out), float(reward), bool(info["diverged"]), False, info

    def get_state(self) -> EnvState:
        """Everything that the environment goes on from, random streams included; see `EnvState`.

        Raises:
            ResetNeeded: before the first reset.
        """
        self._need_reset()
        assert self._out is not None
        state = take_state(self.core, self._out, np.zeros(1, bool))
        return dataclasses.replace(state, generator=copy.deepcopy(self.np_random.bit_generator.state))

    def set_state(self, state: EnvState) -> None:
        """Put the environment into the state of one made alike, single or one of a vector; it goes on bit for bit.

        Raises:
            ValueError: if it is no state, or does not fit.
        """
        state, which = checked_state(state, self.core, None)
        if state.generator is not None:
            self.np_random.bit_generator.state = copy.deepcopy(state.generator)
        self._seeded_from = self.np_random
        self._out = self.core.new_outcome()
        put_state(self.core, state, which, self._out, np.zeros(1, bool))
        if self._painter is not None:
            self._painter.begin()

    def _compute_reward(self, achieved_goal: ArrayLike, desired_goal: ArrayLike, info: object) -> np.ndarray:
        """Sparse reward of any pair of goals, (3 P,) or (batch, 3 P) m: 0 within `success_distance`, else -1; one that
        is not finite is not reached.
        """
        return reward_of_goals(achieved_goal, desired_goal, 3 * len(self.core.nodes), self.success_distance)

    def _need_reset(self) -> Outcome:
        """The last step's outcome."""
        if self._out is None:
            raise ResetNeeded("environment must be reset before its first step or frame, but was not: call reset().")
        return self._out

    def _observation(self, out: Outcome) -> np.ndarray | dict[str, np.ndarray]:
        if self.goal:
            return {name: value[0] for name, value in goal_observation(out).items()}
        return out.observations[0]

    def _info(self, out: Outcome, action: np.ndarray | None) -> dict[str, Any]:
        info = self.core.info(out, action, self.success_distance)
        if self.goal:
            info = {name: value for name, value in info.items() if not name.startswith("reward_")}
        return {name: value[0].item() if value.ndim == 1 else value[0] for name, value in info.items()}

    def render(self) -> np.ndarray | None:
        """The rod now, (height, width, 3) uint8; None without a render mode."""
        out = self._need_reset()
        return None if self._painter is None else self._painter.paint(0, out)
