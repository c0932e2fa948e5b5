"""Rods, magnets and scenes: section properties, and one clear sentence for every kind of bad input."""

import dataclasses
import math
import pickle

import numpy as np
import pytest

from magrod_env.magnetics import MU_0
from magrod_env.scene import Magnet, Rod, Scene

ROUND = Rod.circular(length=0.06, diameter=4e-3, density=1100.0, youngs_modulus=1e6, poissons_ratio=0.5)
SQUARE = Rod.square(length=0.08, edge=2e-3, density=1000.0, youngs_modulus=3e6, poissons_ratio=0.35)
TIP = Magnet.cylinder(position=0.06, diameter=2e-3, length=4e-3, mass=1e-4, remanence=1.3)
MIDDLE = Magnet.dipole(position=0.03, moment=5e-3, direction=(0.0, -2.0, 0.0))


def integrate_section(rod, function, samples=1001):
    """Integrate a function of the transverse coordinates over the section by the midpoint rule."""
    edge = (np.arange(samples) + 0.5) / samples - 0.5
    y, z = np.meshgrid(edge * rod.width, edge * rod.width)
    inside = y**2 + z**2 <= (rod.width / 2) ** 2 if rod.shape == "circular" else np.ones_like(y)
    return np.sum(inside * function(y, z)) * (rod.width / samples) ** 2


@pytest.mark.parametrize("rod", [ROUND, SQUARE])
def test_section_properties_are_the_integrals_over_the_section(rod):
    assert rod.area == pytest.approx(integrate_section(rod, lambda y, z: np.ones_like(y)), rel=1e-4)
    assert rod.second_moment == pytest.approx(integrate_section(rod, lambda y, z: z**2), rel=1e-4)
    assert rod.polar_moment == pytest.approx(integrate_section(rod, lambda y, z: y**2 + z**2), rel=1e-4)


@pytest.mark.parametrize("rod", [ROUND, SQUARE])
def test_stiffnesses_and_inertias_follow_from_the_section(rod):
    shear = rod.youngs_modulus / (2 * (1 + rod.poissons_ratio))
    assert rod.axial_stiffness == rod.youngs_modulus * rod.area
    assert rod.shear_stiffness == pytest.approx(shear * rod.area)
    assert rod.bending_stiffness == rod.youngs_modulus * rod.second_moment
    assert rod.torsional_stiffness == pytest.approx(2 * shear * rod.second_moment)
    assert rod.mass_per_length == rod.density * rod.area
    assert rod.rotary_inertia_per_length == rod.density * rod.second_moment
    assert rod.mass == rod.mass_per_length * rod.length


def test_moment_of_a_cylinder_follows_from_remanence_and_volume():
    volume = math.pi * 1e-3**2 * 4e-3
    np.testing.assert_allclose(TIP.dipole_moment, [1.3 * volume / MU_0, 0.0, 0.0], rtol=1e-14)


def test_direction_of_a_magnet_is_scaled_to_length_one():
    assert MIDDLE.direction == (0.0, -1.0, 0.0)
    assert Magnet.dipole(position=1.0, moment=1.0, direction=(3e-200, 0, 4e-200)).direction == (0.6, 0.0, 0.8)
    np.testing.assert_allclose(MIDDLE.dipole_moment, [0.0, -5e-3, 0.0])


def test_scaling_a_unit_direction_changes_nothing():
    rng = np.random.default_rng(5)
    for direction in rng.normal(size=(200, 3)):
        magnet = Magnet.dipole(position=1.0, moment=1.0, direction=tuple(direction))
        assert dataclasses.replace(magnet) == magnet


def test_segment_ends_are_the_magnets_and_the_tip():
    assert Scene(rod=ROUND).segment_ends == (0.06,)
    assert Scene(rod=ROUND, magnets=(TIP, MIDDLE)).segment_ends == (0.03, 0.06)
    assert Scene(rod=ROUND, magnets=[MIDDLE]).segment_ends == (0.03, 0.06)


def test_order_of_the_magnets_is_kept():
    assert Scene(rod=ROUND, magnets=[TIP, MIDDLE]).magnets == (TIP, MIDDLE)


def test_a_magnet_at_the_tip_up_to_rounding_sits_at_the_tip():
    for position in (np.nextafter(0.06, 1.0), np.nextafter(0.06, 0.0)):
        scene = Scene(rod=ROUND, magnets=(dataclasses.replace(TIP, position=position),))
        assert scene.segment_ends == (0.06,)


def test_mass_of_a_scene_counts_the_magnets():
    assert Scene(rod=ROUND, magnets=(TIP, MIDDLE)).mass == pytest.approx(ROUND.mass + 1e-4)


def test_numpy_numbers_and_lists_become_plain_floats():
    rod = dataclasses.replace(ROUND, length=np.float32(0.5), width=np.array(2e-3), density=np.int64(1000))
    assert [type(value) for value in (rod.length, rod.width, rod.density)] == [float] * 3
    scene = Scene(rod=rod, gravity=np.array([0, 0, -9]), drag_rate=1)
    assert scene.gravity == (0.0, 0.0, -9.0)
    assert all(type(value) is float for value in (*scene.gravity, scene.drag_rate))


@pytest.mark.parametrize("thing", [ROUND, TIP, Scene(rod=ROUND, magnets=[TIP, MIDDLE], gravity=[0, 0, -9.81])])
def test_scenes_hash_pickle_and_stay_frozen(thing):
    assert pickle.loads(pickle.dumps(thing)) == thing
    assert hash(dataclasses.replace(thing)) == hash(thing)
    with pytest.raises(dataclasses.FrozenInstanceError):
        setattr(thing, dataclasses.fields(thing)[0].name, None)


def test_replace_checks_again_and_refuses_unknown_names():
    scene = Scene(rod=ROUND)
    assert scene.replace(drag_rate=2.0).drag_rate == 2.0
    with pytest.raises(ValueError, match="drag_rate"):
        scene.replace(drag_rate=-2.0)
    with pytest.raises(TypeError):
        scene.replace(drag=2.0)


@pytest.mark.parametrize("name", ["length", "width", "density", "youngs_modulus"])
@pytest.mark.parametrize("value", [0.0, -1.0, math.nan, math.inf, True, "2", None, [1.0], 1j, 10**400])
def test_a_rod_needs_finite_positive_numbers(name, value):
    with pytest.raises(ValueError, match=r"of the rod must be a finite number > 0, but got .*: give it in .*\.$"):
        dataclasses.replace(ROUND, **{name: value})


@pytest.mark.parametrize("name", ["length", "width", "density", "youngs_modulus"])
@pytest.mark.parametrize("value", [5e-324, 1e-100, 1e100, 1e300])
def test_a_rod_that_no_one_can_build_is_refused(name, value):
    with pytest.raises(ValueError, match=r"of the rod must be between .* and .*, but got .*: give it in .*\.$"):
        dataclasses.replace(ROUND, **{name: value})


@pytest.mark.parametrize("size", [1e-9, 1e4])
@pytest.mark.parametrize("density", [1e-12, 1e9])
@pytest.mark.parametrize("modulus", [1e-20, 1e18])
def test_what_follows_from_the_least_and_largest_rods_neither_overflows_nor_vanishes(size, density, modulus):
    rod = Rod.circular(
        length=size, diameter=size, density=density, youngs_modulus=modulus, poissons_ratio=math.nextafter(-1.0, 0.0)
    )
    numbers = [getattr(rod, name) for name in dir(Rod) if isinstance(getattr(Rod, name), property)]
    assert len(numbers) == 11
    for number in numbers:
        assert 1e-100 < number < 1e100  # far from 5e-324 and 1.8e308: so are products of two


@pytest.mark.parametrize("value", [-1.0, 0.51, math.nan, "0.3", False])
def test_poissons_ratio_has_bounds(value):
    words = r"Poisson's ratio of the rod must be a finite number > -1 and <= 0.5, but got"
    with pytest.raises(ValueError, match=words):
        dataclasses.replace(ROUND, poissons_ratio=value)


def test_messages_name_the_width_as_the_user_does():
    with pytest.raises(ValueError, match="diameter of the rod"):
        dataclasses.replace(ROUND, width=0.0)
    with pytest.raises(ValueError, match="edge of the rod"):
        dataclasses.replace(SQUARE, width=0.0)


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"position": 0.0}, "position of the magnet must be a finite number > 0, but got 0.0"),
        ({"moment": -1.0}, "moment of the magnet must be a finite number >= 0, but got -1.0"),
        ({"mass": -1e-9}, "mass of the magnet must be a finite number >= 0"),
        ({"direction": (0, 0, 0)}, "direction of the magnet must be a vector that is not zero"),
        ({"direction": (1, 0)}, "direction of the magnet must be three finite numbers"),
        ({"direction": "xyz"}, "direction of the magnet must be three finite numbers"),
        ({"diameter": 0.0}, "diameter of the magnet must be a finite number > 0"),
        ({"diameter": 1e-100}, "diameter of the magnet must be between 1e-09 and 10000, but got 1e-100"),
        ({"length": 1e300}, "length of the magnet must be between 1e-09 and 10000, but got 1e\\+300"),
        ({"moment": 1e300}, "moment of the magnet must be between 0 and 1e\\+09, but got 1e\\+300"),
        ({"mass": 1e300}, "mass of the magnet must be between 0 and 1e\\+09, but got 1e\\+300"),
        ({"length": math.nan}, "length of the magnet must be a finite number > 0"),
    ],
)
def test_bad_magnets_are_told_in_one_sentence(changes, words):
    with pytest.raises(ValueError, match=words):
        dataclasses.replace(TIP, **changes)


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"rod": None}, "rod of the scene must be a Rod, but got None"),
        ({"magnets": TIP}, "magnets of the scene must be a tuple or list of Magnet"),
        ({"magnets": (0.06,)}, "magnets of the scene must be a tuple or list of Magnet"),
        (
            {"magnets": (TIP, TIP)},
            "magnets of the scene must lie at different positions, but two lie at 0.06 m",
        ),
        (
            {"magnets": (dataclasses.replace(TIP, position=0.061),)},
            "position of a magnet must be at most the rod's length 0.06 m, but got 0.061 m",
        ),
        ({"gravity": 9.81}, "gravity of the scene must be three finite numbers, but got 9.81"),
        ({"gravity": (0, 0, math.inf)}, "gravity of the scene must be three finite numbers"),
        ({"gravity": (0, 0, -1e300)}, "an entry of the gravity of the scene must be between -1e\\+09 and 1e\\+09"),
        ({"drag_rate": 1e300}, "drag_rate of the scene must be between 0 and 1e\\+12"),
        ({"spin_drag_rate": 1e300}, "spin_drag_rate of the scene must be between 0 and 1e\\+12"),
        ({"internal_damping": 1e300}, "internal_damping of the scene must be between 0 and 1e\\+06"),
        ({"drag_rate": -1.0}, "drag_rate of the scene must be a finite number >= 0, but got -1.0"),
        (
            {"internal_damping": True},
            "internal_damping of the scene must be a finite number >= 0, but got True",
        ),
    ],
)
def test_bad_scenes_are_told_in_one_sentence(changes, words):
    with pytest.raises(ValueError, match=words):
        Scene(**{"rod": ROUND, **changes})


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"diameter": 1e-100}, "diameter of the magnet must be between"),
        ({"length": 1e-200}, "length of the magnet must be between"),
        ({"remanence": 1345.0}, "remanence of the magnet must be between 0 and 100, but got 1345.0: give it in tesla"),
        ({"remanence": 0.0}, "remanence of the magnet must be a finite number > 0"),
    ],
)
def test_a_cylinder_that_no_one_can_build_is_refused(changes, words):
    good = {"position": 0.06, "diameter": 2e-3, "length": 4e-3, "mass": 1e-4, "remanence": 1.3}
    with pytest.raises(ValueError, match=words):
        Magnet.cylinder(**{**good, **changes})


def test_an_unknown_shape_is_told_in_one_sentence():
    with pytest.raises(ValueError, match='shape of the rod must be "circular" or "square", but got \'round\''):
        dataclasses.replace(ROUND, shape="round")
