"""The single environment: a batch of one behind gymnasium.Env."""

from __future__ import annotations

from typing import Any

import gymnasium
import numpy as np
from gymnasium.error import ResetNeeded

from magrod_env.envs.arguments import choice, flag, reals, reset_options, seed_number, success_radius, told
from magrod_env.envs.goals import goal_observation, goal_space, reward_of_goals, sparse_reward
from magrod_env.envs.options import make_core
from magrod_env.envs.pictures import Painter
from magrod_env.envs.vector import action_space_of, observation_space_of


class MagRodEnv(gymnasium.Env):
    """A magnetic rod steered by the field of Helmholtz coils.

    ## Description
    An elastic rod is clamped at the origin, lies along +x when unloaded and carries one or two small permanent magnets.
    The action is the field of the coils; the field turns the magnets and bends the rod. `task` says what its magnets
    shall do: follow a circle ("circle"), another closed path ("path"), reach a point ("reach", "planar_reach"), or
    follow a path with two magnets at once ("two_magnet"). Each registered id is a task with a scene of its own
    (docs/environments).

    ## Action Space
    `Box(-1, 1, (num_axes,), float32)`: the field along each coil axis as a share of the coils' limit (45 mT). Beyond 1
    the coils saturate, which `info["saturated"]` tells. It acts for one control step, 20 ms by default.

    | axis of "circle", "path", "reach" | "two_magnet", "planar_reach" | unit |
    |---|---|---|
    | y (horizontal, across the rod) | x (along the rod) | coils' limit |
    | z (up) | z (up) | coils' limit |

    ## Observation Space
    `Box(-100, 100, (size,), float32)`. P points are tracked: the magnets, from the tip inwards. L is the rod's length.

    | entries | what | unit |
    |---|---|---|
    | 3 P | position of the tracked points as the camera sees them, world | L |
    | 3 P | their velocity: difference of the last two frames | L/s |
    | num_axes | field of the coils by their own sensors | coils' limit |
    | 3 P | target minus position | L/10 |
    | 9 P (paths only) | target in 0.04, 0.1 and 0.2 s minus target now | L/10 |
    | 13 a node (observe="state") | position (L), quaternion w x y z, velocity (L/s), body spin (10 rad/s) | |
    | 7 a node (the same, planar) | position x z, half-angle cosine and sine, velocity, spin | |

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
    | num_elements | 4 (two magnets: 10) | elements of the rod |
    | axial_softening, rotary_scaling | 1, 8 | conditioning of stiff modes, see `Simulation`; 1, 1 where scene or \
num_elements is given |
    | time_step | None | s; None: 0.4 of the stability bound of the stiffest rod that may be drawn |
    | tolerance | None | m; chooses the four above for this tip error in the fields that the targets need |
    | precision | "float64" | or "float32" |
    | plane | None (planar: "xz") | motion in space or in a plane |
    | axes | "yz" or "xz" | axes with coils, up to "xyz" |
    | actuator | Actuator() | limit (45 mT; two magnets: 25 mT), slew limit, lag, dead time of the coils |
    | control_rate | 50 | Hz, 1 to 10,000 |
    | camera | Camera() | noise, rate, delay |
    | observe | "camera" | or "state"; or "estimate": in the camera's place, see `EstimateState` |
    | randomization | None | a `Randomization` |
    | success_distance | 1e-3 | m, for `info["is_success"]`; at most half of the rod's length |
    | num_threads | one for each usable core | threads that share a batch |
    | radius, period, center_field, random_start | 16 mm, 2 s, (0, 0, 7.75 mT), True | "circle" |
    | path, size, period, ... | "figure_eight", 12 mm, 4 s | "path": a shape's name or points (M, 2) or (M, 3) m |
    | reach_limit | 25 mT | "reach", "planar_reach": fields whose equilibria are the targets |
    | amplitude, period, random_start | 20 mT, 4 s, True | "two_magnet" |

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
        success_distance: float = 1e-3,
        render_mode: str | None = None,
        **settings: Any,
    ) -> None:
        self.render_mode = choice("render_mode", render_mode, (None, "rgb_array"))
        self.goal = flag("goal", goal)
        self.core = make_core(task, 1, settings)
        self.success_distance = success_radius(success_distance, self.core.scene.rod.length)
        self.metadata = self.metadata | {"render_fps": self.core.control_rate}
        box = observation_space_of(self.core)
        self.observation_space = goal_space(self.core, box) if self.goal else box
        self.action_space = action_space_of(self.core)
        self._first = np.zeros(1, np.int64)
        if self.goal:
            self.compute_reward = self._compute_reward
        self._seeded_from: np.random.Generator | None = None
        self._out: Any = None  # until the first reset
        self._painter = Painter(self.core) if render_mode == "rgb_array" else None

    def reset(self, *, seed: int | None = None, options: dict[str, Any] | None = None) -> tuple[Any, dict[str, Any]]:
        """Begin a new episode; `seed` as in Gymnasium. There are no options: a key in them is refused."""
        reset_options(options)
        super().reset(seed=seed_number(seed))
        if self._seeded_from is not self.np_random:
            self._seeded_from = self.np_random
            self.core.seed(self._first, [self.np_random])
        self._out = self.core.new_outcome()
        self.core.reset(self._first, self._out)
        if self._painter is not None:
            self._painter.begin()
        return self._observation(), self._info(None)

    def step(self, action: Any) -> tuple[Any, float, bool, bool, dict[str, Any]]:
        """One control step."""
        self._need_reset()
        array = reals(action)
        if array is None or array.shape != self.action_space.shape or not np.isfinite(array).all():
            raise ValueError(
                f"action must be finite numbers of shape {self.action_space.shape}, but got {told(action)}: "
                "give the share of each coil pair's limit."
            )
        self._out = self.core.new_outcome()
        self.core.step(array[None], self._out)
        info = self._info(array[None])
        reward = self._out.rewards[0]
        if self.goal:
            reward = sparse_reward(self._out, self.success_distance, self.core.batch.status != 0)[0]
        if self._painter is not None:
            self._painter.follow(self._out)
        return self._observation(), float(reward), bool(info["diverged"]), False, info

    def _compute_reward(self, achieved_goal: Any, desired_goal: Any, info: Any) -> Any:
        """Sparse reward of any pair of goals, (3 P,) or (batch, 3 P) m: 0 within `success_distance`, else -1; one that
        is not finite is not reached.
        """
        return reward_of_goals(achieved_goal, desired_goal, 3 * len(self.core.nodes), self.success_distance)

    def _need_reset(self) -> None:
        if self._out is None:
            raise ResetNeeded("environment must be reset before its first step or frame, but was not: call reset().")

    def _observation(self) -> Any:
        if self.goal:
            return {name: value[0] for name, value in goal_observation(self._out).items()}
        return self._out.observations[0]

    def _info(self, action: np.ndarray | None) -> dict[str, Any]:
        info = self.core.info(self._out, action, self.success_distance)
        if self.goal:
            info = {name: value for name, value in info.items() if not name.startswith("reward_")}
        return {name: value[0].item() if value.ndim == 1 else value[0] for name, value in info.items()}

    def render(self) -> np.ndarray | None:
        """The rod now, (height, width, 3) uint8; None without a render mode."""
        self._need_reset()
        return None if self._painter is None else self._painter.paint(0, self._out)
