"""The scenes of the tasks: rods of the paper, damped as silicone is."""

from __future__ import annotations

from magrod_env.scene import Scene
from magrod_env.scenes import load_scene
from magrod_env.simulation.resolution import Resolution

DRAG_RATE = 5.0  # 1/s: the paper's rods come to rest within a second
SPIN_DRAG_RATE = 100.0  # 1/s: lets the ringing of a section after a step of the field die out
INTERNAL_DAMPING = 3e-3  # s: a loss factor of 0.09 at the first vibration (two magnets: 0.03), as silicone may have
ROUND_ROD = Resolution(num_elements=4, rotary_scaling=8.0)  # of `round_rod`


def round_rod() -> Scene:
    """The rod of the paper's experiment 5, with the modulus that moves like the paper's."""
    return damped(load_scene("paper5_circle", modulus="effective"))


def two_magnet_rod() -> Scene:
    """The rod of the paper's experiment 6, with two magnets."""
    return damped(load_scene("paper6_two_magnets"))


def damped(scene: Scene) -> Scene:
    """A scene with the damping of the environments' rods."""
    return scene.replace(drag_rate=DRAG_RATE, spin_drag_rate=SPIN_DRAG_RATE, internal_damping=INTERNAL_DAMPING)
