"""Shared by the tests of the environments: the scripted actions, the oracle and the bitwise comparison."""

import gymnasium
import numpy as np
from gymnasium.vector import SyncVectorEnv
from gymnasium.wrappers import TimeLimit

from magrod_env.envs import Camera, MagRodEnv, Randomization
from magrod_env.magnetics import Actuator

EVERYTHING_VARIES = Randomization(
    modulus=0.2,
    density=0.1,
    drag=0.3,
    remanence=0.05,
    field_gain=0.05,
    field_misalignment=0.05,
    gravity_direction=0.05,
    initial_field=2e-3,
)
NOISY = Camera(noise=5e-5, rate=25.0, delay=0.06)
SLOW_COILS = Actuator(slew_limit=0.5, lag=0.03, dead_time=0.031)

# Few elements: the same kernels, but they run faster. Two magnets need some, or their coarse elements need tiny steps.
FEW = {"circle": 3, "path": 3, "reach": 3, "planar_reach": 3, "two_magnet": 6}

# What changes the arithmetic of an environment.
VARIANTS = {
    "circle": {"task": "circle", "num_elements": 3},
    "randomised": {"task": "circle", "num_elements": 3, "randomization": EVERYTHING_VARIES},
    "camera": {"task": "reach", "num_elements": 3, "camera": NOISY},
    "slow coils": {"task": "circle", "num_elements": 3, "actuator": SLOW_COILS},
    "dead time": {"task": "circle", "num_elements": 3, "actuator": Actuator(dead_time=0.05)},
    "float32": {"task": "circle", "num_elements": 3, "precision": "float32"},
    "planar": {"task": "planar_reach", "num_elements": 3},
    "planar, randomised": {"task": "planar_reach", "num_elements": 3, "randomization": EVERYTHING_VARIES},
    "state": {"task": "path", "num_elements": 3, "observe": "state"},
    "planar state": {"task": "planar_reach", "num_elements": 3, "observe": "state"},
    "goal": {"task": "reach", "num_elements": 3, "goal": True},
    "two magnets": {"task": "two_magnet", "num_elements": 6},
    "all at once": {
        "task": "circle",
        "num_elements": 3,
        "randomization": EVERYTHING_VARIES,
        "camera": NOISY,
        "actuator": SLOW_COILS,
        "observe": "state",
        "axes": "xyz",
    },
}


def one(settings, steps=None):
    """A single environment, with a time limit where `steps` is given."""
    env = MagRodEnv(**settings)
    return env if steps is None else TimeLimit(env, steps)


def oracle(settings, num_envs, steps, mode="NextStep"):
    """What the native batch must equal: Gymnasium's own vector environment over single ones."""
    return SyncVectorEnv([lambda: one(settings, steps)] * num_envs, autoreset_mode=mode)


def scripted_actions(space, count, seed=0, overdrive=1.3):
    """`count` actions of a space, some beyond what the coils can do."""
    random = np.random.default_rng(seed)
    return random.uniform(-overdrive, overdrive, (count, *space.shape)).astype(np.float32)


def assert_same(got, want, where=""):
    """Same structure, types, shapes and bits (NaN equals NaN); entries that a mask `_key` rules out are ignored."""
    if isinstance(want, dict):
        assert set(got) == set(want), where
        for key, value in want.items():
            mask = want.get(f"_{key}")
            if mask is not None and not isinstance(value, dict):
                assert_same(got[key][mask], value[mask], f"{where}/{key}")
            else:
                assert_same(got[key], value, f"{where}/{key}")
    elif isinstance(want, np.ndarray) and want.dtype == object:
        assert got.shape == want.shape, where
        for i, value in enumerate(want):
            assert_same(got[i], value, f"{where}[{i}]")
    elif isinstance(want, np.ndarray):
        np.testing.assert_array_equal(got, want, err_msg=where, strict=True)
    elif isinstance(want, (tuple, list)):
        assert len(got) == len(want), where
        for i, value in enumerate(want):
            assert_same(got[i], value, f"{where}[{i}]")
    else:
        assert type(got) is type(want), f"{where}: {type(got)} and {type(want)}"
        assert got == want or (got != got and want != want), f"{where}: {got!r} and {want!r}"


def copy_of(value):
    """Deep copy of what an environment handed out."""
    if isinstance(value, dict):
        return {key: copy_of(entry) for key, entry in value.items()}
    if isinstance(value, (tuple, list)):
        return type(value)(copy_of(entry) for entry in value)
    return value.copy() if isinstance(value, np.ndarray) else value


def arrays_in(value):
    """Every array inside something that an environment handed out."""
    if isinstance(value, dict):
        value = list(value.values())
    if isinstance(value, np.ndarray):
        return [value] if value.dtype != object else [found for entry in value for found in arrays_in(entry)]
    return [found for entry in value for found in arrays_in(entry)] if isinstance(value, (tuple, list)) else []


def run(env, actions, seed):
    """Reset and steps of any environment, single or vector, as a list."""
    results = [env.reset(seed=seed)]
    for action in actions:
        results.append(env.step(action))
        if isinstance(env, gymnasium.Env) and (results[-1][2] or results[-1][3]):
            results.append(env.reset())
    return results
