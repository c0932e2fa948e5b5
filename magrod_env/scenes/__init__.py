"""Scenes by name: those of the paper, audited, and a guidewire."""

from magrod_env.scenes.record import PaperScene, ReportedError, nodal_stiffening
from magrod_env.scenes.registry import load_scene, paper_scene, scene_names

__all__ = ["PaperScene", "ReportedError", "load_scene", "nodal_stiffening", "paper_scene", "scene_names"]
