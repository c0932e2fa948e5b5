"""The unscented filter: its transform against filterpy, Kalman's formulas where all is linear, twins, late frames."""

import numpy as np
import pytest
from rod.beams import with_tip

from estimation.test_ensemble_filter import exact_filter, follow
from estimation.twins import FRAME, NOISE, SCENE, fields, frame, stiffer, truth
from magrod_env.estimation import EnsembleFilter, Measurement, Unknown, UnscentedFilter
from magrod_env.estimation.unscented import moments, sigma_points, sigma_weights

PLANAR = {"plane": "xz", "num_elements": 4, "num_threads": 1}
SPREAD = np.sqrt(3.0)


def gaussian(size, seed=0):
    generator = np.random.default_rng(seed)
    root = generator.normal(size=(size, size))
    return generator.normal(size=size), root @ root.T


@pytest.mark.parametrize("size", [2, 5, 9])
def test_the_transform_is_that_of_filterpy(size):
    """Same sigma points, square root given, and the same moments after a function that is far from linear."""
    kalman = pytest.importorskip("filterpy.kalman")
    mean, covariance = gaussian(size)

    def root(scaled):  # filterpy passes (n + lambda) P and adds rows
        values, vectors = np.linalg.eigh(scaled)
        return (vectors * np.sqrt(values)).T

    theirs = kalman.MerweScaledSigmaPoints(size, alpha=SPREAD / np.sqrt(size), beta=2.0, kappa=0.0, sqrt_method=root)
    points = sigma_points(mean, covariance, SPREAD)
    np.testing.assert_allclose(points, theirs.sigma_points(mean, covariance), atol=1e-12)
    weights = sigma_weights(size, SPREAD)
    np.testing.assert_allclose(weights[0], theirs.Wm, atol=1e-12)
    np.testing.assert_allclose(weights[1], theirs.Wc, atol=1e-12)
    bent = np.sin(points) + points**2
    for found, expected in zip(moments(bent, *weights), kalman.unscented_transform(bent, theirs.Wm, theirs.Wc)):
        np.testing.assert_allclose(found, expected, atol=1e-10)


def test_moments_survive_the_sigma_points():
    mean, covariance = gaussian(6)
    found = moments(sigma_points(mean, covariance, SPREAD), *sigma_weights(6, SPREAD))
    np.testing.assert_allclose(found[0], mean, atol=1e-12)
    np.testing.assert_allclose(found[1], covariance, atol=1e-12)


def test_a_square_has_the_mean_that_a_gaussian_gives_it():
    mean, covariance = gaussian(4)
    found, _ = moments(sigma_points(mean, covariance, SPREAD) ** 2, *sigma_weights(4, SPREAD))
    np.testing.assert_allclose(found, mean**2 + np.diag(covariance), rtol=1e-12)


def test_small_motions_are_filtered_as_kalman_would():
    scene = SCENE.replace(gravity=None, magnets=with_tip(SCENE.rod).magnets)
    load, tip, noise = Unknown(deviation=1e-3, memory=0.3), 2e-6, 1e-6
    generator = np.random.default_rng(3)
    seen = 3e-6 * np.sin(2.0 * np.pi * FRAME * np.arange(1, 26))[:, None] * [0.0, 1.0]
    seen = seen + noise * generator.standard_normal(seen.shape)
    means, deviations = exact_filter(scene, load, tip, noise, seen, noise_first=False)
    estimator = UnscentedFilter(scene, parameters={"acceleration": load}, tip_deviation=tip, num_modes=12, **PLANAR)
    found, spread = [], []
    for k, (x, z) in enumerate(seen):
        estimator.predict((0.0, 0.0, 0.0), FRAME)
        positions = np.array([[[scene.rod.length + x, 0.0, z]]])
        estimator.update(Measurement(positions=positions, covariance=noise**2 * np.eye(3), time=(k + 1) * FRAME))
        found.append(estimator.tip_position[0, 2])
        spread.append(estimator.uncertainty[0, -1, 2])
    np.testing.assert_allclose(found, means, atol=0.01 * deviations.min())
    np.testing.assert_allclose(spread, deviations, rtol=0.01)


def test_a_wrong_modulus_is_found_and_both_filters_agree():
    commands = fields(60, "xz")
    tips = truth(stiffer(SCENE, 1.15), commands, plane="xz")
    results = []
    for estimator in (
        UnscentedFilter(SCENE, parameters={"modulus": 0.2}, **PLANAR),
        EnsembleFilter(SCENE, parameters={"modulus": 0.2}, num_members=32, **PLANAR),
    ):
        estimator.reset(commands[0])
        errors, _ = follow(estimator, commands, tips, np.random.default_rng(0))
        assert errors[20:].mean() < NOISE
        assert estimator.parameters["modulus"][0] == pytest.approx(1.15, abs=0.02)
        results.append(estimator.tip_position)
    np.testing.assert_allclose(results[0], results[1], atol=NOISE)


def test_innovations_are_as_large_as_they_should_be():
    commands, generator, statistics = fields(40, "xz"), np.random.default_rng(5), []
    for factor in np.exp(0.2 * generator.standard_normal(8)):
        tips = truth(stiffer(SCENE, factor), commands, num_elements=4, plane="xz")
        estimator = UnscentedFilter(SCENE, parameters={"modulus": 0.2}, tip_deviation=0.0, **PLANAR)
        estimator.reset(commands[0])
        statistics.append(follow(estimator, commands, tips, generator)[1])
    assert 0.8 < np.mean(statistics) / 3.0 < 1.25


def test_a_late_frame_leaves_what_it_would_have_left_in_time():
    """Taken in at its moment of exposure, it gives the estimate that a punctual frame gives."""
    commands = fields(10, "xz")
    tips = truth(SCENE, commands, num_elements=4, plane="xz")
    punctual, late = (UnscentedFilter(SCENE, **PLANAR) for _ in range(2))
    for estimator in (punctual, late):
        estimator.reset(commands[0])
        for k, field in enumerate(commands):
            estimator.predict(field, FRAME)
            if estimator is punctual and k == 6:
                estimator.update(frame(tips[7:8], 7 * FRAME))
    late.update(frame(tips[7:8], 7 * FRAME))
    np.testing.assert_allclose(late.positions, punctual.positions, atol=1e-9)
    np.testing.assert_allclose(late.uncertainty, punctual.uncertainty, atol=1e-9)
    late.update(frame(tips[9:10], 8.5 * FRAME))
    assert late.time == pytest.approx(10 * FRAME)


def test_coasting_and_unseen_markers():
    estimator = UnscentedFilter(SCENE, **PLANAR)
    estimator.reset((0.0, 0.0, 8e-3))
    tip = estimator.tip_position
    estimator.update(None)
    np.testing.assert_array_equal(estimator.tip_position, tip)
    estimator.update(frame([[np.nan, 0.0, 0.0]], 0.0))
    np.testing.assert_allclose(estimator.tip_position, tip, atol=1e-9)
    assert np.isnan(estimator.normalised_innovation[0])
    estimator.update(frame(tip, 0.0))
    sure = estimator.uncertainty[0, -1, 2]
    for _ in range(50):
        estimator.predict((0.0, 0.0, 8e-3), FRAME)
    assert estimator.uncertainty[0, -1, 2] > 2.0 * sure


def test_a_rod_of_a_batch_is_estimated_as_if_alone_and_a_mask_resets_its_rod():
    commands = fields(6, "xz")
    tips = [truth(stiffer(SCENE, factor), commands, num_elements=4, plane="xz") for factor in (0.9, 1.2)]
    together, *alone = (UnscentedFilter(SCENE, num_rods=rods, **PLANAR) for rods in (2, 1, 1))
    for k, field in enumerate(commands):
        frames = [tip[k + 1] for tip in tips]
        for estimator, seen in zip((together, *alone), (frames, frames[:1], frames[1:])):
            estimator.predict(field, FRAME)
            estimator.update(frame(seen, estimator.time))
    for rod, single in enumerate(alone):
        np.testing.assert_allclose(together.positions[rod], single.positions[0], atol=1e-9)
    kept = together.positions[1]
    together.reset(mask=np.array([True, False]))
    np.testing.assert_allclose(together.positions[1], kept, atol=1e-9)
    np.testing.assert_allclose(together.positions[0, -1], [SCENE.rod.length, 0.0, 0.0], atol=1e-4)


def test_bad_input_is_refused():
    with pytest.raises(ValueError, match="spread must be a finite number > 0"):
        UnscentedFilter(SCENE, spread=0.0, **PLANAR)
    with pytest.raises(ValueError, match="scene must be a Scene"):
        UnscentedFilter(None)
    estimator = UnscentedFilter(SCENE, history=0.05, **PLANAR)
    for _ in range(5):
        estimator.predict((0.0, 0.0, 0.0), FRAME)
    tip = estimator.tip_position
    with pytest.raises(ValueError, match="the oldest state kept"):
        estimator.update(frame(tip, 0.01))
    with pytest.raises(ValueError, match="time of the measurement must be at most"):
        estimator.update(frame(tip, 0.2))
    estimator.update(frame(tip, 0.09))
    with pytest.raises(ValueError, match="that of the last update"):
        estimator.update(frame(tip, 0.08))
