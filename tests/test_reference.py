"""The stored reference solutions: complete, as the cases define them, and as exact as their README says."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from scripts.reference.spectral_rod import Mesh, product
from tests.reference.cases import DYNAMIC, EQUILIBRIA, OWN_TIMES, TIMES, TWIST_AND_TENSION

STORED = np.load(Path(__file__).parent / "reference" / "reference.npz")
ERRORS = {"fast_step": 5e-8, "aluminium": 2e-8, "tilted_swing": 1e-7}  # m; 5e-9 elsewhere


def test_reference_holds_every_case_and_no_other():
    keys = {f"{name}_{key}" for name in DYNAMIC for key in ("time", "tip", "tip_tangent", "energy")}
    keys |= {f"{name}_error_{kind}" for name in DYNAMIC for kind in ("space", "time")}
    keys |= {f"{name}_{key}" for name in EQUILIBRIA for key in ("field", "tip", "tip_tangent", "error_space")}
    assert set(STORED) == keys | {"two_magnet_free_decay_middle"}


@pytest.mark.parametrize("name", DYNAMIC)
def test_reference_motion_starts_straight_and_states_small_errors(name):
    case = DYNAMIC[name]
    np.testing.assert_array_equal(STORED[f"{name}_time"], OWN_TIMES.get(name, TIMES))
    assert STORED[f"{name}_tip"].shape == STORED[f"{name}_tip_tangent"].shape == (201, 3)
    np.testing.assert_allclose(STORED[f"{name}_tip"][0], (case.length, 0.0, 0.0), atol=1e-15)
    np.testing.assert_allclose(np.linalg.norm(STORED[f"{name}_tip_tangent"], axis=1), 1.0, atol=1e-8)
    assert max(STORED[f"{name}_error_{kind}"] for kind in ("space", "time")) < ERRORS.get(name, 5e-9)


@pytest.mark.parametrize("name", EQUILIBRIA)
def test_reference_equilibrium_states_a_small_error(name):
    np.testing.assert_array_equal(STORED[f"{name}_field"], EQUILIBRIA[name].field(0.0))
    np.testing.assert_allclose(np.linalg.norm(STORED[f"{name}_tip_tangent"]), 1.0, atol=1e-8)
    assert STORED[f"{name}_error_space"] < 1e-11  # m


@pytest.mark.parametrize("name", [name for name, case in DYNAMIC.items() if not case.drag])
def test_reference_motion_without_drag_keeps_its_energy(name):
    energy = STORED[f"{name}_energy"]
    assert np.abs(energy - energy[0]).max() < 1e-12


def test_reference_of_the_metal_rod_starts_with_the_motion_of_its_sections():
    """v(s) across the rod and the sections' spin about +y, which turns +x towards -z: spin = -dv/ds."""
    case = DYNAMIC["aluminium"]
    s = np.linspace(0.0, case.length, 401)
    velocity, spin = case.velocity(s), case.spin(s)
    assert velocity[-1, 2] == pytest.approx(2.3) and not velocity[:, :2].any() and not spin[:, [0, 2]].any()
    np.testing.assert_allclose(spin[1:-1, 1], -np.gradient(velocity[:, 2], s)[1:-1], atol=1e-3)


# ---- tension in closed form, and the loads of the solver


def test_reference_pulled_straight_stretches_by_its_force_over_its_stiffness():
    """L (1 + F/EA): the dipole stays along x, F = m dB_x/dx."""
    case = TWIST_AND_TENSION["static_pull_straight"]
    force = case.magnets[0].dipole[0] * case.gradient[0][0]
    exact = (case.length * (1 + force / case.c1[0]), 0.0, 0.0)
    np.testing.assert_allclose(STORED["static_pull_straight_tip"], exact, atol=1e-14)  # rounding


def test_reference_hanging_straight_stretches_by_its_weight():
    """rho g L^2 / (2 E)."""
    case = TWIST_AND_TENSION["static_hanging"]
    stretch = case.density * case.gravity[0] * case.length**2 / (2 * case.youngs_modulus)
    np.testing.assert_allclose(STORED["static_hanging_tip"], (case.length + stretch, 0.0, 0.0), atol=1e-14)


def random_state(mesh, random):
    """A bent and twisted state: positions (n, 3) m and unit quaternions (n, 4)."""
    p, q, _, _ = (part.copy() for part in mesh.split(mesh.straight))
    p += 0.05 * mesh.case.length * random.normal(size=p.shape)
    q += 0.2 * random.normal(size=q.shape)
    return p, q / np.linalg.norm(q, axis=1, keepdims=True)


@pytest.mark.parametrize("name", ["static_two_tilted_magnets", "static_pull_aside"])
def test_reference_loads_are_minus_the_gradient_of_its_energy(name):
    """In any field and field gradient: central differences, whose own error is 1e-9 of the largest load."""
    random = np.random.default_rng(1)
    case = replace(EQUILIBRIA[name], gradient=tuple(map(tuple, random.normal(size=(3, 3)))))
    mesh = Mesh(case, 3, [magnet.s for magnet in case.magnets if magnet.s < case.length])
    (p, q), field = random_state(mesh, random), random.normal(size=3)
    force, torque, _ = mesh.loads(p, q, field)
    found, nudge = np.empty((2, mesh.count, 3)), 1e-6
    for node, axis in np.ndindex(mesh.count, 3):
        moved, turned = [], []
        for sign in (1.0, -1.0):
            p_new, q_new, half = p.copy(), q.copy(), np.zeros(4)
            p_new[node, axis] += sign * nudge * case.length
            half[0], half[1 + axis] = np.cos(nudge / 2), sign * np.sin(nudge / 2)
            q_new[node] = product(q[node], half)
            moved.append(mesh.loads(p_new, q, field)[2])
            turned.append(mesh.loads(p, q_new, field)[2])
        found[:, node, axis] = (moved[1] - moved[0]) / (2 * nudge), (turned[1] - turned[0]) / (2 * nudge)
    np.testing.assert_allclose(force * case.length, found[0], atol=1e-8 * np.abs(found[0]).max())
    np.testing.assert_allclose(torque, found[1], atol=1e-8 * np.abs(found[1]).max())


def test_reference_feels_the_gradient_at_a_magnet_as_a_force_and_a_field():
    """Grad(m.B) of B = B0 + G p is G^T m, and B acts where the magnet is; to rounding beside the elastic forces."""
    case = TWIST_AND_TENSION["static_pull_slight"]
    with_gradient, without = Mesh(case, 3), Mesh(replace(case, gradient=((0.0, 0.0, 0.0),) * 3), 3)
    p, q = random_state(with_gradient, np.random.default_rng(2))
    gradient, field, dipole = np.array(case.gradient), np.array([1e-3, 2e-3, 3e-3]), np.array(case.magnets[0].dipole)
    force, torque, energy = with_gradient.loads(p, q, field)
    plain_force, plain_torque, plain_energy = without.loads(p, q, field + gradient @ p[-1])
    w, r = q[-1, 0], q[-1, 1:]
    world = dipole + 2 * np.cross(r, np.cross(r, dipole) + w * dipole)
    np.testing.assert_allclose((force - plain_force)[-1], gradient.T @ world, rtol=1e-10)
    np.testing.assert_allclose(torque, plain_torque, atol=1e-15)
    assert energy == pytest.approx(plain_energy, rel=1e-14)
