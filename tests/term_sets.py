"""Scenes of a few sets of terms, so that the tests share their compiled kernels.

A kernel is compiled for every set of terms, number of lanes and precision, which takes far longer than most tests. A
test of something that does not depend on the absence of a term has the term with the value zero instead, which changes
nothing but rounding (``rod/test_batch.py``). Scenes of its own have only the tests of absent terms.
"""

from magrod_env import Magnet, Scene


def dragged(scene: Scene) -> Scene:
    """The scene with gravity and drag, zero where it has none: the terms of most tests of the motion."""
    return scene.replace(gravity=scene.gravity or (0.0, 0.0, 0.0), drag_rate=scene.drag_rate or 0.0)


def loaded(scene: Scene) -> Scene:
    """The same of a scene that may have no magnet: one without mass and moment then sits at its tip."""
    nothing = Magnet.dipole(position=scene.rod.length, moment=0.0)
    return dragged(scene.replace(magnets=scene.magnets or (nothing,)))


def damped(scene: Scene) -> Scene:
    """The scene with spin drag and internal damping as well: the terms of the environments."""
    terms = {name: getattr(scene, name) or 0.0 for name in ("spin_drag_rate", "internal_damping")}
    return dragged(scene).replace(**terms)
