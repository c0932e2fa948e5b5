"""What a scene leaves out is not in its kernel: its numbers may be NaN, for nothing reads them."""

import numpy as np
import pytest

from magrod_env import Magnet, Rod, Scene, Simulation
from magrod_env.rod.layout import DAMPING, DRAG, FIELD, GRADIENT, GRAVITY, REFERENCE, SPIN_DRAG, TARGET

ROD = Rod.circular(length=60e-3, diameter=4e-3, density=1100.0, youngs_modulus=1.5e6, poissons_ratio=0.5)
TIP = Magnet.dipole(position=60e-3, moment=0.013, mass=9.6e-5)
BARE = Scene(rod=ROD, magnets=(TIP,))
FIELD_ON = (0.0, 4e-3, 6e-3)
ROWS = {
    "gravity": (GRAVITY, 3),
    "drag_rate": (DRAG, 1),
    "spin_drag_rate": (SPIN_DRAG, 1),
    "internal_damping": (DAMPING, 1),
    "gradient": (GRADIENT, 9),
    "slew and lag": (REFERENCE, 3),
    "target": (TARGET, 3),
}


def moved(scene, *, poison=None, plane=None, num_rods=1):
    simulation = Simulation(scene, num_elements=4, time_step=1e-4, plane=plane, num_rods=num_rods, num_threads=1)
    if poison is not None:
        first, count = poison
        simulation.rods.batch.rows[:, first : first + count] = np.nan
    field = FIELD_ON if plane is None else (0.0, 0.0, 6e-3)
    if scene.magnets:
        simulation.rods.batch.set_field(np.tile(field, (num_rods, 1)))
    simulation.rods.batch.run(400, 1e-4)
    return simulation.positions, simulation.velocities, simulation.rotations


@pytest.mark.parametrize("plane", [None, "xz"])
@pytest.mark.parametrize("name", ROWS)
def test_kernel_never_reads_what_the_scene_leaves_out(name, plane):
    clean, poisoned = moved(BARE, plane=plane), moved(BARE, plane=plane, poison=ROWS[name])
    for one, other in zip(clean, poisoned, strict=True):
        np.testing.assert_array_equal(one, other)


def test_lanes_never_read_what_the_scene_leaves_out():
    clean = moved(BARE, num_rods=8)
    for rows in ROWS.values():
        poisoned = moved(BARE, num_rods=8, poison=rows)
        for one, other in zip(clean, poisoned, strict=True):
            np.testing.assert_array_equal(one, other)


@pytest.mark.parametrize("plane", [None, "xz"])
def test_kernel_without_magnets_never_reads_a_field(plane):
    scene = Scene(rod=ROD, gravity=(0.0, 0.0, -9.81))
    clean, poisoned = moved(scene, plane=plane), moved(scene, plane=plane, poison=(FIELD, 3))
    for one, other in zip(clean, poisoned, strict=True):
        np.testing.assert_array_equal(one, other)
