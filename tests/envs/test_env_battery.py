"""What Gymnasium and its users expect of any environment, over every registered id, with warnings as errors."""

import copy
import pickle

import gymnasium
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env
from gymnasium.vector import AutoresetMode, VectorEnv
from gymnasium.wrappers import RecordEpisodeStatistics, TimeLimit
from gymnasium.wrappers.vector import RecordEpisodeStatistics as VectorRecordEpisodeStatistics
from rollouts import arrays_in, assert_same, copy_of, run, scripted_actions

import magrod_env
from magrod_env.registration import IDS, register_all

pytestmark = pytest.mark.filterwarnings("error")

every_id = pytest.mark.parametrize("name", IDS)
INFO = {
    "tip_error": ((), np.float64),
    "is_success": ((), np.bool_),
    "field_applied": ((3,), np.float64),
    "saturated": ((), np.bool_),
    "diverged": ((), np.bool_),
    "tip_position": ((3,), np.float64),
    "target": ((3,), np.float64),
}


@every_id
def test_gymnasiums_check_env(name):
    check_env(gymnasium.make(name, render_mode="rgb_array").unwrapped)


@every_id
def test_gymnasiums_check_env_with_an_estimate(name):
    check_env(gymnasium.make(name, observe="estimate").unwrapped)


@every_id
def test_wrapped_environment_steps_without_a_warning(name):
    """gym.make adds the passive checker, order enforcement and the time limit of the id."""
    env = gymnasium.make(name)
    env.reset(seed=0)
    for action in scripted_actions(env.action_space, 5, overdrive=1.0):
        observation, reward, terminated, truncated, info = env.step(action)
        assert observation in env.observation_space
        assert type(reward) is float and type(terminated) is bool and type(truncated) is bool
    assert env.spec.max_episode_steps == IDS[name][1]


@every_id
def test_episode_is_truncated_at_the_ids_limit(name):
    """Holding still, every episode lasts as long as the id says, single and vector."""
    limit = IDS[name][1]
    env, batch = gymnasium.make(name), gymnasium.make_vec(name, num_envs=2)
    env.reset(seed=0), batch.reset(seed=0)
    still = np.zeros(env.action_space.shape, np.float32)
    for step in range(1, limit + 1):
        _, _, terminated, truncated, _ = env.step(still)
        _, _, ended, cut, _ = batch.step(np.zeros(batch.action_space.shape, np.float32))
        assert (terminated, truncated) == (False, step == limit)
        assert (ended.tolist(), cut.tolist()) == ([False] * 2, [step == limit] * 2)


@every_id
def test_vector_environment_keeps_gymnasiums_conventions(name):
    num_envs = 3
    batch = gymnasium.make_vec(name, num_envs=num_envs)
    single = gymnasium.make(name)
    assert isinstance(batch, VectorEnv) and batch.num_envs == num_envs
    assert batch.spec.id == name
    assert batch.metadata["autoreset_mode"] is AutoresetMode.NEXT_STEP
    assert batch.single_observation_space == single.observation_space
    assert batch.single_action_space == single.action_space
    assert batch.observation_space == gymnasium.vector.utils.batch_space(single.observation_space, num_envs)
    assert batch.action_space == gymnasium.vector.utils.batch_space(single.action_space, num_envs)
    observations, info = batch.reset(seed=0)
    assert observations in batch.observation_space
    for actions in scripted_actions(batch.action_space, 3, overdrive=1.0):
        observations, rewards, terminated, truncated, info = batch.step(actions)
        assert observations in batch.observation_space
        assert rewards.shape == terminated.shape == truncated.shape == (num_envs,)
        assert rewards.dtype == np.float64 and terminated.dtype == truncated.dtype == np.bool_
        check_infos(info, num_envs)
    batch.close()


def check_infos(info, num_envs):
    """Every key has a mask of the environments that it is about."""
    values = {key for key in info if not key.startswith("_")}
    assert {f"_{key}" for key in values} == {key for key in info if key.startswith("_")}
    assert set(INFO) <= values
    for key, (shape, dtype) in INFO.items():
        assert info[key].shape == (num_envs, *shape) and info[key].dtype == dtype, key
    for key in values:
        assert info[f"_{key}"].dtype == np.bool_ and info[f"_{key}"].tolist() == [True] * num_envs, key


@every_id
def test_info_of_a_single_environment_holds_python_numbers(name):
    env = gymnasium.make(name)
    _, first = env.reset(seed=0)
    info = env.step(env.action_space.sample())[4]
    assert set(first) == set(info)
    for key, (shape, dtype) in INFO.items():
        if shape:
            assert info[key].shape == shape and info[key].dtype == dtype
        else:
            assert type(info[key]) is (bool if dtype is np.bool_ else float), key


@every_id
def test_native_vector_equals_sync_bitwise(name):
    """make_vec gives the same rows whichever way it makes them."""
    native = gymnasium.make_vec(name, num_envs=3)
    sync = gymnasium.make_vec(name, num_envs=3, vectorization_mode="sync")
    assert type(native).__name__ == "MagRodVectorEnv" and type(sync).__name__ == "SyncVectorEnv"
    actions = scripted_actions(native.action_space, 25, overdrive=1.0)
    for k, (got, want) in enumerate(zip(run(native, actions, 4), run(sync, actions, 4), strict=True)):
        assert_same(got, want, f"{name} {k}")


@every_id
def test_same_seed_repeats_and_another_differs(name):
    env = gymnasium.make(name)
    actions = scripted_actions(env.action_space, 10)
    first, again, other = (copy_of(run(env, actions, seed)) for seed in (3, 3, 4))
    assert_same(again, first)
    assert not np.array_equal(first[0][1]["target"], other[0][1]["target"])


@every_id
def test_spaces_are_seeded_apart_from_the_episodes(name):
    """Drawing from the action space does not disturb the environment's random numbers."""
    env = gymnasium.make(name).unwrapped
    env.reset(seed=5)
    want = env.reset()
    env.reset(seed=5)
    env.action_space.seed(0)
    env.action_space.sample(), env.observation_space.sample()
    assert_same(env.reset(), want)


@every_id
@pytest.mark.parametrize("vector", [False, True], ids=["single", "vector"])
@pytest.mark.parametrize(
    "clone", [lambda env: pickle.loads(pickle.dumps(env)), copy.deepcopy], ids=["pickle", "deepcopy"]
)
def test_copy_in_mid_episode_goes_on_with_the_same_bits(name, vector, clone):
    """Also over the next resets, and without either copy touching the other."""
    env = gymnasium.make_vec(name, num_envs=2) if vector else gymnasium.make(name)
    actions = scripted_actions(env.action_space, 8)
    run(env, actions[:4], 9)
    twin = clone(env)
    before = copy_of([env.step(action) for action in actions[4:]] + [env.reset()])
    after = [twin.step(action) for action in actions[4:]] + [twin.reset()]
    assert_same(after, before)


@every_id
def test_copy_of_a_fresh_environment_can_be_used(name):
    env = pickle.loads(pickle.dumps(gymnasium.make(name)))
    assert_same(env.reset(seed=2), gymnasium.make(name).reset(seed=2))


@every_id
@pytest.mark.parametrize("mode", ["single", "NextStep", "SameStep"])
def test_nothing_handed_out_changes_later_or_is_shared(name, mode):
    """Observations, rewards, ends and infos are the caller's own: later steps and resets leave them alone."""
    if mode == "single":
        env = TimeLimit(gymnasium.make(name).unwrapped, 4)
    else:
        env = gymnasium.make_vec(name, num_envs=2, max_episode_steps=4, autoreset_mode=mode)
    results = run(env, scripted_actions(env.action_space, 10), 1)
    kept = copy_of(results)
    results += [env.step(env.action_space.sample()), env.reset(), env.step(env.action_space.sample())]
    assert_same(results[: len(kept)], kept)
    handed = [arrays_in(result) for result in results]
    for i, these in enumerate(handed):
        for j, those in enumerate(handed[:i]):
            assert not any(np.shares_memory(a, b) for a in these for b in those), (i, j)


@every_id
@pytest.mark.parametrize("vector", [False, True], ids=["single", "vector"])
def test_what_a_caller_writes_into_results_and_actions_has_no_effect(name, vector):
    """A wrapper may normalise observations or reuse its array of actions in place."""
    env, twin = (gymnasium.make_vec(name, num_envs=2) if vector else gymnasium.make(name) for _ in range(2))
    env.reset(seed=1), twin.reset(seed=1)
    reused = np.zeros(env.action_space.shape, np.float32)
    for action in scripted_actions(env.action_space, 4):
        reused[...] = action
        results, want = env.step(reused), copy_of(twin.step(action))
        assert_same(results, want)
        reused[...] = np.nan
        for array in arrays_in(results):
            array[...] = 0
    if vector:
        mask = np.array([True, False])
        got, want = (one.reset(options={"reset_mask": mask.copy()}) for one in (env, twin))
        assert_same(got, want)


@every_id
def test_record_episode_statistics(name):
    env = RecordEpisodeStatistics(TimeLimit(gymnasium.make(name).unwrapped, 5))
    env.reset(seed=0)
    rewards = []
    for action in scripted_actions(env.action_space, 5):
        _, reward, _, truncated, info = env.step(action)
        rewards.append(reward)
    assert truncated
    assert info["episode"]["l"] == 5
    assert info["episode"]["r"] == pytest.approx(sum(rewards))


@every_id
@pytest.mark.parametrize("mode", ["NextStep", "SameStep"])
def test_vector_record_episode_statistics(name, mode):
    """Two episodes of each environment: their lengths and returns."""
    batch = VectorRecordEpisodeStatistics(
        gymnasium.make_vec(name, num_envs=3, max_episode_steps=5, autoreset_mode=mode)
    )
    batch.reset(seed=0)
    every = 6 if mode == "NextStep" else 5  # the step of a next-step reset belongs to no episode
    sums, seen = np.zeros(3), 0
    for actions in scripted_actions(batch.action_space, 2 * every):
        _, rewards, _, truncated, info = batch.step(actions)
        sums += rewards
        if truncated.any():
            np.testing.assert_array_equal(info["episode"]["l"], [5, 5, 5])
            np.testing.assert_allclose(info["episode"]["r"], sums, rtol=1e-12)  # summed in the same order
            sums, seen = np.zeros(3), seen + 1
    assert seen == 2


@every_id
def test_environments_do_not_disturb_each_other(name):
    """Two of a kind in one process, in turns: each does what it does alone."""
    env, other = gymnasium.make(name), gymnasium.make(name)
    actions = scripted_actions(env.action_space, 6)
    want = copy_of(run(env, actions, 0))
    got = [env.reset(seed=0)]
    other.reset(seed=1)
    for action in actions:
        got.append(env.step(action))
        other.step(-action)
    assert_same(got, want)


@every_id
def test_vector_environment_before_its_first_reset(name):
    """As single ones under gym.make: a step or a partial reset before the first reset is refused."""
    batch = gymnasium.make_vec(name, num_envs=2)
    with pytest.raises(gymnasium.error.ResetNeeded):
        batch.step(np.zeros(batch.action_space.shape, np.float32))
    with pytest.raises(gymnasium.error.ResetNeeded):
        batch.reset(options={"reset_mask": np.array([True, False])})
    batch.close()


def test_registering_twice_is_silent():
    register_all()
    assert set(IDS) <= set(gymnasium.registry)
    assert all(name.startswith("MagRod/") and name.endswith("-v0") for name in IDS)


def test_make_takes_the_arguments_of_an_environment():
    env = gymnasium.make("MagRod/Circle-v0", num_elements=3, axes="xyz", max_episode_steps=2)
    assert env.action_space.shape == (3,)
    env.reset(seed=0)
    assert [env.step(np.zeros(3, np.float32))[3] for _ in range(2)] == [False, True]
    batch = gymnasium.make_vec("MagRod/Circle-v0", num_envs=2, num_elements=3, max_episode_steps=2)
    batch.reset(seed=0)
    assert [batch.step(np.zeros((2, 2), np.float32))[3].tolist() for _ in range(2)] == [[False] * 2, [True] * 2]


def test_spec_remakes_the_environment():
    env = gymnasium.make("MagRod/Path-v0", path="square", num_elements=3)
    again = gymnasium.make(env.spec)
    assert_same(again.reset(seed=1), env.reset(seed=1))
    spec = type(env.spec).from_json(env.spec.to_json())
    assert_same(gymnasium.make(spec).reset(seed=1), env.reset(seed=1))


def test_public_names_exist():
    assert set(magrod_env.__all__) <= set(dir(magrod_env))
