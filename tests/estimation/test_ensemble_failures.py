"""An ensemble that reports failures instead of raising them: one lost rod costs no other."""

import numpy as np
import pytest
from term_sets import damped

from magrod_env import load_scene
from magrod_env.estimation import EnsembleFilter, Measurement
from magrod_env.simulation import SimulationDiverged

FIELD = (0.0, 4e-3, 8e-3)


def ensemble(**settings):
    scene = damped(load_scene("paper5_circle", modulus="effective").replace(drag_rate=5.0, spin_drag_rate=100.0))
    rods = EnsembleFilter(scene, num_rods=3, num_members=16, num_elements=3, **settings)
    rods.reset(FIELD)
    return rods


def spoil(rods, rod):
    """A member's velocity is lost."""
    batch, lane = rods.members.simulation.rods.batch, rod * rods.num_members + 2
    row = batch.layout.nodes + batch.node_rows.size + batch.node_rows.velocity
    batch.rows[lane // batch.width, row, lane % batch.width] = np.nan


def step(rods, seen):
    rods.predict(FIELD, 0.02)
    rods.update(Measurement(positions=seen[:, None], covariance=1e-8 * np.eye(3), time=rods.time))


def test_failure_is_raised_unless_it_shall_be_reported():
    rods = ensemble()
    spoil(rods, 1)
    with pytest.raises(SimulationDiverged, match="member 2 of rod 1"):
        rods.predict(FIELD, 0.02)
    with pytest.raises(ValueError, match="on_failure must be"):
        ensemble(on_failure="ignore")


def test_reported_failure_lasts_until_the_reset_and_leaves_the_others_alone():
    rods, healthy = ensemble(on_failure="report"), ensemble(on_failure="report")
    seen = healthy.tip_position + (0.0, 5e-4, 0.0)  # m
    spoil(rods, 1)
    for _ in range(3):
        step(rods, seen), step(healthy, seen)
        assert rods.status.tolist() == [0, 1, 0] and healthy.status.tolist() == [0, 0, 0]
        np.testing.assert_allclose(rods.positions[[0, 2]], healthy.positions[[0, 2]], rtol=0, atol=1e-12)
        assert np.isnan(rods.normalised_innovation).tolist() == [False, True, False]
    rods.reset(FIELD, mask=np.array([False, True, False]))
    assert rods.status.tolist() == [0, 0, 0]
    np.testing.assert_allclose(rods.positions[1], ensemble().positions[1], rtol=0, atol=1e-3)
    for _ in range(3):
        step(rods, seen)
    assert rods.status.tolist() == [0, 0, 0] and np.isfinite(rods.positions).all()


def test_parameters_that_stray_begin_anew_where_failures_are_reported():
    rods = ensemble(on_failure="report")
    values = rods.members.parameters.copy()
    values[1, :, 0] += 2.5  # a modulus of twelve times the scene's, with a prior of 20 %: kept at its bound
    rods.members.parameters = values
    before = rods.members.parameters[0].copy()
    rods.update(None)
    rods.update(Measurement(positions=np.full((3, 1, 3), np.nan), covariance=1e-8 * np.eye(3), time=rods.time))
    assert abs(np.log(rods.parameters["modulus"][1])) < 0.2
    assert rods.parameter_uncertainty["modulus"][1] == pytest.approx(0.2, rel=0.1)
    np.testing.assert_allclose(rods.members.parameters[0], before, rtol=0, atol=1e-12)
