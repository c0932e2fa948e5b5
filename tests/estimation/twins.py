"""Twin experiments for the tests of filters: a truth that is simulated apart, and frames of it."""

from __future__ import annotations

import dataclasses

import numpy as np
from term_sets import damped

from magrod_env import Simulation, load_scene
from magrod_env.estimation.measurement import Measurement

FRAME = 0.02  # s
NOISE = 5e-5  # m
SCENE = damped(load_scene("paper5_circle", modulus="effective").replace(drag_rate=1.0, spin_drag_rate=100.0))


def stiffer(scene, factor):
    """The scene with another Young's modulus."""
    return scene.replace(rod=dataclasses.replace(scene.rod, youngs_modulus=scene.rod.youngs_modulus * factor))


def fields(count, plane=None):
    """Fields, T, (count, 3): against gravity, and turning (swinging in a plane) once a second."""
    angle = 2.0 * np.pi * FRAME * np.arange(count)
    across = 0.0 if plane == "xz" else 10e-3
    return np.stack([0.0 * angle, across * np.cos(angle), 8e-3 + 10e-3 * np.sin(angle)], axis=1)


def turned(field, vector):
    """Fields turned by a rotation vector, rad, by scipy."""
    from scipy.spatial.transform import Rotation

    return Rotation.from_rotvec(vector).apply(field)


def truth(scene, commands, *, num_elements=12, plane=None, misalignment=(0.0, 0.0, 0.0)):
    """Positions of the tip at the start and after every frame, (count + 1, 3), from equilibrium in the first field."""
    acting = turned(commands, misalignment)
    simulation = Simulation(scene, num_elements=num_elements, plane=plane, num_threads=1)
    simulation.reset(acting[0])
    tips = [simulation.tip_position[0]]
    for field in acting:
        simulation.advance(FRAME, field)
        tips.append(simulation.tip_position[0])
    return np.array(tips)


def frame(tips, time, generator=None, noise=NOISE):
    """A frame of tips (num_rods, 3), with camera noise where there is a generator."""
    seen = np.array(tips, float)
    if generator is not None:
        seen += noise * generator.standard_normal(seen.shape)
    return Measurement(positions=seen[:, None], covariance=noise**2 * np.eye(3), time=time)
