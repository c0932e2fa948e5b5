"""Pinhole cameras: a picture computed by hand, homogeneous matrices, difference quotients, and back to rays."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from magrod_env.estimation import PinholeCamera

LENS = dict(focal_length=(900.0, 1000.0), image_size=(640, 480), principal_point=(300.0, 250.0))
BROWN = (-0.25, 0.1, 1e-3, -2e-3, 0.02)
GOOD = dict(position=(0.0, 0.0, 0.0), rotation=np.eye(3), focal_length=1000.0, image_size=(640, 480))


def tilted_camera(**options):
    return PinholeCamera.looking_at((0.03, 0.01, 0.0), position=(0.2, -0.3, 0.15), **{**LENS, **options})


def cloud(shape=(200,)):
    return np.random.default_rng(3).uniform(-0.05, 0.05, (*shape, 3)) + (0.03, 0.0, 0.0)


def test_picture_computed_by_hand():
    """One metre off along -y and looking along +y, right is x and up is z: 10 mm right is 9 pixels, 20 mm up is 20."""
    camera = PinholeCamera.looking_at((0.0, 0.0, 0.0), position=(0.0, -1.0, 0.0), **LENS)
    np.testing.assert_allclose(camera.rotation, [[1, 0, 0], [0, 0, -1], [0, 1, 0]], atol=1e-15)
    np.testing.assert_allclose(camera.project((0.01, 0.0, 0.02)), (309.0, 230.0), rtol=1e-14)
    np.testing.assert_allclose(camera.project((0.01, 1.0, 0.02)), (304.5, 240.0), rtol=1e-14)  # twice as far


def test_projection_is_that_of_the_homogeneous_matrix():
    camera, points = tilted_camera(), cloud((4, 50))
    outside = np.eye(4)  # world to camera, rotation after translation, as 4 x 4 matrices
    outside[:3, :3] = camera.rotation
    back = np.eye(4)
    back[:3, 3] = -np.asarray(camera.position)
    inside = np.array([[900.0, 0.0, 300.0, 0.0], [0.0, 1000.0, 250.0, 0.0], [0.0, 0.0, 1.0, 0.0]])
    np.testing.assert_allclose(camera.projection_matrix, inside @ outside @ back, atol=1e-12)
    expected = np.empty((4, 50, 2))
    for index in np.ndindex(4, 50):
        u, v, w = inside @ outside @ back @ np.append(points[index], 1.0)
        expected[index] = u / w, v / w
    np.testing.assert_allclose(camera.project(points), expected, rtol=1e-12)


def test_lens_is_the_formula_of_brown_written_out():
    k1, k2, p1, p2, k3 = BROWN
    plain, bent = tilted_camera(), tilted_camera(distortion=BROWN)
    for point in cloud((20,)):
        x, y = (plain.project(point) - (300.0, 250.0)) / (900.0, 1000.0)
        r = np.hypot(x, y)
        radial = 1 + k1 * r**2 + k2 * r**4 + k3 * r**6
        u = 300.0 + 900.0 * (x * radial + 2 * p1 * x * y + p2 * (r**2 + 2 * x**2))
        v = 250.0 + 1000.0 * (y * radial + p1 * (r**2 + 2 * y**2) + 2 * p2 * x * y)
        np.testing.assert_allclose(bent.project(point), (u, v), rtol=1e-12)


@pytest.mark.parametrize("distortion", [None, BROWN])
def test_jacobian_is_that_of_central_differences(distortion):
    camera, points, h = tilted_camera(distortion=distortion), cloud(), 1e-6
    pixels, jacobian, depth = camera.linearise(points)
    np.testing.assert_allclose(pixels, camera.project(points), rtol=1e-14)
    np.testing.assert_allclose(depth, (points - camera.position) @ camera.rotation[2], rtol=1e-12)
    for axis in range(3):
        step = h * np.eye(3)[axis]
        quotient = (camera.project(points + step) - camera.project(points - step)) / (2 * h)
        np.testing.assert_allclose(jacobian[..., axis], quotient, atol=1e-3)  # of some 3000; h^2 f/z^3


@pytest.mark.parametrize("distortion", [None, BROWN])
def test_ray_of_a_pixel_goes_through_the_point(distortion):
    camera, points = tilted_camera(distortion=distortion), cloud((5, 7))
    rays = camera.ray(camera.project(points))
    distance = np.linalg.norm(points - camera.position, axis=-1, keepdims=True)
    np.testing.assert_allclose(camera.position + distance * rays, points, atol=1e-11)
    assert np.isnan(camera.ray((np.nan, 1.0))).all()


def test_nothing_is_seen_behind_the_camera_or_outside_the_image():
    camera = PinholeCamera(**GOOD)
    assert np.isfinite(camera.project((0.0, 0.0, 1.0))).all()
    unseen = [(0.0, 0.0, -1.0), (0.0, 0.0, 0.0), (np.nan, 0.0, 1.0), (0.3201, 0.0, 1.0), (0.0, -0.2401, 1.0)]
    assert np.isnan(camera.project(unseen)).all()
    edges = [(0.3199, 0.0, 1.0), (-0.3199, 0.0, 1.0), (0.0, 0.2399, 1.0), (0.0, -0.2399, 1.0)]
    assert np.isfinite(camera.project(edges)).all()


def test_a_lens_does_not_show_what_it_folds_back():
    """r (1 - 4 r^2) grows up to r = 0.29 only: r = 0.45, at 0.0855, would come out in the image."""
    camera = PinholeCamera(**GOOD, distortion=(-4.0, 0.0, 0.0, 0.0, 0.0))
    np.testing.assert_allclose(camera.project((0.1, 0.0, 1.0)), (319.5 + 96.0, 239.5), rtol=1e-12)
    assert np.isnan(camera.project((0.45, 0.0, 1.0))).all()
    assert np.isnan(camera.ray((319.5 + 300.0, 239.5))).all()  # r (1 - 4 r^2) = 0.3 has no root below 0.29


def test_moved_camera_is_turned_about_its_own_centre():
    camera, turn = tilted_camera(), np.array([0.02, -0.03, 0.5])
    moved = camera.moved(shift=(0.001, 0.0, -0.002), turn=turn)
    np.testing.assert_allclose(moved.position, camera.position + np.array([0.001, 0.0, -0.002]), atol=1e-15)
    expected = camera.rotation @ Rotation.from_rotvec(turn).as_matrix().T
    np.testing.assert_allclose(moved.rotation, expected, atol=1e-14)
    np.testing.assert_allclose(camera.moved().rotation, camera.rotation, atol=1e-15)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (dict(position=(0.0, np.nan, 0.0)), "position of the camera must be three finite numbers"),
        (dict(rotation=2.0 * np.eye(3)), "rotation of the camera must be a rotation matrix"),
        (dict(rotation=np.diag([1.0, 1.0, -1.0])), "rotation of the camera must be a rotation matrix"),
        (dict(rotation="up"), "rotation of the camera must be a rotation matrix"),
        (dict(focal_length=0.0), "focal_length of the camera must be positive"),
        (dict(focal_length=(1.0, 2.0, 3.0)), "focal_length of the camera must be 2 finite numbers"),
        (dict(focal_length=None), "focal_length of the camera must be 2 finite numbers"),
        (dict(image_size=(640, 0)), "image_size of the camera must be a whole number of 1 or more"),
        (dict(image_size=(640.5, 480)), "image_size of the camera must be a whole number"),
        (dict(principal_point=(1.0, np.inf)), "principal_point of the camera must be 2 finite numbers"),
        (dict(distortion=(0.1, 0.2)), "distortion of the camera must be 5 finite numbers"),
    ],
)
def test_a_bad_camera_is_refused(change, message):
    with pytest.raises(ValueError, match=message):
        PinholeCamera(**{**GOOD, **change})


def test_a_view_that_cannot_be_is_refused():
    with pytest.raises(ValueError, match="target - position of the camera must be a vector that is not zero"):
        PinholeCamera.looking_at((1.0, 0.0, 0.0), position=(1.0, 0.0, 0.0), **LENS)
    with pytest.raises(ValueError, match="up of the camera must not lie along its optical axis"):
        PinholeCamera.looking_at((0.0, 0.0, 0.0), position=(0.0, 0.0, 1.0), **LENS)
    with pytest.raises(ValueError, match=r"points must have shape \(..., 3\)"):
        PinholeCamera(**GOOD).project((1.0, 2.0))
    with pytest.raises(ValueError, match=r"pixels must have shape \(..., 2\)"):
        PinholeCamera(**GOOD).ray((1.0, 2.0, 3.0))
