"""Helmholtz pairs, systems of pairs, ideal uniform coils and the actuator's numbers."""

import dataclasses
import pickle

import numpy as np
import pytest

from magrod_env.magnetics import MU_0, Actuator, CoilSystem, HelmholtzPair, UniformCoils

PAIR = HelmholtzPair(radius=0.1, turns=300, axis=(1.0, 2.0, -1.0), center=(0.01, 0.02, 0.03))
NESTED = CoilSystem(
    (
        HelmholtzPair(radius=0.12, turns=400, axis=(0.0, 1.0, 0.0)),
        HelmholtzPair(radius=0.08, turns=300, axis=(0.0, 0.0, 1.0)),
    )
)


def along_axis(pair, distance):
    return np.array(pair.center) + np.asarray(distance)[..., None] * np.array(pair.axis)


def test_helmholtz_field_at_the_centre_is_the_closed_form():
    expected = 0.8**1.5 * MU_0 * 300 / 0.1
    assert PAIR.field_per_ampere == pytest.approx(expected, rel=1e-14)
    np.testing.assert_allclose(PAIR.field(PAIR.center, 2.0), 2.0 * expected * np.array(PAIR.axis), rtol=1e-13)


@pytest.mark.parametrize("separation", [0.05, 0.1, 0.3])
def test_field_per_ampere_holds_at_any_separation(separation):
    pair = dataclasses.replace(PAIR, separation=separation)
    np.testing.assert_allclose(pair.field(pair.center, 1.0), pair.field_per_ampere * np.array(pair.axis), rtol=1e-13)


def test_gradient_and_second_derivative_vanish_at_the_centre_of_a_helmholtz_pair():
    step = 1e-3 * PAIR.radius
    scale = PAIR.field_per_ampere / PAIR.radius
    before, at, after = PAIR.gradient(along_axis(PAIR, [-step, 0.0, step]), 1.0)
    assert np.abs(at).max() < 1e-13 * scale
    # the first derivative that is left is the fourth: the slope of the gradient is of the order of step^2
    assert np.abs(after - before).max() / (2 * step) < 1e-4 * scale / PAIR.radius
    wide = dataclasses.replace(PAIR, separation=1.2 * PAIR.radius)
    before, _, after = wide.gradient(along_axis(wide, [-step, 0.0, step]), 1.0)
    assert np.abs(after - before).max() / (2 * step) > 0.1 * scale / PAIR.radius


def test_field_of_a_helmholtz_pair_is_uniform_to_fourth_order():
    distance = PAIR.radius * np.array([0.02, 0.04])
    drop = 1.0 - PAIR.field(along_axis(PAIR, distance), 1.0) @ np.array(PAIR.axis) / PAIR.field_per_ampere
    np.testing.assert_allclose(drop / (distance / PAIR.radius) ** 4, 144.0 / 125.0, rtol=0.01)


def test_pair_is_the_sum_of_its_loops_and_of_its_reverse():
    points = np.random.default_rng(3).normal(size=(50, 3)) * 0.2
    low, high = PAIR.loops
    np.testing.assert_allclose(PAIR.field(points, 1.5), low.field(points, 1.5) + high.field(points, 1.5))
    reverse = dataclasses.replace(PAIR, axis=tuple(-np.array(PAIR.axis)))
    np.testing.assert_allclose(reverse.field(points, -1.5), PAIR.field(points, 1.5), rtol=1e-10, atol=1e-18)


def test_replace_keeps_the_helmholtz_spacing():
    low, high = dataclasses.replace(PAIR, radius=0.3).loops
    assert np.linalg.norm(np.subtract(high.center, low.center)) == pytest.approx(0.3)


def test_currents_make_the_wanted_field_at_the_centre():
    wanted = np.array([[0.0, 10e-3, -5e-3], [0.0, 0.0, 0.0]])
    currents = NESTED.currents_for(wanted)
    assert currents.shape == (2, 2)
    np.testing.assert_allclose(NESTED.field(NESTED.center, currents), wanted, atol=1e-16)


def test_system_adds_the_fields_and_gradients_of_its_pairs():
    points = np.random.default_rng(4).normal(size=(6, 1, 3)) * 0.02
    currents = np.array([[1.0, -2.0], [0.5, 3.0]])
    field, gradient = NESTED.field(points, currents), NESTED.gradient(points, currents)
    first, second = NESTED.pairs
    assert field.shape == (6, 2, 3)
    assert gradient.shape == (6, 2, 3, 3)
    np.testing.assert_allclose(
        field[:, 1], first.field(points[:, 0], 0.5) + second.field(points[:, 0], 3.0), rtol=1e-13
    )
    np.testing.assert_allclose(
        gradient[:, 0], first.gradient(points[:, 0], 1.0) + second.gradient(points[:, 0], -2.0), rtol=1e-13
    )


def test_a_field_without_a_coil_axis_is_refused():
    with pytest.raises(ValueError, match="field_at_center must be finite and within reach"):
        NESTED.currents_for([1e-3, 0.0, 0.0])


def test_uniform_coils_map_fractions_to_world_axes_and_back():
    coils = UniformCoils(limit=(0.02, 0.04), axes="zx")
    fraction = np.array([[0.5, -1.0], [0.0, 0.25]])
    field = coils.field(fraction)
    np.testing.assert_allclose(field, [[-0.04, 0.0, 0.01], [0.01, 0.0, 0.0]])
    np.testing.assert_allclose(coils.fraction(field), fraction)


def test_default_coils_are_those_of_the_paper():
    coils = UniformCoils()
    assert (coils.num_axes, coils.limit) == (2, (45e-3, 45e-3))
    np.testing.assert_allclose(coils.field([1.0, -1.0]), [0.0, 45e-3, -45e-3])


def test_uniform_coils_saturate_beyond_one():
    coils = UniformCoils()
    fraction = np.array([[1.0, -1.0], [1.5, 0.0], [0.0, -1.0001]])
    np.testing.assert_array_equal(coils.saturates(fraction), [False, True, True])
    np.testing.assert_allclose(coils.field(fraction), coils.field(np.clip(fraction, -1.0, 1.0)))


@pytest.mark.parametrize(
    ("call", "words"),
    [
        (lambda: UniformCoils(axes="xx"), 'axes of the coils must be distinct letters out of "xyz"'),
        (lambda: UniformCoils(axes=""), "axes of the coils must be distinct letters"),
        (lambda: UniformCoils(axes="yw"), "axes of the coils must be distinct letters"),
        (lambda: UniformCoils(limit=-1.0), "limit of the coils must be a finite number > 0, but got -1.0"),
        (
            lambda: UniformCoils(limit=(1.0, 2.0, 3.0)),
            "limit of the coils must be one number or one for each",
        ),
        (lambda: UniformCoils().field([1.0]), r"fraction must have shape \(..., 2\), but got shape \(1,\)"),
        (lambda: UniformCoils().field([1.0, np.nan]), "fraction must hold no NaN"),
        (lambda: HelmholtzPair(radius=-1.0, turns=1, axis=(1, 0, 0)), "radius of the coil pair must be"),
        (lambda: HelmholtzPair(radius=1.0, turns=0, axis=(1, 0, 0)), "turns of the coil pair must be"),
        (lambda: HelmholtzPair(radius=1.0, turns=1, axis=(0, 0, 0)), "axis of the coil pair must be"),
        (
            lambda: HelmholtzPair(radius=1.0, turns=1, axis=(1, 0, 0), separation=0.0),
            "separation of the coil pair",
        ),
        (lambda: CoilSystem(()), "pairs must be one or more HelmholtzPair"),
        (lambda: CoilSystem((PAIR, NESTED.pairs[0])), "pairs must share one center"),
        (lambda: NESTED.field([0.0, 0.0, 0.0], [1.0]), r"currents must have shape \(..., 2\)"),
        (lambda: Actuator(lag=0.0), "lag of the actuator must be a finite number > 0, but got 0.0"),
        (lambda: Actuator(slew_limit="fast"), "slew_limit of the actuator must be a finite number"),
        (lambda: Actuator(dead_time=-1e-3), "dead_time of the actuator must be"),
        (lambda: Actuator(limit=np.inf), "limit of the actuator must be"),
    ],
)
def test_bad_coils_are_told_in_one_sentence(call, words):
    with pytest.raises(ValueError, match=words) as caught:
        call()
    assert str(caught.value).endswith(".")


def test_actuator_leaves_out_what_is_none():
    assert Actuator() == Actuator(limit=np.float64(45e-3), slew_limit=None, lag=None, dead_time=None)
    assert Actuator(limit=None, lag=5e-3).lag == 5e-3


@pytest.mark.parametrize("thing", [PAIR, NESTED, UniformCoils(limit=[0.01, 0.02]), Actuator(slew_limit=1.0)])
def test_coils_and_actuators_hash_and_pickle(thing):
    assert pickle.loads(pickle.dumps(thing)) == thing
    assert hash(dataclasses.replace(thing)) == hash(thing)


def test_the_linear_field_has_the_value_and_gradient_of_the_coils_at_its_point():
    rng = np.random.default_rng(4)
    points, currents = rng.uniform(-0.02, 0.02, (5, 3)), rng.normal(size=(5, 2))
    field, gradient = NESTED.linear_field(points, currents)
    assert field.shape == (5, 3) and gradient.shape == (5, 3, 3)
    at_points = field + np.einsum("kij,kj->ki", gradient, points)
    np.testing.assert_allclose(at_points, NESTED.field(points, currents), rtol=1e-13, atol=1e-20)
    np.testing.assert_array_equal(gradient, NESTED.gradient(points, currents))
    one, slope = NESTED.linear_field(points[0], currents[0])
    np.testing.assert_allclose(one, field[0], rtol=1e-13)
    np.testing.assert_allclose(slope, gradient[0], rtol=1e-13)


def test_the_linear_field_errs_by_the_square_of_the_distance():
    """Half of it, a quarter of the error: 4 up to a share of the distance in radii."""
    place, aside, currents = np.array([0.05, 0.01, -0.02]), np.array([2e-4, -1e-4, 3e-4]), np.array([1.0, 2.0])
    field, gradient = NESTED.linear_field(place, currents)
    errors = [
        np.linalg.norm(field + gradient @ point - NESTED.field(point, currents))
        for point in (place + aside, place + 0.5 * aside)
    ]
    assert errors[0] / errors[1] == pytest.approx(4.0, rel=0.02)
