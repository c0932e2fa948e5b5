"""Observations made by an estimator: their layout, what the estimator is told and when, errors, resets, failures."""

import copy
import pickle
import subprocess
import sys
from functools import partial
from pathlib import Path

import gymnasium
import numpy as np
import pytest
from gymnasium.vector import SyncVectorEnv
from rollouts import EVERYTHING_VARIES, NOISY, SLOW_COILS, assert_same, copy_of, run, scripted_actions

from agents.open_loop_circle import InverseStatics
from agents.policy import Policy
from magrod_env.envs import Camera, EstimateState, MagRodEnv, MagRodVectorEnv, Randomization
from magrod_env.estimation import EnsembleFilter, PredictionFilter, StereoCameras
from magrod_env.magnetics import Actuator
from magrod_env.rod.state import BatchState
from magrod_env.simulation import SimulationDiverged, StabilityError

pytestmark = pytest.mark.filterwarnings("error")

STEP, LIMIT = 0.02, 45e-3  # s, T
SOFT = Randomization(modulus=0.2)
WEIGHTS = Path(__file__).parents[2] / "agents" / "weights" / "circle_ppo.npz"
ids = pytest.mark.parametrize("name", ["MagRod/Circle-v0", "MagRod/ReachGoal-v0", "MagRod/PlanarReach-v0"])


class Recorder:
    """An estimator that notes what it is told and estimates as it is ordered."""

    def __init__(self, scene, *, num_rods, num_elements, **settings):
        self.settings, self.calls, self.time = settings, [], 0.0
        self.positions = np.zeros((num_rods, num_elements + 1, 3))

    def reset(self, field=None, mask=None):
        self.time = self.time if mask is not None else 0.0
        self.calls.append(("reset", None if field is None else np.array(field), mask))

    def predict(self, field, duration):
        self.time += duration
        self.calls.append(("predict", np.array(field), duration))

    def update(self, measurement):
        self.calls.append(("update", measurement, self.time))

    def told(self, what):
        """The calls of one kind since the last time."""
        found = [call[1:] for call in self.calls if call[0] == what]
        self.calls = [call for call in self.calls if call[0] != what]
        return found


class TruthTeller(Recorder):
    """Knows where the rods are."""

    def __init__(self, scene, *, truth, **settings):
        self.truth = truth
        super().__init__(scene, **settings)

    positions = property(lambda self: self.truth.positions, lambda self, value: None)


def recorded(num_envs=None, **settings):
    """An environment, or a vector of them, with a recorder in it."""
    settings = {"task": "circle", "num_elements": 3} | settings
    env = MagRodEnv(**settings) if num_envs is None else MagRodVectorEnv(num_envs=num_envs, **settings)
    env = EstimateState(env, estimator=Recorder)
    return env, env.estimator


def smooth(space, count):
    """Actions (count, *shape) that turn slowly, within the coils' limit."""
    angle = 0.06 * np.arange(count)
    turning = np.stack([0.35 * np.sin(angle), 0.2 + 0.3 * np.cos(angle)], axis=-1)
    return np.broadcast_to(turning.reshape(count, *(1,) * (len(space.shape) - 1), 2), (count, *space.shape)).astype(
        np.float32
    )


# ---- what one gets


@ids
def test_shortcut_and_wrapper_keep_spaces_and_say_the_error(name):
    plain = gymnasium.make(name, num_elements=3)
    short = gymnasium.make(name, num_elements=3, observe="estimate")
    wrapped = EstimateState(gymnasium.make(name, num_elements=3), members=8)
    for env in (short, wrapped):
        assert env.observation_space == plain.observation_space and env.action_space == plain.action_space
        _, info = env.reset(seed=0)
        env.action_space.seed(0)
        observation, _, _, _, info = env.step(env.action_space.sample())
        assert observation in env.observation_space
        assert type(info["estimate_error"]) is float and 0.0 < info["estimate_error"] < 5e-3
        assert info["estimate_lost"] is False
        assert ("estimate_time" in info) is (env is wrapped)
    assert type(info["estimate_time"]) is float and 0.0 < info["estimate_time"] < 10.0
    assert isinstance(wrapped, gymnasium.Wrapper) and len(wrapped.spec.additional_wrappers) == 1


@ids
def test_vector_shortcut_and_wrapper(name):
    plain = gymnasium.make_vec(name, num_envs=3, num_elements=3)
    short = gymnasium.make_vec(name, num_envs=3, num_elements=3, observe="estimate")
    wrapped = EstimateState(gymnasium.make_vec(name, num_envs=3, num_elements=3), members=8)
    assert isinstance(wrapped, gymnasium.vector.VectorWrapper)
    for envs in (short, wrapped):
        assert envs.observation_space == plain.observation_space
        envs.reset(seed=0)
        for actions in scripted_actions(envs.action_space, 2):
            observations, _, _, _, info = envs.step(actions)
        assert observations in envs.observation_space
        assert info["estimate_error"].shape == info["estimate_lost"].shape == (3,)
        assert info["_estimate_error"].tolist() == [True] * 3
    assert info["estimate_time"].shape == (3,) and np.ptp(info["estimate_time"]) == 0.0


@pytest.mark.parametrize("task", ["circle", "planar_reach", "two_magnet"])
def test_observation_of_a_perfect_estimate_is_that_of_a_perfect_camera(task):
    settings = {"num_elements": 6 if task == "two_magnet" else 3, "randomization": EVERYTHING_VARIES}
    plain, env = MagRodEnv(task, **settings), MagRodEnv(task, **settings)
    env = EstimateState(env, estimator=partial(TruthTeller, truth=BatchState(env.core.batch)))
    actions = scripted_actions(env.action_space, 6)
    for got, want in zip(run(env, actions, 3), run(plain, actions, 3)):
        np.testing.assert_allclose(got[0], want[0], rtol=0, atol=1e-6)  # float32
        assert got[-1]["estimate_error"] == 0.0


def test_velocities_are_of_the_last_control_step_whatever_the_cameras_rate():
    env = EstimateState(MagRodEnv(num_elements=3, camera=NOISY), members=4)
    length = env.unwrapped.core.scene.rod.length
    observation, before = env.reset(seed=3)[0], env.estimator.tip_position[0]
    np.testing.assert_allclose(observation[:6], [*(before / length), 0.0, 0.0, 0.0], rtol=1e-6)
    for action in scripted_actions(env.action_space, 5):
        observation, now = env.step(action)[0], env.estimator.tip_position[0]
        np.testing.assert_allclose(observation[:3], now / length, rtol=1e-6)
        np.testing.assert_allclose(observation[3:6], (now - before) / (STEP * length), rtol=1e-5, atol=1e-6)
        before = now


def test_rewards_and_truth_stay_what_they_are():
    plain, env = MagRodEnv(num_elements=3), EstimateState(MagRodEnv(num_elements=3), members=8)
    actions = scripted_actions(plain.action_space, 3)
    for got, want in zip(run(env, actions, 2), run(plain, actions, 2)):
        assert_same(got[1:-1], want[1:-1])
        assert_same({key: got[-1][key] for key in want[-1]}, want[-1])


# ---- how good it is


def test_estimate_is_better_than_a_frame_although_the_rod_is_not_the_nominal_one():
    """Noise of 0.05 mm along each axis is 0.080 mm in space on average; the model alone is off by millimetres."""
    envs = gymnasium.make_vec("MagRod/Circle-v0", num_envs=6, num_elements=3, randomization=SOFT, observe="estimate")
    blind = EstimateState(
        gymnasium.make_vec("MagRod/Circle-v0", num_envs=6, num_elements=3, randomization=SOFT), cameras=Blind()
    )
    envs.reset(seed=0), blind.reset(seed=0)
    errors, alone = [], []
    for actions in smooth(envs.action_space, 90):
        errors.append(envs.step(actions)[4]["estimate_error"])
        alone.append(blind.step(actions)[4]["estimate_error"])
    assert np.mean(errors[50:]) < 0.080e-3
    assert np.mean(alone[50:]) > 1e-3


class Blind:
    """Cameras that see nothing."""

    def measure(self, positions, generator, centrelines=None):
        return np.full(positions.shape, np.nan), np.ones((*positions.shape, 3)) * np.eye(3)


def test_late_frames_are_taken_for_what_they_are():
    """At 25 Hz and 60 ms late, the camera's own picture is millimetres behind the moving rod."""
    envs = gymnasium.make_vec("MagRod/Circle-v0", num_envs=4, num_elements=3, camera=NOISY, observe="estimate")
    seen = gymnasium.make_vec("MagRod/Circle-v0", num_envs=4, num_elements=3, camera=NOISY)
    envs.reset(seed=0), seen.reset(seed=0)
    errors, behind = [], []
    for actions in smooth(envs.action_space, 80):
        errors.append(envs.step(actions)[4]["estimate_error"])
        observations, _, _, _, info = seen.step(actions)
        length = envs.unwrapped.core.scene.rod.length
        behind.append(np.linalg.norm(length * observations[:, :3] - info["tip_position"], axis=1))
    assert np.mean(errors[50:]) < 0.25 * np.mean(behind[50:])
    assert np.mean(behind[50:]) > 1e-3


@pytest.mark.parametrize(
    "settings",
    [
        {"precision": "float32"},
        {"camera": NOISY, "actuator": SLOW_COILS, "axes": "xyz"},
    ],
    ids=["float32", "all coils, slow"],
)
def test_other_settings_are_estimated_too(settings):
    envs = MagRodVectorEnv(num_envs=2, num_elements=3, observe="estimate", **settings)
    envs.reset(seed=0)
    hold = 0.3 * np.ones(envs.action_space.shape, np.float32)
    errors = [envs.step(hold)[4]["estimate_error"] for _ in range(40)]
    assert np.mean(errors[20:]) < 0.3e-3


# ---- what the estimator is told


def test_estimator_is_told_the_scene_and_the_environments_resolution():
    env, recorder = recorded()
    assert recorder.settings["markers"] == "tip" and recorder.settings["plane"] is None
    assert recorder.settings["expected_field"] >= LIMIT * np.sqrt(2.0)


def test_commanded_not_acting_field_is_told():
    """Coils of another gain, turned against the world: the estimator does not know."""
    env, recorder = recorded(randomization=EVERYTHING_VARIES)
    _, info = env.reset(seed=1)
    ((field, mask),) = recorder.told("reset")
    assert mask is None and field.shape == (1, 3)
    assert not np.allclose(field[0], info["field_applied"], atol=1e-5)
    for action in scripted_actions(env.action_space, 3):
        info = env.step(action)[4]
        ((field, duration),) = recorder.told("predict")
        np.testing.assert_allclose(
            field[0], [0.0, *(LIMIT * np.clip(action, -1.0, 1.0))], rtol=1e-6
        )  # actions are float32
        assert duration == pytest.approx(STEP) and not np.allclose(field[0], info["field_applied"], atol=1e-5)


@pytest.mark.parametrize(
    "actuator",
    [SLOW_COILS, Actuator(lag=0.03), Actuator(slew_limit=0.5), Actuator(dead_time=0.05), Actuator(dead_time=0.013)],
    ids=["all", "lag", "slew", "dead", "short dead"],
)
@pytest.mark.parametrize("spread", [None, EVERYTHING_VARIES], ids=["nominal", "varied"])
def test_drive_is_followed_as_the_coils_own_sensors_say(actuator, spread):
    """They are entries 6 and 7 of an observation; their means over a step follow by fine steps of twin environments."""
    settings = {"actuator": actuator, "randomization": spread, "random_start": False}
    env, recorder = recorded(**settings)
    fine = MagRodEnv("circle", num_elements=3, control_rate=1000.0, **settings)
    env.reset(seed=0), fine.reset(seed=0)
    recorder.told("predict")
    for action in scripted_actions(env.action_space, 8):
        observation = env.step(action)[0]
        pieces = recorder.told("predict")
        assert sum(duration for _, duration in pieces) == pytest.approx(STEP)
        told = sum(field[0] * duration for field, duration in pieces) / STEP
        sensors = np.array([fine.step(action)[0][6:8] for _ in range(20)])
        np.testing.assert_allclose(told[1:] / LIMIT, sensors.mean(axis=0), atol=0.04)  # a sample is up to 1 ms late
        drive = env.unwrapped.core.estimation._coils.field[0]
        np.testing.assert_allclose(drive[1:] / LIMIT, observation[6:8], atol=1e-3)


def test_frames_come_at_the_cameras_rate_and_late():
    env, recorder = recorded(camera=Camera(noise=1e-5, rate=25.0, delay=0.06))
    _, info = env.reset(seed=0)
    tips, frames = [info["tip_position"]], recorder.told("update")
    for action in smooth(env.action_space, 12):
        tips.append(env.step(action)[4]["tip_position"])
        frames += recorder.told("update")
    for step, (frame, now) in enumerate(frames):
        assert (frame is not None) is (step >= 3 and (step - 3) % 2 == 0), step
        if frame is not None:
            assert frame.time == pytest.approx(now - 0.06) == pytest.approx((step - 3) * STEP)
            np.testing.assert_allclose(frame.positions[0, 0], tips[step - 3], atol=6e-5)
            np.testing.assert_allclose(frame.covariance[0, 0], 1e-10 * np.eye(3))


def test_reset_of_one_rod_is_told_and_its_frames_under_way_are_not():
    envs, recorder = recorded(3, camera=Camera(noise=1e-5, delay=0.04), autoreset_mode="Disabled")
    envs.reset(seed=0)
    for actions in smooth(envs.action_space, 4):
        envs.step(actions)
    recorder.calls = []
    mask = np.array([False, True, False])
    envs.reset(options={"reset_mask": mask})
    ((fields, told),) = recorder.told("reset")
    np.testing.assert_array_equal(told, mask)
    core = envs.unwrapped.core
    np.testing.assert_array_equal(fields[1], core.commands[0, 1])
    recorder.calls = []
    for k, actions in enumerate(smooth(envs.action_space, 3)):
        envs.step(actions)
        ((frame, now),) = recorder.told("update")
        assert now == pytest.approx((5 + k) * STEP) and frame.time == pytest.approx(now - 0.04)
        assert np.isfinite(frame.positions).all(axis=(1, 2)).tolist() == [True, k >= 1, True]


# ---- resets and batches


def test_single_environment_equals_a_vector_of_one_through_its_autoresets():
    settings = {"num_elements": 3, "randomization": EVERYTHING_VARIES, "observe": "estimate"}
    one = gymnasium.make_vec("MagRod/Circle-v0", num_envs=1, max_episode_steps=3, **settings)
    sync = SyncVectorEnv([lambda: gymnasium.make("MagRod/Circle-v0", max_episode_steps=3, **settings)])
    actions = scripted_actions(one.action_space, 8)
    for got, want in zip(run(one, actions, 5), run(sync, actions, 5)):
        assert_same(got, want)


def test_rows_equal_single_environments():
    """Until a rod is reset by itself; to rounding, since sums over members are taken in other orders."""
    settings = {"num_elements": 3, "randomization": EVERYTHING_VARIES, "observe": "estimate"}
    envs, single = MagRodVectorEnv(num_envs=3, **settings), MagRodEnv(**settings)
    actions = scripted_actions(envs.action_space, 5)
    rows, alone = run(envs, actions, 0), run(single, actions[:, 2], 2)
    for got, want in zip(rows, alone):
        np.testing.assert_allclose(got[0][2], want[0], atol=2e-6)
        np.testing.assert_allclose(got[-1]["estimate_error"][2], want[-1]["estimate_error"], rtol=1e-4)


@pytest.mark.parametrize("mode", ["NextStep", "SameStep"])
@pytest.mark.parametrize("camera", [Camera(), NOISY], ids=["default", "late"])
def test_autoreset_of_single_rods_restarts_their_estimates_only(mode, camera):
    """A reset puts a rod elsewhere on the circle, centimetres away: its estimate goes with it, the others stay."""
    envs = MagRodVectorEnv(num_envs=4, num_elements=3, observe="estimate", autoreset_mode=mode, camera=camera)
    envs.reset(seed=0)
    actions = smooth(envs.action_space, 40)
    for k in range(20):
        envs.step(actions[k])
    poison(envs.core, 2)
    for k in range(20, 40):
        _, _, terminated, _, info = envs.step(actions[k])
        assert terminated.tolist() == [False, False, k == 20, False]
        healthy = np.arange(4) != (2 if k == 20 and mode == "NextStep" else -1)
        assert (info["estimate_error"][healthy] < 5e-3).all(), k
    assert (info["estimate_error"] < 1e-3).all()


def poison(core, i, value=np.nan):
    """Put a number into the velocity of one rod's first free node."""
    batch = core.batch
    row = batch.layout.nodes + batch.node_rows.size + batch.node_rows.velocity
    batch.rows[i // batch.width, row, i % batch.width] = value


def test_a_rod_that_diverges_keeps_a_finite_observation():
    env = EstimateState(MagRodEnv(num_elements=3), members=4)
    env.reset(seed=0)
    poison(env.unwrapped.core, 0)
    observation, _, terminated, _, info = env.step(np.zeros(2, np.float32))
    assert terminated and info["diverged"] and observation in env.observation_space and np.isfinite(observation).all()
    assert not info["estimate_lost"]
    assert env.reset()[1]["estimate_error"] < 1e-3


# ---- failures


def test_one_failed_estimate_begins_anew_and_no_other():
    envs = EstimateState(MagRodVectorEnv(num_envs=3, num_elements=3, randomization=SOFT))
    envs.reset(seed=0)
    actions = smooth(envs.action_space, 30)
    for k in range(10):
        envs.step(actions[k])
    simulation = envs.estimator.members.simulation
    batch, lane = simulation.rods.batch, envs.estimator.num_members  # the first member of the second rod
    row = batch.layout.nodes + batch.node_rows.size + batch.node_rows.velocity
    batch.rows[lane // batch.width, row, lane % batch.width] = np.nan
    for k in range(10, 30):
        observations, _, terminated, _, info = envs.step(actions[k])
        assert info["estimate_lost"].tolist() == [False, k == 10, False]
        assert not terminated.any() and np.isfinite(observations).all()
        assert (info["estimate_error"][[0, 2]] < 0.3e-3).all()
    assert (info["estimate_error"] < 0.5e-3).all()


def test_estimator_without_a_status_begins_anew_for_all():
    envs, recorder = recorded(2)
    envs.reset(seed=0)
    recorder.calls = []

    def fail(field, duration):
        raise SimulationDiverged("rod 1 left the stable range.")

    recorder.predict = fail
    info = envs.step(np.zeros((2, 2), np.float32))[4]
    assert info["estimate_lost"].tolist() == [True, True]
    ((field, mask),) = recorder.told("reset")
    assert mask is None
    np.testing.assert_array_equal(field, 0.0)


def test_start_that_buckles_the_estimators_rod_begins_straight():
    envs, recorder = recorded(3)

    def reset(field=None, mask=None):
        Recorder.reset(recorder, field, mask)
        if field is not None and (mask is None or mask[1]):
            raise StabilityError("field must lead to a stable equilibrium.")

    recorder.reset = reset
    envs.reset(seed=0)
    last = {tuple(mask): field for field, mask in recorder.told("reset") if mask is not None}
    assert last[(False, True, False)] is None and last[(True, False, False)] is not None


def test_the_hardest_driving_neither_fails_nor_loses_the_rod():
    """White noise of the coils' full strength: the rod is thrown about at a metre a second."""
    envs = EstimateState(MagRodVectorEnv(num_envs=6, num_elements=4, rotary_scaling=8.0, randomization=SOFT))
    envs.reset(seed=0)
    errors = []
    for actions in scripted_actions(envs.action_space, 60, overdrive=1.0):
        observations, _, _, _, info = envs.step(actions)
        errors.append(info["estimate_error"])
        assert np.isfinite(observations).all()
    assert np.median(errors[20:]) < 2e-3
    assert envs.estimator.members.simulation.time_step > 5e-5


# ---- other estimators, cameras, copies, agents


@pytest.mark.parametrize(
    "options",
    [
        {"estimator": PredictionFilter},
        {"estimator": partial(EnsembleFilter, num_members=8, parameters={"modulus": 0.2})},
        {"cameras": StereoCameras(), "members": 8, "markers": (0.5, 1.0)},
    ],
    ids=["prediction", "own ensemble", "stereo, two markers"],
)
def test_other_estimators_cameras_and_markers(options):
    plain = MagRodVectorEnv(num_envs=2, num_elements=4, randomization=Randomization(modulus=0.05))
    length = plain.core.scene.rod.length
    if "markers" in options:
        options = options | {"markers": tuple(length * share for share in options["markers"])}
    envs = EstimateState(plain, **options)
    envs.reset(seed=0)
    for actions in smooth(envs.action_space, 25):
        info = envs.step(actions)[4]
    assert (info["estimate_error"] < 0.5e-3).all()
    assert envs.estimator.innovation.shape == (2, 2 if "markers" in options else 1, 3)


@pytest.mark.parametrize("clone", [copy.deepcopy, lambda env: pickle.loads(pickle.dumps(env))], ids=["copy", "pickle"])
def test_copies_go_on_alike(clone):
    env = EstimateState(MagRodEnv(num_elements=3, camera=NOISY), members=4, timed=False)
    actions = scripted_actions(env.action_space, 6)
    run(env, actions[:3], 1)
    twin = clone(env)
    want = copy_of([env.step(action) for action in actions[3:]] + [env.reset()])
    assert_same([twin.step(action) for action in actions[3:]] + [twin.reset()], want)


def test_equal_seeds_give_equal_estimates_and_others_other_noise():
    env = MagRodEnv(num_elements=3, observe="estimate", random_start=False)
    actions = scripted_actions(env.action_space, 3)
    first, again, other = (copy_of(run(env, actions, seed)) for seed in (1, 1, 2))
    assert_same(again, first)
    assert first[-1][-1]["tip_position"].tolist() == other[-1][-1]["tip_position"].tolist()
    assert first[-1][-1]["estimate_error"] != other[-1][-1]["estimate_error"]


def test_controllers_run_on_estimates():
    """The trained policy holds the circle about as well as with a perfect camera."""
    errors = {}
    for observe in ("camera", "estimate"):
        for controller in (Policy.load(WEIGHTS), InverseStatics()):
            envs = gymnasium.make_vec("MagRod/Circle-v0", num_envs=4, randomization=SOFT, observe=observe)
            observations, _ = envs.reset(seed=0)
            history = []
            for _ in range(60):
                observations, _, _, _, info = envs.step(controller(observations, envs).astype(np.float32))
                history.append(info["tip_error"])
            errors[observe, type(controller).__name__] = np.mean(history[25:])
    assert errors["estimate", "Policy"] < errors["camera", "Policy"] + 0.3e-3
    assert errors["estimate", "Policy"] < errors["estimate", "InverseStatics"]


# ---- bad input


class Lacking:
    def __init__(self, scene, **settings):
        self.time = 0.0


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"estimator": 3}, ["estimator", "3", "called"]),
        ({"estimator": Lacking}, ["estimator", "Lacking", "lacks reset, predict"]),
        ({"estimator": lambda scene, **settings: EnsembleFilter(scene)}, ["positions of the estimator", "(1, 4, 3)"]),
        ({"estimator": Recorder, "members": 4}, ["members", "4"]),
        ({"members": 0}, ["members", "0"]),
        ({"members": 1}, ["num_members", "2"]),
        ({"markers": "middle"}, ["markers", "middle"]),
        ({"markers": (0.011,)}, ["marker", "0.011", "num_elements"]),
        ({"cameras": 5}, ["cameras", "measure", "5"]),
    ],
)
def test_bad_options_are_refused_with_a_sentence(options, words):
    with pytest.raises(ValueError) as error:
        EstimateState(MagRodEnv(num_elements=3), **options)
    assert len(str(error.value)) < 400
    for word in words:
        assert word in str(error.value)


def test_environments_that_cannot_be_estimated_are_refused():
    for env in (gymnasium.make("CartPole-v1"), SyncVectorEnv([lambda: MagRodEnv(num_elements=3)]), None):
        with pytest.raises(ValueError, match="env must be a MagRodEnv"):
            EstimateState(env)
    with pytest.raises(ValueError, match=r'observe .* must be "camera" or "estimate", but got "state"'):
        EstimateState(MagRodEnv(num_elements=3, observe="state"))


def test_who_estimates_nothing_loads_no_estimator():
    code = "import sys, magrod_env.envs; sys.exit('magrod_env.estimation' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code], timeout=120).returncode == 0


def test_wrapped_in_the_middle_of_an_episode_it_asks_for_a_reset():
    env = MagRodEnv(num_elements=3)
    env.reset(seed=0)
    wrapped = EstimateState(env, estimator=Recorder)
    with pytest.raises(gymnasium.error.ResetNeeded):
        wrapped.step(np.zeros(2, np.float32))
