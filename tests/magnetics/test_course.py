"""Field courses: straight lines between samples, constant outside."""

import numpy as np
import pytest

from magrod_env import Simulation, load_scene
from magrod_env.magnetics import FieldCourse

TIMES = np.array([0.1, 0.2, 0.5])
FIELDS = np.array([[0.0, 1e-3, 0.0], [0.0, 2e-3, 4e-3], [0.0, -1e-3, 4e-3]])


def test_between_samples_it_is_numpys_interpolation():
    at = np.linspace(0.0, 1.0, 57)
    found = FieldCourse(times=TIMES, fields=FIELDS).sample(at)
    for axis in range(3):
        np.testing.assert_allclose(found[:, axis], np.interp(at, TIMES, FIELDS[:, axis]), atol=1e-18)


def test_one_sample_is_a_constant_field():
    course = FieldCourse(times=[0.0], fields=[[0.0, 0.0, 1e-3]])
    np.testing.assert_array_equal(course.sample([0.0, 3.0]), [[0.0, 0.0, 1e-3]] * 2)


def test_every_rod_may_have_its_own():
    fields = np.stack([FIELDS, 2.0 * FIELDS], axis=1)
    found = FieldCourse(times=TIMES, fields=fields).sample([0.15])
    np.testing.assert_allclose(found[0, 1], 2.0 * found[0, 0])


@pytest.mark.parametrize("num_rods", [1, 3])
def test_rods_move_as_under_the_same_function_of_time(num_rods):
    scene = load_scene("paper5_circle").replace(drag_rate=5.0)
    one, other = (Simulation(scene, num_rods=num_rods, num_elements=3) for _ in range(2))
    one.advance(0.3, FieldCourse(times=[0.0, 1.0], fields=[[0.0, 0.0, 0.0], [0.0, 4e-3, 8e-3]]))
    other.advance(0.3, lambda t: t * np.array([0.0, 4e-3, 8e-3]))
    np.testing.assert_allclose(one.positions, other.positions, rtol=0, atol=1e-12)


@pytest.mark.parametrize(
    ("times", "fields", "words"),
    [
        ([0.0, 0.0], np.zeros((2, 3)), "times of the field's course must be"),
        ([1.0, 0.0], np.zeros((2, 3)), "times of the field's course must be"),
        ([], np.zeros((0, 3)), "times of the field's course must be"),
        ([0.0, np.nan], np.zeros((2, 3)), "times of the field's course must be"),
        ([0.0, 1.0], np.zeros((3, 3)), "fields of the field's course must have shape"),
        ([0.0, 1.0], np.zeros((2, 2)), "fields of the field's course must have shape"),
        ([0.0, 1.0], np.full((2, 3), np.inf), "fields of the field's course must be finite"),
    ],
)
def test_bad_samples_are_refused(times, fields, words):
    with pytest.raises(ValueError, match=words):
        FieldCourse(times=times, fields=fields)


def test_a_course_for_other_rods_is_refused():
    simulation = Simulation(load_scene("paper5_circle"), num_rods=3, num_elements=3)
    with pytest.raises(ValueError, match="field must be finite of shape"):
        simulation.advance(0.01, FieldCourse(times=[0.0, 1.0], fields=np.zeros((2, 2, 3))))


def test_a_course_across_the_plane_is_refused():
    simulation = Simulation(load_scene("paper5_circle"), num_elements=3, plane="xz")
    with pytest.raises(ValueError, match="field must lie in the plane 'xz'"):
        simulation.advance(0.01, FieldCourse(times=TIMES, fields=FIELDS))
