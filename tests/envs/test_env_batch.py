"""The native batch does what Gymnasium's vector environment does with single ones: same bits, same conventions."""

import numpy as np
import pytest
from gymnasium.vector import AutoresetMode
from rollouts import VARIANTS, assert_same, oracle, scripted_actions

from magrod_env.envs import MagRodVectorEnv

pytestmark = pytest.mark.filterwarnings("error")


def lanes(settings):
    return 16 if settings.get("precision") == "float32" else 8


@pytest.mark.parametrize("mode", ["NextStep", "SameStep"])
@pytest.mark.parametrize("variant", VARIANTS)
def test_batch_equals_single_bitwise(variant, mode):
    """Observations, rewards, ends and infos over three episodes; the last lane block is only partly used."""
    settings, num_envs = VARIANTS[variant], lanes(VARIANTS[variant]) + 1
    batch = MagRodVectorEnv(**settings, num_envs=num_envs, max_episode_steps=6, autoreset_mode=mode)
    want = oracle(settings, num_envs, 6, mode)
    assert_same(batch.reset(seed=7), want.reset(seed=7), "reset")
    ended = 0
    for k, actions in enumerate(scripted_actions(batch.action_space, 17)):
        got = batch.step(actions)
        assert_same(got, want.step(actions), f"step {k}")
        ended += int((got[2] | got[3]).sum())
    assert ended == 2 * num_envs


@pytest.mark.parametrize("mode", ["NextStep", "SameStep", "Disabled"])
@pytest.mark.parametrize("variant", ["camera", "randomised", "goal"])
def test_partial_reset_equals_gymnasiums(variant, mode):
    """`reset_mask` restarts only its environments; their streams go on, and the others' observations stay."""
    settings, num_envs = VARIANTS[variant], 9
    batch = MagRodVectorEnv(**settings, num_envs=num_envs, max_episode_steps=8, autoreset_mode=mode)
    want = oracle(settings, num_envs, 8, mode)
    assert_same(batch.reset(seed=3), want.reset(seed=3))
    actions = scripted_actions(batch.action_space, 12)
    mask = np.arange(num_envs) % 3 == 1
    for k in range(4):
        assert_same(batch.step(actions[k]), want.step(actions[k]), f"step {k}")
    assert_same(
        batch.reset(options={"reset_mask": mask.copy()}), want.reset(options={"reset_mask": mask.copy()}), "mask"
    )
    for k in range(4, 8):
        got = batch.step(actions[k])
        assert_same(got, want.step(actions[k]), f"step {k}")
    assert got[3].tolist() == (~mask).tolist()
    ended = ~mask
    if mode == "Disabled":
        assert_same(batch.reset(options={"reset_mask": ended.copy()}), want.reset(options={"reset_mask": ended.copy()}))
    for k in range(8, 11):
        assert_same(batch.step(actions[k]), want.step(actions[k]), f"step {k}")


def test_reset_with_seeds_for_some_environments_equals_gymnasiums():
    settings = VARIANTS["camera"]
    batch, want = MagRodVectorEnv(**settings, num_envs=3), oracle(settings, 3, None)
    assert_same(batch.reset(seed=[5, 5, 9]), want.reset(seed=[5, 5, 9]))
    actions = scripted_actions(batch.action_space, 6)
    for action in actions[:3]:
        assert_same(batch.step(action), want.step(action))
    assert_same(batch.reset(seed=[None, 4, None]), want.reset(seed=[None, 4, None]))
    for action in actions[3:]:
        assert_same(batch.step(action), want.step(action))


def test_masked_reset_with_a_seed_equals_gymnasiums():
    """Only the environments that are reset take their seed."""
    settings = VARIANTS["camera"]
    batch, want = MagRodVectorEnv(**settings, num_envs=3), oracle(settings, 3, None)
    mask = np.array([False, True, False])
    for env in (batch, want):
        env.reset(seed=1)
    assert_same(
        batch.reset(seed=50, options={"reset_mask": mask.copy()}),
        want.reset(seed=50, options={"reset_mask": mask.copy()}),
    )
    for action in scripted_actions(batch.action_space, 4):
        assert_same(batch.step(action), want.step(action))
    assert_same(batch.reset(), want.reset())


def test_streams_go_on_without_a_seed():
    """reset() without a seed draws new episodes, the same new ones after the same seed."""
    batch = MagRodVectorEnv("reach", 4, num_elements=3)
    first, again = batch.reset(seed=11), batch.reset()
    assert not np.any(np.all(first[1]["target"] == again[1]["target"], axis=1))
    assert_same(batch.reset(seed=11), first)
    assert_same(batch.reset(), again)


@pytest.mark.parametrize("seed", [None, [None] * 6], ids=["no seed", "seeds of None"])
def test_environments_differ_without_a_seed(seed):
    """Without any seed, every environment and every batch has a stream of its own."""
    targets = []
    for _ in range(2):
        targets.append(MagRodVectorEnv("reach", 6, num_elements=3).reset(seed=seed)[1]["target"])
    assert len(np.unique(np.concatenate(targets), axis=0)) == 12


def test_different_seeds_differ_and_equal_ones_repeat():
    batch = MagRodVectorEnv("reach", 64, num_elements=3)
    observations, info = batch.reset(seed=0)
    assert len(np.unique(info["target"], axis=0)) == 64
    shifted = batch.reset(seed=1)[1]
    np.testing.assert_array_equal(shifted["target"][:-1], info["target"][1:])


def test_batch_size_and_threads_do_not_change_a_row():
    """Row i does not depend on how many rows there are, nor on how many threads share them."""
    settings = VARIANTS["randomised"]
    large = MagRodVectorEnv(**settings, num_envs=70, num_threads=3)
    small = MagRodVectorEnv(**settings, num_envs=3, num_threads=1)
    assert_same(large.reset(seed=5)[0][:3], small.reset(seed=5)[0])
    for actions in scripted_actions(large.action_space, 5):
        got, want = large.step(actions), small.step(actions[:3])
        assert_same(got[0][:3], want[0])
        assert_same(got[1][:3], want[1])


def test_disabled_autoreset_leaves_ended_episodes_alone():
    batch = MagRodVectorEnv("reach", 3, num_elements=3, max_episode_steps=4, autoreset_mode="Disabled")
    assert batch.metadata["autoreset_mode"] is AutoresetMode.DISABLED
    targets = batch.reset(seed=0)[1]["target"]
    for actions in scripted_actions(batch.action_space, 4):
        _, _, terminated, truncated, info = batch.step(actions)
    assert truncated.all() and not terminated.any()
    np.testing.assert_array_equal(info["target"], targets)
    assert "final_obs" not in info and "final_info" not in info


def test_truncation_takes_as_many_steps_as_the_limit_says():
    batch = MagRodVectorEnv("reach", 2, num_elements=3, max_episode_steps=3)
    batch.reset(seed=0)
    ends = [batch.step(actions)[3].tolist() for actions in scripted_actions(batch.action_space, 12)]
    assert [row[0] for row in ends] == [False, False, True, False] * 3
