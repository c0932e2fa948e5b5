"""Stereo and Gaussian cameras: triangulation, its covariance, rounding, occlusion, wrong calibration, bad input."""

import numpy as np
import pytest
from scipy.optimize import least_squares, minimize
from scipy.spatial import cKDTree
from scipy.stats import chi2

from magrod_env.estimation import GaussianCameras, PinholeCamera, StereoCameras
from magrod_env.estimation.cameras import default_cameras
from magrod_env.estimation.occlusion import _distances, hidden_by_rod
from magrod_env.estimation.triangulation import triangulate

TIP = np.array([0.06, 0.0, 0.0])
BROWN = (-0.25, 0.1, 1e-3, -2e-3, 0.02)


def three_cameras():
    lens = dict(focal_length=(2000.0, 2100.0), image_size=(1280, 1024), distortion=BROWN)
    aslant = PinholeCamera.looking_at((0.03, 0.0, 0.0), position=(0.35, -0.2, -0.25), up=(0.0, 0.2, 1.0), **lens)
    return (*default_cameras(), aslant)


def workspace(*shape):
    """Points in the ball of 60 mm about the clamp."""
    directions = np.random.default_rng(5).standard_normal((*shape, 3))
    radii = 0.06 * np.random.default_rng(6).random(shape) ** (1 / 3)
    return radii[..., None] * directions / np.linalg.norm(directions, axis=-1, keepdims=True)


def test_default_cameras_see_all_within_60_mm_of_the_clamp():
    shell = workspace(3000)
    shell *= 0.06 / np.linalg.norm(shell, axis=-1, keepdims=True)
    for camera in default_cameras():
        assert np.isfinite(camera.project(shell)).all()


@pytest.mark.parametrize("cameras", [default_cameras(), three_cameras()], ids=["two", "three with a lens"])
def test_pixels_without_noise_give_the_point_back(cameras):
    points = workspace(8, 25)
    found, _ = triangulate(cameras, np.stack([camera.project(points) for camera in cameras]), 1.0)
    np.testing.assert_allclose(found, points, atol=1e-9)
    single, _ = triangulate(cameras, np.stack([camera.project(points[3, 7]) for camera in cameras]), 1.0)
    np.testing.assert_allclose(single, found[3, 7], rtol=0, atol=1e-15)


def test_triangulation_minimises_the_reprojection_error():
    """Against scipy's least squares on the pixels, from another start."""
    cameras, points = three_cameras(), workspace(5)
    rng = np.random.default_rng(0)
    pixels = np.stack([camera.project(points) for camera in cameras])
    pixels += 3.0 * rng.standard_normal(pixels.shape)
    pixels[2, 4] = np.nan
    found, covariance = triangulate(cameras, pixels, 9.0)
    for k in range(5):
        used = [c for c in range(3) if np.isfinite(pixels[c, k]).all()]
        fit = least_squares(
            lambda x, k=k, used=used: np.concatenate([cameras[c].project(x) - pixels[c, k] for c in used]),
            points[k],
            x_scale=1e-3,
            xtol=1e-15,
            ftol=1e-15,
            gtol=1e-15,
        )
        np.testing.assert_allclose(found[k], fit.x, atol=1e-9)
        np.testing.assert_allclose(covariance[k], 9.0 * np.linalg.inv(fit.jac.T @ fit.jac), rtol=1e-4)


def test_default_error_is_what_geometry_says():
    """At the middle of the rod a pixel is 0.4 m / 2500 = 0.16 mm. Both cameras see x, one alone sees z and one y,
    so 0.3 pixels are 0.034, 0.048 and 0.048 mm."""
    middle = np.array([[[0.03, 0.0, 0.0]]])
    _, covariance = StereoCameras().measure(middle, np.random.default_rng(0))
    expected = 0.3 * 0.4 / 2500.0 * np.array([np.sqrt(0.5), 1.0, 1.0])
    np.testing.assert_allclose(np.sqrt(np.diag(covariance[0, 0])), expected, rtol=2e-3)  # it is told from a noisy point


@pytest.mark.parametrize("cameras", [default_cameras(), three_cameras()], ids=["two", "three with a lens"])
@pytest.mark.parametrize("place", [(0.06, 0.0, 0.0), (0.02, -0.04, 0.03)])
def test_covariance_is_that_of_many_measurements(cameras, place):
    stereo, count = StereoCameras(cameras=cameras), 20000
    measured, covariance = stereo.measure(np.tile(place, (count, 1, 1)), np.random.default_rng(1))
    errors = (measured - place)[:, 0]
    # An entry of a sample covariance has a standard deviation of at most sqrt(2/count) = 1 % of the variances; 5 fit.
    scale = np.sqrt(np.diag(covariance[0, 0]))
    np.testing.assert_allclose(
        np.cov(errors.T) / np.outer(scale, scale), covariance[0, 0] / np.outer(scale, scale), atol=0.05
    )
    np.testing.assert_allclose(errors.mean(axis=0) / scale, 0.0, atol=5 / np.sqrt(count))
    squares = np.einsum("ki,kij,kj->k", errors, np.linalg.inv(covariance[:, 0]), errors)
    assert abs(squares.mean() - 3.0) < 5 * np.sqrt(6.0 / count)
    assert abs((squares > chi2(3).ppf(0.95)).mean() - 0.05) < 5 * np.sqrt(0.05 * 0.95 / count)


@pytest.mark.parametrize("quantisation", [1.0, 0.25])
def test_rounding_counts_a_twelfth_of_its_square(quantisation):
    stereo = StereoCameras(noise=None, quantisation=quantisation)
    points = TIP + np.random.default_rng(2).uniform(-0.005, 0.005, (20000, 1, 3))  # over some 60 pixels
    exact = StereoCameras(noise=None).photograph(points, np.random.default_rng(0))
    rounded = stereo.photograph(points, np.random.default_rng(0))
    np.testing.assert_allclose(rounded / quantisation, np.round(rounded / quantisation), atol=1e-12)
    assert np.abs(rounded - exact).max() <= 0.5 * quantisation + 1e-9
    assert stereo.pixel_variance == pytest.approx(quantisation**2 / 12)
    np.testing.assert_allclose((rounded - exact).var(), stereo.pixel_variance, rtol=0.02)
    measured, covariance = stereo.measure(points, np.random.default_rng(0))
    errors = (measured - points)[:, 0]
    squares = np.einsum("ki,kij,kj->k", errors, np.linalg.inv(covariance[:, 0]), errors)
    assert abs(squares.mean() - 3.0) < 0.05


def test_noise_and_rounding_add_up():
    stereo = StereoCameras(noise=0.4, quantisation=1.0)
    points = TIP + np.random.default_rng(2).uniform(-0.005, 0.005, (20000, 1, 3))
    errors = stereo.photograph(points, np.random.default_rng(0)) - StereoCameras(noise=None).photograph(points, None)
    assert stereo.pixel_variance == pytest.approx(0.16 + 1 / 12)
    np.testing.assert_allclose(errors.var(), stereo.pixel_variance, rtol=0.02)


def test_occlusion_strikes_each_marker_and_camera_by_itself():
    stereo, points = StereoCameras(occlusion_probability=0.2), np.tile(TIP, (4000, 5, 1))
    pixels = stereo.photograph(points, np.random.default_rng(0))
    hidden = np.isnan(pixels[..., 0])
    assert abs(hidden.mean() - 0.2) < 5 * np.sqrt(0.16 / hidden.size)
    assert abs((hidden[0] & hidden[1]).mean() - 0.04) < 5 * np.sqrt(0.04 / hidden[0].size)
    measured, covariance = stereo.triangulate(pixels)
    np.testing.assert_array_equal(np.isnan(measured).any(axis=-1), hidden.any(axis=0))
    assert (covariance[hidden.any(axis=0)] == np.eye(3)).all()
    assert (np.linalg.eigvalsh(covariance) > 0.0).all()


def test_of_three_cameras_any_two_are_enough():
    cameras, points = three_cameras(), workspace(6)
    pixels = np.stack([camera.project(points) for camera in cameras])
    for camera, marker in ((0, 0), (1, 1), (2, 2), (0, 3), (1, 3)):
        pixels[camera, marker] = np.nan
    found, covariance = triangulate(cameras, pixels, 0.1)
    assert np.isnan(found[3]).all()
    kept = [0, 1, 2, 4, 5]
    np.testing.assert_allclose(found[kept], points[kept], atol=1e-9)
    alone, alone_covariance = triangulate(cameras[1:], pixels[1:, :1], 0.1)
    np.testing.assert_allclose(found[:1], alone, atol=1e-12)
    np.testing.assert_allclose(covariance[:1], alone_covariance, rtol=1e-9)


def test_parallel_rays_and_points_behind_are_not_measured():
    lens = dict(focal_length=1000.0, image_size=(640, 480))
    cameras = [PinholeCamera(position=(x, 0.0, 0.0), rotation=np.eye(3), **lens) for x in (-0.1, 0.1)]
    middle = 319.5, 239.5
    found, _ = triangulate(cameras, np.array([[middle], [middle]]), 1.0)  # both straight ahead: they meet nowhere
    assert np.isnan(found).all()
    apart = np.array([[(219.5, 239.5)], [(419.5, 239.5)]])  # they meet a metre behind
    assert np.isnan(triangulate(cameras, apart, 1.0)[0]).all()
    np.testing.assert_allclose(triangulate(cameras, apart[::-1], 1.0)[0], [[0.0, 0.0, 1.0]], atol=1e-9)
    for distance, known in ((1e-3, True), (1e-6, False)):  # between the cameras: 1 mm is still a baseline, 1 um is none
        close = [cameras[0], cameras[0].moved(shift=(distance, 0.0, 0.0))]
        pixels = np.stack([camera.project([(-0.1, 0.0, 1.0)]) for camera in close])
        assert np.isfinite(triangulate(close, pixels, 1.0)[0]).all() == known


def test_a_batch_sees_what_each_rod_alone_would():
    stereo, points = StereoCameras(quantisation=0.1, noise=None), workspace(7, 3)
    together, covariance = stereo.measure(points, np.random.default_rng(0))
    for k in range(7):
        alone, alone_covariance = stereo.measure(points[k : k + 1], np.random.default_rng(0))
        np.testing.assert_allclose(together[k], alone[0], rtol=0, atol=1e-13)
        np.testing.assert_allclose(covariance[k], alone_covariance[0], rtol=1e-9)


def test_wrong_calibration_shifts_the_point_and_not_the_covariance():
    """Cameras that are believed 0.1 mm too far along x put the point there; the one at the side, believed to look up by
    0.1 mrad too much, puts it 0.04 mm too high at 0.4 m, and the one above sees no height."""
    truth, point = default_cameras(), np.array([[[0.03, 0.0, 0.0]]])
    shifted = StereoCameras(noise=None, quantisation=0.01, calibration=[c.moved(shift=(1e-4, 0, 0)) for c in truth])
    measured, covariance = shifted.measure(point, np.random.default_rng(0))
    np.testing.assert_allclose(measured[0, 0], (0.0301, 0.0, 0.0), atol=3e-6)  # a hundredth of a pixel is 1.6e-6 m
    plain = StereoCameras(noise=None, quantisation=0.01).measure(point, np.random.default_rng(0))
    np.testing.assert_allclose(covariance, plain[1], rtol=1e-6, atol=1e-16)
    turned = StereoCameras(noise=None, calibration=[truth[0].moved(turn=(1e-4, 0, 0)), truth[1]])
    error = turned.measure(point, np.random.default_rng(0))[0][0, 0] - point[0, 0]
    np.testing.assert_allclose(error, (0.0, 0.0, 0.4e-4), atol=1e-7)


def test_a_rod_hides_what_is_behind_it():
    """A rod along x to 40 mm, then along y: seen from +y its far end hides the corner, seen from -y the corner hides
    the far end, seen from above nothing hides anything."""
    rod = np.array([[[0.0, 0.0, 0.0], [0.02, 0.0, 0.0], [0.04, 0.0, 0.0], [0.04, 0.02, 0.0], [0.04, 0.04, 0.0]]])
    markers = rod[:, [1, 2, 4]]
    hidden = [
        hidden_by_rod(markers, np.array(eye), rod, 0.002)[0] for eye in ((0.04, 1, 0), (0.04, -1, 0), (0.04, 0, 1))
    ]
    np.testing.assert_array_equal(hidden, [[False, True, False], [False, False, True], [False, False, False]])


def test_a_rod_hides_what_sampled_lines_of_sight_say():
    rng, radius = np.random.default_rng(8), 0.002
    steps = 0.006 * rng.standard_normal((30, 10, 3))
    rods = np.concatenate([np.zeros((30, 1, 3)), np.cumsum(steps, axis=1)], axis=1)
    markers, eye = rods[:, [3, 6, 10]], np.array([0.1, -0.3, 0.05])
    share = np.linspace(0.0, 1.0, 101)[:, None]
    hidden, near = hidden_by_rod(markers, eye, rods, radius), 0
    for k in range(30):
        body = cKDTree(np.concatenate([(1 - share) * a + share * b for a, b in zip(rods[k, :-1], rods[k, 1:])]))
        for m in range(3):
            towards = (eye - markers[k, m]) / np.linalg.norm(eye - markers[k, m])
            line = markers[k, m] + np.arange(2 * radius, 0.12, 1e-4)[:, None] * towards
            gap = body.query(line)[0].min()
            if abs(gap - radius) < 1e-4:
                near += 1
                continue
            assert hidden[k, m] == (gap < radius)
    assert near < 10 and 10 < hidden.sum() < 80


def test_distance_of_segments_is_the_least_of_all_pairs_of_points():
    rng = np.random.default_rng(9)
    starts, ends, others = rng.standard_normal((3, 60, 3))
    directions = rng.standard_normal((60, 3))
    directions /= np.linalg.norm(directions, axis=-1, keepdims=True)
    directions[:5] = ((others - ends) / np.linalg.norm(others - ends, axis=-1, keepdims=True))[:5]  # parallel
    reach = rng.uniform(0.2, 2.0, 60)
    gaps = _distances(starts, directions, reach, ends, others)
    for k in range(60):

        def squared(x, k=k):
            apart = starts[k] + x[0] * directions[k] - ends[k] - x[1] * (others[k] - ends[k])
            return apart @ apart

        fit = minimize(squared, (0.1, 0.5), bounds=((0.0, reach[k]), (0.0, 1.0)), options=dict(ftol=1e-15, gtol=1e-10))
        np.testing.assert_allclose(gaps[k], np.sqrt(fit.fun), atol=1e-5)


def test_hidden_markers_need_another_camera():
    """A rod to the side hides its corner from a camera there; two others do see it."""
    rod = np.array([[[0.0, 0.0, 0.0], [0.04, 0.0, 0.0], [0.04, -0.04, 0.0]]])
    across = PinholeCamera.looking_at(
        (0.04, 0, 0), position=(0.04, -0.4, 0), focal_length=2500.0, image_size=(1280, 1024)
    )
    _, above, aslant = three_cameras()
    two, three = ((across, above), (across, above, aslant))
    corner = rod[:, [1]]
    measured = [
        StereoCameras(cameras=c, rod_radius=0.002, noise=None).measure(corner, None, rod)[0] for c in (two, three)
    ]
    assert np.isnan(measured[0]).all()
    np.testing.assert_allclose(measured[1], corner, atol=1e-9)


def test_gaussian_cameras_have_the_noise_that_they_say():
    cameras, points = GaussianCameras(noise=2e-5, occlusion_probability=0.1), workspace(10000, 2)
    measured, covariance = cameras.measure(points, np.random.default_rng(0))
    seen = np.isfinite(measured).all(axis=-1)
    assert abs(seen.mean() - 0.9) < 5 * np.sqrt(0.09 / seen.size)
    errors = (measured - points)[seen]
    np.testing.assert_allclose(np.cov(errors.T), 4e-10 * np.eye(3), atol=0.06 * 4e-10)
    np.testing.assert_allclose(covariance[seen], np.tile(4e-10 * np.eye(3), (seen.sum(), 1, 1)), rtol=1e-15)
    assert (covariance[~seen] == np.eye(3)).all()
    exact, nothing = GaussianCameras(noise=None).measure(points, np.random.default_rng(0))
    np.testing.assert_array_equal(exact, points)
    assert not nothing.any()


@pytest.mark.parametrize("cameras", [StereoCameras(), GaussianCameras()])
def test_a_diverged_rod_is_not_seen_and_input_is_left_alone(cameras):
    points = np.tile(TIP, (2, 1, 1))
    points[1, 0, 2] = np.inf
    measured, covariance = cameras.measure(points, np.random.default_rng(0))
    assert np.isfinite(measured[0]).all() and np.isnan(measured[1]).all() and (covariance[1] == np.eye(3)).all()
    assert np.isinf(points[1, 0, 2])


@pytest.mark.parametrize(
    ("make", "options", "message"),
    [
        (StereoCameras, dict(cameras=default_cameras()[:1]), "cameras must be two PinholeCameras or more"),
        (StereoCameras, dict(cameras=[1, 2]), "cameras must be two PinholeCameras or more"),
        (StereoCameras, dict(cameras=[default_cameras()[0]] * 2), "cameras must be at different places"),
        (StereoCameras, dict(calibration=three_cameras()), "calibration must have 2 cameras, but got 3"),
        (StereoCameras, dict(noise=0.0), "noise of the cameras must be a finite number > 0"),
        (StereoCameras, dict(quantisation=-1.0), "quantisation of the cameras must be a finite number > 0"),
        (StereoCameras, dict(rod_radius=0.0), "rod_radius of the cameras must be a finite number > 0"),
        (StereoCameras, dict(occlusion_probability=1.5), "occlusion_probability of the cameras must be"),
        (GaussianCameras, dict(noise=np.nan), "noise of the cameras must be a finite number > 0"),
        (GaussianCameras, dict(occlusion_probability=-0.1), "occlusion_probability of the cameras must be"),
    ],
)
def test_bad_options_are_refused(make, options, message):
    with pytest.raises(ValueError, match=message):
        make(**options)


@pytest.mark.parametrize("cameras", [StereoCameras(), GaussianCameras()])
def test_positions_of_another_shape_are_refused(cameras):
    with pytest.raises(ValueError, match=r"positions must have shape \(num_rods, n, 3\), but got shape \(1, 3\)"):
        cameras.measure(np.zeros((1, 3)), np.random.default_rng(0))


def test_geometric_occlusion_needs_centrelines_of_every_rod():
    cameras, tips = StereoCameras(rod_radius=0.002), np.tile(TIP, (2, 1, 1))
    with pytest.raises(ValueError, match="centrelines must be given with a rod_radius"):
        cameras.measure(tips, np.random.default_rng(0))
    with pytest.raises(ValueError, match=r"centrelines must have shape \(2, n, 3\)"):
        cameras.measure(tips, np.random.default_rng(0), np.zeros((1, 5, 3)))
