"""Loads that differ from rod to rod act as the loads of scenes of their own."""

import numpy as np
import pytest

from magrod_env import PointLoad, Simulation, TipWrench, load_scene

SCENE = load_scene("paper5_circle", modulus="effective").replace(drag_rate=5.0)
FORCES = np.array([[0.0, 2e-4, 0.0], [1e-4, 0.0, 5e-4]])


def scene(force, follows=True):
    return SCENE.replace(
        loads=(PointLoad(position=0.03, force=(0.0, 1e-4, 0.0)), TipWrench(force=tuple(force), follows=follows))
    )


def test_each_rod_has_its_own_load_in_motion_statics_and_reactions():
    simulation = Simulation(scene((1e-4, 1e-4, 1e-4)), num_rods=2, num_elements=5, time_step=5e-5)
    simulation.set_load(1, force=FORCES)
    simulation.reset(field=(0.0, 0.0, 4e-3))
    simulation.advance(0.05, field=(0.0, 3e-3, 4e-3))
    reactions = simulation.reactions()
    for k in range(2):
        alone = Simulation(scene(FORCES[k]), num_elements=5, time_step=5e-5)
        found = simulation.equilibrium((0.0, 0.0, 4e-3), rod=k)
        np.testing.assert_allclose(found.positions, alone.equilibrium((0.0, 0.0, 4e-3)).positions, atol=1e-11)
        alone.reset(field=(0.0, 0.0, 4e-3))
        alone.advance(0.05, field=(0.0, 3e-3, 4e-3))
        np.testing.assert_allclose(simulation.positions[k], alone.positions[0], atol=1e-10)
        np.testing.assert_allclose(reactions.clamp_force[k], alone.reactions().clamp_force[0], atol=1e-9)


def test_bad_loads_are_refused():
    simulation = Simulation(scene((1e-4, 0.0, 0.0)), num_rods=2)
    with pytest.raises(ValueError, match="number must be that of one of the scene's 2 loads"):
        simulation.set_load(2, force=(0.0, 0.0, 0.0))
    with pytest.raises(ValueError, match="must be force"):
        simulation.set_load(0, density=1.0)
