"""Frames to a file."""

from collections.abc import Iterable
from importlib.util import find_spec
from numbers import Real
from pathlib import Path

import numpy as np
from numpy.typing import NDArray


def write_video(frames: Iterable[NDArray[np.uint8]], path: str | Path, fps: float) -> None:
    """Write frames (height, width, 3) uint8, one after the other, as .mp4 or .gif.

    frames: any iterable; it is consumed frame by frame.
    path: file to write; its ending picks the format.
    fps: frames per second of playback, above 0 and at most 1000.
    Raises ImportError without imageio and imageio-ffmpeg, ValueError for another ending or rate.
    """
    if isinstance(fps, bool) or not isinstance(fps, Real) or not 0 < fps <= 1000:
        raise ValueError(f"fps must be a number above 0 and at most 1000, received {fps!r}.")
    suffix = Path(path).suffix.lower()
    if suffix not in (".mp4", ".gif"):
        raise ValueError(f"path must end in .mp4 or .gif, received {str(path)!r}.")
    if find_spec("imageio") is None or find_spec("imageio_ffmpeg") is None:
        raise ImportError("Writing videos needs imageio and imageio-ffmpeg: install magrod-env[viz].")
    import imageio.v2 as imageio

    if suffix == ".gif":
        writer = imageio.get_writer(path, format="GIF", mode="I", duration=1000 / fps, loop=0)
    else:
        writer = imageio.get_writer(path, format="FFMPEG", mode="I", fps=fps, quality=8, macro_block_size=2)
    with writer:
        for frame in frames:
            writer.append_data(frame)
