"""Frames of the environments: shape, type, freshness, without a display, and a clear error without Pillow."""

import sys

import numpy as np
import pytest
from rollouts import scripted_actions

from magrod_env import load_scene
from magrod_env.envs import MagRodEnv, MagRodVectorEnv
from magrod_env.registration import IDS

pytest.importorskip("PIL")
pytestmark = pytest.mark.filterwarnings("error")


def check_frame(frame):
    assert isinstance(frame, np.ndarray) and frame.dtype == np.uint8
    assert frame.ndim == 3 and frame.shape[2] == 3 and min(frame.shape[:2]) >= 120
    assert len(np.unique(frame[::6, ::6].reshape(-1, 3), axis=0)) > 20  # more than an empty background


@pytest.mark.parametrize("name", IDS)
def test_frames_of_a_single_environment(name, monkeypatch):
    """Without any display; a frame is fresh and shows the motion."""
    for variable in ("DISPLAY", "WAYLAND_DISPLAY"):
        monkeypatch.delenv(variable, raising=False)
    env = MagRodEnv(**IDS[name][0], render_mode="rgb_array")
    env.reset(seed=0)
    first = env.render()
    check_frame(first)
    np.testing.assert_array_equal(env.render(), first)
    kept = first.copy()
    for action in scripted_actions(env.action_space, 5):
        env.step(action)
    later = env.render()
    check_frame(later)
    assert later.shape == first.shape and np.any(later != first)
    assert not np.shares_memory(first, later)
    np.testing.assert_array_equal(first, kept)
    env.close()


@pytest.mark.parametrize("name", IDS)
def test_frames_of_a_batch(name):
    """A tuple with one frame of each environment, row i that of a single environment with its seed."""
    batch = MagRodVectorEnv(**IDS[name][0], num_envs=3, render_mode="rgb_array")
    batch.reset(seed=5)
    frames = batch.render()
    assert isinstance(frames, tuple) and len(frames) == 3
    single = MagRodEnv(**IDS[name][0], render_mode="rgb_array")
    for i, frame in enumerate(frames):
        check_frame(frame)
        single.reset(seed=5 + i)
        np.testing.assert_array_equal(single.render(), frame)
    batch.step(scripted_actions(batch.action_space, 1)[0])
    assert all(np.any(after != before) for after, before in zip(batch.render(), frames, strict=True))
    batch.close()


def test_planar_rod_is_drawn_where_a_spatial_one_is():
    """Same load, same poses: what the planar kernel knows is turned into space the right way round."""
    poses = []
    for plane in ("xz", None):
        env = MagRodEnv("planar_reach", plane=plane, num_elements=3, render_mode="rgb_array")
        env.reset(seed=0)
        poses.append(env._painter._pose(0))
    for planar, spatial in zip(*poses, strict=True):
        np.testing.assert_allclose(planar, spatial, rtol=0, atol=1e-12)


def test_no_frame_without_a_render_mode():
    env, batch = MagRodEnv("reach", num_elements=3), MagRodVectorEnv("reach", 2, num_elements=3)
    env.reset(seed=0), batch.reset(seed=0)
    assert env.render() is None and batch.render() is None
    assert env.render_mode is None and batch.render_mode is None


def test_diverged_rod_can_be_drawn():
    """A video of a run that fails is worth having."""
    env = MagRodEnv("reach", num_elements=3, render_mode="rgb_array")
    env.reset(seed=0)
    batch = env.core.batch
    batch.rows[0, batch.layout.nodes + batch.node_rows.size] = np.nan
    assert env.step(np.zeros(2))[2]
    check_frame(env.render())
    env.reset()
    check_frame(env.render())


def test_scene_with_a_gravity_of_zero_can_be_drawn():
    scene = load_scene("paper5_circle", modulus=2e6).replace(gravity=(0.0, 0.0, 0.0))
    env = MagRodEnv("reach", scene=scene, num_elements=3, render_mode="rgb_array")
    env.reset(seed=0)
    check_frame(env.render())


def test_trace_of_a_rod_that_is_lost_ends_where_it_was_last_seen():
    """The clamp, where a lost rod counts as lying, is no place that its tip has been to."""
    env = MagRodEnv("circle", num_elements=3, render_mode="rgb_array")
    env.reset(seed=0)
    for action in scripted_actions(env.action_space, 3):
        env.step(action)
    trace = np.array(env._painter._trace)
    batch = env.core.batch
    batch.rows[0, batch.layout.nodes + batch.node_rows.size] = np.nan
    assert env.step(np.zeros(2))[2]
    np.testing.assert_array_equal(env._painter._trace, trace)


def test_frame_follows_the_reset():
    """The trace of the last episode is gone, and the frame is that of a fresh environment."""
    env, fresh = (MagRodEnv("circle", num_elements=3, render_mode="rgb_array") for _ in range(2))
    env.reset(seed=0)
    for action in scripted_actions(env.action_space, 5):
        env.step(action)
    env.reset(seed=1), fresh.reset(seed=1)
    np.testing.assert_array_equal(env.render(), fresh.render())


def test_rendering_does_not_change_the_episode():
    env, twin = MagRodEnv("circle", num_elements=3, render_mode="rgb_array"), MagRodEnv("circle", num_elements=3)
    env.reset(seed=0), twin.reset(seed=0)
    for action in scripted_actions(env.action_space, 4):
        env.render()
        np.testing.assert_array_equal(env.step(action)[0], twin.step(action)[0])


@pytest.mark.parametrize("kind", ["single", "vector"])
def test_missing_pillow_is_named(monkeypatch, kind):
    """Environments without pictures do not need it."""
    monkeypatch.setitem(sys.modules, "PIL", None)
    for name in [name for name in sys.modules if name.startswith("magrod_env.rendering")]:
        monkeypatch.delitem(sys.modules, name)
    make = MagRodEnv if kind == "single" else MagRodVectorEnv
    with pytest.raises(ImportError, match=r"Pillow.*magrod-env\[viz\]"):
        make("reach", num_elements=3, render_mode="rgb_array")
    make("reach", num_elements=3).reset(seed=0)
