"""The field of a current loop and its gradient, against magpylib, closed forms and finite differences."""

import magpylib
import numpy as np
import pytest
import scipy.special
from scipy.spatial.transform import Rotation

from magrod_env.magnetics import MU_0, CircularLoop
from magrod_env.magnetics.elliptic import complete_integrals

CURRENT = 3.0
LOOPS = [
    CircularLoop(radius=0.05, center=(0.0, 0.0, 0.0), normal=(0.0, 0.0, 1.0)),
    CircularLoop(radius=0.2, center=(0.1, -0.3, 0.2), normal=(1.0, 0.0, 0.0), turns=120),
    CircularLoop(radius=1e-3, center=(1e-3, 2e-3, -1e-3), normal=(0.3, -0.7, 0.2), turns=7),
    CircularLoop(radius=3.0, center=(5.0, 0.0, -1.0), normal=(-2.0, -1.0, -9.0)),
]


def world(loop, local):
    """Turn points given in units of the radius, the loop's normal along z, into world points (m)."""
    turn, _ = Rotation.align_vectors([loop.normal], [[0.0, 0.0, 1.0]])
    return np.array(loop.center) + loop.radius * turn.apply(local)


def sample_points():
    """Points near the centre, around the loop, far away, near the axis and near the wire, in radii."""
    rng = np.random.default_rng(2)
    spread = rng.normal(size=(300, 3)) * np.array([0.1, 1.0, 10.0])[rng.integers(3, size=300)][:, None]
    near_axis = np.column_stack([np.geomspace(1e-15, 1e-2, 30), np.zeros(30), np.linspace(-2.0, 2.0, 30)])
    angle = rng.uniform(0.0, 2.0 * np.pi, size=(2, 60))
    gap = np.geomspace(1e-6, 1e-2, 60)
    rho = 1.0 + gap * np.cos(angle[0])
    near_wire = np.column_stack([rho * np.cos(angle[1]), rho * np.sin(angle[1]), gap * np.sin(angle[0])])
    return np.concatenate([spread, near_axis, near_wire])


def magpylib_field(loop, points):
    turn, _ = Rotation.align_vectors([loop.normal], [[0.0, 0.0, 1.0]])
    source = magpylib.current.Circle(
        current=CURRENT * loop.turns, diameter=2.0 * loop.radius, position=loop.center, orientation=turn
    )
    return source.getB(points)


def largest_relative(difference, reference, axes):
    return np.max(np.linalg.norm(difference, axis=axes) / np.linalg.norm(reference, axis=axes))


@pytest.mark.parametrize("loop", LOOPS)
def test_field_agrees_with_magpylib(loop):
    points = world(loop, sample_points())
    expected = magpylib_field(loop, points)
    # 1e-6 radii from the wire, rounding of the point is worth up to about 1e-9 of the field
    assert largest_relative(loop.field(points, CURRENT) - expected, expected, -1) < 1e-8


@pytest.mark.parametrize("loop", LOOPS)
def test_field_agrees_with_magpylib_to_rounding_away_from_the_wire(loop):
    local = sample_points()
    away = np.hypot(np.hypot(local[:, 0], local[:, 1]) - 1.0, local[:, 2]) > 0.05
    points = world(loop, local[away])
    expected = magpylib_field(loop, points)
    assert largest_relative(loop.field(points, CURRENT) - expected, expected, -1) < 1e-12


@pytest.mark.parametrize("loop", LOOPS)
def test_gradient_agrees_with_finite_differences(loop):
    local = sample_points()
    distance = np.hypot(np.hypot(local[:, 0], local[:, 1]) - 1.0, local[:, 2])
    points = world(loop, local[distance > 0.01])
    step = 2e-4 * loop.radius * np.minimum(distance[distance > 0.01], 1.0)[:, None]
    columns = []
    for axis in np.eye(3):  # fourth-order differences: truncation about 1e-13, rounding about 1e-11 of the gradient
        far, near = (
            loop.field(points + k * step * axis, CURRENT) - loop.field(points - k * step * axis, CURRENT)
            for k in (2.0, 1.0)
        )
        columns.append((8.0 * near - far) / (12.0 * step))
    expected = np.stack(columns, axis=-1)
    assert largest_relative(loop.gradient(points, CURRENT) - expected, expected, (-2, -1)) < 1e-7


@pytest.mark.parametrize("loop", LOOPS)
def test_gradient_is_symmetric_and_has_trace_zero(loop):
    gradient = loop.gradient(world(loop, sample_points()), CURRENT)
    size = np.linalg.norm(gradient, axis=(-2, -1))
    transposed = np.swapaxes(gradient, -2, -1)
    assert np.max(np.linalg.norm(gradient - transposed, axis=(-2, -1)) / size) < 1e-14
    assert np.max(np.abs(np.trace(gradient, axis1=-2, axis2=-1)) / size) < 1e-14


def test_field_and_gradient_on_the_axis_are_the_closed_forms():
    radius, z = 0.05, np.linspace(-0.2, 0.2, 41)
    loop = CircularLoop(radius=radius, center=(0.0, 0.0, 0.0), normal=(0.0, 0.0, 1.0), turns=10)
    points = np.column_stack([np.zeros_like(z), np.zeros_like(z), z])
    square = radius**2 + z**2
    axial = 0.5 * MU_0 * 10 * CURRENT * radius**2 / square**1.5
    slope = -3.0 * z * axial / square
    field, gradient = loop.field(points, CURRENT), loop.gradient(points, CURRENT)
    np.testing.assert_allclose(field[:, 2], axial, rtol=1e-14)
    np.testing.assert_array_equal(field[:, :2], 0.0)
    expected = slope[:, None, None] * np.diag([-0.5, -0.5, 1.0])
    np.testing.assert_allclose(gradient, expected, rtol=1e-14, atol=1e-15 * np.abs(slope).max())


@pytest.mark.parametrize("rho", [1e-300, 1e-18, 1e-12, 1e-9, 1e-6])
def test_no_digits_are_lost_next_to_the_axis(rho):
    loop = CircularLoop(radius=1.0, center=(0.0, 0.0, 0.0), normal=(0.0, 0.0, 1.0))
    on_axis, beside = (loop.gradient([x, 0.0, 0.3], CURRENT) for x in (0.0, rho))
    # the gradient changes by a share of about rho; B_x itself is rho dB_x/dx up to a share of rho^2
    np.testing.assert_allclose(beside, on_axis, atol=(10 * rho + 1e-15) * np.abs(on_axis).max())
    np.testing.assert_allclose(loop.field([rho, 0.0, 0.3], CURRENT)[0], rho * on_axis[0, 0], rtol=1e-11)


def test_elliptic_integrals_agree_with_scipy():
    kc = np.concatenate([np.geomspace(1e-9, 1.0, 200), 1.0 - np.geomspace(1e-16, 0.5, 200)])
    first_kind, second_kind, sigma = complete_integrals(kc)
    np.testing.assert_allclose(first_kind, scipy.special.ellipkm1(kc**2), rtol=1e-14)
    np.testing.assert_allclose(second_kind, scipy.special.ellipe((1.0 - kc) * (1.0 + kc)), rtol=1e-13)
    assert sigma[kc == 1.0] == pytest.approx(1.0 / 16.0)  # the limit on the axis


def test_current_broadcasts_against_points():
    loop, points = LOOPS[0], np.full((4, 1, 3), 0.01)
    currents = np.array([1.0, -2.0])
    assert loop.field(points, currents).shape == (4, 2, 3)
    assert loop.gradient(points, currents).shape == (4, 2, 3, 3)
    np.testing.assert_allclose(loop.field(points, currents)[:, 1], -2.0 * loop.field(points[:, 0], 1.0))


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"radius": 0.0}, "radius of the loop must be a finite number > 0, but got 0.0"),
        ({"normal": (0.0, 0.0, 0.0)}, "normal of the loop must be a vector that is not zero"),
        ({"center": (0.0, np.nan, 0.0)}, "center of the loop must be three finite numbers"),
        ({"turns": 2.5}, "turns of the loop must be a whole number of 1 or more, but got 2.5"),
        ({"turns": True}, "turns of the loop must be a whole number"),
    ],
)
def test_bad_loops_are_told_in_one_sentence(changes, words):
    with pytest.raises(ValueError, match=words):
        CircularLoop(**{"radius": 1.0, "center": (0.0, 0.0, 0.0), "normal": (0.0, 0.0, 1.0), **changes})


@pytest.mark.parametrize("method", ["field", "gradient"])
def test_a_point_on_the_wire_is_refused(method):
    with pytest.raises(ValueError, match="points must lie off the wire"):
        getattr(LOOPS[0], method)([[0.0, 0.0, 0.0], [0.0, 0.05, 0.0]], CURRENT)


def test_points_without_three_coordinates_are_refused():
    with pytest.raises(ValueError, match=r"points must have shape \(..., 3\), but got shape \(2,\)"):
        LOOPS[0].field([0.0, 1.0], CURRENT)
