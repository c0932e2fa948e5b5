"""Long runs under hard driving: what an untrained policy does must not blow up a rod at the default settings."""

import numpy as np
import pytest
from rollouts import EVERYTHING_VARIES

from magrod_env.envs import MagRodVectorEnv
from magrod_env.envs.vector import OBSERVATION_BOUND
from magrod_env.registration import IDS

pytestmark = pytest.mark.filterwarnings("error")


def diverged(settings, num_envs, steps, kind, seed=0):
    """Number of rods that diverged under random actions; checks the results of every step on the way."""
    batch = MagRodVectorEnv(**settings, num_envs=num_envs)
    batch.reset(seed=seed)
    random, count = np.random.default_rng(seed), 0
    for _ in range(steps):
        actions = random.uniform(-1.0, 1.0, batch.action_space.shape)
        observations, rewards, terminated, _, info = batch.step(np.sign(actions) if kind == "bang-bang" else actions)
        assert observations in batch.observation_space
        assert np.isfinite(rewards).all()
        assert not info["saturated"].any()
        assert np.isfinite(info["tip_error"][~terminated]).all()
        count += int(terminated.sum())
    return count


@pytest.mark.parametrize("kind", ["uniform", "bang-bang"])
@pytest.mark.parametrize("name", IDS)
def test_no_rod_diverges_under_random_actions(name, kind):
    """6 s of 64 rods, full reversals of the field included."""
    assert diverged(IDS[name][0], 64, 300, kind) == 0


@pytest.mark.parametrize("name", [name for name in IDS if name != "MagRod/TwoMagnet-v0"])
def test_no_randomised_rod_diverges_under_random_actions(name):
    settings = IDS[name][0] | {"randomization": EVERYTHING_VARIES}
    assert diverged(settings, 32, 150, "bang-bang") == 0


@pytest.mark.parametrize("rate", [10.0, 200.0])
def test_no_rod_diverges_at_another_control_rate(rate):
    assert diverged({"task": "circle", "control_rate": rate}, 16, 100, "bang-bang") == 0


@pytest.mark.parametrize("name", IDS)
def test_no_entry_of_an_observation_is_often_cut_off(name):
    """Under uniform actions, what an untrained policy does, each entry lies within the bounds 98 % of the time."""
    batch = MagRodVectorEnv(**IDS[name][0], num_envs=16)
    batch.reset(seed=0)
    random, cut = np.random.default_rng(0), []
    for _ in range(60):
        observations = batch.step(random.uniform(-1.0, 1.0, batch.action_space.shape))[0]
        values = observations["observation"] if isinstance(observations, dict) else observations
        cut.append(np.abs(values) >= OBSERVATION_BOUND)
    assert np.mean(cut, axis=(0, 1)).max() < 0.02
