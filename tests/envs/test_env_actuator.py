"""The coils between action and field: closed forms for lag, slew limit, saturation and dead time, alone and mixed."""

import numpy as np
import pytest
from rollouts import EVERYTHING_VARIES, assert_same, copy_of, run, scripted_actions

from magrod_env.envs import MagRodEnv, MagRodVectorEnv, Randomization
from magrod_env.magnetics import Actuator

pytestmark = pytest.mark.filterwarnings("error")

LIMIT, STEP = 45e-3, 0.02  # T, s
TINY = 1e-12 * LIMIT  # T: rounding of some hundred steps of numbers of the size of the limit


def reach(actuator, **settings):
    """A rod that starts in zero field."""
    return MagRodEnv("reach", num_elements=3, actuator=actuator, **settings)


def fields(env, actions, seed=0):
    """Start field and the fields after each action, T, (len(actions) + 1, 3)."""
    start = env.reset(seed=seed)[1]["field_applied"]
    return np.array([start] + [env.step(np.array(action, np.float32))[4]["field_applied"] for action in actions])


ACTIONS = [(1.0, 0.0), (1.0, -0.5), (-1.0, -0.5), (0.25, 0.75), (0.25, 0.75), (0.0, 0.0), (0.0, 0.0)]
COMMANDS = LIMIT * np.array([(0.0, *action) for action in ACTIONS])


def test_bare_coils_follow_the_command_at_once():
    np.testing.assert_allclose(fields(reach(Actuator()), ACTIONS)[1:], COMMANDS, rtol=0, atol=TINY)


@pytest.mark.parametrize("axes", ["yz", "zy", "xyz", "zxy"])
def test_each_axis_drives_its_own_component(axes):
    env = reach(Actuator(limit=30e-3), axes=axes)
    actions = np.linspace(-0.9, 0.7, len(axes))
    env.reset(seed=0)
    want = np.zeros(3)
    for letter, action in zip(axes, actions, strict=True):
        want["xyz".index(letter)] = 30e-3 * action
    info = env.step(actions)[4]
    np.testing.assert_allclose(info["field_applied"], want, rtol=0, atol=TINY)


def test_coils_saturate_and_say_so():
    """Beyond the limit the field is the limit's, the flag is set, and the episode goes on as with the limit itself."""
    env, twin = reach(Actuator()), reach(Actuator())
    env.reset(seed=0), twin.reset(seed=0)
    for action in [(1.0, 1.0), (1.001, 0.0), (0.0, -1e6), (-1.0, 1.0)]:
        clipped = np.clip(action, -1.0, 1.0)
        got, want = env.step(np.array(action)), twin.step(clipped)
        assert got[4]["saturated"] is bool(np.any(clipped != action))
        assert want[4]["saturated"] is False
        np.testing.assert_allclose(got[4]["field_applied"], [0.0, *(LIMIT * clipped)], rtol=0, atol=TINY)
        assert_same(got[:4], want[:4])


@pytest.mark.parametrize("lag", [2e-3, 0.03, 0.5])
def test_lag_is_the_exact_first_order_response(lag):
    """B(t) = target + (B0 - target) exp(-t/lag), whatever the physics step."""
    got = fields(reach(Actuator(lag=lag)), ACTIONS)
    for before, after, command in zip(got, got[1:], COMMANDS, strict=False):
        np.testing.assert_allclose(after, command + (before - command) * np.exp(-STEP / lag), rtol=0, atol=TINY)


@pytest.mark.parametrize("slew", [0.3, 2.0, 100.0])
def test_slew_limit_is_a_ramp(slew):
    """Each component moves by at most slew * t, and stops on the command."""
    got = fields(reach(Actuator(slew_limit=slew)), ACTIONS)
    for before, after, command in zip(got, got[1:], COMMANDS, strict=False):
        np.testing.assert_allclose(
            after, before + np.clip(command - before, -slew * STEP, slew * STEP), rtol=0, atol=TINY
        )


def test_slew_limit_before_lag():
    """A ramp through a lag: B lags it by slew * lag (1 - exp(-t/lag)), to first order in the physics step."""
    slew, lag = 1.0, 0.05
    env = reach(Actuator(slew_limit=slew, lag=lag))
    got = fields(env, [(1.0, 0.0)] * 2)
    times = STEP * np.arange(3)
    want = slew * (times - lag * (1.0 - np.exp(-times / lag)))
    # The reference climbs stairs of half a physics step, at the start of each: a quarter step ahead on average.
    np.testing.assert_allclose(got[:, 1], want, rtol=0, atol=0.5 * slew * env.core.time_step)
    assert np.all(got[1:, 1] > 0.0)


@pytest.mark.parametrize("late", [1, 2, 5])
def test_dead_time_of_whole_control_steps_shifts_the_commands(late):
    got = fields(reach(Actuator(dead_time=late * STEP)), ACTIONS)
    want = np.concatenate([np.zeros((late, 3)), COMMANDS])[: len(ACTIONS)]
    np.testing.assert_allclose(got[1:], want, rtol=0, atol=TINY)


def test_dead_time_of_a_fraction_of_a_control_step():
    """The command of a step acts for the rest of that step: seen exactly behind a lag."""
    late, lag = 0.25 * STEP, 0.01
    env = reach(Actuator(dead_time=late, lag=lag), time_step=1e-4)
    assert env.core.num_steps % 4 == 0  # so that a quarter of a control step is a whole number of physics steps
    got, command = fields(env, ACTIONS), np.zeros(3)
    for before, after, new in zip(got, got[1:], COMMANDS, strict=False):
        middle = command + (before - command) * np.exp(-late / lag)
        np.testing.assert_allclose(after, new + (middle - new) * np.exp(-(STEP - late) / lag), rtol=0, atol=TINY)
        command = new


def test_dead_time_of_one_and_a_half_control_steps():
    late, lag = 1.5 * STEP, 0.01
    got = fields(reach(Actuator(dead_time=late, lag=lag), time_step=1e-4), ACTIONS)
    commands = np.concatenate([np.zeros((2, 3)), COMMANDS])
    for k in range(len(ACTIONS)):
        middle = commands[k] + (got[k] - commands[k]) * np.exp(-0.5 * STEP / lag)
        want = commands[k + 1] + (middle - commands[k + 1]) * np.exp(-0.5 * STEP / lag)
        np.testing.assert_allclose(got[k + 1], want, rtol=0, atol=TINY)


def test_half_a_control_step_late_equals_twice_the_control_rate():
    """50 Hz with 10 ms of dead time is 100 Hz with every command one step later, bit for bit in the rod's motion."""
    step = 1e-4
    slow = reach(Actuator(dead_time=0.5 * STEP), time_step=step)
    fast = reach(Actuator(), control_rate=100.0, time_step=step)
    assert slow.core.num_steps == 2 * fast.core.num_steps
    assert_same(slow.reset(seed=1)[1], fast.reset(seed=1)[1])
    before = np.zeros(2, np.float32)
    for action in scripted_actions(slow.action_space, 6, overdrive=1.0):
        fast.step(before)
        want, got = fast.step(action)[4], slow.step(action)[4]
        for key in ("tip_position", "field_applied", "tip_error"):
            assert_same(got[key], want[key], key)
        before = action


@pytest.mark.parametrize(
    ("neutral", "tolerance"),
    [
        (Actuator(dead_time=1e-9), 0.0),
        # The field is reached by adding the difference, which rounds: 1e-9 m is far above that, far below an effect.
        (Actuator(slew_limit=1e9), 1e-9),
        (Actuator(lag=1e-9), 1e-9),
    ],
    ids=["dead time", "slew limit", "lag"],
)
def test_neutral_value_equals_none(neutral, tolerance):
    """An effect that is there but does nothing, and one that is absent, move the rod alike."""
    actions = scripted_actions(reach(Actuator()).action_space, 25)
    plain, other = run(reach(Actuator()), actions, 2), run(reach(neutral), actions, 2)
    for want, got in zip(plain, other, strict=True):
        np.testing.assert_allclose(got[-1]["tip_position"], want[-1]["tip_position"], rtol=0, atol=tolerance)
        np.testing.assert_allclose(got[-1]["field_applied"], want[-1]["field_applied"], rtol=0, atol=TINY)


def test_each_effect_changes_the_motion():
    """The rod feels what the field does between the control steps."""
    actions = scripted_actions(reach(Actuator()).action_space, 10)
    ends = [
        run(reach(actuator), actions, 0)[-1][-1]["tip_position"]
        for actuator in (
            Actuator(),
            Actuator(lag=5e-3),
            Actuator(slew_limit=5.0),
            Actuator(dead_time=5e-3),
            Actuator(limit=44e-3),
        )
    ]
    for i, one in enumerate(ends):
        assert all(np.linalg.norm(one - other) > 1e-5 for other in ends[:i])


@pytest.mark.parametrize("actuator", [Actuator(lag=0.1), Actuator(slew_limit=0.3), Actuator(dead_time=0.07)])
def test_reset_forgets_what_was_under_way(actuator):
    """Commands on their way, and a field on its way, do not reach into the next episode."""
    env = reach(actuator)
    want = copy_of(run(env, [(0.0, 0.0)] * 5, 6))
    env.reset(seed=0)
    for _ in range(3):
        env.step((1.0, -1.0))
    assert_same(run(env, [(0.0, 0.0)] * 5, 6), want)


def test_rod_stays_where_the_start_field_holds_it():
    """Circle starts in the field of its first point: repeating it keeps the rod at rest, also behind slow coils."""
    for actuator in (Actuator(), Actuator(lag=0.05, slew_limit=1.0, dead_time=0.045)):
        env = MagRodEnv("circle", num_elements=3, actuator=actuator)
        info = env.reset(seed=0)[1]
        start, hold = info["tip_position"], (info["field_applied"][1:] / LIMIT)
        np.testing.assert_allclose(start, info["target"], rtol=0, atol=1e-9)
        for _ in range(10):
            info = env.step(hold)[4]
        np.testing.assert_allclose(info["tip_position"], start, rtol=0, atol=1e-8)  # statics stop at 1e-8 m


def misaligned(num_envs, **settings):
    spread = Randomization(field_gain=0.2, field_misalignment=0.3)
    return MagRodVectorEnv("reach", num_envs, num_elements=3, randomization=spread, **settings)


def test_gain_and_misalignment_turn_and_scale_the_field():
    """field_applied = gain * rotation @ command, with gain and angle within bounds and the same over an episode."""
    batch = misaligned(64, axes="xyz")
    batch.reset(seed=0)
    columns = []
    for axis in range(3):
        action = np.zeros((64, 3), np.float32)
        action[:, axis] = 1.0
        columns.append(batch.step(action)[4]["field_applied"] / LIMIT)
    mixing = np.stack(columns, axis=2)
    gains = np.cbrt(np.linalg.det(mixing))
    rotations = mixing / gains[:, None, None]
    np.testing.assert_allclose(
        rotations @ rotations.transpose(0, 2, 1), np.broadcast_to(np.eye(3), (64, 3, 3)), atol=1e-12
    )
    angles = np.arccos(np.clip((np.trace(rotations, axis1=1, axis2=2) - 1.0) / 2.0, -1.0, 1.0))
    assert 0.8 <= gains.min() < 0.85 and 1.15 < gains.max() <= 1.2
    assert angles.min() < 0.05 and 0.25 < angles.max() <= 0.3 + 1e-9
    again = batch.step(np.full((64, 3), 0.5, np.float32))[4]["field_applied"]
    np.testing.assert_allclose(again, LIMIT * mixing @ np.full(3, 0.5), rtol=0, atol=TINY)


def test_coil_sensors_see_the_command_not_the_misaligned_field():
    """The observation's field entries are the coils' own: the command, whatever the gain and the misalignment."""
    batch = misaligned(8)
    batch.reset(seed=0)
    for actions in scripted_actions(batch.action_space, 3):
        observations, *_, info = batch.step(actions)
        np.testing.assert_allclose(observations[:, 6:8], np.clip(actions, -1, 1), rtol=0, atol=2e-7)  # float32
        assert np.all(np.abs(info["field_applied"][:, 1:] / LIMIT - np.clip(actions, -1, 1)).max(axis=1) > 1e-3)


def test_slew_limit_belongs_to_the_coils_not_to_the_world():
    """Behind misaligned coils of another gain, the coils' own sensors still see the closed form of the ramp."""
    slew = 0.5
    batch = misaligned(16, actuator=Actuator(slew_limit=slew))
    batch.reset(seed=0)
    seen = np.zeros((16, 2))
    for actions in scripted_actions(batch.action_space, 6, overdrive=1.0):
        now = batch.step(actions)[0][:, 6:8].astype(float)
        want = seen + np.clip(actions - seen, -slew * STEP / LIMIT, slew * STEP / LIMIT)
        np.testing.assert_allclose(now, want, rtol=0, atol=1e-6)  # observations are float32
        seen = now


def test_initial_field_is_seen_and_bounded():
    """The field of a start lies within the spread about the nominal one, on every axis, and in the observation."""
    spread = Randomization(initial_field=3e-3)
    batch = MagRodVectorEnv("reach", 256, num_elements=3, randomization=spread)
    observations, info = batch.reset(seed=0)
    assert np.abs(info["field_applied"]).max() <= 3e-3
    assert np.all(np.abs(info["field_applied"]).max(axis=0)[1:] > 2.5e-3)
    np.testing.assert_allclose(observations[:, 6:8], info["field_applied"][:, 1:] / LIMIT, rtol=0, atol=2e-7)


@pytest.mark.parametrize("settings", [{"axes": "yz"}, {"task": "planar_reach"}], ids=["yz", "planar"])
def test_initial_field_is_one_that_the_coils_can_make(settings):
    """No field lies along an axis that has no coils."""
    settings = {"task": "reach"} | settings
    batch = MagRodVectorEnv(num_envs=32, num_elements=3, randomization=Randomization(initial_field=3e-3), **settings)
    field = batch.reset(seed=0)[1]["field_applied"]
    without = ["xyz".index(axis) for axis in set("xyz") - set(batch.core.coils.axes)]
    np.testing.assert_array_equal(field[:, without], 0.0)


def test_everything_at_once_stays_within_the_limits():
    batch = MagRodVectorEnv(
        "circle",
        16,
        num_elements=3,
        randomization=EVERYTHING_VARIES,
        actuator=Actuator(slew_limit=0.5, lag=0.03, dead_time=0.031),
    )
    batch.reset(seed=0)
    bound = np.sqrt(2.0) * LIMIT * (1.0 + EVERYTHING_VARIES.field_gain)
    for actions in scripted_actions(batch.action_space, 30, overdrive=2.0):
        info = batch.step(actions)[4]
        assert np.linalg.norm(info["field_applied"], axis=1).max() <= bound
        assert not info["diverged"].any()
