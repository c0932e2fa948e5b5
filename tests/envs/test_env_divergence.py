"""A rod that leaves the range of its numbers ends its own episode, says so, and disturbs nothing else."""

import numpy as np
import pytest
from gymnasium.error import ResetNeeded
from rollouts import EVERYTHING_VARIES, NOISY, assert_same, oracle, scripted_actions

from magrod_env.envs import MagRodEnv, MagRodVectorEnv
from magrod_env.registration import IDS
from magrod_env.rod.energy import NOT_FINITE

pytestmark = pytest.mark.filterwarnings("error")

SICK, NUM_ENVS = 3, 9


def poison(core, i, what="velocity", value=np.nan):
    """Put a number into the state of one rod, at its first free node."""
    batch = core.batch
    row = batch.layout.nodes + batch.node_rows.size + getattr(batch.node_rows, what)
    batch.rows[i // batch.width, row, i % batch.width] = value


def finite(observation):
    values = observation.values() if isinstance(observation, dict) else [observation]
    return all(np.isfinite(value).all() for value in values)


def all_finite(value):
    """Every number in what a reset or step has handed out."""
    if isinstance(value, dict):
        value = list(value.values())
    if isinstance(value, (list, tuple)) or (isinstance(value, np.ndarray) and value.dtype == object):
        return all(all_finite(entry) for entry in value if entry is not None)
    return bool(np.isfinite(value).all())


def others(value):
    """What belongs to the healthy environments, of anything with one row for each."""
    if isinstance(value, dict):
        return {key: others(entry) for key, entry in value.items()}
    return np.delete(value, SICK, axis=0)


SETTINGS = {
    "plain": {"task": "circle"},
    "planar": {"task": "planar_reach"},
    "goal": {"task": "reach", "goal": True},
    "camera": {"task": "reach", "camera": NOISY},
    "state": {"task": "circle", "observe": "state"},
    "randomised": {"task": "circle", "randomization": EVERYTHING_VARIES},
}


def pair(settings, mode="NextStep"):
    """Two equal batches in the middle of an episode, one of them with a sick rod."""
    made = []
    for _ in range(2):
        batch = MagRodVectorEnv(**settings, num_envs=NUM_ENVS, num_elements=3, autoreset_mode=mode)
        batch.reset(seed=0)
        for actions in scripted_actions(batch.action_space, 3):
            batch.step(actions)
        made.append(batch)
    poison(made[0].core, SICK)
    return made


@pytest.mark.parametrize("name", SETTINGS)
def test_one_diverged_rod_ends_its_episode_and_no_other(name):
    """Everything about the others keeps its bits, then and after the sick one has begun anew."""
    batch, healthy = pair(SETTINGS[name])
    for k, actions in enumerate(scripted_actions(batch.action_space, 6, seed=1)):
        got, want = batch.step(actions), healthy.step(actions)
        for index in range(5):
            assert_same(others(got[index]), others(want[index]), f"step {k}")
        assert batch.observation_space.contains(got[0]) and finite(got[0]) and np.isfinite(got[1]).all()
        alone = np.arange(NUM_ENVS) == SICK
        np.testing.assert_array_equal(got[2], alone & (k == 0))
        np.testing.assert_array_equal(got[4]["diverged"], alone & (k == 0))
        assert k > 0 or not got[4]["is_success"][SICK]
        assert not got[3].any()


@pytest.mark.parametrize("mode", ["NextStep", "SameStep"])
@pytest.mark.parametrize("name", SETTINGS)
def test_recovery_equals_that_of_single_environments(name, mode):
    """With autoreset, the sick rod's next episode is the one that it would have alone, bit for bit."""
    settings = SETTINGS[name] | {"num_elements": 3}
    batch = MagRodVectorEnv(**settings, num_envs=NUM_ENVS, max_episode_steps=9, autoreset_mode=mode)
    want = oracle(settings, NUM_ENVS, 9, mode)
    batch.reset(seed=0), want.reset(seed=0)
    for k, actions in enumerate(scripted_actions(batch.action_space, 13)):
        if k == 3:
            poison(batch.core, SICK)
            poison(want.envs[SICK].unwrapped.core, 0)
        assert_same(batch.step(actions), want.step(actions), f"step {k}")


def test_same_step_autoreset_hands_out_the_last_of_a_diverged_rod():
    batch, _ = pair(SETTINGS["plain"], "SameStep")
    observations, rewards, terminated, _, info = batch.step(np.zeros((NUM_ENVS, 2)))
    assert terminated.tolist() == (np.arange(NUM_ENVS) == SICK).tolist()
    assert finite(info["final_obs"][SICK]) and info["final_obs"][0] is None
    assert info["final_info"]["diverged"][SICK] and not info["diverged"].any()
    assert info["tip_error"][SICK] < 1e-7  # a fresh start on the path
    assert np.isfinite(observations).all() and np.isfinite(rewards).all()


def test_diverged_rod_pays_the_largest_tracking_cost():
    env = MagRodEnv("circle", num_elements=3)
    hold = env.reset(seed=0)[1]["field_applied"][1:] / 45e-3
    poison(env.core, 0)
    observation, reward, terminated, truncated, info = env.step(hold)
    assert terminated and not truncated and info["diverged"] and not info["is_success"]
    assert info["reward_tracking"] == -10.0 and info["reward_precision"] == 0.0
    np.testing.assert_allclose(reward, -10.0 - 0.01 * hold @ hold, rtol=1e-6)
    assert finite(observation) and observation in env.observation_space
    observation, info = env.reset()
    assert not info["diverged"] and info["tip_error"] < 1e-7
    assert not env.step(hold)[2]


def test_diverged_goal_environment_has_a_finite_goal_and_no_success():
    env = MagRodEnv("reach", goal=True, num_elements=3)
    env.reset(seed=0)
    poison(env.core, 0)
    observation, reward, terminated, _, info = env.step(np.zeros(2))
    assert terminated and info["diverged"] and reward == -1.0
    assert finite(observation) and observation in env.observation_space
    assert env.compute_reward(observation["achieved_goal"], observation["desired_goal"], info) == reward


@pytest.mark.parametrize(
    ("what", "value", "status"),
    [
        ("position", np.nan, NOT_FINITE),
        ("position", np.inf, NOT_FINITE),
        ("rotation", np.nan, NOT_FINITE),
        ("velocity", -np.inf, NOT_FINITE),
        ("momentum", np.nan, NOT_FINITE),
        ("position", 1.0, None),  # a metre away: stretched far beyond a half, and soon not finite
        ("velocity", 1e4, None),
    ],
)
def test_watchdog_sees_every_kind_of_sick_state(what, value, status):
    env = MagRodEnv("reach", num_elements=3)
    env.reset(seed=0)
    poison(env.core, 0, what, value)
    observation, reward, terminated, _, info = env.step(np.zeros(2))
    assert terminated and info["diverged"]
    assert finite(observation) and np.isfinite(reward)
    assert env.core.batch.status[0] == (status or env.core.batch.status[0]) != 0


def test_diverged_rod_stays_diverged_until_it_is_reset():
    env = MagRodEnv("reach", num_elements=3)
    env.reset(seed=0)
    poison(env.core, 0)
    for _ in range(2):
        result = env.step(np.zeros(2))
        assert result[2] and result[4]["diverged"] and all_finite(result)
    assert not env.reset()[1]["diverged"]
    assert not env.step(np.zeros(2))[2]


def test_without_autoreset_a_diverged_rod_must_be_reset_before_the_next_step():
    batch = MagRodVectorEnv("reach", 2, num_elements=3, autoreset_mode="Disabled")
    batch.reset(seed=0)
    poison(batch.core, 1)
    result = batch.step(np.zeros((2, 2)))
    assert result[2].tolist() == result[4]["diverged"].tolist() == [False, True] and all_finite(result)
    with pytest.raises(ResetNeeded, match=r"\[1\].*reset_mask"):
        batch.step(np.zeros((2, 2)))
    mask = np.array([False, True])
    assert not batch.reset(options={"reset_mask": mask})[1]["diverged"][1]
    assert not batch.step(np.zeros((2, 2)))[2].any()


@pytest.mark.parametrize("value", [np.nan, np.inf, 1e30])
@pytest.mark.parametrize("name", IDS)
def test_all_that_is_told_of_a_lost_rod_is_finite(name, value):
    """Its tip counts as lying at the clamp: position, error and achieved goal say the same, and none is a success."""
    env = MagRodEnv(**IDS[name][0])
    env.reset(seed=0)
    poison(env.core, 0, "position", value)
    result = env.step(np.zeros(env.action_space.shape))
    observation, info = result[0], result[4]
    assert info["diverged"] and not info["is_success"] and all_finite(result)
    assert info["tip_position"].tolist() == [0.0, 0.0, 0.0]
    assert info["tip_error"] == pytest.approx(np.linalg.norm(info["target"]), rel=1e-12)
    assert info.get("middle_error", 1.0) > 0.0
    if env.goal:
        assert not observation["achieved_goal"].any()
        assert env.compute_reward(observation["achieved_goal"], observation["desired_goal"], info) == result[1] == -1.0


@pytest.mark.parametrize("mode", ["NextStep", "SameStep", "Disabled"])
@pytest.mark.parametrize("name", IDS)
def test_all_that_a_batch_tells_of_a_lost_rod_is_finite(name, mode):
    batch = MagRodVectorEnv(**IDS[name][0], num_envs=3, autoreset_mode=mode)
    batch.reset(seed=0)
    poison(batch.core, 1)
    result = batch.step(np.zeros(batch.action_space.shape))
    assert result[2].tolist() == [False, True, False] and all_finite(result)
    told = result[4]["final_info"] if mode == "SameStep" else result[4]
    assert told["diverged"].tolist() == [False, True, False]
    assert not told["tip_position"][1].any() and told["tip_position"][[0, 2]].any(axis=1).all()


@pytest.mark.parametrize("vector", [False, True], ids=["single", "vector"])
def test_estimate_of_a_lost_rod_is_told_in_finite_numbers(vector):
    settings = {"task": "circle", "num_elements": 3, "observe": "estimate"}
    env = MagRodVectorEnv(**settings, num_envs=2) if vector else MagRodEnv(**settings)
    env.reset(seed=0)
    poison(env.core, 0)
    result = env.step(np.zeros(env.action_space.shape))
    assert np.ravel(result[4]["diverged"])[0] and all_finite(result)


def test_all_rods_of_a_batch_may_diverge():
    batch = MagRodVectorEnv("reach", 5, num_elements=3)
    batch.reset(seed=0)
    for i in range(5):
        poison(batch.core, i)
    assert batch.step(np.zeros((5, 2)))[2].all()
    assert not batch.step(np.zeros((5, 2)))[2].any()
    assert not batch.step(np.zeros((5, 2)))[2].any()
