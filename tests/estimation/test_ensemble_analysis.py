"""The ensemble's update against Kalman's formulas with the ensemble's own mean and covariance."""

import numpy as np
import pytest

from magrod_env.estimation.analysis import SURPRISE, ensemble_update, exact_draws

RODS, MEMBERS, MARKERS, SIZE = 3, 12, 2, 7


@pytest.fixture
def problem():
    generator = np.random.default_rng(0)
    states = generator.normal(size=(RODS, MEMBERS, SIZE))
    observe = generator.normal(size=(3 * MARKERS, SIZE))
    predictions = (states @ observe.T).reshape(RODS, MEMBERS, MARKERS, 3)
    roots = generator.normal(size=(RODS, MARKERS, 3, 3))
    covariances = roots @ np.swapaxes(roots, -1, -2) + 0.1 * np.eye(3)
    innovation = generator.normal(size=(RODS, MARKERS, 3))
    return states, observe, predictions, covariances, innovation


def kalman(states, observe, covariances, innovation):
    """Mean and covariance after the update, and the normalised innovation squared, of one rod."""
    mean, prior = states.mean(axis=0), np.cov(states.T)
    noise = np.zeros((len(observe), len(observe)))
    for k, covariance in enumerate(covariances):
        noise[3 * k : 3 * k + 3, 3 * k : 3 * k + 3] = covariance
    total = observe @ prior @ observe.T + noise
    gain = prior @ observe.T @ np.linalg.inv(total)
    left = prior - gain @ observe @ prior
    return mean + gain @ innovation, left, innovation @ np.linalg.solve(total, innovation)


def test_mean_covariance_and_statistic_are_kalmans(problem):
    states, observe, predictions, covariances, innovation = problem
    update = ensemble_update(predictions, innovation, covariances, np.ones((RODS, MARKERS), bool), 0.0, 1.0)
    after = update.apply(states)
    for r in range(RODS):
        mean, covariance, statistic = kalman(states[r], observe, covariances[r], innovation[r].ravel())
        np.testing.assert_allclose(after[r].mean(axis=0), mean, rtol=1e-10)
        np.testing.assert_allclose(np.cov(after[r].T), covariance, atol=1e-10)
        assert update.statistic[r] == pytest.approx(statistic, rel=1e-10)


def test_an_unseen_marker_is_as_if_it_were_not_there(problem):
    states, observe, predictions, covariances, innovation = problem
    seen = np.array([[True, False]] * RODS)
    innovation[:, 1] = np.nan
    after = ensemble_update(predictions, innovation, covariances, seen, 0.0, 1.0).apply(states)
    for r in range(RODS):
        mean, covariance, _ = kalman(states[r], observe[:3], covariances[r, :1], innovation[r, 0])
        np.testing.assert_allclose(after[r].mean(axis=0), mean, rtol=1e-10)
        np.testing.assert_allclose(np.cov(after[r].T), covariance, atol=1e-10)


def test_nothing_seen_changes_nothing(problem):
    states, _, predictions, covariances, innovation = problem
    update = ensemble_update(predictions, innovation, covariances, np.zeros((RODS, MARKERS), bool), 0.3, 3.0)
    np.testing.assert_allclose(update.apply(states), states, rtol=1e-14)


def test_relaxation_mixes_prior_and_posterior_spread(problem):
    states, _, predictions, covariances, innovation = problem
    seen = np.ones((RODS, MARKERS), bool)
    spread = [
        (after := ensemble_update(predictions, innovation, covariances, seen, share, 1.0).apply(states))
        - after.mean(axis=1, keepdims=True)
        for share in (0.0, 0.25, 1.0)
    ]
    np.testing.assert_allclose(spread[1], 0.75 * spread[0] + 0.25 * spread[2], atol=1e-12)
    np.testing.assert_allclose(spread[2], states - states.mean(axis=1, keepdims=True), atol=1e-12)


def test_a_surprise_grows_the_prior_until_it_is_credible(problem):
    states, observe, predictions, covariances, innovation = problem
    far = 5.0 * innovation
    seen = np.ones((RODS, MARKERS), bool)
    update = ensemble_update(predictions, far, covariances, seen, 0.0, 100.0)
    bound = 6.0 + SURPRISE * np.sqrt(12.0)
    for r in range(RODS):
        assert update.growth[r] > 1.0
        centre = states[r].mean(axis=0)
        grown = centre + update.growth[r] * (states[r] - centre)
        mean, covariance, statistic = kalman(grown, observe, covariances[r], far[r].ravel())
        assert statistic == pytest.approx(bound, rel=1e-3)
        after = update.apply(states)[r]
        np.testing.assert_allclose(after.mean(axis=0), mean, rtol=1e-9)
        np.testing.assert_allclose(np.cov(after.T), covariance, rtol=1e-9, atol=1e-9)
    assert (ensemble_update(predictions, far, covariances, seen, 0.0, 1.0).growth == 1.0).all()
    capped = ensemble_update(predictions, 1e3 * far, covariances, seen, 0.0, 3.0)
    np.testing.assert_allclose(capped.growth, 3.0, rtol=1e-12)


def test_exact_draws_have_mean_zero_and_unit_covariance():
    draws = exact_draws(np.random.default_rng(0), 16, 5)
    np.testing.assert_allclose(draws.mean(axis=0), 0.0, atol=1e-14)
    np.testing.assert_allclose(np.cov(draws.T), np.eye(5), atol=1e-13)
    few = exact_draws(np.random.default_rng(0), 4, 9)
    np.testing.assert_allclose(few.mean(axis=0), 0.0, atol=1e-14)
    np.testing.assert_allclose(few.std(axis=0, ddof=1), 1.0, rtol=1e-13)
