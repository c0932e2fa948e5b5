"""Environments of a scene that lists loads: episodes begin at rest under them, on rods that differ as well."""

import gymnasium
import numpy as np

from magrod_env import FluidDrag, TipWrench, load_scene
from magrod_env.envs import Randomization
from magrod_env.rod.state import BatchState


def test_randomised_episodes_begin_in_equilibrium_under_the_listed_loads():
    """A force that follows the tip and a flow: where statics and stepping share their loads, nothing moves."""
    scene = load_scene("paper5_circle", modulus="effective").replace(drag_rate=5.0, internal_damping=3e-3)
    force = 0.3 * scene.rod.bending_stiffness / scene.rod.length**2
    water = FluidDrag(density=1000.0, normal_coefficient=1.1, tangential_coefficient=0.02, flow=(0.0, 0.05, 0.0))
    scene = scene.replace(loads=(TipWrench(force=(0.0, force, force), follows=True), water))
    spread = Randomization(modulus=0.1, density=0.1, gravity_direction=0.05)
    env = gymnasium.make_vec("MagRod/Reach-v0", num_envs=2, scene=scene, randomization=spread)
    env.reset(seed=0)
    core = env.unwrapped.core
    state = BatchState(core.batch)
    start = state.positions
    core.batch.run(200, core.time_step)
    np.testing.assert_allclose(state.positions, start, atol=1e-9)
    assert np.abs(start[:, -1, 1]).min() > 0.02 * scene.rod.length  # the loads act
    assert np.abs(start[0, -1] - start[1, -1]).max() > 1e-5  # the rods differ
    env.step(np.zeros(env.action_space.shape))
    assert not core.batch.status.any()
