"""States of environments: who goes on from one does so bit for bit, in a batch or alone."""

import copy
import pickle

import gymnasium
import numpy as np
import pytest
from gymnasium.error import ResetNeeded

from magrod_env import Actuator
from magrod_env.envs import Camera, Randomization

SPREAD = Randomization(modulus=0.1, density=0.1, field_gain=0.05, field_misalignment=0.05, initial_field=2e-3)
SETTINGS = {
    "randomization": SPREAD,
    "camera": Camera(noise=1e-4, delay=0.02),
    "actuator": Actuator(limit=45e-3, lag=10e-3, slew_limit=2.0, dead_time=0.025),
    "num_elements": 3,
}
IDS = ["MagRod/Circle-v0", "MagRod/PlanarReach-v0"]


def settings(name):
    return SETTINGS | ({"randomization": Randomization(modulus=0.1)} if "Planar" in name else {})


def rollout(env, actions):
    """Everything that steps return, flat."""
    out = []
    for action in actions:
        observation, reward, terminated, truncated, info = env.step(action)
        out += [observation, reward, terminated, truncated, info["tip_position"], info["target"]]
    return out


def assert_equal(one, other):
    for a, b in zip(one, other, strict=True):
        np.testing.assert_array_equal(a, b)


@pytest.mark.parametrize("name", IDS)
def test_a_vector_goes_on_from_its_state_through_resets(name):
    envs = gymnasium.make_vec(name, num_envs=5, max_episode_steps=12, **settings(name))
    envs.reset(seed=3)
    actions = np.random.default_rng(0).uniform(-1, 1, (20, *envs.action_space.shape))
    rollout(envs, actions[:5])
    inner = envs.unwrapped
    state = inner.get_state()
    first = rollout(envs, actions)
    inner.set_state(pickle.loads(pickle.dumps(state)))
    assert_equal(rollout(envs, actions), first)
    other = gymnasium.make_vec(name, num_envs=5, max_episode_steps=12, **settings(name))
    other.unwrapped.set_state(state)
    assert_equal(rollout(other, actions), first)


@pytest.mark.parametrize("name", IDS)
def test_a_single_environment_goes_on_from_its_state_and_from_one_of_a_vector(name):
    env = gymnasium.make(name, disable_env_checker=True, **settings(name)).unwrapped
    env.reset(seed=3)
    actions = np.random.default_rng(0).uniform(-1, 1, (6, *env.action_space.shape))
    rollout(env, actions)
    state = env.get_state()
    first = [*rollout(env, actions), env.reset()[0], *rollout(env, actions)]
    env.set_state(state)
    assert_equal([*rollout(env, actions), env.reset()[0], *rollout(env, actions)], first)
    envs = gymnasium.make_vec(name, num_envs=4, **settings(name)).unwrapped
    envs.reset(seed=0)
    before = rollout(copy.deepcopy(envs), np.repeat(actions[:, None], 4, axis=1))
    envs.set_state(state, envs=[2])
    together = rollout(envs, np.repeat(actions[:, None], 4, axis=1))
    alone = first[: len(together)]
    for one, own, old in zip(together, alone, before, strict=True):
        np.testing.assert_array_equal(one[2], own)
        np.testing.assert_array_equal(one[[0, 1, 3]], old[[0, 1, 3]])
    envs.set_state(envs.get_state()[2])
    for one in rollout(envs, np.repeat(actions[:, None], 4, axis=1)):
        np.testing.assert_array_equal(one, np.repeat(one[:1], 4, axis=0))


def test_an_environment_that_estimates_goes_on_with_its_estimates():
    envs = gymnasium.make_vec("MagRod/Circle-v0", num_envs=2, observe="estimate", num_elements=3).unwrapped
    envs.reset(seed=0)
    actions = np.random.default_rng(0).uniform(-0.3, 0.3, (5, *envs.action_space.shape))
    rollout(envs, actions)
    state = envs.get_state()
    first = rollout(envs, actions)
    envs.set_state(state)
    assert_equal(rollout(envs, actions), first)


def test_what_is_no_state_or_of_another_make_is_refused():
    envs = gymnasium.make_vec("MagRod/Circle-v0", num_envs=3).unwrapped
    with pytest.raises(ResetNeeded):
        envs.get_state()
    envs.reset(seed=0)
    state = envs.get_state()
    for given, where, sentence in (
        ({}, None, "state must be what get_state.. returned"),
        (state[:2], None, "state must be of one environment or of 3, but is of 2"),
        (state, [0, 0, 1], "envs must be different indices"),
        (state[0], [3], "envs must be different indices"),
    ):
        with pytest.raises(ValueError, match=sentence):
            envs.set_state(given, envs=where)
    other = gymnasium.make_vec("MagRod/Circle-v0", num_envs=3, radius=10e-3).unwrapped
    with pytest.raises(ValueError, match="their targets differs"):
        other.set_state(state)
