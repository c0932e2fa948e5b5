"""Frames written to a file can be read again."""

import numpy as np
import pytest

pytest.importorskip("PIL")
pytest.importorskip("imageio")
pytest.importorskip("imageio_ffmpeg")

import imageio.v2 as imageio

from magrod_env.rendering import video, write_video


def frames(count):
    for level in np.linspace(40, 200, count):
        yield np.full((48, 64, 3), level, dtype=np.uint8)


@pytest.mark.parametrize("suffix", [".mp4", ".gif"])
def test_written_video_holds_the_frames(tmp_path, suffix):
    path = tmp_path / f"clip{suffix}"
    write_video(frames(6), path, fps=10)
    with imageio.get_reader(path) as reader:
        levels = [float(np.mean(frame[..., :3])) for frame in reader]
    # Lossy codecs and palettes shift the grey levels a little.
    np.testing.assert_allclose(levels, np.linspace(40, 200, 6), atol=6.0)


def test_unknown_ending_is_named(tmp_path):
    with pytest.raises(ValueError, match=r"must end in \.mp4 or \.gif"):
        write_video(frames(1), tmp_path / "clip.txt", fps=10)


@pytest.mark.parametrize("fps", [0, -1, float("nan"), float("inf"), 1e300, True, "x", None, set()], ids=str)
def test_rate_that_no_video_has_is_named(tmp_path, fps):
    with pytest.raises(ValueError, match="fps must be"):
        write_video(frames(1), tmp_path / "clip.gif", fps=fps)


def test_missing_packages_are_named(tmp_path, monkeypatch):
    monkeypatch.setattr(video, "find_spec", lambda name: None)
    with pytest.raises(ImportError, match=r"install magrod-env\[viz\]"):
        write_video(frames(1), tmp_path / "clip.mp4", fps=10)
