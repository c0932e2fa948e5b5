"""Members: parameters lane by lane against separate simulations, and starting shapes against their equilibria."""

import dataclasses

import numpy as np
import pytest

from estimation.twins import SCENE, stiffer, turned
from magrod_env import Simulation
from magrod_env.estimation.members import Members
from magrod_env.estimation.unknowns import Unknown, Unknowns

EVERYTHING = {"modulus": 0.2, "drag": 0.5, "moment": 0.1, "misalignment": 0.05, "acceleration": 0.5}
VALUES = np.array([0.3, -0.5, 0.2, 0.02, -0.03, 0.04, 0.2, -0.4, 0.5])
FIELD = np.array([2e-3, 5e-3, 9e-3])


def members(count=3, **settings):
    return Members(SCENE, EVERYTHING, 1, count, 4, {"num_elements": 4, "num_threads": 1, **settings})


def as_told(scene, values):
    """The scene of a member with these parameters, built from scene objects."""
    magnet = scene.magnets[0]
    magnet = dataclasses.replace(magnet, moment=magnet.moment * np.exp(values[2]))
    gravity = tuple(np.array(scene.gravity) + values[6:9])
    return stiffer(scene, np.exp(values[0])).replace(
        magnets=(magnet,), drag_rate=scene.drag_rate * np.exp(values[1]), gravity=gravity
    )


def test_a_member_moves_as_a_simulation_of_its_own_scene():
    guesses = members()
    guesses.parameters = np.stack([0.0 * VALUES, VALUES, -VALUES])[None]
    guesses.advance(FIELD[None], 0.2)
    for lane, sign in enumerate((0.0, 1.0, -1.0)):
        alone = Simulation(
            as_told(SCENE, sign * VALUES), num_elements=4, time_step=guesses.simulation.time_step, num_threads=1
        )
        alone.advance(0.2, turned(FIELD, sign * VALUES[3:6]))
        np.testing.assert_allclose(guesses.simulation.positions[lane], alone.positions[0], atol=1e-11)
        np.testing.assert_allclose(guesses.simulation.velocities[lane], alone.velocities[0], atol=1e-9)


def test_a_member_starts_in_the_equilibrium_of_its_own_scene():
    guesses = members()
    strains = guesses.at_rest(FIELD[None], np.stack([0.0 * VALUES, VALUES, -VALUES])[None])
    guesses.lay(strains, np.array([True]))
    for lane, sign in enumerate((0.0, 1.0, -1.0)):
        alone = Simulation(as_told(SCENE, sign * VALUES), num_elements=4, num_threads=1)
        case = alone.equilibrium(turned(FIELD, sign * VALUES[3:6]))
        np.testing.assert_allclose(guesses.simulation.positions[lane], case.positions, atol=1e-10)


def test_the_step_suits_the_stiffest_member():
    guesses = members()
    before = guesses.simulation.time_step
    bound = guesses.simulation.stable_time_step
    guesses.parameters = guesses.parameters + np.log(16.0) * np.eye(9)[0]
    assert guesses.simulation.time_step < before
    stiff = Simulation(stiffer(SCENE, 16.0), num_elements=4)
    assert guesses.simulation.time_step <= stiff.stable_time_step < bound


def test_a_state_that_is_split_and_joined_is_as_it_was():
    guesses = members()
    guesses.advance(FIELD[None], 0.1)
    before = guesses.simulation.positions, guesses.simulation.velocities, guesses.simulation.rotations
    guesses.join(*guesses.split())
    after = guesses.simulation.positions, guesses.simulation.velocities, guesses.simulation.rotations
    for found, expected in zip(after, before):
        np.testing.assert_allclose(found, expected, atol=1e-12)


@pytest.mark.parametrize("plane", [None, "xz", "xy"])
def test_a_bend_moves_the_tip_by_what_is_asked(plane):
    scene = SCENE.replace(gravity=None)
    guesses = Members(scene, {}, 1, 2, 2, {"num_elements": 6, "plane": plane})
    axes = {None: (1, 2), "xz": (2,), "xy": (1,)}[plane]
    for bend, axis in zip(guesses.bends(), axes):
        strains = guesses.at_rest(None, np.zeros((1, 2, 0))) + 1e-5 * bend
        guesses.lay(strains, np.array([True]))
        assert guesses.simulation.tip_position[0, axis] == pytest.approx(1e-5, rel=0.02)


def test_an_unknown_forgets_and_never_exceeds_its_deviation():
    unknowns = Unknowns(SCENE, {"modulus": Unknown(deviation=0.3, memory=2.0), "moment": 0.1}, None)
    variance = np.zeros(2)
    for _ in range(100):
        variance = unknowns.kept(0.1) ** 2 * variance + unknowns.noise(0.1) ** 2
    np.testing.assert_allclose(variance, [0.09 * (1.0 - np.exp(-10.0)), 0.0], rtol=1e-12)
    assert unknowns.pieces(0.02) == 1 and unknowns.pieces(3.0) == 3


def test_a_factor_does_not_run_away_and_a_load_may():
    guesses = members(1)
    far = np.full((1, 1, 9), 100.0)
    guesses.parameters = far
    np.testing.assert_allclose(guesses.parameters[0, 0], [1.0, 2.5, 0.5, *6 * [100.0]])
    assert np.all(far == 100.0)  # the caller's are left alone
    guesses.parameters = -far
    np.testing.assert_allclose(guesses.parameters[0, 0, :3], [-1.0, -2.5, -0.5])
    assert np.isfinite(guesses.simulation.rods.batch.rows).all()


@pytest.mark.parametrize(
    ("parameters", "scene", "message"),
    [
        ({"mass": 0.1}, SCENE, "parameters must be among 'modulus'"),
        ({"drag": 0.1}, SCENE.replace(drag_rate=None), "but got 'drag' on a scene without drag_rate"),
        ({"moment": 0.1}, SCENE.replace(magnets=()), "but got 'moment' on a scene without magnets"),
        ({"modulus": -0.1}, SCENE, "deviation must be a finite number >= 0"),
        ({"modulus": np.nan}, SCENE, "deviation must be a finite number"),
    ],
)
def test_bad_parameters_are_refused(parameters, scene, message):
    with pytest.raises(ValueError, match=message):
        Unknowns(scene, parameters, None)


def test_a_memory_is_above_zero():
    with pytest.raises(ValueError, match="memory must be a finite number > 0"):
        Unknown(deviation=0.1, memory=0.0)
