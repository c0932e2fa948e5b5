"""The prediction filter: its law against brute force, what it recovers, late frames, coasting, batches, twins."""

import dataclasses

import numpy as np
import pytest
from scipy.optimize import minimize
from term_sets import damped, dragged

from magrod_env import Simulation, load_scene
from magrod_env.estimation import Measurement, PredictionFilter
from magrod_env.estimation.history import state_rows
from magrod_env.simulation import SimulationDiverged, StabilityError

SCENE = dragged(load_scene("paper4_pdms_tip_magnet", modulus="effective"))
LENGTH = SCENE.rod.length
BENT, FREE = (0.0, 0.0, 20e-3), (0.0, 0.0, 0.0)
FRAME, NOISE = 0.01, 5e-5
EVERY = tuple(LENGTH * k / 4 for k in (1, 2, 3, 4))
OPTIONS = dict(num_elements=4, plane="xz", num_threads=1)


def frame(positions, time, noise=NOISE):
    return Measurement(positions=positions, covariance=noise**2 * np.eye(3), time=time)


def swinging(**options):
    """A filter released from a bent equilibrium a tenth of a second ago."""
    estimator = PredictionFilter(SCENE, **{**OPTIONS, **options})
    estimator.reset(BENT)
    for _ in range(10):
        estimator.predict(FREE, FRAME)
    return estimator


def twin(scene=SCENE, num_elements=4, plane="xz", start=BENT):
    truth = Simulation(scene, num_elements=num_elements, plane=plane, num_threads=1)
    truth.reset(field=start)
    return truth


# ---- what it does


@pytest.mark.parametrize(("share", "tolerance"), [(1.0, 0.08), (0.25, 0.02)])
def test_filter_finds_the_minimiser_of_the_true_cost(share, tolerance):
    """Brute force over the two dampings of the tip, with the simulator itself in the cost. The law is of first order:
    a quarter of the innovation has a quarter of the error, 1.7 % of 6.8 %; the cost is hardly above the least.
    """
    estimator = swinging(damped="seen")
    estimator.update(frame(np.full((1, 1, 3), np.nan), estimator.time))  # closes the interval
    start = state_rows(estimator._model)
    estimator.predict(FREE, FRAME)
    goal = estimator.tip_position[:, None] + share * np.array([[[1e-5, 0.0, 1e-4]]])
    estimator.update(frame(goal, estimator.time))
    model, unit = swinging()._model, estimator._model.node_masses[0, 4] / FRAME
    outcome = []

    def cost(x):
        damping = np.zeros((1, 5, 3))
        damping[0, 4, [0, 2]] = x * unit
        model.rods.batch.scatter(0, start)
        model.rods.batch.set_node_damping(damping)
        model.advance(FRAME, field=FREE)
        outcome[:] = [model.tip_position[0]]
        e = model.tip_position[0] - goal[0, 0]
        return e @ e / NOISE**2 + np.sum((x / (20.0 * FRAME)) ** 2)

    found = minimize(cost, np.zeros(2), method="Nelder-Mead", options={"xatol": 1e-6, "fatol": 1e-9})
    assert np.abs(found.x).max() > 0.02 * share
    chosen = estimator.damping[0, 4, [0, 2]] / unit
    np.testing.assert_allclose(chosen, found.x, rtol=tolerance)
    assert cost(chosen) - found.fun < 0.003 * share * (cost(np.zeros(2)) - found.fun)
    cost(found.x)
    np.testing.assert_allclose(estimator.tip_position[0], outcome[0], atol=2e-6)


def test_zero_innovation_gives_zero_damping_and_changes_nothing():
    estimator = swinging()
    before = estimator.positions
    estimator.update(frame(before[:, [4]], estimator.time))
    np.testing.assert_allclose(estimator.damping, 0.0, atol=1e-12)
    np.testing.assert_allclose(estimator.positions, before, atol=1e-13)
    np.testing.assert_array_equal(estimator.innovation, 0.0)
    assert estimator.innovation_dof == [3]
    assert estimator.normalised_innovation == [0.0]


def test_known_uniform_damping_is_recovered_from_all_nodes():
    """From a common state on, the truth has a drag of 0.5 /s: one noise-free frame tells K_a = m_a/2, node by node."""
    estimator = swinging(markers=EVERY, damping_spread=1e3, measurement_weight=1e18)
    estimator.update(frame(np.full((1, 4, 3), np.nan), estimator.time))  # closes the interval
    truth, masses = swinging()._model, estimator._model.node_masses[0, 1:, None]
    truth.rods.batch.scatter(0, state_rows(estimator._model))
    truth.rods.batch.set_node_damping(0.5 * np.repeat(truth.node_masses[..., None], 3, axis=-1))
    truth.advance(FRAME, field=FREE)
    estimator.predict(FREE, FRAME)
    missed = np.abs(estimator.positions - truth.positions).max()
    estimator.update(frame(truth.positions[:, 1:], estimator.time, noise=0.0))
    rates = estimator.damping[0, 1:] / masses
    power = masses * estimator.velocities[0, 1:] ** 2
    np.testing.assert_allclose(rates[:, 2], 0.5, rtol=0.05)
    np.testing.assert_allclose(np.sum(rates * power) / np.sum(power), 0.5, rtol=0.01)
    assert np.abs(estimator.positions - truth.positions).max() < 0.01 * missed


@pytest.mark.parametrize("law", ["replay", "extrapolated"])
def test_a_rod_at_rest_tells_nothing_and_keeps_its_error(law):
    """Without velocity there is no damping force: an error of a millimetre at rest stays."""
    estimator = PredictionFilter(SCENE, law=law, **OPTIONS)
    estimator.reset(BENT)
    start = estimator.positions
    for k in range(1, 6):
        estimator.predict(BENT, FRAME)
        estimator.update(frame(start[:, [4]] + [0.0, 0.0, 1e-3], k * FRAME))
    np.testing.assert_allclose(estimator.positions, start, atol=2e-6)
    np.testing.assert_allclose(estimator.innovation[0, 0], [0.0, 0.0, 1e-3], atol=2e-6)


def test_damping_stays_within_its_bound_whatever_a_camera_says():
    estimator = swinging(largest_change=0.5)
    rng = np.random.default_rng(0)
    bound = 0.5 * estimator._model.node_masses[0] / FRAME
    for k in range(20):
        estimator.predict(FREE, FRAME)
        estimator.update(frame(0.05 * rng.normal(size=(1, 1, 3)), estimator.time))
        interval = FRAME if k else 11 * FRAME
        ratio = np.abs(estimator.damping[0, 1:]).max(axis=-1) / bound[1:] * interval / FRAME
        assert 0.0 < ratio.max() < 1.0 + 1e-9
    assert np.isfinite(estimator.positions).all()
    assert (estimator.status == 0).all()


@pytest.mark.parametrize("law", ["replay", "extrapolated"])
def test_twin_with_a_finer_mesh_unknown_damping_and_a_wrong_modulus(law):
    """Truth: three times the elements, Kelvin-Voigt damping, a modulus 10 % higher; 0.05 mm noise, 100 Hz, tip only."""
    rod = dataclasses.replace(SCENE.rod, youngs_modulus=1.1 * SCENE.rod.youngs_modulus)
    truth = twin(damped(SCENE.replace(rod=rod, internal_damping=1e-3)), num_elements=12)
    estimator = PredictionFilter(SCENE, law=law, **OPTIONS)
    alone = Simulation(SCENE, **OPTIONS)
    alone.reset(field=BENT)
    estimator.reset(BENT)
    rng, errors, scores, claims = np.random.default_rng(0), [], [], []
    for k in range(1, 101):
        for each in (truth, alone):
            each.advance(FRAME, field=FREE)
        estimator.predict(FREE, FRAME)
        estimator.update(frame((truth.tip_position + NOISE * rng.normal(size=3))[:, None], k * FRAME))
        errors.append([np.linalg.norm(each.tip_position - truth.tip_position) for each in (alone, estimator)])
        claims.append(np.linalg.norm(estimator.uncertainty[0, -1, [0, 2]]))
        scores.append(estimator.normalised_innovation[0] / 3)
    without, with_filter = np.mean(errors, axis=0)
    assert with_filter < (0.05 if law == "replay" else 0.25) * without
    if law == "replay":
        assert with_filter < 0.4e-3
        assert 0.3 < np.mean(scores[20:]) < 3.0
        assert 0.3 < np.sqrt(np.mean(np.square(errors)[20:, 1]) / np.mean(np.square(claims)[20:])) < 2.0


# ---- time


def test_coasting_is_the_plain_simulation():
    """No frame, or frames in which nothing was seen, leave the motion as it is."""
    truth, estimator = twin(), swinging()
    for _ in range(10):
        truth.advance(FRAME, field=FREE)
    for k in range(5):
        truth.advance(FRAME, field=FREE)
        estimator.predict(FREE, FRAME)
        estimator.update(None if k % 2 else frame(np.full((1, 1, 3), np.nan), estimator.time))
        assert np.isnan(estimator.innovation).all()
        assert np.isnan(estimator.normalised_innovation).all()
        assert estimator.innovation_dof == [0]
    np.testing.assert_allclose(estimator.positions, truth.positions, atol=1e-12)
    np.testing.assert_allclose(estimator.velocities, truth.velocities, atol=1e-9)


def test_uncertainty_grows_while_coasting_and_falls_with_frames():
    estimator, seen = swinging(initial_uncertainty=2e-3), []
    for _ in range(10):
        estimator.predict(FREE, FRAME)
        estimator.update(frame(estimator.positions[:, [4]], estimator.time))
        seen.append(estimator.uncertainty[0, -1, 2])
    assert seen[-1] < 0.5 * 2e-3
    for _ in range(3):
        estimator.predict(FREE, FRAME)
        estimator.update(None)
        seen.append(estimator.uncertainty[0, -1, 2])
    assert seen[-4] < seen[-3] < seen[-2] < seen[-1]
    np.testing.assert_array_equal(estimator.uncertainty[0, 0], 0.0)


@pytest.mark.parametrize("hold", [False, True])
@pytest.mark.parametrize("law", ["replay", "extrapolated"])
def test_a_late_frame_says_what_it_would_have_said_in_time(law, hold):
    """Two frames; one filter gets the second 25 ms late, in the middle of a piece of its history."""
    first, second = [np.array([[[0.045, 0.0, z]]]) for z in (8e-3, 6e-3)]
    ends = []
    for late in (False, True):
        estimator = swinging(law=law, hold=hold, largest_change=0.1)
        estimator.update(frame(first, estimator.time))
        if not late:
            estimator.predict(FREE, 0.01)
            estimator.predict(FREE, 0.005)
            estimator.update(frame(second, estimator.time))
            estimator.predict(FREE, 0.005)
            estimator.predict(BENT, 0.02)
        else:
            estimator.predict(FREE, 0.01)
            estimator.predict(FREE, 0.01)
            estimator.predict(BENT, 0.02)
            estimator.update(frame(second, estimator.time - 0.025))
        assert np.abs(estimator.damping).max() > 0
        ends.append((estimator.positions, estimator.velocities, estimator.damping, estimator.innovation))
    for one, other in zip(*ends):
        if law == "replay":
            np.testing.assert_allclose(one, other, atol=1e-9 * max(1.0, np.abs(one).max() / LENGTH))
    if law == "extrapolated":  # in time it cannot know the field to come; the innovation does not need it
        np.testing.assert_allclose(ends[0][3], ends[1][3], atol=1e-9)


def test_a_rod_that_starts_again_is_as_new_and_the_others_go_on():
    both, other = swinging(num_rods=2), swinging(num_rods=2)
    both.reset(BENT, mask=np.array([False, True]))
    late = frame(np.tile([[[0.05, 0.0, 1e-3]]], (2, 1, 1)), both.time - 0.5 * FRAME)
    for estimator in (both, other):
        estimator.update(late)
        estimator.predict(FREE, FRAME)
    np.testing.assert_array_equal(both.positions[0], other.positions[0])
    assert both.innovation_dof.tolist() == [3, 0]
    assert np.isnan(both.innovation[1]).all()
    fresh = twin()
    fresh.advance(FRAME, field=FREE)
    np.testing.assert_allclose(both.positions[1], fresh.positions[0], atol=1e-12)


@pytest.mark.parametrize("law", ["replay", "extrapolated"])
def test_an_interval_with_a_new_start_in_it_begins_there(law):
    """A late frame from before the start says nothing of the new rod; later ones say what they say to a new filter."""
    both, fresh = swinging(num_rods=2, law=law), PredictionFilter(SCENE, law=law, **OPTIONS)
    both.reset(BENT, mask=np.array([False, True]))
    fresh.reset(BENT)
    for each in (both, fresh):
        each.predict(FREE, FRAME)
    both.update(frame(np.tile([[[0.05, 0.0, 1e-3]]], (2, 1, 1)), both.time - 1.5 * FRAME))
    np.testing.assert_allclose(both.positions[1], fresh.positions[0], atol=1e-12)
    for each in (both, fresh):
        for z in (1e-4, 2e-4):
            each.predict(FREE, FRAME)
            off = np.array([0.0, 0.0, z])
            each.update(frame(np.tile(twin_tip(2 + round(z / 1e-4)) + off, (each.num_rods, 1, 1)), each.time))
    assert np.abs(fresh.damping).max() > 0.0
    np.testing.assert_allclose(both.damping[1], fresh.damping[0], rtol=1e-6, atol=1e-12)
    np.testing.assert_allclose(both.positions[1], fresh.positions[0], atol=1e-11)


def twin_tip(frames):
    """The tip of the released rod after so many frames, m, (1, 3)."""
    truth = twin()
    truth.advance(frames * FRAME, field=FREE)
    return truth.tip_position


def test_batch_equals_singles_bitwise():
    rng = np.random.default_rng(5)
    goals = np.array([0.05, 0.0, 0.0]) + 5e-3 * rng.normal(size=(4, 3, 2, 3))
    goals[1, 0] = goals[2, 1, 1] = np.nan
    fields = np.array([[0.0, 0.0, z] for z in (1e-3, 0.0, -4e-3)])

    def run(rods):
        options = {**OPTIONS, "num_elements": 4, "markers": (LENGTH / 2, LENGTH)}
        estimator = PredictionFilter(SCENE, num_rods=len(rods), **options)
        estimator.reset(fields[rods])
        for goal in goals:
            for _ in range(2):
                estimator.predict(-fields[rods], FRAME)
            estimator.update(frame(goal[rods], estimator.time - 0.3 * FRAME))
        return estimator.positions, estimator.damping, estimator.uncertainty, estimator.normalised_innovation

    together = run([0, 1, 2])
    for rod in range(3):
        for one, all_of_them in zip(run([rod]), together):
            np.testing.assert_array_equal(one[0], all_of_them[rod])


def test_spatial_rod_with_all_nodes_damped():
    """The circle's field, drag that the model lacks, tip only: the error falls by more than half."""
    field = np.array([0.0, 14e-3, 8e-3])
    truth = Simulation(SCENE.replace(drag_rate=6.0), num_elements=3, num_threads=1)
    alone = Simulation(SCENE, num_elements=3, num_threads=1)
    estimator = PredictionFilter(SCENE, num_elements=3, num_threads=1)
    errors = []
    for k in range(1, 31):
        for each in (truth, alone):
            each.advance(FRAME, field=field)
        estimator.predict(field, FRAME)
        estimator.update(frame(truth.tip_position[:, None], k * FRAME))
        errors.append([np.linalg.norm(each.tip_position - truth.tip_position) for each in (alone, estimator)])
    without, with_filter = np.mean(errors, axis=0)
    assert with_filter < 0.2 * without


@pytest.mark.parametrize("on_failure", ["raise", "report"])
def test_a_model_that_fails_says_so(on_failure):
    estimator = swinging(on_failure=on_failure)
    estimator._model.set_motion(np.array([[[0.0, 0.0, 1e3 * (-1) ** node] for node in range(5)]]))
    if on_failure == "raise":
        with pytest.raises(SimulationDiverged, match="rod 0 of the filter's model left the stable range"):
            estimator.predict(FREE, FRAME)
    else:
        estimator.predict(FREE, FRAME)
        assert estimator.status[0] > 0


def test_a_reset_that_fails_leaves_the_estimate_alone():
    """A field against the magnet buckles a straight rod: there is no equilibrium to start from."""
    estimator = PredictionFilter(SCENE.replace(gravity=(-1e-3, 0.0, 0.0)), **OPTIONS)
    estimator.reset(BENT)
    estimator.predict(FREE, FRAME)
    before = estimator.positions
    with pytest.raises(StabilityError):
        estimator.reset((-45e-3, 0.0, 0.0))
    np.testing.assert_array_equal(estimator.positions, before)
    assert estimator.time == pytest.approx(FRAME)


# ---- bad input


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (dict(law="newton"), 'law must be "replay" or "extrapolated", but got'),
        (dict(damped="none"), 'damped must be "all" or "seen", but got'),
        (dict(on_failure="ignore"), "on_failure must be"),
        (dict(damping_spread=0.0), "damping_spread must be"),
        (dict(damping_weight=-1.0), "damping_weight must be"),
        (dict(measurement_weight=np.nan), "measurement_weight must be"),
        (dict(largest_change=0.0), "largest_change must be"),
        (dict(history=-1.0), "history must be"),
        (dict(initial_uncertainty=-1.0), "initial_uncertainty must be"),
        (dict(markers=[0.0123]), "marker must be at a node"),
        (dict(num_rods=0), "num_rods must be"),
    ],
)
def test_bad_options_are_refused(options, message):
    with pytest.raises(ValueError, match=message):
        PredictionFilter(SCENE, **{**OPTIONS, **options})


def test_bad_frames_are_refused():
    estimator = swinging(history=0.05)
    tip = estimator.positions[:, [4]]
    for wrong, message in (
        (tip, "measurement must be a Measurement or None"),
        (frame(np.zeros((1, 2, 3)), 0.1), r"positions of the measurement must have shape \(1, 1, 3\)"),
        (frame(tip, 0.2), "time of the measurement must be at most 0.1 s"),
        (frame(tip, 0.02), "time of the measurement must be at least"),
    ):
        with pytest.raises(ValueError, match=message):
            estimator.update(wrong)
    estimator.update(frame(tip, 0.1))
    estimator.predict(FREE, FRAME)
    with pytest.raises(ValueError, match="that of the last update"):
        estimator.update(frame(tip, 0.095))


@pytest.mark.parametrize(
    ("field", "duration", "message"),
    [
        (FREE, -1.0, "duration must be"),
        ((0.0, 1.0), FRAME, "field must be finite of shape"),
        (None, FRAME, "field must be finite of shape"),
        ((0.0, 1e-3, 0.0), FRAME, "field must lie in the plane"),
    ],
)
def test_bad_predictions_are_refused(field, duration, message):
    with pytest.raises(ValueError, match=message):
        swinging().predict(field, duration)


@pytest.mark.parametrize("mask", [np.array([1, 0]), np.ones(3, bool)])
def test_bad_masks_are_refused(mask):
    with pytest.raises(ValueError, match="mask must be bool of shape"):
        swinging().reset(mask=mask)
