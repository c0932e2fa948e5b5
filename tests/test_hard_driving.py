"""Steps under tension, sudden changes of the field, loss factors: loads that are not gentle."""

from itertools import pairwise

import numpy as np
import pytest
from rod.beams import CLAMPED_FREE
from rod.test_stability import assert_limit_between
from scipy.spatial.transform import Rotation
from term_sets import damped, dragged

from magrod_env import Magnet, Rod, Scene, Simulation, load_scene
from magrod_env.rod.equilibrium import Equilibrium

SOFT = Rod.circular(length=0.1, diameter=1e-3, density=1100.0, youngs_modulus=1e6, poissons_ratio=0.5)
PULLED = dragged(Scene(rod=SOFT, magnets=(Magnet.dipole(position=0.1, moment=0.1),)))
PULL = np.diag([0.2, -0.1, -0.1])  # T/m
SIDEWAYS = (0.0, 0.0, 20e-3)  # T


def test_a_rod_that_is_pulled_taut_stretches_by_the_closed_form():
    """F = m dB/dx = 0.02 N."""
    simulation = Simulation(PULLED.replace(drag_rate=20.0), num_elements=6)
    simulation.advance(2.0, field=(0.0, 0.0, 0.0), gradient=PULL)
    area = np.pi * 1e-3**2 / 4.0
    np.testing.assert_allclose(simulation.tip_position[0], [0.1 * (1.0 + 0.02 / (1e6 * area)), 0.0, 0.0], atol=1e-7)


def test_a_given_step_that_a_gradient_makes_unstable_is_refused():
    step = 0.9 * Simulation(PULLED, num_elements=6).stable_time_step
    simulation = Simulation(PULLED, num_elements=6, time_step=step)
    with pytest.raises(ValueError, match=r"time_step must be at most .* s in a gradient of 0\.2 T/m"):
        simulation.advance(0.01, gradient=PULL)


@pytest.mark.parametrize(
    ("direction", "field", "gradient"),
    [
        ((1.0, 0.0, 0.0), (0.0, 0.0, 1e-5), PULL),  # taut and a little aside
        ((1.0, 1.0, 0.0), (0.0, 0.0, 3e-4), np.zeros((3, 3))),  # twisted and bent
        ((1.0, 0.0, 0.0), (0.0, 2e-4, 4e-4), np.zeros((3, 3))),  # bent in space
    ],
    ids=["tension", "twist", "bend"],
)
def test_the_bound_at_an_equilibrium_is_the_step_at_which_its_vibrations_grow(direction, field, gradient):
    magnet = Magnet.dipole(position=0.1, moment=0.1 if gradient.any() else 2e-3, direction=direction)
    simulation = Simulation(PULLED.replace(magnets=(magnet,)), num_elements=6)
    equilibrium = simulation.equilibrium(field, gradient)
    assert equilibrium.reached
    bound = simulation.stable_time_step_at(equilibrium)
    simulation.time_step = 0.2 * bound
    simulation.reset(field=field, gradient=gradient)
    assert_limit_between(simulation, 0.999 * bound, 1.003 * bound)


def test_a_loss_factor_is_that_of_the_first_vibration():
    scene = load_scene("paper4_pdms_tip_magnet").replace(drag_rate=None, loss_factor=0.1)
    omega = 2.0 * np.pi * scene.first_frequency
    np.testing.assert_allclose(scene.damping_time * omega, 0.1, rtol=1e-12)
    exact = Simulation(scene.replace(loss_factor=None), num_elements=20).natural_frequencies()[0]
    np.testing.assert_allclose(scene.first_frequency, exact, rtol=3e-3)  # without shear and rotary inertia
    bare = scene.replace(magnets=())
    rod = bare.rod
    beam = CLAMPED_FREE[0] ** 2 * np.sqrt(rod.bending_stiffness / rod.mass_per_length) / rod.length**2
    np.testing.assert_allclose(2.0 * np.pi * bare.first_frequency, beam, rtol=1e-7)
    assert Simulation(scene, num_elements=4).rods.batch.terms.internal_damping is not None


def test_damping_said_twice_is_refused():
    with pytest.raises(ValueError, match="internal_damping of the scene must be None beside a loss_factor"):
        PULLED.replace(internal_damping=1e-3, loss_factor=0.1)


def flips(scene, count, **options):
    simulation = Simulation(scene, num_elements=4, on_failure="report", **options)
    for k in range(count):
        simulation.advance(0.02, field=np.array(SIDEWAYS) * (-1) ** k)
    return simulation


def test_a_field_that_flips_asks_for_more_elements_than_one_that_is_turned_on():
    scene = load_scene("paper5_circle", modulus="effective").replace(drag_rate=5.0)
    assert not flips(scene, 1).coarse
    assert flips(scene, 12).coarse
    lossy = damped(scene.replace(internal_damping=3e-3))  # upper vibrations are gone at the next flip
    assert not flips(lossy, 12).coarse


def test_a_field_that_turns_slowly_is_no_sudden_one():
    scene = load_scene("paper5_circle", modulus="effective").replace(drag_rate=5.0)
    simulation = Simulation(scene, num_elements=4, on_failure="report")
    for k in range(100):
        angle = 0.02 * np.pi * k
        simulation.advance(0.02, field=20e-3 * np.array([0.0, np.cos(angle), np.sin(angle)]))
    assert not simulation.coarse


def test_a_hanging_rod_is_found_by_implicit_steps_of_its_own():
    """Silicone that hangs: its swing, not the vibration of the straight rod, sets the step."""
    rod = Rod.circular(length=0.15, diameter=2e-3, density=1070.0, youngs_modulus=1.5e5, poissons_ratio=0.5)
    simulation = Simulation(Scene(rod=rod, gravity=(9.81, 0.0, 9.81e-3), drag_rate=5.0), integrator="implicit")
    simulation.advance(6.0)
    exact = rod.length + rod.density * 9.81 * rod.length**2 / (2.0 * rod.youngs_modulus)
    np.testing.assert_allclose(simulation.tip_position[0, 0], exact, atol=2e-5)


def shape_of(simulation, rod, field):
    """The present shape of a rod in a field, as an equilibrium that its linear bound is asked of."""
    quaternions = Rotation.from_matrix(simulation.rotations[rod]).as_quat(scalar_first=True)
    for one, other in pairwise(quaternions):
        other *= np.sign(one @ other)  # rotations of neighbours below a half turn
    return Equilibrium(simulation.positions[rod], quaternions, True, 2.0, field, np.zeros((3, 3)))


@pytest.mark.parametrize(
    ("name", "num_elements", "rotary_scaling", "strength"),
    [("paper4_pdms_tip_magnet", 4, 8.0, 15e-3), ("paper6_two_magnets", 6, 8.0, 15e-3)],
)
def test_the_default_step_stays_below_the_bounds_met_while_fields_flip(name, num_elements, rotary_scaling, strength):
    """No vibration but drag takes energy out, so that each flip bends the rod further. 0.7 and 0.75 of them is seen."""
    directions = np.random.default_rng(0).normal(size=(4, 3))
    directions /= np.linalg.norm(directions, axis=1)[:, None]
    simulation = Simulation(
        load_scene(name).replace(drag_rate=5.0),
        num_rods=4,
        num_elements=num_elements,
        rotary_scaling=rotary_scaling,
        expected_field=strength,
        on_failure="report",
    )
    default, static = simulation.time_step, simulation.rods.model.static
    simulation.time_step = 0.25 * default
    least = np.inf
    for k in range(100):
        fields = (-1) ** (k // 5) * strength * directions  # flips every 10 ms
        simulation.advance(2e-3, field=fields)
        bounds = [static.stable_time_step_at(shape_of(simulation, rod, fields[rod]), None) for rod in range(4)]
        least = min(least, *bounds)
    assert not simulation.status.any()
    assert default < 0.8 * least < simulation.stable_time_step
