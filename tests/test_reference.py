"""The stored reference solutions: complete, as the cases define them, and as exact as their README says."""

from pathlib import Path

import numpy as np
import pytest

from tests.reference.cases import DYNAMIC, OWN_TIMES, STATIC, TIMES

STORED = np.load(Path(__file__).parent / "reference" / "reference.npz")
ERRORS = {"fast_step": 5e-8, "aluminium": 2e-8}  # m; 5e-9 elsewhere


def test_reference_holds_every_case_and_no_other():
    keys = {f"{name}_{key}" for name in DYNAMIC for key in ("time", "tip", "tip_tangent", "energy")}
    keys |= {f"{name}_error_{kind}" for name in DYNAMIC for kind in ("space", "time")}
    keys |= {f"{name}_{key}" for name in STATIC for key in ("field", "tip", "tip_tangent", "error_space")}
    assert set(STORED) == keys | {"two_magnet_free_decay_middle"}


@pytest.mark.parametrize("name", DYNAMIC)
def test_reference_motion_starts_straight_and_states_small_errors(name):
    case = DYNAMIC[name]
    np.testing.assert_array_equal(STORED[f"{name}_time"], OWN_TIMES.get(name, TIMES))
    assert STORED[f"{name}_tip"].shape == STORED[f"{name}_tip_tangent"].shape == (201, 3)
    np.testing.assert_allclose(STORED[f"{name}_tip"][0], (case.length, 0.0, 0.0), atol=1e-15)
    np.testing.assert_allclose(np.linalg.norm(STORED[f"{name}_tip_tangent"], axis=1), 1.0, atol=1e-8)
    assert max(STORED[f"{name}_error_{kind}"] for kind in ("space", "time")) < ERRORS.get(name, 5e-9)


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
