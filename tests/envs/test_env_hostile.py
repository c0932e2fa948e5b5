"""Every argument of every id, made single and as a batch, with values that no argument should take in silence."""

import dataclasses
import math

import gymnasium
import numpy as np
import pytest
from rollouts import SLOW_COILS

from magrod_env import load_scene
from magrod_env.envs import Camera, EstimateState, Randomization
from magrod_env.magnetics import Actuator
from magrod_env.registration import IDS

pytestmark = pytest.mark.filterwarnings("error")

HOSTILE = {
    "nan": math.nan,
    "inf": math.inf,
    "-1": -1,
    "0": 0,
    "1e-300": 1e-300,
    "1e300": 1e300,
    "True": True,
    "x": "x",
    "None": None,
    "set": set(),
    "list": [],
    "dict": {},
    "object": object(),
    "1e400": 10**400,
    "1j": 1j,
}
TASK = {
    "MagRod/Circle-v0": ("radius", "period", "center_field", "random_start"),
    "MagRod/Path-v0": ("path", "size", "period", "center_field", "random_start"),
    "MagRod/Reach-v0": ("reach_limit",),
    "MagRod/ReachGoal-v0": ("reach_limit",),
    "MagRod/TwoMagnet-v0": ("amplitude", "period", "random_start"),
    "MagRod/PlanarReach-v0": ("reach_limit",),
}
SHARED = (
    "task",
    "scene",
    "num_elements",
    "axial_softening",
    "rotary_scaling",
    "tolerance",
    "time_step",
    "precision",
    "plane",
    "axes",
    "actuator",
    "control_rate",
    "camera",
    "observe",
    "randomization",
    "success_distance",
    "num_threads",
    "goal",
)
VECTOR = ("num_envs", "max_episode_steps", "autoreset_mode", "render_mode")


def all_finite(value):
    if isinstance(value, dict):
        return all(all_finite(entry) for entry in value.values())
    return bool(np.isfinite(value).all())


def check_refused_or_runs(make, word):
    """Either an environment whose first step is finite, or a ValueError of one sentence with the word in it."""
    try:
        env = make()
        observation, info = env.reset(seed=0)
        result = env.step(np.zeros(env.action_space.shape, np.float32))
    except ValueError as error:
        message = str(error)
        assert word in message and message.endswith(".") and "\n" not in message and len(message) < 600, message
        return
    assert all_finite(observation) and all_finite(info) and all(all_finite(part) for part in result)


def made(name, vector, **settings):
    if vector:
        return gymnasium.make_vec(name, **({"num_envs": 2} | settings))
    return gymnasium.make(name, **settings)


@pytest.mark.parametrize("vector", [False, True], ids=["single", "vector"])
@pytest.mark.parametrize(
    ("name", "argument"), [(name, argument) for name in IDS for argument in TASK[name] + SHARED], ids=str
)
def test_argument(name, argument, vector):
    for value in HOSTILE.values():
        check_refused_or_runs(lambda: made(name, vector, **{argument: value}), argument)  # noqa: B023


@pytest.mark.parametrize("argument", VECTOR)
@pytest.mark.parametrize("name", IDS)
def test_argument_of_a_batch(name, argument):
    for value in HOSTILE.values():
        check_refused_or_runs(lambda: made(name, True, **{argument: value}), argument)  # noqa: B023


@pytest.mark.parametrize("value", HOSTILE.values(), ids=HOSTILE)
@pytest.mark.parametrize("vector", [False, True], ids=["single", "vector"])
def test_unknown_argument(value, vector):
    for name in IDS:
        with pytest.raises(ValueError, match="colour"):
            made(name, vector, colour=value)


PARTS = {
    "camera": (Camera(), [field.name for field in dataclasses.fields(Camera)]),
    "randomization": (Randomization(), [field.name for field in dataclasses.fields(Randomization)]),
    "actuator": (SLOW_COILS, [field.name for field in dataclasses.fields(SLOW_COILS)]),
}


@pytest.mark.parametrize("vector", [False, True], ids=["single", "vector"])
@pytest.mark.parametrize(("part", "field"), [(part, field) for part in PARTS for field in PARTS[part][1]], ids=str)
def test_field_of_a_part(part, field, vector):
    """A drive without one of its effects is another kernel, and tested elsewhere."""
    for value in HOSTILE.values():
        if part == "actuator" and value is None and field != "limit":
            continue
        settings = {"num_elements": 3}

        def make(value=value, settings=settings):
            changed = dataclasses.replace(PARTS[part][0], **{field: value})
            return made("MagRod/Circle-v0", vector, **settings, **{part: changed})

        check_refused_or_runs(make, field)


@pytest.mark.parametrize("argument", ["estimator", "members", "markers", "cameras", "timed"])
@pytest.mark.parametrize("vector", [False, True], ids=["single", "vector"])
def test_argument_of_an_estimated_state(argument, vector):
    for value in HOSTILE.values():
        check_refused_or_runs(
            lambda: EstimateState(made("MagRod/Circle-v0", vector, num_elements=3), **{argument: value}),  # noqa: B023
            argument.removesuffix("s"),
        )


@pytest.mark.parametrize(
    ("settings", "word"),
    [
        ({"radius": 1.0}, "reach"),
        ({"center_field": (0.0, 0.0, 5.0)}, "reach"),
        ({"center_field": (-1.0, 0.0, 0.0)}, "reach"),
        ({"control_rate": 0.01}, "control_rate"),
        ({"time_step": 1e-9}, "time_step"),
        ({"camera": Camera(delay=9.99), "control_rate": 1e4}, "delay"),
    ],
    ids=str,
)
def test_values_that_only_look_reasonable(settings, word):
    for vector in (False, True):
        check_refused_or_runs(lambda: made("MagRod/Circle-v0", vector, **settings), word)  # noqa: B023


def test_fields_in_which_a_rod_buckles_are_refused_by_the_argument_that_asks_for_them():
    settings = {"amplitude": 0.1, "actuator": Actuator(limit=0.2)}
    for vector in (False, True):
        with pytest.raises(ValueError, match=r"amplitude.*stability"):
            made("MagRod/TwoMagnet-v0", vector, **settings)


def test_a_rod_that_buckles_under_its_own_weight_is_told_of_and_not_the_field():
    upright = load_scene("paper5_circle", modulus=1e3).replace(gravity=(-9.81, 0.0, 0.0))
    for name in IDS:
        with pytest.raises(ValueError, match=r"scene.*weight"):
            made(name, False, scene=upright)
