"""Rods of one batch that differ: each behaves as a scene of its own that says the same."""

import dataclasses

import numpy as np
import pytest

from magrod_env import Magnet, Rod, Scene, Simulation

ROD = Rod.circular(length=0.06, diameter=4e-3, density=1101.0, youngs_modulus=3.6e5, poissons_ratio=0.5)
MAGNETS = (
    Magnet.dipole(position=0.03, moment=6e-3, mass=5e-5, direction=(-1.0, 0.0, 0.0)),
    Magnet.dipole(position=0.06, moment=0.0134, mass=9.6e-5, direction=(1.0, 0.2, 0.0)),
)
SCENE = Scene(rod=ROD, magnets=MAGNETS, gravity=(0.0, 0.0, -9.81), drag_rate=5.0, spin_drag_rate=50.0, loss_factor=0.05)
FIELD = np.array([1e-3, 3e-3, 6e-3])
MODULUS, DENSITY, MOMENT = (1.0, 1.3, 0.8), (1.0, 0.9, 1.2), (1.0, 1.1, 0.7)
DRAG, SHIFT = (1.0, 0.5, 2.0), (0.0, 2e-3, -1e-3)
GRAVITY = np.array([[0.0, 0.0, -9.81], [0.0, 5.0, -8.0], [3.0, 0.0, -9.0]])


def own_scene(k):
    """The scene that says what the parameters say of rod k."""
    rod = Rod.circular(
        length=0.06,
        diameter=4e-3,
        density=1101.0 * DENSITY[k],
        youngs_modulus=3.6e5 * MODULUS[k],
        poissons_ratio=0.5,
    )
    magnets = tuple(
        Magnet.dipole(
            position=magnet.position + (SHIFT[k] if magnet.position < 0.06 else 0.0),
            moment=magnet.moment * MOMENT[k],
            mass=magnet.mass,
            direction=magnet.direction,
        )
        for magnet in MAGNETS
    )
    return Scene(
        rod=rod,
        magnets=magnets,
        gravity=tuple(GRAVITY[k]),
        drag_rate=5.0 * DRAG[k],
        spin_drag_rate=50.0,
        internal_damping=SCENE.damping_time,
    )


def varied():
    simulation = Simulation(SCENE, num_rods=3, num_elements=6, time_step=4e-5)
    simulation.set_parameters(
        modulus=MODULUS, density=DENSITY, moment=MOMENT, drag=DRAG, magnet_shift=SHIFT, gravity=GRAVITY
    )
    return simulation


def test_each_rod_moves_as_the_scene_that_says_the_same():
    """To rounding: the constants are the same numbers, but for the order of two products."""
    simulation = varied()
    simulation.reset()
    simulation.advance(0.2, field=FIELD)
    for k in range(3):
        alone = Simulation(own_scene(k), num_elements=6, time_step=4e-5)
        alone.advance(0.2, field=FIELD)
        np.testing.assert_allclose(simulation.positions[k], alone.positions[0], atol=1e-10)
        np.testing.assert_allclose(simulation.energy()[k], alone.energy()[0], rtol=1e-8)


def test_statics_frequencies_and_bounds_know_the_parameters():
    simulation = varied()
    simulation.reset(field=FIELD)
    bounds = []
    for k in range(3):
        alone = Simulation(own_scene(k), num_elements=6)
        case, other = simulation.equilibrium(FIELD, rod=k), alone.equilibrium(FIELD)
        np.testing.assert_allclose(case.positions, other.positions, atol=1e-11)
        np.testing.assert_allclose(simulation.positions[k], other.positions, atol=1e-11)
        found = simulation.natural_frequencies(FIELD, rod=k)
        np.testing.assert_allclose(found, alone.natural_frequencies(FIELD), rtol=1e-5)
        bounds.append(alone.stable_time_step)
    assert 0.5 * min(bounds) < simulation.stable_time_step <= min(bounds)


def test_a_turned_and_scaled_field_acts_as_that_field():
    """By a quarter turn about z: x becomes y."""
    simulation, plain = (Simulation(SCENE, num_rods=2, num_elements=4) for _ in range(2))
    simulation.set_parameters(field_rotation=(0.0, 0.0, 0.5 * np.pi), field_gain=[1.0, 1.5])
    acting = np.array([[-3e-3, 1e-3, 6e-3], [-4.5e-3, 1.5e-3, 9e-3]])
    simulation.advance(0.05, field=FIELD)
    plain.advance(0.05, field=acting)
    np.testing.assert_allclose(simulation.positions, plain.positions, atol=1e-12)
    np.testing.assert_array_equal(simulation.field, np.tile(FIELD, (2, 1)))
    simulation.advance(0.05, field=lambda time: FIELD)
    plain.advance(0.05, field=lambda time: acting)
    np.testing.assert_allclose(simulation.positions, plain.positions, atol=1e-11)
    for k in range(2):
        np.testing.assert_allclose(
            simulation.equilibrium(FIELD, rod=k).positions, plain.equilibrium(acting[k]).positions, atol=1e-12
        )


def test_a_turned_gradient_acts_as_that_gradient():
    gradient = 0.05 * np.array([[1.0, 0.3, 0.0], [0.3, -0.6, 0.1], [0.0, 0.1, -0.4]])
    turn = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
    simulation, plain = (Simulation(SCENE, num_elements=4) for _ in range(2))
    simulation.set_parameters(field_rotation=(0.0, 0.0, 0.5 * np.pi), field_gain=1.5)
    simulation.advance(0.05, field=FIELD, gradient=gradient)
    plain.advance(0.05, field=1.5 * turn @ FIELD, gradient=1.5 * turn @ gradient @ turn.T)
    np.testing.assert_allclose(simulation.positions, plain.positions, atol=1e-12)


def test_a_step_that_was_left_to_the_simulation_follows_and_a_given_one_is_refused():
    free, given = Simulation(SCENE), Simulation(SCENE, time_step=Simulation(SCENE).stable_time_step)
    free.set_parameters(modulus=4.0)
    stiff = SCENE.replace(rod=dataclasses.replace(ROD, youngs_modulus=4.0 * ROD.youngs_modulus))
    np.testing.assert_allclose(free.time_step, Simulation(stiff).time_step, rtol=1e-6)
    position = given.tip_position
    with pytest.raises(ValueError, match="time_step must be at most"):
        given.set_parameters(modulus=4.0)
    given.advance(0.01)
    untouched = Simulation(SCENE, time_step=given.time_step)
    untouched.advance(0.01)
    np.testing.assert_array_equal(given.positions, untouched.positions)
    assert np.abs(given.tip_position - position).max() > 0.0


def test_parameters_of_some_rods_leave_the_others_and_all_motion():
    simulation = Simulation(SCENE, num_rods=3, num_elements=4)
    simulation.advance(0.05, field=FIELD)
    before = simulation.positions, simulation.velocities, simulation.angular_velocities
    simulation.set_parameters(density=[2.0, 0.5], drag=0.0, rods=[2, 0])
    for one, other in zip(
        (simulation.positions, simulation.velocities, simulation.angular_velocities), before, strict=True
    ):
        np.testing.assert_allclose(one, other, rtol=1e-14)
    masses = simulation.node_masses
    assert masses[2].sum() > masses[1].sum() > masses[0].sum()


def test_planar_rods_keep_to_their_plane():
    flat = SCENE.replace(magnets=(Magnet.dipole(position=0.06, moment=0.0134, mass=9.6e-5),))
    simulation, space = Simulation(flat, num_rods=2, plane="xz"), Simulation(flat, num_rods=2)
    for each in (simulation, space):
        each.set_parameters(
            modulus=[1.0, 1.2], gravity=[[1.0, 0.0, -9.0], [0.0, 0.0, -5.0]], field_rotation=[0.0, 0.3, 0.0]
        )
        each.advance(0.05, field=(1e-3, 0.0, 5e-3))
    np.testing.assert_allclose(simulation.positions, space.positions, atol=1e-9)
    with pytest.raises(ValueError, match="field_rotation must keep the field in the plane 'xz'"):
        simulation.set_parameters(field_rotation=(0.1, 0.0, 0.0))
    with pytest.raises(ValueError, match="gravity must lie in the plane 'xz'"):
        simulation.set_parameters(gravity=(0.0, 1.0, 0.0))


BAD = [
    ({"modulus": 0.0}, "modulus must be above 0"),
    ({"modulus": [1.0, np.nan]}, "modulus must be finite of shape"),
    ({"density": [1.0, 1.0, 1.0]}, "density must be finite of shape"),
    ({"moment": "x"}, "moment must be finite of shape"),
    ({"drag": -1.0}, "drag must be at least 0"),
    ({"magnet_shift": 0.04}, "magnet_shift must leave every magnet between clamp and tip"),
    ({"gravity": (0.0, 0.0)}, "gravity must be finite of shape"),
    ({"gravity": (0.0, 0.0, 1e12)}, "gravity must be at most"),
    ({"field_rotation": 1.0}, "field_rotation must be finite of shape"),
    ({"field_gain": 1e9}, "field_gain must be above 0 and at most"),
    ({"modulus": 1.0, "rods": [5]}, "rods must be different indices"),
]


@pytest.mark.parametrize(("given", "sentence"), BAD)
def test_bad_parameters_are_refused_and_change_nothing(given, sentence):
    simulation = Simulation(SCENE, num_rods=2)
    before = simulation.energies()
    with pytest.raises(ValueError, match=sentence):
        simulation.set_parameters(**given)
    for name, value in simulation.energies().items():
        np.testing.assert_array_equal(value, before[name])


@pytest.mark.parametrize("name", ["drag", "spin_drag", "internal_damping", "gravity"])
def test_what_the_scene_lacks_cannot_be_scaled(name):
    bare = Simulation(Scene(rod=ROD, magnets=MAGNETS))
    with pytest.raises(ValueError, match=f"{name} must be left out for a scene without"):
        bare.set_parameters(**{name: (0.0, 0.0, -9.81) if name == "gravity" else 1.0})
