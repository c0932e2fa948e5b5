"""Recomputes reference.npz beside this file, case by case: python -m tests.reference.make_reference [case ...]

Every dynamic case runs on three settings: the reference, a coarser mesh (error in s) and a looser tolerance (error in
t). The largest distances over the run are stored beside the data, so a test knows how far to trust it. See README.md.
"""

import sys
from dataclasses import replace
from pathlib import Path

import numpy as np

from scripts.reference.spectral_rod import Mesh, to_world

from .cases import DYNAMIC, EQUILIBRIA, LAYERS, OWN_TIMES, TIMES, inner_cuts
from .solving import equilibrium as rest
from .solving import run_implicit

FILE = Path(__file__).with_name("reference.npz")
REFERENCE = dict(elements=8, degree=8, tolerance=1e-9)
COARSER_MESH = dict(elements=5, degree=9, tolerance=1e-9)
LOOSER_TIME = dict(elements=8, degree=8, tolerance=1e-5)
SETTINGS = {  # cases that need others: reference, coarser mesh, looser tolerance or fewer steps
    "fast_step": (
        dict(elements=16, degree=8, tolerance=1e-5),
        dict(elements=10, degree=8, tolerance=1e-6),
        dict(elements=16, degree=8, tolerance=1e-3),
    ),
    "aluminium": (
        dict(elements=1, degree=16, steps=100),
        dict(elements=1, degree=13, steps=100),
        dict(elements=1, degree=16, steps=50),
    ),
    "niti": (
        dict(elements=1, degree=14, steps=50),
        dict(elements=1, degree=10, steps=50),
        dict(elements=1, degree=14, steps=25),
    ),
    "tilted_rotating_field": (
        dict(elements=2, degree=10, tolerance=1e-9),
        dict(elements=1, degree=13, tolerance=1e-9),
        dict(elements=2, degree=10, tolerance=1e-5),
    ),
    "tilted_swing": (
        dict(elements=12, degree=8, tolerance=1e-9),
        dict(elements=8, degree=8, tolerance=1e-7),
        dict(elements=12, degree=8, tolerance=1e-5),
    ),
}
STATIC_SETTINGS = ((2, 10), (1, 14))  # elements and degree: reference, coarser mesh
LAYER_SETTINGS = ((None, 12), (None, 9))  # degrees on the cuts of LAYERS


def trajectory(case, times=TIMES, *, elements, degree, tolerance=None, steps=None):
    """Positions (times, magnets, 3) and tangents (times, magnets, 3) of the magnets, and the energy (times,).

    A rod without magnets is watched at its tip. Either a tolerance (explicit) or steps a sample (implicit).
    """
    mesh = Mesh(case, degree, inner_cuts(case, elements))
    states = mesh.run(times, tolerance) if steps is None else run_implicit(mesh, times, steps)
    watched = mesh.magnet_node or [mesh.count - 1]
    q = np.array([mesh.split(y)[1][watched] for y in states])
    tangent = np.stack(to_world(np.moveaxis(q, -1, 0), (1.0, 0.0, 0.0)), axis=-1)
    position = np.array([mesh.split(y)[0][watched] for y in states])
    energy = np.array([mesh.energy(y, t) for y, t in zip(states, times)])
    return position, tangent, energy


def dynamic(name):
    """The arrays stored for one dynamic case."""
    case = DYNAMIC[name]
    reference, coarser_mesh, looser_time = SETTINGS.get(name, (REFERENCE, COARSER_MESH, LOOSER_TIME))
    times = OWN_TIMES.get(name, TIMES)
    position, tangent, energy = trajectory(case, times, **reference)
    out = {"time": times, "tip": position[:, 0], "tip_tangent": tangent[:, 0], "energy": energy}
    if len(case.magnets) == 2:
        out |= {"middle": position[:, 1]}
    for key, setting in {"error_space": coarser_mesh, "error_time": looser_time}.items():
        out[key] = np.linalg.norm(trajectory(case, times, **setting)[0] - position, axis=-1).max()
    return {f"{name}_{key}": value for key, value in out.items()}


def equilibrium(case, cuts, degree):
    """Tip position and tangent reached from the straight rod by raising gravity, then field and gradient, slowly."""
    state, share, step = None, 0.0, 0.25  # share 0 to 1: of gravity, 1 to 2: of field and gradient
    while share < 2.0:
        goal = min(share + step, np.floor(share) + 1.0)
        weight, pull = min(goal, 1.0), max(goal - 1.0, 0.0)
        loaded = replace(case, gravity=weight * np.array(case.gravity), gradient=pull * np.array(case.gradient))
        mesh = Mesh(loaded, degree, cuts)
        try:
            state, share = rest(mesh, pull * case.field(0.0), state), goal
        except RuntimeError:
            step /= 2
            if step < 1e-4:
                raise
    p, q, _, _ = mesh.split(state)
    return p[-1], to_world(q[-1], (1.0, 0.0, 0.0))


def static(name):
    """The arrays stored for one static case."""
    case = EQUILIBRIA[name]
    settings = STATIC_SETTINGS if name not in LAYERS else LAYER_SETTINGS
    (tip, tangent), (coarser, _) = (
        equilibrium(case, LAYERS.get(name) or inner_cuts(case, elements), degree) for elements, degree in settings
    )
    out = {"field": case.field(0.0), "tip": tip, "tip_tangent": np.array(tangent)}
    out["error_space"] = np.linalg.norm(coarser - tip)
    return {f"{name}_{key}": value for key, value in out.items()}


def main(names):
    for name in names or [*DYNAMIC, *EQUILIBRIA]:
        stored = dict(np.load(FILE)) if FILE.exists() else {}
        new = static(name) if name in EQUILIBRIA else dynamic(name)
        np.savez_compressed(FILE, **stored | new)
        print(
            name,
            *(f"{key.removeprefix(name + '_')} {value:.1e} m" for key, value in new.items() if "error" in key),
            flush=True,
        )


if __name__ == "__main__":
    main(sys.argv[1:])
