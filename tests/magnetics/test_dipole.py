"""Torque, force and energy of a point dipole agree with each other and with closed forms."""

import numpy as np
import pytest
import scipy.constants

from magrod_env.magnetics import (
    MU_0,
    CircularLoop,
    dipole_energy,
    dipole_force,
    dipole_moment,
    dipole_torque,
)

LOOP = CircularLoop(radius=0.05, center=(0.01, -0.02, 0.005), normal=(0.3, -0.5, 0.9), turns=200)


def test_permeability_is_the_codata_value():
    assert scipy.constants.mu_0 == pytest.approx(MU_0, rel=1e-9)  # editions of CODATA differ by less


def test_moment_of_the_papers_tip_magnet():
    volume = 4.0 * np.pi * 1e-9  # diameter 2 mm, height 4 mm (section 4.3)
    assert dipole_moment(1.345, volume) == pytest.approx(1.345e-2, rel=1e-6)  # 4 pi mm^3 / mu0 cancels pi


def test_torque_turns_the_moment_towards_the_field():
    np.testing.assert_allclose(dipole_torque([1.0, 0.0, 0.0], [0.0, 2.0, 0.0]), [0.0, 0.0, 2.0])


def test_torque_is_minus_the_derivative_of_the_energy():
    rng = np.random.default_rng(0)
    moment, field, axis = rng.normal(size=(3, 3))
    step = 1e-6
    change = step * np.cross(axis, moment)
    slope = (dipole_energy(moment + change, field) - dipole_energy(moment - change, field)) / (2 * step)
    np.testing.assert_allclose(dipole_torque(moment, field) @ axis, -slope, rtol=1e-9)


def test_force_is_minus_the_gradient_of_the_energy():
    rng = np.random.default_rng(1)
    moment = rng.normal(size=(20, 3))
    places = rng.normal(size=(20, 3)) * 0.05
    step = 1e-6
    slopes = [
        (
            dipole_energy(moment, LOOP.field(places + shift, 2.0))
            - dipole_energy(moment, LOOP.field(places - shift, 2.0))
        )
        / (2 * step)
        for shift in step * np.eye(3)
    ]
    force = dipole_force(moment, LOOP.gradient(places, 2.0))
    # central differences over 1e-6 m in a field that varies over 1e-2 m err by about 1e-8
    np.testing.assert_allclose(force, -np.stack(slopes, axis=-1), rtol=1e-6, atol=1e-6 * np.abs(force).max())


def test_leading_shapes_broadcast():
    moment, field = np.ones((4, 1, 3)), np.ones((5, 3))
    assert dipole_torque(moment, field).shape == (4, 5, 3)
    assert dipole_energy(moment, field).shape == (4, 5)
    assert dipole_force(moment, np.ones((5, 3, 3))).shape == (4, 5, 3)


@pytest.mark.parametrize(
    ("call", "words"),
    [
        (lambda: dipole_moment(-1.0, 1e-9), "remanence must be a finite number > 0, but got -1.0"),
        (lambda: dipole_moment(1.3, 0.0), "volume must be a finite number > 0, but got 0.0"),
        (lambda: dipole_torque([1.0, 2.0], [0.0, 0.0, 1.0]), r"moment must have shape \(..., 3\)"),
        (lambda: dipole_energy([1.0, 2.0, 3.0], 1.0), r"field must have shape \(..., 3\)"),
        (lambda: dipole_force([1.0, 2.0, 3.0], [1.0, 2.0, 3.0]), r"gradient must have shape \(..., 3, 3\)"),
    ],
)
def test_bad_input_is_told_in_one_sentence(call, words):
    with pytest.raises(ValueError, match=words):
        call()
