"""Wrapper of an environment, single or vector, whose observations are an estimate."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import gymnasium
from gymnasium.utils import RecordConstructorArgs
from gymnasium.vector import VectorEnv, VectorWrapper
from numpy.typing import ArrayLike

from magrod_env.envs.attributes import attributes_of
from magrod_env.envs.estimates import Estimator
from magrod_env.envs.estimation_core import Estimation
from magrod_env.estimation.cameras import Cameras


class EstimateState(gymnasium.Wrapper, RecordConstructorArgs):
    """Replaces what the camera saw in an observation by what an estimator makes of it, layout and units kept.

    Positions and velocities of the tracked points are those of the estimate, and so is "target minus position"; all
    else, rewards and goals among it, stays. Policies for `observe="camera"` run unchanged. Every rod has an estimator
    of its own; an episode that begins resets its own only. The estimator knows the nominal scene and the field that
    was commanded, not what the environment has randomised. docs/environments.md says what it is told and what it costs.

    `gymnasium.make(id, observe="estimate")` and `make_vec` do the same with the defaults, and without `estimate_time`,
    so that equal seeds give equal infos.

    In `info`, (num_envs,) each for a vector environment: `estimate_error`, m, distance of the estimated tip from the
    true one; `estimate_lost`, whether the estimate had diverged and began anew; `estimate_time`, s, wall time that the
    estimation of this step took, all rods together.

    Args:
        env: from `gymnasium.make` or `gymnasium.make_vec`; its observe must be "camera" or "estimate". Its estimation
            runs inside it from now on.
        estimator: what builds one, called with the scene and num_rods, num_elements, axial_softening, rotary_scaling,
            markers, plane and expected_field: a class of `magrod_env.estimation` or a `functools.partial` of it. None
            for an `EnsembleFilter`.
        members: of that filter; None for 32.
        markers: what cameras see: "tip", "magnets" or arc lengths, m; each at a node.
        cameras: with `measure`, such as `StereoCameras()`; None for `GaussianCameras` with the noise of the
            environment's camera, 0.05 mm where it has none. Rate and delay are those of the environment's camera.
        timed: whether `info` has `estimate_time`.

    Raises:
        ValueError: on another environment, or a bad argument.
    """

    def __new__(cls, env: Any = None, **options: Any) -> Any:
        """A `VectorEstimateState` for a vector environment."""
        return VectorEstimateState(env, **options) if isinstance(env, VectorEnv) else super().__new__(cls)

    def __init__(
        self,
        env: gymnasium.Env,
        *,
        estimator: Callable[..., Estimator] | None = None,
        members: int | None = None,
        markers: str | ArrayLike = "tip",
        cameras: Cameras | None = None,
        timed: bool = True,
    ) -> None:
        options: dict[str, Any] = {
            "estimator": estimator,
            "members": members,
            "markers": markers,
            "cameras": cameras,
            "timed": timed,
        }
        RecordConstructorArgs.__init__(self, **options)
        self._estimation = _install(env, options)
        super().__init__(env)

    @property
    def estimator(self) -> Estimator:
        """The estimator, of a batch of one."""
        return self._estimation.estimator


class VectorEstimateState(VectorWrapper):
    """What `EstimateState` makes of a vector environment; arguments as there."""

    def __init__(self, env: VectorEnv, **options: Any) -> None:
        self._estimation = _install(env, {"timed": True} | options)
        super().__init__(env)

    @property
    def estimator(self) -> Estimator:
        """The estimator of all rods."""
        return self._estimation.estimator


def _install(env: gymnasium.Env | VectorEnv, options: dict[str, Any]) -> Estimation:
    core = attributes_of(env).core
    core.estimation = estimation = Estimation(core, **options)
    return estimation
