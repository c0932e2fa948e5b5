"""Stable-Baselines3 takes the environments: its checker, its vector environments and hindsight replay."""

import warnings

import gymnasium
import numpy as np
import pytest
from rollouts import FEW

from magrod_env.envs import MagRodEnv
from magrod_env.registration import IDS

with warnings.catch_warnings():  # what the libraries say of each other on import is not about this package
    warnings.simplefilter("ignore")
    stable_baselines3 = pytest.importorskip("stable_baselines3")
    from stable_baselines3.common import env_checker, vec_env

pytestmark = pytest.mark.filterwarnings("error")


@pytest.mark.parametrize("name", IDS)
def test_stable_baselines_check_env(name):
    env_checker.check_env(gymnasium.make(name).unwrapped)


@pytest.mark.parametrize("name", IDS)
def test_dummy_vector_environment_steps(name):
    """Over the end of an episode: its last observation and its truncation are in the info."""
    arguments = IDS[name][0] | {"num_elements": FEW[IDS[name][0]["task"]]}
    envs = vec_env.DummyVecEnv([lambda: gymnasium.wrappers.TimeLimit(MagRodEnv(**arguments), 4)] * 2)
    envs.seed(0)
    envs.reset()
    for step in range(1, 7):
        _, rewards, ends, infos = envs.step(np.zeros((2, *envs.action_space.shape), np.float32))
        assert rewards.shape == (2,) and ends.tolist() == [step == 4] * 2
        assert ("terminal_observation" in infos[0]) == (step == 4)
        assert infos[0]["TimeLimit.truncated"] == (step == 4)


def tiny(algorithm, policy, envs, **arguments):
    return algorithm(policy, envs, policy_kwargs={"net_arch": [16]}, seed=0, device="cpu", **arguments)


def test_hindsight_replay_learns_from_relabelled_goals():
    """A few hundred steps of SAC; the rewards in the buffer are those that `compute_reward` gives."""
    env = gymnasium.make("MagRod/ReachGoal-v0", num_elements=3, max_episode_steps=25)
    model = tiny(
        stable_baselines3.SAC,
        "MultiInputPolicy",
        env,
        learning_starts=50,
        batch_size=32,
        train_freq=8,
        gradient_steps=2,
        buffer_size=1000,
        replay_buffer_class=stable_baselines3.HerReplayBuffer,
        replay_buffer_kwargs={"n_sampled_goal": 4, "goal_selection_strategy": "future"},
    )
    model.learn(200)
    batch = model.replay_buffer.sample(256)
    achieved = batch.next_observations["achieved_goal"].numpy()
    desired = batch.next_observations["desired_goal"].numpy()
    rewards = batch.rewards.numpy().ravel()
    distance = np.linalg.norm(achieved - desired, axis=1)
    clear = np.abs(distance - 1e-3) > 1e-6  # the sampled goals are float32
    np.testing.assert_array_equal(rewards[clear], -(distance > 1e-3)[clear].astype(float))
    assert np.any(rewards == 0.0) and np.any(rewards == -1.0)  # relabelled goals are reached


def test_policy_gradient_runs_over_the_end_of_an_episode():
    env = gymnasium.make("MagRod/Circle-v0", num_elements=3, max_episode_steps=20)
    model = tiny(stable_baselines3.PPO, "MlpPolicy", env, n_steps=32, batch_size=32, n_epochs=1)
    model.learn(64)
    action, _ = model.predict(env.reset(seed=0)[0])
    assert action in env.action_space
