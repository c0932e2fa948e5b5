"""Measurements of markers: shapes, what is seen, and which node a marker is."""

import numpy as np
import pytest

from magrod_env import Simulation, load_scene
from magrod_env.estimation.measurement import Measurement, marker_arc_lengths, marker_nodes


def test_one_covariance_serves_all_markers_and_nan_is_unseen():
    positions = np.zeros((2, 3, 3))
    positions[1, 2, 0] = np.nan
    measurement = Measurement(positions=positions, covariance=4e-8 * np.eye(3), time=0.1)
    assert measurement.covariance.shape == (2, 3, 3, 3)
    np.testing.assert_array_equal(measurement.seen, [[True, True, True], [True, True, False]])


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (dict(positions=np.zeros((2, 3))), "positions must be finite, or NaN where unseen"),
        (dict(positions=np.full((1, 1, 3), np.inf)), "positions must be finite"),
        (dict(covariance=-np.eye(3)), "covariance must be finite, symmetric and without negative eigenvalues"),
        (dict(covariance=np.array([[1.0, 2.0, 0.0], [2.0, 1.0, 0.0], [0.0, 0.0, 1.0]])), "negative eigenvalues"),
        (dict(covariance=np.arange(9.0).reshape(3, 3)), "symmetric"),
        (dict(covariance=np.eye(2)), r"covariance must have shape \(3, 3\)"),
        (dict(time=np.nan), "time must be a finite number"),
    ],
)
def test_a_bad_measurement_is_refused(change, message):
    good = dict(positions=np.zeros((1, 1, 3)), covariance=np.eye(3), time=0.0)
    with pytest.raises(ValueError, match=message):
        Measurement(**{**good, **change})


def test_markers_by_word_and_by_place():
    scene = load_scene("paper6_two_magnets")
    assert marker_arc_lengths(scene, "tip") == (scene.rod.length,)
    assert marker_arc_lengths(scene, "magnets") == tuple(magnet.position for magnet in scene.magnets)
    assert marker_arc_lengths(scene, [0.01, 0.02]) == (0.01, 0.02)


@pytest.mark.parametrize("markers", ["middle", [], [-0.01], [1.0], [np.nan]])
def test_markers_that_are_not_on_the_rod_are_refused(markers):
    with pytest.raises(ValueError, match="marker"):
        marker_arc_lengths(load_scene("paper5_circle"), markers)


def test_a_magnet_is_at_a_node_and_another_place_is_refused():
    scene = load_scene("paper6_two_magnets")
    simulation = Simulation(scene, num_elements=10)
    nodes = marker_nodes(simulation.arc_lengths, marker_arc_lengths(scene, "magnets"))
    assert tuple(nodes) == simulation.magnet_nodes
    with pytest.raises(ValueError, match=r"marker must be at a node of the estimator's rod, but got 0\.0123 m"):
        marker_nodes(simulation.arc_lengths, (0.0123,))
