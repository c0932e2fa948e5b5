"""Bad input to the environments: one clear sentence each, that names the argument and what it got."""

import dataclasses

import gymnasium
import numpy as np
import pytest

from magrod_env import Magnet, Rod, Scene, load_scene
from magrod_env.envs import Camera, MagRodEnv, MagRodVectorEnv, Randomization
from magrod_env.magnetics import Actuator
from magrod_env.registration import IDS

pytestmark = pytest.mark.filterwarnings("error")

NAN = float("nan")


def check_sentence(error, *words):
    """One sentence, not a dump, that holds the words."""
    message = str(error.value)
    assert len(message) < 600
    for word in words:
        assert word in message, f"{word!r} is not in: {message}"


@pytest.mark.parametrize(
    ("settings", "words"),
    [
        ({"task": "sphere"}, ["task", "sphere", "circle"]),
        ({"task": None}, ["task", "None"]),
        ({"colour": "red"}, ["colour", "spelling"]),
        ({"task": "reach", "radius": 0.01}, ["radius", "spelling"]),
        ({"scene": "paper9"}, ["name", "paper9", "paper5_circle"]),
        ({"scene": 5}, ["scene", "Scene", "5"]),
        ({"observe": "radar"}, ["observe", "radar", "state", "estimate"]),
        ({"observe": None}, ["observe", "None"]),
        ({"precision": "float16"}, ["precision", "float16", "float32"]),
        ({"precision": np.float32}, ["precision", "float32"]),
        ({"plane": "yz"}, ["plane", "yz"]),
        ({"plane": "xy"}, ["plane", "xy"]),
        ({"plane": 3}, ["plane", "3"]),
        ({"axes": "yw"}, ["axes", "yw"]),
        ({"axes": "yy"}, ["axes", "yy"]),
        ({"axes": ""}, ["axes"]),
        ({"axes": 2}, ["axes", "2"]),
        ({"axes": ["y", "z"]}, ["axes", "'y', 'z'"]),
        ({"task": "planar_reach", "axes": "yz"}, ["axes", "yz"]),
        ({"num_elements": 0}, ["num_elements", "0"]),
        ({"num_elements": -3}, ["num_elements", "-3"]),
        ({"num_elements": 2.5}, ["num_elements", "2.5"]),
        ({"num_elements": "five"}, ["num_elements", "five"]),
        ({"num_elements": True}, ["num_elements", "True"]),
        ({"task": "two_magnet", "num_elements": 1}, ["num_elements", "1"]),
        ({"time_step": 1e-2}, ["time_step", "0.01", "stability"]),
        ({"time_step": 0.0}, ["time_step", "0.0"]),
        ({"time_step": -1e-5}, ["time_step", "-1e-05"]),
        ({"time_step": NAN}, ["time_step", "nan"]),
        ({"control_rate": 0.0}, ["control_rate", "0.0"]),
        ({"control_rate": -50}, ["control_rate", "-50"]),
        ({"control_rate": np.inf}, ["control_rate", "inf"]),
        ({"control_rate": None}, ["control_rate", "None"]),
        ({"actuator": None}, ["actuator", "Actuator", "None"]),
        ({"actuator": 45e-3}, ["actuator", "Actuator", "0.045"]),
        ({"actuator": Actuator(limit=None)}, ["limit", "None", "tesla"]),
        ({"camera": 30.0}, ["camera", "Camera", "30.0"]),
        ({"camera": Camera(rate=30.0)}, ["rate", "camera", "50 Hz", "30"]),
        ({"camera": Camera(rate=100.0)}, ["rate", "camera", "50 Hz", "100"]),
        ({"randomization": 0.1}, ["randomization", "Randomization", "0.1"]),
        ({"randomization": {"modulus": 0.1}}, ["randomization", "Randomization"]),
        ({"success_distance": 0.0}, ["success_distance", "0.0"]),
        ({"success_distance": NAN}, ["success_distance", "nan"]),
        ({"render_mode": "human"}, ["render_mode", "human", "rgb_array"]),
        ({"num_threads": 0}, ["num_threads", "0"]),
        ({"num_threads": -2}, ["num_threads", "-2"]),
        ({"num_threads": 1.5}, ["num_threads", "1.5"]),
        ({"num_threads": "all"}, ["num_threads", "all"]),
        ({"radius": -1e-3}, ["radius", "-0.001"]),
        ({"radius": "big"}, ["radius", "big"]),
        ({"period": 0.0}, ["period", "0.0"]),
        ({"period": NAN}, ["period", "nan"]),
        ({"center_field": 7e-3}, ["center_field", "0.007"]),
        ({"center_field": (0.0, 7e-3)}, ["center_field", "0.007"]),
        ({"center_field": (0.0, NAN, 0.0)}, ["center_field", "nan"]),
        ({"center_field": "up"}, ["center_field", "up"]),
        ({"task": "path", "size": -1e-3}, ["size", "-0.001"]),
        ({"task": "path", "path": "star"}, ["star", "figure_eight"]),
        ({"task": "path", "path": [[0.0, 1.0, 2.0, 3.0]] * 4}, ["path", "(4, 4)"]),
        ({"task": "path", "path": [[0.0, 0.0]]}, ["path", "(1, 2)"]),
        ({"task": "path", "path": []}, ["path"]),
        ({"task": "path", "path": [[0.0, NAN], [1e-3, 0.0]]}, ["path", "finite"]),
        ({"task": "path", "path": [[0.0, 0.0], [1e-3]]}, ["path"]),
        ({"task": "path", "path": None}, ["path"]),
        ({"task": "reach", "reach_limit": 0.0}, ["reach_limit", "0.0"]),
        ({"task": "reach", "reach_limit": None}, ["reach_limit", "None"]),
        ({"task": "two_magnet", "amplitude": -5e-3}, ["amplitude", "-0.005"]),
    ],
    ids=str,
)
@pytest.mark.parametrize("kind", ["single", "vector"])
def test_bad_argument(settings, words, kind):
    with pytest.raises(ValueError) as error:
        MagRodEnv(**settings) if kind == "single" else MagRodVectorEnv(**settings, num_envs=2)
    check_sentence(error, *words)


@pytest.mark.parametrize(
    ("settings", "words"),
    [
        ({"num_envs": 0}, ["num_envs", "0"]),
        ({"num_envs": -1}, ["num_envs", "-1"]),
        ({"num_envs": 2.5}, ["num_envs", "2.5"]),
        ({"max_episode_steps": 0}, ["max_episode_steps", "0"]),
        ({"max_episode_steps": -5}, ["max_episode_steps", "-5"]),
        ({"max_episode_steps": True}, ["max_episode_steps", "True", "-1"]),
        ({"max_episode_steps": 2.5}, ["max_episode_steps", "2.5"]),
        ({"max_episode_steps": 1e300}, ["max_episode_steps", "1e+300"]),
        ({"num_envs": 1e300}, ["num_envs", "1e+300"]),
        ({"max_episode_steps": "long"}, ["max_episode_steps", "long"]),
        ({"autoreset_mode": "Sometimes"}, ["autoreset_mode", "Sometimes", "SameStep"]),
        ({"autoreset_mode": None}, ["autoreset_mode", "None", "SameStep"]),
    ],
    ids=str,
)
def test_bad_argument_of_a_batch(settings, words):
    with pytest.raises(ValueError) as error:
        MagRodVectorEnv("reach", **({"num_envs": 2} | settings))
    check_sentence(error, *words)


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda: Camera(noise=-1e-4), ["noise", "-0.0001"]),
        (lambda: Camera(noise=NAN), ["noise", "nan"]),
        (lambda: Camera(rate=0.0), ["rate", "0.0"]),
        (lambda: Camera(delay=-0.1), ["delay", "-0.1"]),
        (lambda: Camera(delay="late"), ["delay", "late"]),
        (lambda: Randomization(modulus=-0.1), ["modulus", "-0.1"]),
        (lambda: Randomization(modulus=1.0), ["modulus", "1.0"]),
        (lambda: Randomization(density=NAN), ["density", "nan"]),
        (lambda: Randomization(field_gain="much"), ["field_gain", "much"]),
        (lambda: Randomization(field_misalignment=-0.1), ["field_misalignment", "-0.1"]),
        (lambda: Randomization(initial_field=np.inf), ["initial_field", "inf"]),
        (lambda: Randomization(magnet_position=None), ["magnet_position", "None"]),
    ],
)
def test_bad_setting(make, words):
    with pytest.raises(ValueError) as error:
        make()
    check_sentence(error, *words)


@pytest.mark.parametrize("kind", [Camera, Randomization, Actuator])
def test_settings_are_frozen_and_refuse_unknown_names(kind):
    with pytest.raises(TypeError):
        kind(colour="red")
    with pytest.raises(dataclasses.FrozenInstanceError):
        setattr(kind(), dataclasses.fields(kind)[0].name, 0.1)


def test_magnet_cannot_be_moved_off_the_rod_or_past_another():
    """The middle magnet sits 36 mm from the tip and 49 mm from the clamp."""
    for shift in (0.04, 0.06):
        with pytest.raises(ValueError) as error:
            MagRodEnv("two_magnet", randomization=Randomization(magnet_position=shift))
        check_sentence(error, "magnet_position", str(shift))


@pytest.mark.parametrize(
    "action",
    [
        [NAN, 0.0],
        [0.0, np.inf],
        [0.0],
        [0.0, 0.0, 0.0],
        0.0,
        [[0.0, 0.0]],
        np.zeros((2, 1)),
        None,
        [[0.0], [0.0, 0.0]],
        ["0", "1"],
        [True, False],
        [1j, 0.0],
        np.zeros(2, object),
        {0.0, 1.0},
        [10**400, 0.0],
    ],
    ids=str,
)
def test_bad_action(action):
    env = MagRodEnv("reach", num_elements=3)
    env.reset(seed=0)
    with pytest.raises(ValueError) as error:
        env.step(action)
    check_sentence(error, "action", "(2,)")
    assert np.isfinite(env.step(np.zeros(2))[0]).all()  # and nothing happened


@pytest.mark.parametrize(
    ("actions", "words"),
    [
        ([[0.0, 0.0], [0.0, NAN]], ["finite", "environment 1"]),
        ([[-np.inf, 0.0], [0.0, 0.0]], ["finite", "environment 0"]),
        ([0.0, 0.0], ["(2, 2)", "(2,)"]),
        (np.zeros((3, 2)), ["(2, 2)", "(3, 2)"]),
        (np.zeros((2, 3)), ["(2, 2)", "(2, 3)"]),
        (np.zeros((2, 2, 1)), ["(2, 2)", "(2, 2, 1)"]),
        (None, ["(2, 2)"]),
        ([[0.0], [0.0, 0.0]], ["(2, 2)"]),
        ([["0", "1"]] * 2, ["(2, 2)", "'0'"]),
        (np.ones((2, 2), bool), ["(2, 2)"]),
        (np.ones((2, 2), complex), ["(2, 2)"]),
    ],
    ids=repr,
)
def test_bad_actions_of_a_batch(actions, words):
    batch, twin = (MagRodVectorEnv("reach", 2, num_elements=3) for _ in range(2))
    batch.reset(seed=0), twin.reset(seed=0)
    with pytest.raises(ValueError) as error:
        batch.step(actions)
    check_sentence(error, "actions", *words)
    np.testing.assert_array_equal(batch.step(np.zeros((2, 2)))[0], twin.step(np.zeros((2, 2)))[0])


@pytest.mark.parametrize(
    "mask",
    [
        np.zeros(3, bool),
        np.ones(2, bool),
        np.ones(4, bool),
        np.ones((3, 1), bool),
        np.array([0, 1, 1]),
        None,
        {},
        [True, False, True],
        True,
    ],
    ids=repr,
)
def test_bad_reset_mask(mask):
    """As in Gymnasium's own vector environments: a boolean array with an entry for each, and at least one True."""
    batch = MagRodVectorEnv("reach", 3, num_elements=3)
    batch.reset(seed=0)
    with pytest.raises((ValueError, TypeError)) as error:
        batch.reset(options={"reset_mask": mask})
    check_sentence(error, "reset_mask")


@pytest.mark.parametrize("seed", [[1, 2], [1, 2, 3, 4], []], ids=repr)
def test_wrong_number_of_seeds(seed):
    with pytest.raises(ValueError) as error:
        MagRodVectorEnv("reach", 3, num_elements=3).reset(seed=seed)
    check_sentence(error, "seed", "3", str(len(seed)))


@pytest.mark.parametrize(
    "seed",
    [-1, 1.5, NAN, True, "one", "ab", {1, 2}, object(), [0, "x"], [[0], [1]]],
    ids=lambda seed: "object" if type(seed) is object else str(seed),
)
@pytest.mark.parametrize("kind", ["single", "vector"])
def test_bad_seed(seed, kind):
    env = MagRodEnv("reach", num_elements=3) if kind == "single" else MagRodVectorEnv("reach", 2, num_elements=3)
    with pytest.raises(ValueError) as error:
        env.reset(seed=seed)
    check_sentence(error, "seed")


@pytest.mark.parametrize("seed", [np.int64(4), np.uint32(4)], ids=repr)
def test_numpy_numbers_are_seeds(seed):
    for env in (MagRodEnv("reach", num_elements=3), MagRodVectorEnv("reach", 2, num_elements=3)):
        np.testing.assert_array_equal(env.reset(seed=seed)[0], env.reset(seed=4)[0])


def both(**settings):
    """A single and a vector environment."""
    return MagRodEnv("reach", num_elements=3, **settings), MagRodVectorEnv("reach", 2, num_elements=3, **settings)


@pytest.mark.parametrize("env", both(), ids=["single", "vector"])
@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"colour": "red"}, ["colour"]),
        ({"mask": np.array([True, False])}, ["mask"]),
        ({1: 2}, ["1"]),
        ("reset_mask", ["options", "dict", "reset_mask"]),
        ([], ["options", "dict", "[]"]),
        (5, ["options", "dict", "5"]),
    ],
    ids=str,
)
def test_unknown_options_of_a_reset_are_refused(env, options, words):
    with pytest.raises(ValueError) as error:
        env.reset(options=options)
    check_sentence(error, "options", *words)


def test_options_that_are_unknown_are_told_beside_those_that_are_known():
    single, batch = both()
    with pytest.raises(ValueError, match="empty"):
        single.reset(options={"reset_mask": np.array([True])})
    with pytest.raises(ValueError, match=r"reset_mask.*colour"):
        batch.reset(options={"colour": "red"})
    for env in (single, batch):
        env.reset(options={}), env.reset(options=None)


@pytest.mark.parametrize("name", IDS)
@pytest.mark.parametrize("mode", [None, "rgb_array"])
@pytest.mark.parametrize("vector", [False, True], ids=["single", "vector"])
def test_a_step_or_a_frame_before_the_first_reset_is_refused(name, mode, vector):
    settings = {"render_mode": mode}
    env = gymnasium.make_vec(name, num_envs=2, **settings) if vector else gymnasium.make(name, **settings)
    for call in (lambda: env.unwrapped.step(env.action_space.sample()), env.unwrapped.render, env.render):
        with pytest.raises(gymnasium.error.ResetNeeded, match="reset"):
            call()


@pytest.mark.parametrize("value", [-1, np.int64(-1), None], ids=repr)
def test_minus_one_and_none_are_no_time_limit(value):
    """-1 as in `gymnasium.make`, which adds no TimeLimit then."""
    limit = gymnasium.spec("MagRod/Reach-v0").max_episode_steps
    batch = gymnasium.make_vec("MagRod/Reach-v0", num_envs=1, max_episode_steps=value, num_elements=3)
    batch.reset(seed=0)
    assert not any(batch.step(np.zeros((1, 2)))[3].any() for _ in range(limit + 1))


@pytest.mark.parametrize("value", [0, -5, 2.5, "x"], ids=repr)
def test_no_episode_is_as_long_as_no_count_says(value):
    """`gymnasium.make` hands the limit to its own wrapper, which speaks for itself."""
    with pytest.raises((ValueError, TypeError), match="max_episode_steps"):
        gymnasium.make("MagRod/Reach-v0", max_episode_steps=value, num_elements=3)
    with pytest.raises(ValueError, match="max_episode_steps"):
        gymnasium.make_vec("MagRod/Reach-v0", num_envs=2, max_episode_steps=value, num_elements=3)


def test_without_autoreset_an_ended_episode_must_be_reset_before_the_next_step():
    """By a mask that holds all that have ended, or as a whole."""
    batch = MagRodVectorEnv("reach", 3, num_elements=3, max_episode_steps=2, autoreset_mode="Disabled")
    batch.reset(seed=0)
    still = np.zeros((3, 2))
    batch.step(still), batch.step(still)
    with pytest.raises(gymnasium.error.ResetNeeded) as error:
        batch.step(still)
    check_sentence(error, "[0, 1, 2]", "reset_mask")
    batch.reset(options={"reset_mask": np.array([True, False, True])})
    with pytest.raises(gymnasium.error.ResetNeeded) as error:
        batch.step(still)
    check_sentence(error, "[1]", "reset_mask")
    batch.reset(options={"reset_mask": np.array([False, True, False])})
    assert not batch.step(still)[3].any()
    batch.step(still), batch.reset()
    assert not batch.step(still)[3].any()


@pytest.mark.parametrize("env", both(), ids=["single", "vector"])
def test_closing_twice_is_silent(env):
    env.reset(seed=0)
    env.close(), env.close()


@pytest.mark.parametrize(
    "goal",
    [None, "x", ["a", "b", "c"], 0.0, [0.0, 0.0], np.zeros((2, 2)), np.zeros((4, 4)), [True] * 3, 1j * np.ones(3), {}],
    ids=str,
)
def test_goals_of_a_wrong_kind_or_shape_are_refused(goal):
    env = MagRodEnv("reach", goal=True, num_elements=3)
    for name, goals in (("achieved_goal", (goal, np.zeros(3))), ("desired_goal", (np.zeros(3), goal))):
        with pytest.raises(ValueError) as error:
            env.compute_reward(*goals, {})
        check_sentence(error, name, "3")


def test_goals_give_a_number_each_in_the_shape_that_they_come_in():
    env = MagRodEnv("reach", goal=True, num_elements=3)
    for shape in ((), (1,), (5,), (0,), (2, 4)):
        reward = env.compute_reward(np.zeros((*shape, 3)), np.full((*shape, 3), 1e-4), {})
        assert reward.shape == shape and reward.dtype == np.float64 and not reward.any()
    assert isinstance(env.compute_reward([0, 0, 0], [0.0, 0.0, 1.0], {}), float)
    assert env.compute_reward(np.zeros((4, 3)), np.zeros(3), [{}] * 4).tolist() == [0.0] * 4


def test_goals_of_a_rod_of_three_metres_are_where_the_rod_is():
    """The goals' space reaches as far as the rod."""
    rod = Rod.circular(length=3.0, diameter=4e-2, density=1100.0, youngs_modulus=2e7, poissons_ratio=0.5)
    magnet = Magnet.dipole(position=3.0, moment=100.0)
    scene = Scene(rod=rod, magnets=(magnet,), gravity=(0.0, 0.0, -9.81), drag_rate=5.0, spin_drag_rate=100.0)
    env = MagRodEnv("reach", goal=True, scene=scene, num_elements=3)
    observation, info = env.reset(seed=0)
    assert observation in env.observation_space
    np.testing.assert_array_equal(observation["achieved_goal"], info["tip_position"])
    assert np.linalg.norm(info["tip_position"]) > 2.0


def test_goals_of_shapes_that_do_not_fit_are_refused():
    with pytest.raises(ValueError) as error:
        MagRodEnv("reach", goal=True, num_elements=3).compute_reward(np.zeros((4, 3)), np.zeros((5, 3)), {})
    check_sentence(error, "achieved_goal", "desired_goal", "(4, 3)", "(5, 3)")


@pytest.mark.parametrize("value", [NAN, np.inf, -np.inf, 1e300])
def test_a_goal_that_is_not_finite_is_not_reached(value):
    """Also infinitely far in the same direction as the rod."""
    env = MagRodEnv("reach", goal=True, num_elements=3)
    bad = np.full((2, 3), value)
    for goals in ((bad, np.zeros((2, 3))), (np.zeros((2, 3)), bad), (np.array([0.0, 0.0, value]), np.zeros((2, 3)))):
        assert env.compute_reward(*goals, {}).tolist() == [-1.0, -1.0]
    if not np.isfinite(value):
        assert env.compute_reward(bad, bad, {}).tolist() == [-1.0, -1.0]


def test_actions_may_be_lists_or_of_any_real_type():
    env = MagRodEnv("reach", num_elements=3)
    results = []
    for action in ([1, -1], (1.0, -1.0), np.array([1, -1]), np.array([1, -1], np.float32), np.array([1, -1], np.int8)):
        env.reset(seed=0)
        results.append(env.step(action)[0])
    assert all(np.array_equal(result, results[0]) for result in results)


@pytest.mark.parametrize(
    "settings",
    [
        {"scene": "paper4_pdms_tip_magnet"},
        {"scene": load_scene("paper4_pdms_tip_magnet")},
        {"scene": load_scene("paper5_circle", modulus=2e6).replace(gravity=None)},
        {"control_rate": 30, "time_step": 1e-5},
        {"num_elements": np.int64(3), "success_distance": np.float32(2e-3)},
    ],
    ids=["name", "scene", "no gravity", "control rate", "numpy numbers"],
)
def test_good_arguments_are_taken(settings):
    env = MagRodEnv("reach", **({"num_elements": 3} | settings))
    observation, _ = env.reset(seed=0)
    assert observation in env.observation_space
