"""Rewards, errors and flags against their documented formulas."""

import numpy as np
import pytest
from rollouts import FEW, scripted_actions

from magrod_env.envs import MagRodEnv, MagRodVectorEnv
from magrod_env.registration import IDS

pytestmark = pytest.mark.filterwarnings("error")

DENSE = {name: arguments for name, (arguments, _) in IDS.items() if not arguments.get("goal")}
LENGTH = {"two_magnet": 85.5e-3}  # m; the other scenes have one rod
TERMS = ("tracking", "precision", "effort", "smoothness")


def errors_of(info):
    """Distance of each tracked point from its target, as the info has it."""
    return np.array([info["tip_error"]] + ([info["middle_error"]] if "middle_error" in info else []))


def holding_action(env, info):
    """The action that keeps up the field of the start."""
    axes = ["xyz".index(axis) for axis in env.core.coils.axes]
    return info["field_applied"][axes] / env.core.actuator.limit


@pytest.mark.parametrize("name", DENSE)
def test_terms_follow_their_formulas_and_sum_to_the_reward(name):
    """From the info and the actions alone; an action beyond the limits counts as what the coils made of it."""
    env = MagRodEnv(**DENSE[name])
    _, info = env.reset(seed=3)
    length = LENGTH.get(DENSE[name]["task"], 60.55e-3)
    last = holding_action(env, info)  # counts as the action before the first
    for action in scripted_actions(env.action_space, 30).astype(float):
        _, reward, _, _, info = env.step(action)
        distance, clipped = errors_of(info).mean(), np.clip(action, -1.0, 1.0)
        want = {
            "tracking": -min(distance / (0.1 * length), 10.0),
            "precision": np.exp(-distance / 1e-3),
            "effort": -0.01 * np.sum(clipped**2),
            "smoothness": -0.05 * np.sum((clipped - last) ** 2),
        }
        for term in TERMS:
            np.testing.assert_allclose(info[f"reward_{term}"], want[term], rtol=1e-12, atol=1e-15, err_msg=term)
        np.testing.assert_allclose(reward, sum(info[f"reward_{term}"] for term in TERMS), rtol=1e-14)
        last = clipped


@pytest.mark.parametrize("name", DENSE)
def test_terms_of_a_batch_sum_to_its_rewards(name):
    batch = MagRodVectorEnv(**DENSE[name], num_envs=4, max_episode_steps=7)
    info = batch.reset(seed=0)[1]
    assert all(np.all(info[f"reward_{term}"] == 0.0) for term in TERMS)
    for actions in scripted_actions(batch.action_space, 16):
        _, rewards, _, _, info = batch.step(actions)
        np.testing.assert_allclose(rewards, sum(info[f"reward_{term}"] for term in TERMS), rtol=1e-14)


@pytest.mark.parametrize("name", IDS)
def test_tip_error_is_the_distance_from_the_target(name):
    """Between the true positions, not the camera's."""
    env = MagRodEnv(**IDS[name][0])
    infos = [env.reset(seed=1)[1]] + [env.step(action)[4] for action in scripted_actions(env.action_space, 10)]
    for info in infos:
        want = np.linalg.norm(info["tip_position"] - info["target"])
        np.testing.assert_allclose(info["tip_error"], want, rtol=1e-12, atol=1e-16)


def test_two_magnets_have_an_error_each():
    env = MagRodEnv("two_magnet")
    infos = [env.reset(seed=1)[1]] + [env.step(action)[4] for action in scripted_actions(env.action_space, 20)]
    assert all("middle_error" in info for info in infos)
    assert infos[-1]["middle_error"] != infos[-1]["tip_error"]
    assert "middle_error" not in MagRodEnv("circle").reset(seed=0)[1]


def still_errors(success_distance, task="circle", **settings):
    """Infos of a rod that is first on its target and then left behind."""
    env = MagRodEnv(task, num_elements=FEW[task], success_distance=success_distance, **settings)
    info = env.reset(seed=0)[1]
    hold = holding_action(env, info)
    return [info] + [env.step(hold)[4] for _ in range(20)]


@pytest.mark.parametrize("distance", [1e-3, 5e-3, 15e-3])
def test_success_means_within_the_distance(distance):
    infos = still_errors(distance)
    assert [info["is_success"] for info in infos] == [info["tip_error"] <= distance for info in infos]
    assert infos[0]["is_success"] and not infos[-1]["is_success"]


def test_success_with_two_magnets_is_about_their_mean_error():
    infos = still_errors(1e-3, "two_magnet")
    assert [info["is_success"] for info in infos] == [errors_of(info).mean() <= 1e-3 for info in infos]
    assert infos[0]["is_success"] and not infos[-1]["is_success"]


def goal_env(**settings):
    return MagRodEnv("reach", goal=True, num_elements=3, success_distance=8e-3, **settings)


def test_compute_reward_equals_the_steps_reward():
    """Also for a whole batch of goals at once, as hindsight replay asks for them."""
    env = goal_env()
    achieved, desired, rewards = [], [], []
    for seed in range(6):
        observation, _ = env.reset(seed=seed)
        target = observation["desired_goal"]
        for action in scripted_actions(env.action_space, 15, seed):
            observation, reward, _, _, info = env.step(action)
            assert env.compute_reward(observation["achieved_goal"], observation["desired_goal"], info) == reward
            np.testing.assert_array_equal(observation["desired_goal"], target)
            np.testing.assert_array_equal(observation["achieved_goal"], info["tip_position"])
            np.testing.assert_array_equal(observation["desired_goal"], info["target"])
            assert (reward == 0.0) == info["is_success"]
            achieved.append(observation["achieved_goal"]), desired.append(target), rewards.append(reward)
    assert set(rewards) == {-1.0, 0.0}  # both cases are met
    batched = env.compute_reward(np.array(achieved), np.array(desired), np.array([{}] * len(achieved)))
    assert batched.dtype == np.float64
    np.testing.assert_array_equal(batched, rewards)
    grid = env.compute_reward(np.array(achieved)[:, None], np.array(desired)[None], {})
    assert grid.shape == (90, 90)
    np.testing.assert_array_equal(np.diag(grid), rewards)


def test_compute_reward_of_two_points_takes_their_mean_distance():
    env = MagRodEnv("two_magnet", goal=True, num_elements=3, success_distance=1e-3)
    goal = np.zeros(6)
    near, far = goal.copy(), goal.copy()
    near[0], far[0] = 1.9e-3, 2.1e-3
    np.testing.assert_array_equal(env.compute_reward(np.array([near, far]), np.array([goal, goal]), {}), [0.0, -1.0])


def test_vector_goal_environment_gives_the_same_rewards():
    batch, env = MagRodVectorEnv("reach", 5, goal=True, num_elements=3, success_distance=8e-3), goal_env()
    batch.reset(seed=0)
    for actions in scripted_actions(batch.action_space, 12):
        observations, rewards, _, _, info = batch.step(actions)
        want = env.compute_reward(observations["achieved_goal"], observations["desired_goal"], info)
        np.testing.assert_array_equal(rewards, want)
        np.testing.assert_array_equal(rewards == 0.0, info["is_success"])


def test_goal_environment_has_no_terms_of_another_reward():
    """Terms in the info always sum to the reward: the sparse reward has none."""
    env = goal_env()
    env.reset(seed=0)
    _, reward, _, _, info = env.step(np.zeros(2))
    terms = [value for key, value in info.items() if key.startswith("reward_")]
    assert not terms or sum(terms) == reward


def test_camera_noise_changes_what_is_seen_and_not_what_is_paid():
    from magrod_env.envs import Camera

    clear, noisy = MagRodEnv("reach", num_elements=3), MagRodEnv("reach", num_elements=3, camera=Camera(noise=1e-3))
    clear.reset(seed=0), noisy.reset(seed=0)
    for action in scripted_actions(clear.action_space, 5):
        want, got = clear.step(action), noisy.step(action)
        assert got[1] == want[1] and got[4]["tip_error"] == want[4]["tip_error"]
        assert not np.array_equal(got[0], want[0])
