"""Frames from arrays: a rod, its magnets, the field and the task, drawn with numpy and Pillow, no window."""

from importlib.util import find_spec

if find_spec("PIL") is None:
    raise ImportError("Rendering needs Pillow: install magrod-env[viz].")

from magrod_env.rendering.picture import Picture
from magrod_env.rendering.renderer import Renderer
from magrod_env.rendering.video import write_video

__all__ = ["Picture", "Renderer", "write_video"]
