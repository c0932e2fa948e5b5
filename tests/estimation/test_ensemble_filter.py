"""The ensemble filter: Kalman's formulas where all is linear, twins where it is not, frames that are late or lost."""

import numpy as np
import pytest
from rod.beams import with_tip
from scipy.linalg import expm

from estimation.twins import FRAME, NOISE, SCENE, fields, frame, stiffer, truth
from magrod_env import Simulation
from magrod_env.estimation import EnsembleFilter, Measurement, Unknown

KNOWN: dict[str, float] = {}
PLANAR = {"plane": "xz", "num_elements": 4, "num_threads": 1}
STILL = {"largest_growth": 1.0, "relaxation": 0.0}


def follow(estimator, commands, tips, generator, delay=0, honest=True):
    """Run a filter over (count, 3) T on frames of the tips (count + 1, 3), some frames late: errors of the tip (m)."""
    errors, statistics = [], []
    for k, field in enumerate(commands):
        estimator.predict(field, FRAME)
        shown = k + 1 - delay
        if shown > 0:
            time = shown * FRAME if honest else estimator.time
            estimator.update(frame(np.tile(tips[shown], (estimator.num_rods, 1)), time, generator))
            statistics.append(estimator.normalised_innovation.mean())
        errors.append(np.linalg.norm(estimator.tip_position - tips[k + 1], axis=1).mean())
    return np.array(errors), np.array(statistics)


# ---- the linear limit


def linear_rod(scene, memory):
    """Small planar motion over one frame, (n, n), of [nodes, their rates, load (x, z)], what the load's memory does to
    it, the number of the nodes' degrees of freedom and the rod.
    """
    simulation = Simulation(scene, num_elements=4, plane="xz")
    stiffness, inertia = simulation.rods.model.static.linearise(None)
    active = np.ravel(6 * np.arange(4)[:, None] + [0, 2, 4])
    inner, mass = stiffness[np.ix_(active, active)], inertia[active]
    size = len(active)
    rates = np.tile([scene.drag_rate, scene.drag_rate, scene.spin_drag_rate], 4)
    flow = np.zeros((2 * size + 2, 2 * size + 2))
    flow[:size, size : 2 * size] = np.eye(size)
    flow[size : 2 * size, :size] = -inner / mass[:, None]
    flow[size : 2 * size, size : 2 * size] = -np.diag(rates)
    flow[size : 2 * size : 3, -2] = 1.0
    flow[size + 1 : 2 * size : 3, -1] = 1.0
    decay = np.eye(2 * size + 2)
    decay[-2:, -2:] *= np.exp(-FRAME / memory)
    return expm(FRAME * flow), decay, size, simulation


def exact_filter(scene, unknown, tip_deviation, noise, frames, noise_first=True):
    """Means (tip's z) and standard deviations after each frame, by Kalman's formulas; the load changes before each
    frame's motion or after it.
    """
    move, decay, size, simulation = linear_rod(scene, unknown.memory)
    mean, covariance = np.zeros(len(move)), np.zeros((len(move), len(move)))
    covariance[-2:, -2:] = unknown.deviation**2 * np.eye(2)
    shape = np.zeros(len(move))
    arc, length = simulation.arc_lengths, scene.rod.length
    curvature = 3.0 * (length - 0.5 * (arc[1:] + arc[:-1])) / length**3  # of a load at the tip, piece by piece
    slope = np.concatenate([[0.0], np.cumsum(curvature * np.diff(arc))])
    shape[1:size:3] = np.cumsum(0.5 * (slope[1:] + slope[:-1]) * np.diff(arc))
    shape[2:size:3] = -slope[1:]
    covariance += tip_deviation**2 * np.outer(shape, shape)
    observe = np.zeros((2, len(move)))
    observe[0, size - 3] = observe[1, size - 2] = 1.0
    gained = np.zeros_like(covariance)
    gained[-2:, -2:] = unknown.deviation**2 * (1.0 - np.exp(-2.0 * FRAME / unknown.memory)) * np.eye(2)
    means, deviations = [], []
    for seen in frames:
        if noise_first:
            mean, covariance = move @ decay @ mean, move @ (decay @ covariance @ decay.T + gained) @ move.T
        else:
            mean, covariance = decay @ move @ mean, decay @ move @ covariance @ move.T @ decay.T + gained
        total = observe @ covariance @ observe.T + noise**2 * np.eye(2)
        gain = covariance @ observe.T @ np.linalg.inv(total)
        mean = mean + gain @ (seen - observe @ mean)
        covariance = covariance - gain @ observe @ covariance
        means.append(mean[size - 2])
        deviations.append(np.sqrt(covariance[size - 2, size - 2]))
    return np.array(means), np.array(deviations)


@pytest.mark.parametrize(("members", "share"), [(24, 0.5), (400, 0.1)])
def test_small_motions_are_filtered_as_kalman_would(members, share):
    """All modes, no extras: what is left is the sampling error, a share of the estimate's own standard deviation."""
    scene = SCENE.replace(gravity=None, magnets=with_tip(SCENE.rod).magnets)
    load, tip, noise = Unknown(deviation=1e-3, memory=0.3), 2e-6, 1e-6
    generator = np.random.default_rng(3)
    seen = 3e-6 * np.sin(2.0 * np.pi * FRAME * np.arange(1, 26))[:, None] * [0.0, 1.0]
    seen = seen + noise * generator.standard_normal(seen.shape)
    means, deviations = exact_filter(scene, load, tip, noise, seen)
    estimator = EnsembleFilter(
        scene,
        num_members=members,
        parameters={"acceleration": load},
        tip_deviation=tip,
        num_modes=12,
        **PLANAR,
        **STILL,
    )
    found, spread = [], []
    for k, (x, z) in enumerate(seen):
        estimator.predict((0.0, 0.0, 0.0), FRAME)
        positions = np.array([[[scene.rod.length + x, 0.0, z]]])
        estimator.update(Measurement(positions=positions, covariance=noise**2 * np.eye(3), time=(k + 1) * FRAME))
        found.append(estimator.tip_position[0, 2])
        spread.append(estimator.uncertainty[0, -1, 2])
    assert np.sqrt(np.mean((np.array(found) - means) ** 2)) < share * deviations.mean()
    np.testing.assert_allclose(spread, deviations, rtol=share)


# ---- twins


def test_a_wrong_modulus_and_a_turned_field_are_found():
    """Truth: three times the elements, 15 % stiffer, the field turned by 0.06 rad. On the average of three runs within
    0.01 rad, where one may be off by 0.012, and each within twice its own standard deviation.
    """
    commands, turn = fields(75), (0.0, 0.06, -0.04)
    tips = truth(stiffer(SCENE, 1.15), commands, misalignment=turn)
    found = {"modulus": [], "misalignment_y": [], "misalignment_z": []}
    true = {"modulus": 1.15, "misalignment_y": turn[1], "misalignment_z": turn[2]}
    for seed in range(3):
        estimator = EnsembleFilter(
            SCENE, num_members=32, parameters={"modulus": 0.2, "misalignment": 0.05}, num_elements=4, num_threads=1
        )
        estimator.reset(commands[0])
        errors, _ = follow(estimator, commands, tips, np.random.default_rng(seed))
        assert errors[25:].mean() < NOISE
        for name, values in found.items():
            values.append(estimator.parameters[name][0] - true[name])
            assert abs(values[-1]) < 2.0 * estimator.parameter_uncertainty[name][0]
        assert (estimator.parameter_uncertainty["modulus"] < 0.02).all()
    assert np.abs(found["modulus"]).max() < 0.02
    for axis in "yz":
        assert abs(np.mean(found[f"misalignment_{axis}"])) < 0.01
        assert np.abs(found[f"misalignment_{axis}"]).max() < 0.012


def test_without_an_estimator_the_same_rod_is_far_off():
    commands = fields(75)
    tips = truth(stiffer(SCENE, 1.15), commands, misalignment=(0.0, 0.06, -0.04))
    blind = truth(SCENE, commands, num_elements=4)
    assert np.linalg.norm(blind - tips, axis=1).mean() > 10 * NOISE


def test_innovations_are_as_large_as_they_should_be():
    """Truths drawn from the prior: the normalised innovation squared has the mean of its degrees of freedom."""
    commands, generator, statistics = fields(40, "xz"), np.random.default_rng(5), []
    for factor in np.exp(0.2 * generator.standard_normal(8)):
        tips = truth(stiffer(SCENE, factor), commands, num_elements=4, plane="xz")
        estimator = EnsembleFilter(
            SCENE, num_members=32, parameters={"modulus": 0.2}, tip_deviation=0.0, **PLANAR, **STILL
        )
        estimator.reset(commands[0])
        statistics.append(follow(estimator, commands, tips, generator)[1])
    ratio = np.mean(statistics) / 3.0
    assert 0.8 < ratio < 1.25  # 8 x 40 x 3 numbers: +-0.05


def test_a_sudden_load_is_followed():
    """Half a newton a kilogram more weight from one frame to the next, which nothing in the filter stands for."""
    commands = np.tile([0.0, 0.0, 8e-3], (60, 1))
    before = Simulation(SCENE, num_elements=8, plane="xz", num_threads=1)
    before.reset(commands[0])
    after = Simulation(SCENE.replace(gravity=(0.0, 0.0, -10.81)), num_elements=8, plane="xz", num_threads=1)
    after.rods.motion.write(before.positions, before.rods.motion.quaternions)
    tips = [before.tip_position[0]] * 21
    for field in commands[20:]:
        after.advance(FRAME, field)
        tips.append(after.tip_position[0])
    quick = EnsembleFilter(SCENE, num_members=32, **PLANAR)
    blind = EnsembleFilter(SCENE, num_members=32, parameters={"modulus": 0.2}, **PLANAR, **STILL)
    late = []
    for estimator in (quick, blind):
        estimator.reset(commands[0])
        late.append(follow(estimator, commands, tips, np.random.default_rng(1))[0][40:].mean())
    assert late[0] < 2.0 * NOISE
    assert late[0] < 0.5 * late[1]
    assert quick.parameters["acceleration_z"][0] < -0.3


# ---- frames


def test_coasting_keeps_the_estimate_and_lets_uncertainty_grow():
    estimator = EnsembleFilter(SCENE, num_members=16, **PLANAR)
    estimator.reset((0.0, 0.0, 8e-3))
    tip, doubt = estimator.tip_position, estimator.uncertainty[0, -1]
    estimator.update(None)
    np.testing.assert_array_equal(estimator.tip_position, tip)
    assert np.isnan(estimator.innovation).all() and np.isnan(estimator.normalised_innovation).all()
    estimator.update(frame([[np.nan, 0.0, 0.0]], 0.0))
    np.testing.assert_allclose(estimator.tip_position, tip, atol=1e-12)
    assert estimator.innovation_dof[0] == 0
    estimator.update(frame(tip, 0.0))
    sure = estimator.uncertainty[0, -1, 2]
    assert sure < 0.1 * doubt[2]
    for _ in range(50):
        estimator.predict((0.0, 0.0, 8e-3), FRAME)
        estimator.update(None)
    assert estimator.uncertainty[0, -1, 2] > 2.0 * sure
    assert np.isfinite(estimator.positions).all()


def test_a_late_frame_beats_one_that_is_taken_for_fresh():
    commands = fields(60, "xz")
    tips = truth(stiffer(SCENE, 0.9), commands, plane="xz")
    error = {}
    for delay, honest in ((0, True), (3, True), (3, False)):
        estimator = EnsembleFilter(SCENE, num_members=32, **PLANAR)
        estimator.reset(commands[0])
        errors, _ = follow(estimator, commands, tips, np.random.default_rng(2), delay, honest)
        error[delay, honest] = errors[30:].mean()
    assert error[3, True] < 0.3 * error[3, False]
    assert error[0, True] < error[3, True] < 10.0 * error[0, True]


def test_a_frame_between_two_predictions_is_placed_in_time():
    commands = fields(40, "xz")
    tips = truth(SCENE, commands, num_elements=4, plane="xz")
    simulation = Simulation(SCENE, num_elements=4, plane="xz", num_threads=1)
    simulation.reset(commands[0])
    estimator = EnsembleFilter(SCENE, num_members=8, parameters=KNOWN, tip_deviation=0.0, **PLANAR)
    estimator.reset(commands[0])
    for field in commands[:30]:
        estimator.predict(field, FRAME)
        simulation.advance(FRAME, field)
    simulation.advance(0.4 * FRAME, commands[30])
    estimator.predict(commands[30], FRAME)
    estimator.update(frame(simulation.tip_position, 30.4 * FRAME))
    assert np.linalg.norm(estimator.innovation) < 0.1 * NOISE
    assert np.linalg.norm(tips[31] - tips[30]) > 5e-5


# ---- batches


def test_a_rod_of_a_batch_is_estimated_as_if_alone():
    commands = fields(15, "xz")
    tips = [truth(stiffer(SCENE, factor), commands, num_elements=4, plane="xz") for factor in (0.9, 1.2)]
    estimators = [EnsembleFilter(SCENE, num_rods=rods, num_members=16, **PLANAR) for rods in (2, 1, 1)]
    for estimator in estimators:
        estimator.reset(commands[0])
    for k, field in enumerate(commands):
        frames = [tip[k + 1] for tip in tips]
        for estimator, seen in zip(estimators, (frames, frames[:1], frames[1:])):
            estimator.predict(field, FRAME)
            estimator.update(frame(seen, estimator.time))
    together, *alone = estimators
    for rod, single in enumerate(alone):
        np.testing.assert_allclose(together.positions[rod], single.positions[0], atol=1e-12)
        np.testing.assert_allclose(together.uncertainty[rod], single.uncertainty[0], atol=1e-12)
        assert together.parameters["modulus"][rod] == pytest.approx(single.parameters["modulus"][0], rel=1e-10)


def test_a_mask_resets_its_rods_only_and_older_frames_are_not_theirs():
    field = (0.0, 0.0, 8e-3)
    estimator = EnsembleFilter(SCENE, num_rods=2, num_members=16, **PLANAR)
    start = estimator.positions
    for _ in range(5):
        estimator.predict(field, FRAME)
    moved = estimator.positions
    estimator.reset(mask=np.array([True, False]))
    assert estimator.time == pytest.approx(5 * FRAME)
    np.testing.assert_allclose(estimator.positions[0], start[0], atol=1e-4)
    np.testing.assert_allclose(estimator.positions[1], moved[1], atol=1e-12)
    estimator.update(frame(estimator.tip_position, 4 * FRAME))
    assert np.isnan(estimator.normalised_innovation[0]) and np.isfinite(estimator.normalised_innovation[1])
    estimator.update(frame(estimator.tip_position, 5 * FRAME))
    assert np.isfinite(estimator.normalised_innovation).all()


def test_a_full_reset_starts_the_clock_and_the_draws_again():
    estimator = EnsembleFilter(SCENE, num_members=16, **PLANAR)
    runs = []
    for _ in range(2):
        estimator.reset((0.0, 0.0, 5e-3))
        for _ in range(3):
            estimator.predict((0.0, 0.0, 9e-3), FRAME)
            estimator.update(frame([[0.055, 0.0, -0.01]], estimator.time))
        runs.append((estimator.time, estimator.positions))
    assert runs[0][0] == runs[1][0] == pytest.approx(3 * FRAME)
    np.testing.assert_array_equal(runs[0][1], runs[1][1])


# ---- what is refused


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({"scene": 3}, "scene must be a Scene"),
        ({"num_members": 1}, "num_members must be at least 2"),
        ({"num_rods": 0}, "num_rods must be a whole number of 1 or more"),
        ({"relaxation": 1.5}, "relaxation must be a finite number >= 0 and <= 1"),
        ({"largest_growth": 0.5}, "largest_growth must be a finite number >= 1"),
        ({"history": -1.0}, "history must be a finite number >= 0"),
        ({"tip_deviation": np.nan}, "tip_deviation must be a finite number"),
        ({"markers": [0.0123]}, "marker must be at a node"),
        ({"num_modes": 0}, "num_modes must be a whole number of 1 or more"),
    ],
)
def test_a_bad_setting_is_refused(settings, message):
    with pytest.raises(ValueError, match=message):
        EnsembleFilter(**{"scene": SCENE, "num_members": 4, **PLANAR, **settings})


def test_bad_calls_are_refused():
    estimator = EnsembleFilter(SCENE, num_members=4, history=0.05, **PLANAR)
    for field, duration, message in [
        ((0.0, 0.0), 0.1, "field must be finite of shape"),
        ((0.0, 0.0, np.nan), 0.1, "field must be finite of shape"),
        ((0.0, 0.0, 0.0), -0.1, "duration must be a finite number >= 0"),
    ]:
        with pytest.raises(ValueError, match=message):
            estimator.predict(field, duration)
    with pytest.raises(ValueError, match="mask must be bool of shape"):
        estimator.reset(mask=[1, 0])
    for _ in range(10):
        estimator.predict((0.0, 0.0, 0.0), FRAME)
    tip = estimator.tip_position
    for measurement, message in [
        (3, "measurement must be a Measurement or None"),
        (frame(np.tile(tip, (2, 1)), 0.2), "positions of the measurement must have shape"),
        (frame(tip, 0.3), "time of the measurement must be at most 0.2 s"),
        (frame(tip, 0.1), "the oldest state kept"),
    ]:
        with pytest.raises(ValueError, match=message):
            estimator.update(measurement)
    estimator.update(frame(tip, 0.19))
    with pytest.raises(ValueError, match="that of the last update"):
        estimator.update(frame(tip, 0.17))
