"""The free rotation of a section: the variational integrator's equation, its invariants and its order."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.spatial.transform import Rotation

from magrod_env.rod.planar import planar_free_rotation
from magrod_env.rod.rotation import SWEEPS, free_rotation
from magrod_env.rod.so3 import matrix

INERTIA = np.array([2.0, 1.0, 1.0]) * 3e-12  # kg m^2: a round section, axial and transverse
COMPLIANCE = (0.5 / INERTIA[0], 0.5 / INERTIA[1])
MATRIX_INERTIA = np.diag(INERTIA.sum() / 2 - INERTIA)  # Jd of the paper: J = tr(Jd) - Jd
IDENTITY = (1.0, 0.0, 0.0, 0.0)
TIME_STEP = 2e-4
DIRECTIONS = np.vstack([np.eye(3), np.random.default_rng(3).normal(size=(12, 3))])
DIRECTIONS /= np.linalg.norm(DIRECTIONS, axis=1)[:, None]


def momentum_of(angle, direction):
    """Angular momentum at which the section turns by about ``angle`` (rad) in one time step."""
    return INERTIA * angle / TIME_STEP * direction


def residual(angle):
    """Largest error of dt Pi = (F Jd - Jd F^T)^vee over the directions, as a share of |dt Pi|."""
    worst = 0.0
    for direction in DIRECTIONS:
        momentum = momentum_of(angle, direction)
        q, _ = free_rotation(IDENTITY, tuple(momentum), TIME_STEP, COMPLIANCE)
        F = np.array(matrix(q, 2.0))
        skew = F @ MATRIX_INERTIA - MATRIX_INERTIA @ F.T
        error = np.array([skew[2, 1], skew[0, 2], skew[1, 0]]) - TIME_STEP * momentum
        worst = max(worst, np.linalg.norm(error) / np.linalg.norm(TIME_STEP * momentum))
    return worst


@pytest.mark.parametrize("angle", [1e-6, 1e-4, 1e-3, 3e-3, 1e-2, 0.03, 0.1, 0.3])
def test_three_sweeps_solve_the_implicit_equation(angle):
    """Each sweep gains a factor of about ``angle``; a section of a steered rod turns by 1e-4 to 1e-2 rad in a step."""
    assert SWEEPS == 3
    assert residual(angle) < 0.1 * angle**4 + 1e-15


@pytest.mark.parametrize("angle", [1e-12, 1e-3, 0.3, 1.5])
def test_spatial_angular_momentum_and_the_unit_quaternion_are_kept(angle):
    """Whatever the sweeps leave: F is a rotation, and O F F^T Pi = O Pi."""
    for direction in DIRECTIONS:
        start = tuple(np.roll(Rotation.random(random_state=4).as_quat(), 1))
        momentum = momentum_of(angle, direction)
        q, turned = free_rotation(start, tuple(momentum), TIME_STEP, COMPLIANCE)
        before, after = np.array(matrix(start, 2.0)) @ momentum, np.array(matrix(q, 2.0)) @ np.array(turned)
        np.testing.assert_allclose(after, before, atol=1e-15 * np.linalg.norm(momentum))
        np.testing.assert_allclose(np.linalg.norm(q), 1.0, atol=3e-16)


def test_invariants_do_not_drift_over_many_steps():
    q, momentum = IDENTITY, tuple(momentum_of(0.01, DIRECTIONS[4]))
    before, energy = np.array(momentum), np.sum(np.array(momentum) ** 2 / INERTIA)
    for _ in range(20_000):
        q, momentum = free_rotation(q, momentum, TIME_STEP, COMPLIANCE)
    np.testing.assert_allclose(
        np.array(matrix(q, 2.0)) @ np.array(momentum), before, atol=2e-13 * np.linalg.norm(before)
    )
    np.testing.assert_allclose(np.linalg.norm(q), 1.0, atol=3e-16)
    # the axial momentum, and with it the energy, moves only by what three sweeps leave: 1e-9 a step
    np.testing.assert_allclose(np.sum(np.array(momentum) ** 2 / INERTIA), energy, rtol=2e-8)


def test_no_momentum_no_motion():
    assert free_rotation(IDENTITY, (0.0, 0.0, 0.0), TIME_STEP, COMPLIANCE) == (IDENTITY, (0.0, 0.0, 0.0))


def euler(duration, momentum):
    """Rotation matrix of a free rigid body after ``duration`` by Euler's equations."""

    def rates(t, y):
        omega = y[9:] / INERTIA
        hat = np.array([[0, -omega[2], omega[1]], [omega[2], 0, -omega[0]], [-omega[1], omega[0], 0]])
        return np.concatenate([(y[:9].reshape(3, 3) @ hat).ravel(), np.cross(y[9:], omega)])

    start = np.concatenate([np.eye(3).ravel(), momentum])
    scale = np.concatenate([np.ones(9), np.full(3, np.linalg.norm(momentum))])
    solved = solve_ivp(rates, (0, duration), start, method="DOP853", rtol=1e-12, atol=1e-13 * scale)
    return solved.y[:9, -1].reshape(3, 3)


def test_second_order_against_eulers_equations():
    duration, momentum = 0.01, INERTIA * np.array([60.0, -45.0, 80.0])
    exact, errors = euler(duration, momentum), []
    for steps in (10, 20, 40, 80):
        q, m = IDENTITY, tuple(momentum)
        for _ in range(steps):
            q, m = free_rotation(q, m, duration / steps, COMPLIANCE)
        errors.append(np.abs(np.array(matrix(q, 2.0)) - exact).max())
    np.testing.assert_allclose(np.log2(np.array(errors[:-1]) / errors[1:]), 2.0, atol=0.05)


@pytest.mark.parametrize("angle", [1e-9, 1e-3, 0.1])
def test_rotation_about_one_axis_is_that_of_the_plane(angle):
    """And turns by asin(dt Pi / J): then dt Pi = J sin(angle) solves the implicit equation in a plane.

    f = p (1 + f^2) with p = angle/2: the plane's series p (1 + p^2 + 2 p^4 + 5 p^6) leaves out 14 p^9, sweeps 8 p^9.
    """
    momentum = momentum_of(angle, DIRECTIONS[2])
    q, _ = free_rotation(IDENTITY, tuple(momentum), TIME_STEP, COMPLIANCE)
    w, z = planar_free_rotation((1.0, 0.0), momentum[2], TIME_STEP, COMPLIANCE[1])
    p = 0.5 * angle
    exact = 2.0 * p / (1.0 + np.sqrt(1.0 - 4.0 * p * p))
    np.testing.assert_allclose((q[0], q[3]), (w, z), rtol=7.0 * p**8 + 1e-15)
    np.testing.assert_allclose(z / w, exact, rtol=15.0 * p**8 + 1e-15)
    assert q[1:3] == (0.0, 0.0)
    np.testing.assert_allclose(2 * np.arctan2(z, w), np.arcsin(angle), rtol=0.1 * angle**4 + 1e-15)
