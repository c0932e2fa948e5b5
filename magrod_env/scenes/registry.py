"""Scenes by name."""

from __future__ import annotations

import dataclasses
from typing import Literal

from magrod_env import _checks
from magrod_env.scene import Scene
from magrod_env.scenes.guidewire import niti_guidewire
from magrod_env.scenes.paper import PAPER_SCENES
from magrod_env.scenes.record import PaperScene

_OTHER_SCENES = {"niti_guidewire": niti_guidewire()}


def scene_names() -> tuple[str, ...]:
    """Return the names that `load_scene` knows."""
    return (*PAPER_SCENES, *_OTHER_SCENES)


def paper_scene(name: str) -> PaperScene:
    """Return what the paper states about one of its scenes.

    Raises:
        ValueError: if the name is not one of the paper's scenes.
    """
    if name not in PAPER_SCENES:
        raise ValueError(
            f"name must be a scene of the paper, but got {name!r}: choose one of {', '.join(PAPER_SCENES)}."
        )
    return PAPER_SCENES[name]


def load_scene(name: str, *, modulus: Literal["printed", "effective"] | float = "printed") -> Scene:
    """Return a scene by name.

    The paper's element is too stiff in bending by a factor (`nodal_stiffening`) of 3 to 4 for its round
    polymer rods. A converged model of the same modulus therefore sags further and moves slower than the
    paper's model does. "effective" multiplies the modulus by the factor: 1.08 MPa for the rod of 5 mm, 1.48
    MPa for the rods of 4 mm, both usual for PDMS. It is what a converged model needs to bend like the paper's
    model, not a measured modulus.

    "effective" is refused where the factor makes no sense: for aluminium (68 and 268 times a known modulus),
    for the square rod with two magnets (19 times, 70 MPa, too stiff for the motion the paper reports), for
    the example on frequency scaling (no number of elements is stated) and for scenes that are not the
    paper's.

    Args:
        name: one of `scene_names()`.
        modulus: "printed" for the paper's modulus with its units corrected, "effective" as above, or Young's
            modulus, Pa.

    Raises:
        ValueError: if the name or the choice of modulus is unknown, or "effective" is refused.
    """
    if name not in scene_names():
        raise ValueError(f"name must be a known scene, but got {name!r}: choose one of {', '.join(scene_names())}.")
    scene = PAPER_SCENES[name].scene if name in PAPER_SCENES else _OTHER_SCENES[name]
    if modulus == "printed":
        return scene
    youngs_modulus = _effective_modulus(name) if modulus == "effective" else _given_modulus(modulus)
    return scene.replace(rod=dataclasses.replace(scene.rod, youngs_modulus=youngs_modulus))


def _effective_modulus(name: str) -> float:
    record = PAPER_SCENES.get(name)
    reason = "it is not a scene of the paper" if record is None else record.why_no_effective_modulus
    if record is None or record.stiffening is None or reason is not None:
        raise ValueError(
            f'modulus="effective" must be asked of a polymer rod of the paper, but got {name!r}, '
            f"where {reason}: "
            'use "printed" or give a modulus in pascal.'
        )
    return record.scene.rod.youngs_modulus * record.stiffening


def _given_modulus(modulus: str | float) -> float:
    return _checks.number(
        'modulus, where it is not "printed" or "effective",',
        modulus,
        above=0.0,
        advice="give it in pascal, 1 MPa is 1e6",
    )
