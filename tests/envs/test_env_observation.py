"""Observations against their table: what each entry is, what the camera does to it, and the full state."""

import numpy as np
import pytest
from rollouts import EVERYTHING_VARIES, FEW, assert_same, run, scripted_actions

from magrod_env.envs import Camera, MagRodEnv, MagRodVectorEnv
from magrod_env.magnetics import Actuator
from magrod_env.rod.layout import PLANAR, SPATIAL

pytestmark = pytest.mark.filterwarnings("error")

STEP = 0.02  # s
SINGLE = 1e-6  # observations are float32 numbers of order one to ten
TASKS = {"circle": 1, "path": 1, "reach": 1, "two_magnet": 2, "planar_reach": 1}  # number of tracked points


def entries(env, observation):
    """The entries of an observation by name, as its table lists them."""
    points, axes = TASKS[env.core.task_name], env.core.coils.num_axes
    sizes = [("position", 3 * points), ("velocity", 3 * points), ("field", axes), ("target", 3 * points)]
    if env.core.task_name not in ("reach", "planar_reach"):
        sizes += [("ahead 0.04", 3 * points), ("ahead 0.1", 3 * points), ("ahead 0.2", 3 * points)]
    found, at = {}, 0
    for name, size in sizes:
        found[name] = observation[at : at + size].astype(float)
        at += size
    return found | {"rest": observation[at:].astype(float)}


def make(task, **settings):
    env = MagRodEnv(task, num_elements=FEW[task], **settings)
    env.core.task_name = task
    return env


def gentle_actions(env, count, seed):
    """From the field that holds this seed's start, slowly and a little round: every entry stays within its bounds."""
    info = env.reset(seed=seed)[1]
    hold = info["field_applied"][["xyz".index(axis) for axis in env.core.coils.axes]] / env.core.actuator.limit
    angles = 0.15 * np.arange(1, count + 1)
    return hold + 0.1 * np.stack([np.sin(angles), 1.0 - np.cos(angles)], axis=1)


@pytest.mark.parametrize("task", TASKS)
def test_entries_are_what_the_table_says(task):
    """From the infos alone: positions over L, velocities over L/s, field over the limit, targets over L/10."""
    env = make(task)
    length, limit = env.core.scene.rod.length, env.core.actuator.limit
    axes = ["xyz".index(axis) for axis in env.core.coils.axes]
    actions = gentle_actions(env, 30, 2)
    observation, info = env.reset(seed=2)
    seen = [entries(env, observation)]
    np.testing.assert_array_equal(seen[0]["velocity"], 0.0)
    infos = [info]
    for action in actions:
        observation, _, _, _, info = env.step(action)
        assert np.abs(observation).max() < 10.0  # else the bound would hide what is compared
        seen.append(entries(env, observation))
        infos.append(info)
    for k, (now, info) in enumerate(zip(seen, infos, strict=True)):
        assert now["rest"].size == 0
        np.testing.assert_allclose(now["position"][:3] * length, info["tip_position"], rtol=0, atol=SINGLE * length)
        np.testing.assert_allclose(now["field"] * limit, info["field_applied"][axes], rtol=0, atol=SINGLE * limit)
        gap = info["target"] - info["tip_position"]
        np.testing.assert_allclose(now["target"][:3] * length / 10.0, gap, rtol=0, atol=SINGLE * length)
        if task == "two_magnet":
            middle = np.linalg.norm(now["target"][3:]) * length / 10.0
            np.testing.assert_allclose(middle, info["middle_error"], rtol=0, atol=SINGLE * length)
        if k:
            want = (now["position"] - seen[k - 1]["position"]) / STEP
            np.testing.assert_allclose(now["velocity"], want, rtol=0, atol=2e-5)  # a difference of float32 over 20 ms


@pytest.mark.parametrize("task", ["circle", "path", "two_magnet"])
def test_preview_is_where_the_target_will_be(task):
    """0.04, 0.1 and 0.2 s ahead are 2, 5 and 10 control steps of the targets that the infos then report."""
    env = make(task)
    length = env.core.scene.rod.length
    results = run(env, gentle_actions(env, 30, 5), 5)
    targets = [result[-1]["target"] for result in results]
    for k in range(20):
        now = entries(env, results[k][0])
        for name, steps in (("ahead 0.04", 2), ("ahead 0.1", 5), ("ahead 0.2", 10)):
            want = targets[k + steps] - targets[k]
            np.testing.assert_allclose(now[name][:3] * length / 10.0, want, rtol=0, atol=SINGLE * length)


@pytest.mark.parametrize("task", ["reach", "planar_reach"])
def test_reaching_has_a_fixed_target_and_no_preview(task):
    env = make(task)
    results = run(env, gentle_actions(env, 5, 5), 5)
    assert all(np.array_equal(result[-1]["target"], results[0][-1]["target"]) for result in results)
    assert len(results[0][0]) == 9 + env.core.coils.num_axes


def test_control_rate_scales_time_and_not_the_preview():
    """At 25 Hz a step lasts 40 ms: the first preview is the next target, and the circle takes 50 steps."""
    env = make("circle", control_rate=25.0)
    results = run(env, np.zeros((51, 2)), 0)
    length = env.core.scene.rod.length
    first, second = (results[k][-1]["target"] for k in (0, 1))
    np.testing.assert_allclose(
        entries(env, results[0][0])["ahead 0.04"] * length / 10, second - first, atol=SINGLE * length
    )
    np.testing.assert_allclose(results[50][-1]["target"], first, rtol=0, atol=1e-12)
    assert env.metadata["render_fps"] == 25.0


def positions_seen(env, results):
    """Positions of the tip as the camera shows them, m."""
    return np.array([result[0][:3] for result in results], float) * env.core.scene.rod.length


def positions_true(results):
    return np.array([result[-1]["tip_position"] for result in results])


def test_camera_noise_has_its_standard_deviation():
    """Of 3 x 16,000 coordinates: mean and standard deviation within four standard errors; frames are independent."""
    noise, num_envs, steps = 2e-4, 64, 250
    batch = MagRodVectorEnv("reach", num_envs, num_elements=3, camera=Camera(noise=noise))
    errors = []
    for result in run(batch, np.zeros((steps, num_envs, 2)), 0):
        seen = result[0][:, :3].astype(float) * batch.core.scene.rod.length
        errors.append(seen - result[-1]["tip_position"])
    errors = np.array(errors)
    assert abs(errors.mean()) < 4.0 * noise / np.sqrt(errors.size)
    assert abs(errors.std() / noise - 1.0) < 4.0 / np.sqrt(2.0 * errors.size)
    for axis in range(3):
        assert abs(errors[..., axis].std() / noise - 1.0) < 4.0 / np.sqrt(2.0 * errors[..., axis].size)
    unit = errors / noise
    few = 4.0 / np.sqrt(unit.size / 3)
    assert abs(np.mean(unit[1:] * unit[:-1])) < few  # in time
    assert abs(np.mean(unit[..., 0] * unit[..., 1])) < few  # between coordinates
    assert abs(np.mean(unit[:, 1:] * unit[:, :-1])) < few  # between environments
    assert abs(np.mean(unit**4) - 3.0) < 0.1  # normal: the kurtosis of a uniform one would be 1.8


def test_noise_acts_on_position_velocity_and_gap_alike():
    """All three are of the same noisy frames."""
    env = make("circle", camera=Camera(noise=1e-4))
    results = run(env, gentle_actions(env, 10, 0), 0)
    seen, length = positions_seen(env, results), env.core.scene.rod.length
    for k in range(1, 11):
        now = entries(env, results[k][0])
        if np.abs(now["velocity"]).max() < 10.0:
            np.testing.assert_allclose(now["velocity"] * length, (seen[k] - seen[k - 1]) / STEP, atol=2e-5 * length)
        gap = results[k][-1]["target"] - seen[k]
        np.testing.assert_allclose(now["target"] * length / 10, gap, rtol=0, atol=SINGLE * length)


@pytest.mark.parametrize("delay_steps", [1, 2, 3, 5])
def test_delayed_frames_show_the_past(delay_steps):
    """An observation shows the tip as it was `delay` ago; the start until then."""
    env = make("circle", camera=Camera(delay=delay_steps * STEP))
    results = run(env, scripted_actions(env.action_space, 15), 0)
    true, seen = positions_true(results), positions_seen(env, results)
    want = true[np.maximum(np.arange(16) - delay_steps, 0)]
    np.testing.assert_allclose(seen, want, rtol=0, atol=SINGLE * env.core.scene.rod.length)


@pytest.mark.parametrize("every", [2, 3, 5])
@pytest.mark.parametrize("delay_steps", [0, 1, 4])
def test_slow_camera_holds_its_frames(every, delay_steps):
    """A frame every few control steps, seen `delay` after it was taken; velocity over the time between frames."""
    delay = delay_steps * STEP or None
    env = make("circle", camera=Camera(rate=50.0 / every, delay=delay))
    results = run(env, gentle_actions(env, 20, 0), 0)
    true, seen = positions_true(results), positions_seen(env, results)
    length = env.core.scene.rod.length
    taken = np.maximum(np.arange(21) - delay_steps, 0) // every * every  # the step of the newest frame that has arrived
    np.testing.assert_allclose(seen, true[taken], rtol=0, atol=SINGLE * length)
    before = np.maximum(taken - every, 0)
    for k in range(21):
        want = (true[taken[k]] - true[before[k]]) / (every * STEP)
        np.testing.assert_allclose(entries(env, results[k][0])["velocity"] * length, want, rtol=0, atol=2e-5 * length)


def test_held_frames_keep_their_noise():
    """A frame is noisy once, not anew at every step that shows it."""
    env = make("circle", camera=Camera(noise=1e-3, rate=10.0))
    seen = positions_seen(env, run(env, gentle_actions(env, 20, 0), 0))
    for first in (0, 5, 10, 15):
        assert len(np.unique(seen[first : first + 5], axis=0)) == 1
    assert len(np.unique(seen, axis=0)) == 5


def test_camera_sees_the_target_and_the_coils_without_delay():
    """Only what is filmed is late: target and field entries are those of now."""
    env = make("circle", camera=Camera(delay=0.1))
    results = run(env, gentle_actions(env, 12, 0), 0)
    seen = positions_seen(env, results)
    for k, result in enumerate(results):
        now, info = entries(env, result[0]), result[-1]
        np.testing.assert_allclose(now["field"] * 45e-3, info["field_applied"][1:], rtol=0, atol=SINGLE * 45e-3)
        gap = now["target"] * env.core.scene.rod.length / 10
        np.testing.assert_allclose(gap, info["target"] - seen[k], rtol=0, atol=SINGLE)


def test_every_tracked_point_is_seen_through_the_same_camera():
    env = make("two_magnet", camera=Camera(noise=1e-4, delay=0.04, rate=25.0))
    plain = make("two_magnet")
    actions = gentle_actions(plain, 12, 3)
    noisy, clear = run(env, actions, 3), run(plain, actions, 3)
    length = env.core.scene.rod.length
    taken = np.maximum(np.arange(13) - 2, 0) // 2 * 2
    errors = np.array([noisy[k][0][:6] - clear[taken[k]][0][:6] for k in range(13)]) * length
    assert 0.5e-4 < errors.std() < 1.5e-4
    assert np.abs(errors.mean(axis=0)).max() < 1e-4


def state_of(env):
    """Physics state of the free nodes from the rows of the batch: position, rotation, velocity, spin."""
    batch = env.core.batch
    rows = SPATIAL if batch.plane is None else PLANAR
    parts = {}
    for name, count in zip(("position", "rotation", "velocity", "momentum"), (3, 4, 3, 3), strict=True):
        count = count if batch.plane is None else {"position": 2, "rotation": 2, "velocity": 2, "momentum": 1}[name]
        parts[name] = batch.nodes(getattr(rows, name), count)[0, 1:]
    compliance = batch.nodes(rows.compliance, 2 if batch.plane is None else 1)[0, 1:]
    both = compliance[:, [0, 1, 1]] if batch.plane is None else compliance
    parts["spin"] = 2.0 * both * parts["momentum"]
    return parts


@pytest.mark.parametrize("task", ["circle", "planar_reach", "two_magnet"])
def test_state_entries_are_the_physics_state(task):
    """Position over L, quaternion, velocity over L/s, body spin over 10 rad/s of every free node."""
    env = make(task, observe="state")
    length, plain = env.core.scene.rod.length, make(task)
    size = plain.observation_space.shape[0]
    per_node = 7 if task == "planar_reach" else 13
    num_nodes = FEW[task]
    assert env.observation_space.shape == (size + num_nodes * per_node,)
    twin = [plain.reset(seed=4)]
    actions = gentle_actions(env, 12, 4)
    results = [env.reset(seed=4)]
    for action in actions:
        results.append(env.step(action))
        twin.append(plain.step(action))
        nodes, state = results[-1][0][size:].reshape(num_nodes, per_node).astype(float), state_of(env)
        n = state["position"].shape[1]
        turn = state["rotation"].shape[1]
        np.testing.assert_allclose(nodes[:, :n] * length, state["position"], rtol=0, atol=SINGLE * length)
        np.testing.assert_allclose(nodes[:, n : n + turn], state["rotation"], rtol=0, atol=SINGLE)
        np.testing.assert_allclose(
            nodes[:, n + turn : 2 * n + turn] * length, state["velocity"], rtol=1e-6, atol=SINGLE
        )
        np.testing.assert_allclose(nodes[:, 2 * n + turn :] * 10.0, state["spin"], rtol=1e-6, atol=SINGLE)
    for got, want in zip(results, twin, strict=True):
        assert_same(got[0][:size], want[0])
        assert_same(got[1:], want[1:])
    # The last node carries the tip magnet: its position is the tracked one.
    tip = results[-1][0][size:].reshape(num_nodes, per_node)[-1]
    columns = [0, 2] if task == "planar_reach" else [0, 1, 2]
    np.testing.assert_array_equal(tip[: len(columns)], results[-1][0][columns])


def test_state_velocity_is_the_derivative_of_the_position():
    """Central differences over control steps of 0.1 ms, shorter than the fastest mode of the rod."""
    env = make("circle", observe="state", control_rate=10000.0)
    size = make("circle").observation_space.shape[0]
    results = run(env, np.zeros((100, 2)), 0)
    nodes = np.array([result[0][size:].reshape(3, 13) for result in results], float)
    middle = (nodes[2:, :, :3] - nodes[:-2, :, :3]) / 2e-4
    got = nodes[1:-1, :, 7:10]
    fast = np.abs(got).max()
    assert 0.5 < fast < 10.0
    np.testing.assert_allclose(got, middle, rtol=0, atol=0.02 * fast)


def test_noise_leaves_the_state_alone():
    """Camera entries are noisy, state entries are the simulator's own."""
    clear, noisy = make("circle", observe="state"), make("circle", observe="state", camera=Camera(noise=1e-3))
    size = make("circle").observation_space.shape[0]
    for want, got in zip(run(clear, np.zeros((5, 2)), 0), run(noisy, np.zeros((5, 2)), 0), strict=True):
        assert_same(got[0][size:], want[0][size:])
        assert not np.array_equal(got[0][:3], want[0][:3])


def test_planar_observation_stays_in_its_plane():
    env = make("planar_reach")
    for result in run(env, scripted_actions(env.action_space, 20), 0):
        now = entries(env, result[0])
        assert now["position"][1] == now["velocity"][1] == now["target"][1] == 0.0
        assert result[-1]["tip_position"][1] == result[-1]["field_applied"][1] == 0.0


def test_planar_motion_equals_the_spatial_one():
    """The planar kernel is the spatial scheme restricted to the plane: 1 nm after 0.4 s of strong fields."""
    planar, spatial = make("planar_reach"), make("planar_reach", plane=None)
    spatial.core.time_step, spatial.core.num_steps = planar.core.time_step, planar.core.num_steps
    actions = scripted_actions(planar.action_space, 20)
    for got, want in zip(run(planar, actions, 0), run(spatial, actions, 0), strict=True):
        np.testing.assert_allclose(got[-1]["tip_position"], want[-1]["tip_position"], rtol=0, atol=1e-9)
        np.testing.assert_array_equal(got[-1]["target"], want[-1]["target"])


def test_float32_stays_near_float64():
    """Over 0.2 s of strong fields the tip differs by less than 10 micrometres."""
    double, single = make("circle"), make("circle", precision="float32")
    assert double.core.num_steps == single.core.num_steps
    actions = scripted_actions(double.action_space, 10)
    for got, want in zip(run(single, actions, 0), run(double, actions, 0), strict=True):
        assert got[0].dtype == np.float32 and got[-1]["tip_position"].dtype == np.float64
        np.testing.assert_allclose(got[-1]["tip_position"], want[-1]["tip_position"], rtol=0, atol=1e-5)


@pytest.mark.parametrize("observe", ["camera", "state"])
def test_observations_stay_in_their_space_under_hard_driving(observe):
    batch = MagRodVectorEnv(
        "circle", 8, num_elements=3, observe=observe, randomization=EVERYTHING_VARIES, camera=Camera(noise=1e-3),
        actuator=Actuator(),
    )  # fmt: skip
    for result in run(batch, scripted_actions(batch.action_space, 40, overdrive=3.0), 0):
        assert result[0] in batch.observation_space
