"""Streams of frames: timing, delay, drops, seeds, and simulations that are filmed."""

import numpy as np
import pytest

from magrod_env import Simulation, load_scene
from magrod_env.estimation import CameraStream, GaussianCameras, StereoCameras

TIP = np.array([0.06, 0.0, 0.0])
TIPS = np.tile(TIP, (1, 1, 1))


def exact(**options):
    return CameraStream(GaussianCameras(noise=None), **options)


def moving(time):
    return TIPS + (0.0, 0.1 * time, 0.0)


def test_frames_are_due_at_whole_multiples_and_arrive_late():
    stream, arrivals = exact(rate=30.0, delay=0.05), []
    for _ in range(7):
        due = stream.next_exposure
        stream.expose(due, moving(due))
        arrivals += [(due, m.time) for m in stream.arrived(due)]
    # After seven frames 0, 1/30, ... 0.2: those of age 0.05 or more when a frame is exposed.
    np.testing.assert_allclose(
        arrivals, [(2 / 30, 0), (3 / 30, 1 / 30), (4 / 30, 2 / 30), (5 / 30, 3 / 30), (0.2, 4 / 30)]
    )
    assert not stream.arrived(0.05 + 5 / 30 - 1e-6)
    (last,) = stream.arrived(0.05 + 5 / 30)
    assert last.time == 5 / 30
    np.testing.assert_array_equal(last.positions, moving(5 / 30))
    assert [m.time for m in stream.arrived(10.0)] == [0.2]


def test_control_steps_that_coincide_with_frames():
    """50 Hz control, 25 frames a second, 30 ms late: even steps are exposed, and seen two steps later."""
    stream, seen = exact(rate=25.0, delay=0.03), {}
    for step in range(9):
        time = 0.02 * step
        seen[step] = [round(m.time / 0.02) for m in stream.observe(time, moving(time))]
    assert seen == {0: [], 1: [], 2: [0], 3: [], 4: [2], 5: [], 6: [4], 7: [], 8: [6]}


def test_control_steps_between_frames_say_when_they_exposed():
    """50 Hz control, 30 frames a second: frames due at 0, 33.3, 66.7 and 100 ms are taken at 0, 40, 80 and 100 ms."""
    stream, frames = exact(rate=30.0), []
    for step in range(6):
        frames += stream.observe(0.02 * step, moving(0.02 * step))
    np.testing.assert_allclose([m.time for m in frames], [0.0, 0.04, 0.08, 0.1])
    for frame in frames:
        np.testing.assert_array_equal(frame.positions, moving(frame.time))


def test_no_frame_is_lost_to_rounding_over_many_steps():
    stream = exact(rate=50.0, delay=0.02)
    count = sum(len(stream.observe(step * 0.02, TIPS)) for step in range(20001))
    assert count == 20000


def test_dropped_frames_never_arrive():
    stream = exact(rate=100.0, drop_probability=0.3)
    stream.reset(seed=4)
    count = sum(len(stream.observe(0.01 * step, TIPS)) for step in range(4000))
    assert abs(count / 4000 - 0.7) < 5 * np.sqrt(0.21 / 4000)
    assert exact(drop_probability=1.0).observe(0.0, TIPS) == []


def test_each_rod_of_a_batch_drops_by_itself():
    stream = exact(rate=100.0, drop_probability=0.3)
    stream.reset(seed=4)
    frames = [frame for step in range(2000) for frame in stream.observe(0.01 * step, np.tile(TIP, (3, 2, 1)))]
    seen = np.array([frame.seen for frame in frames])
    assert (seen[..., 0] == seen[..., 1]).all()  # a frame has all markers of a rod or none
    arrived = seen[..., 0]
    assert arrived.any(axis=1).all()
    assert abs(len(frames) / 2000 - (1 - 0.3**3)) < 5 * np.sqrt(0.3**3 / 2000)
    np.testing.assert_allclose(arrived.sum(axis=0) / 2000, 0.7, atol=5 * np.sqrt(0.21 / 2000))
    both = (arrived[:, 0] & arrived[:, 1]).sum() / 2000
    assert abs(both - 0.49) < 5 * np.sqrt(0.25 / 2000)


@pytest.mark.parametrize("cameras", [StereoCameras(occlusion_probability=0.2), GaussianCameras()])
def test_the_same_seed_gives_the_same_frames(cameras):
    stream = CameraStream(cameras, drop_probability=0.2)

    def run(seed):
        stream.reset(seed=seed)
        frames = [frame for step in range(40) for frame in stream.observe(0.02 * step, np.tile(TIP, (2, 3, 1)))]
        return np.array([frame.time for frame in frames]), np.array([frame.positions for frame in frames])

    (times, positions), (again, same), (_, other) = run(1), run(1), run(2)
    np.testing.assert_array_equal(times, again)
    np.testing.assert_array_equal(positions, same)
    assert not np.array_equal(positions[0], other[0], equal_nan=True)


def test_drops_leave_the_noise_as_it_is():
    def run(drop_probability):
        stream = CameraStream(StereoCameras(), drop_probability=drop_probability)
        stream.reset(seed=1)
        return {m.time: m.positions for step in range(50) for m in stream.observe(0.02 * step, TIPS)}

    all_frames, some = run(0.0), run(0.5)
    assert 10 < len(some) < 40
    for time, positions in some.items():
        np.testing.assert_array_equal(positions, all_frames[time])


def test_reset_forgets_frames_under_way():
    stream = exact(rate=10.0, delay=0.5)
    stream.observe(0.0, TIPS)
    stream.reset()
    assert stream.time == 0.0 and stream.next_exposure == 0.0
    assert stream.arrived(5.0) == []


def test_time_that_goes_backwards_and_missed_frames_are_refused():
    stream = exact(rate=100.0)
    stream.observe(0.0, TIPS)
    with pytest.raises(ValueError, match=r"time must be at a frame, but got 0.005 s: the next is due at 0.01 s"):
        stream.expose(0.005, TIPS)
    with pytest.raises(ValueError, match="a frame was missed"):
        stream.observe(0.02, TIPS)
    stream.observe(0.013, TIPS)
    for call in (lambda: stream.observe(0.012, TIPS), lambda: stream.arrived(0.0), lambda: stream.expose(0.01, TIPS)):
        with pytest.raises(ValueError, match="time must not go backwards"):
            call()
    with pytest.raises(ValueError, match="time must be a finite number"):
        stream.arrived(np.nan)
    with pytest.raises(ValueError, match="positions must have shape"):
        stream.expose(0.02, TIP)
    stream.observe(0.02, TIPS)  # what was refused changed nothing


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (dict(rate=0.0), "rate must be a finite number > 0"),
        (dict(delay=-0.1), "delay must be a finite number >= 0"),
        (dict(drop_probability=2.0), "drop_probability must be a finite number >= 0 and <= 1"),
    ],
)
def test_bad_options_are_refused(options, message):
    with pytest.raises(ValueError, match=message):
        exact(**options)


def test_something_that_cannot_measure_is_refused():
    with pytest.raises(ValueError, match="cameras must have measure"):
        CameraStream("stereo")


@pytest.fixture(scope="module")
def simulation():
    return Simulation(load_scene("paper5_circle").replace(drag_rate=5.0), num_rods=2, num_elements=3)


FIELD = np.array([0.0, 0.01, 0.01])


def test_a_film_shows_the_simulation_at_every_exposure(simulation):
    """At 30 frames a second, in pieces of 20 ms, against one straight run with its time step split at each frame."""
    stream, frames = exact(rate=30.0, delay=0.01), []
    simulation.reset()
    for _ in range(10):
        frames += stream.film(simulation, 0.02, FIELD, nodes=[2, 3])
    assert simulation.time == pytest.approx(0.2, abs=1e-12)
    assert [round(30 * m.time, 6) for m in frames] == [0, 1, 2, 3, 4, 5]  # the seventh, of 0.2 s, is under way
    simulation.reset()
    for frame in frames:
        simulation.advance(frame.time - simulation.time, FIELD)
        # The steps are split elsewhere: the error of the time step, not of the film.
        np.testing.assert_allclose(frame.positions, simulation.positions[:, [2, 3]], atol=2e-6)
    assert np.abs(frames[-1].positions[:, 1] - TIP).max() > 1e-3  # it did move


def test_a_film_gives_centrelines_to_cameras_that_need_them(simulation):
    simulation.reset()
    stream = CameraStream(StereoCameras(rod_radius=0.002))
    frames = stream.film(simulation, 0.05, FIELD)
    assert [frame.positions.shape for frame in frames] == [(2, 1, 3)] * 3
    assert all(frame.seen.all() for frame in frames)


def test_a_film_of_a_simulation_with_another_clock_is_refused(simulation):
    simulation.reset()
    simulation.advance(0.1, FIELD)
    with pytest.raises(ValueError, match="a frame was missed"):
        exact().film(simulation, 0.02, FIELD)
    stream = exact()
    stream.arrived(1.0)
    with pytest.raises(ValueError, match="time must not go backwards"):
        stream.film(simulation, 0.02, FIELD)
