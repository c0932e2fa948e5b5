"""Equilibria against the elastica: couples, end loads, buckling; against the dynamics and the spectral solution."""

from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import solve_bvp
from scipy.optimize import brentq
from scipy.spatial.transform import Rotation
from scipy.special import ellipe, ellipeinc, ellipk, ellipkinc
from term_sets import dragged

from magrod_env import Equilibrium, Rod, Scene, Simulation, StabilityError, load_scene
from rod.beams import slender_rod, weightless

REFERENCE = np.load(Path(__file__).parents[1] / "reference" / "reference.npz")
ROD = slender_rod(youngs_modulus=1e7)
MOMENT = 1e-2
CRITICAL = ROD.bending_stiffness / (MOMENT * ROD.length)  # T: the field at which the straight rod buckles


def wire(num_elements, scene=None, **options):
    return Simulation(scene or weightless(ROD, moment=MOMENT), num_elements=num_elements, **options)


# ---- a couple at the tip: the rod is a circular arc


@pytest.mark.parametrize("num_elements", [1, 2, 5])
@pytest.mark.parametrize(("ratio", "direction"), [(0.3, 90.0), (2.0, 90.0), (6.0, 150.0), (0.5, -120.0), (15.0, 170.0)])
def test_a_dipole_at_the_tip_bends_a_weightless_rod_into_an_exact_arc(num_elements, ratio, direction):
    """m B sin(direction - theta) = EI theta/L, the tip at L (sin theta, 1 - cos theta)/theta: at one element too."""
    alpha = np.radians(direction)
    field = ratio * CRITICAL * np.array([np.cos(alpha), 0.0, np.sin(alpha)])
    theta = brentq(lambda t: ratio * np.sin(alpha - t) - t, *sorted((0.0, alpha)), xtol=1e-15)
    case = wire(num_elements).equilibrium(field)
    assert case.reached
    exact = ROD.length / theta * np.array([np.sin(theta), 0.0, 1.0 - np.cos(theta)])
    np.testing.assert_allclose(case.tip_position, exact, atol=1e-9 * ROD.length)  # what Newton leaves
    np.testing.assert_allclose(case.tangents[-1], [np.cos(theta), 0.0, np.sin(theta)], atol=1e-9)


@pytest.mark.parametrize("num_elements", [1, 4])
def test_a_dipole_across_the_rod_twists_it_by_its_torsional_stiffness(num_elements):
    """Dipole along y in a field along z: m B cos(phi) = GJ phi/L, and the rod stays straight."""
    field = 0.7 * ROD.torsional_stiffness / (MOMENT * ROD.length)
    phi = brentq(lambda p: 0.7 * np.cos(p) - p, 0.0, 1.0, xtol=1e-15)
    scene = weightless(ROD, moment=MOMENT, direction=(0.0, 1.0, 0.0))
    simulation = wire(num_elements, scene)
    simulation.reset(field=(0.0, 0.0, field))
    np.testing.assert_allclose(simulation.tip_position[0], [ROD.length, 0.0, 0.0], atol=1e-9 * ROD.length)
    np.testing.assert_allclose(simulation.rotations[0, -1] @ [0, 1, 0], [0.0, np.cos(phi), np.sin(phi)], atol=1e-9)


# ---- a dead weight at the tip: the elastica by elliptic integrals


def elastica_tip(load_ratio):
    """Tip (x, drop)/L of an inextensible cantilever under P L^2/EI = load_ratio (Bisshopp and Drucker 1945)."""

    def incomplete(theta):
        k2 = (1.0 + np.sin(theta)) / 2.0
        return k2, np.arcsin(1.0 / np.sqrt(2.0 * k2))

    def condition(theta):
        k2, phi = incomplete(theta)
        return ellipk(k2) - ellipkinc(phi, k2) - np.sqrt(load_ratio)

    theta = brentq(condition, 1e-6, np.pi / 2 - 1e-9, xtol=1e-15)
    k2, phi = incomplete(theta)
    root = np.sqrt(load_ratio)
    return np.sqrt(2.0 * np.sin(theta)) / root, 1.0 - 2.0 / root * (ellipe(k2) - ellipeinc(phi, k2))


def sheared_elastica_tip(rod, load_ratio):
    """The same of a rod that stretches by N/EA and shears by Q/GA, by collocation: s, x, drop, angle and its slope."""
    force = load_ratio * rod.bending_stiffness / rod.length**2

    def slopes(s, y, share):
        pull, shear = (
            share * force * np.sin(y[2]) / rod.axial_stiffness,
            share * force * np.cos(y[2]) / rod.shear_stiffness,
        )
        forward = (1.0 + pull) * np.cos(y[2]) - shear * np.sin(y[2])
        down = (1.0 + pull) * np.sin(y[2]) + shear * np.cos(y[2])
        return np.array([forward, down, y[3], -share * load_ratio * forward])

    s = np.linspace(0.0, 1.0, 41)
    y = np.array([s, 0.0 * s, 0.0 * s, 0.0 * s])
    for share in np.linspace(0.1, 1.0, 8):
        found = solve_bvp(
            lambda s, y, share=share: slopes(s, y, share),
            lambda start, end: np.array([*start[:3], end[3]]),
            s,
            y,
            tol=1e-11 if share == 1.0 else 1e-4,
            bc_tol=1e-13,
            max_nodes=100_000,
        )
        assert found.success
        s, y = found.x, found.y
    return y[0, -1], y[1, -1]


@pytest.mark.parametrize(
    ("load_ratio", "numbers"), [(0.1, (2, 4)), (1.0, (4, 8, 16)), (5.0, (6, 12, 24)), (10.0, (12, 24))]
)
def test_an_end_load_converges_to_the_elastica_with_the_fourth_power(load_ratio, numbers):
    """A wire 2000 times as long as wide, whose extension and shear of 2e-8 of its length a unit of load count too.

    From the numbers of elements on where the error has changed its sign and is not rounding, 1e-9 lengths.
    """
    thin = slender_rod(youngs_modulus=1e7, diameter=5e-5)
    mass = load_ratio * thin.bending_stiffness / (9.81 * thin.length**2)
    scene = weightless(thin, moment=MOMENT, mass=mass).replace(gravity=(0.0, 0.0, -9.81))
    x, drop = sheared_elastica_tip(thin, load_ratio)
    np.testing.assert_allclose((x, drop), elastica_tip(load_ratio), atol=4.5e-8 * load_ratio)
    exact, errors = thin.length * np.array([x, 0.0, -drop]), []
    for num_elements in (4, *numbers):
        case = wire(num_elements, scene).equilibrium()
        assert case.reached
        errors.append(np.linalg.norm(case.tip_position - exact) / thin.length)
    assert errors[0] < 4e-6 * load_ratio
    assert np.log2(np.array(errors[1:-1]) / errors[2:]).min() > 3.8


# ---- buckling


@pytest.mark.parametrize("num_elements", [1, 4])
def test_the_straight_rod_buckles_at_ei_over_m_l(num_elements):
    """Bent by a couple only, it is an arc: theta EI/L = m B sin(theta) has another solution beyond m B L/EI = 1."""
    simulation = wire(num_elements)
    assert simulation.equilibrium((-0.99 * CRITICAL, 0.0, 0.0)).reached
    lost = simulation.equilibrium((-1.01 * CRITICAL, 0.0, 0.0))
    assert not lost.reached
    np.testing.assert_allclose((lost.share - 1.0) * 1.01, 1.0, atol=0.002)
    simulation.reset(field=(-0.99 * CRITICAL, 0.0, 0.0))
    with pytest.raises(StabilityError, match=r"loses stability .* of the field"):
        simulation.reset(field=(-1.01 * CRITICAL, 0.0, 0.0))
    np.testing.assert_allclose(lost.positions[-1], [ROD.length, 0.0, 0.0], atol=1e-12)  # not jumped


@pytest.mark.parametrize("axis", [1, 2])
def test_frequency_falls_to_zero_at_buckling(axis):
    """One element, one bending mode with a known stiffness: the square of its frequency is linear in the field."""
    simulation = wire(1, weightless(ROD, moment=MOMENT, mass=1e-4), plane="xy" if axis == 1 else "xz")
    lowest = [simulation.natural_frequencies((-part * CRITICAL, 0.0, 0.0))[0] for part in (0.0, 0.9, 0.99, 0.999)]
    assert np.all(np.diff(lowest) < 0.0)
    assert lowest[-1] < 0.07 * lowest[0]


def turning_points():
    """Fields at 45 mT a component under gravity, beyond what the soft rods stand in many directions."""
    rng = np.random.default_rng(5)
    return 45e-3 * rng.uniform(-1, 1, (6, 3))


@pytest.mark.parametrize("field", turning_points())
def test_stability_is_reported_lost_only_where_a_frequency_vanishes(field):
    """On the way to a strong field the shape is stable everywhere; where it ends, its lowest frequency goes to zero."""
    simulation = wire(6, load_scene("paper4_pdms_tip_magnet"))
    case = simulation.equilibrium(field)
    share = case.share - 1.0
    rest = simulation.natural_frequencies((0.0, 0.0, 0.0))[0]
    parts = share * np.array([0.0, 0.2, 0.4, 0.6, 0.8, 0.9, 0.97])
    on_the_way = [simulation.equilibrium(part * field) for part in parts]
    assert all(step.reached for step in on_the_way)
    lowest = np.array([simulation.natural_frequencies(part * field)[0] for part in parts])
    assert np.all(lowest > 0.0)
    if case.reached:
        assert np.isfinite(simulation.natural_frequencies(field)).all()
    else:
        last = simulation.natural_frequencies(0.9997 * share * field)[0]
        assert last < 0.35 * rest
        assert last < lowest[-1]


# ---- other roads to the same shapes


@pytest.mark.parametrize("name", ["static_gravity", "static_field_z", "static_field_yz"])
@pytest.mark.parametrize(("num_elements", "tolerance"), [(4, 2e-4), (8, 1.3e-5), (16, 1e-6)])
def test_equilibrium_is_that_of_the_spectral_solution(name, num_elements, tolerance):
    simulation = wire(num_elements, load_scene("paper4_pdms_tip_magnet", modulus=1.48e6))
    case = simulation.equilibrium(REFERENCE[f"{name}_field"])
    np.testing.assert_allclose(case.tip_position, REFERENCE[f"{name}_tip"], atol=tolerance)
    np.testing.assert_allclose(case.tangents[-1], REFERENCE[f"{name}_tip_tangent"], atol=30.0 * tolerance)


def rest_of(simulation, field, **options):
    """Positions after the field has risen slowly from the equilibrium under gravity, and time to rest.

    Slowly, as drag acts on no rotation: twist and shear, once set ringing, would go on for ever.
    """
    simulation.reset(field=(0.0, 0.0, 0.0))
    simulation.advance(1.0, field=lambda t: np.array(field) * np.sin(0.5 * np.pi * t) ** 2, **options)
    simulation.advance(1.0, field=field)
    return simulation.positions[0]


@pytest.mark.parametrize("element", ["helical", "nodal"])
def test_equilibrium_is_where_a_damped_motion_ends(element):
    scene = load_scene("paper4_pdms_tip_magnet").replace(drag_rate=60.0)  # near critical damping of the first mode
    field = (4e-3, 3e-3, 12e-3)
    simulation = Simulation(scene, num_elements=4, element=element)
    case = simulation.equilibrium(field)
    assert case.reached
    np.testing.assert_allclose(rest_of(simulation, field), case.positions, atol=1e-6)


@pytest.mark.parametrize("element", ["helical", "nodal"])
def test_a_rod_released_in_its_equilibrium_stays_there(element):
    simulation = Simulation(dragged(load_scene("paper4_pdms_tip_magnet")), num_elements=6, element=element)
    simulation.reset(field=(0.0, 3e-3, 9e-3))
    before = simulation.positions
    simulation.advance(0.5)
    np.testing.assert_allclose(simulation.positions, before, atol=1e-11)


def test_equilibrium_in_a_gradient_is_where_a_damped_motion_ends():
    """It ends where the energy -m.B(p) of the dipole is stationary; a gradient is symmetric and has no trace."""
    slope = 0.1 * np.array([[0.2, 0.1, -0.3], [0.1, -0.5, 0.05], [-0.3, 0.05, 0.3]])
    scene = load_scene("paper4_pdms_tip_magnet").replace(drag_rate=60.0)
    simulation = Simulation(scene, num_elements=4)
    field = np.array([2e-3, -1e-3, 6e-3])
    case = simulation.equilibrium(field, gradient=slope)
    np.testing.assert_allclose(rest_of(simulation, field, gradient=slope), case.positions, atol=1e-6)


def test_equilibria_of_a_batch_are_those_of_its_fields():
    scene = load_scene("paper4_pdms_tip_magnet")
    fields = np.array([[0, 0, 0], [0, 0, 8e-3], [0, 5e-3, 5e-3], [0, 0, 8e-3]])
    simulation = Simulation(scene, num_rods=4, num_elements=4)
    simulation.reset(field=fields)
    for rod, field in enumerate(fields):
        np.testing.assert_array_equal(simulation.positions[rod], simulation.equilibrium(field).positions)


# ---- other branches

TWISTED = weightless(ROD, moment=MOMENT, direction=(0.0, 1.0, 0.0))
RATIO = 1.5  # m B L/GJ


def turned_field(degrees):
    """Field across the rod, from the magnet's direction without load, y, towards z."""
    angle = np.radians(degrees)
    strength = RATIO * ROD.torsional_stiffness / (MOMENT * ROD.length)
    return strength * np.array([0.0, np.cos(angle), np.sin(angle)])


def twist_of(case):
    y = case.rotations[-1][:, 1]
    return np.arctan2(y[2], y[1])


def turn_round(simulation, sign):
    """Equilibria along a field that turns by 1 degree at a time until stability is lost; the last is the lost one."""
    cases = [simulation.equilibrium(turned_field(0.0))]
    for degrees in range(1, 360):
        cases.append(simulation.equilibrium(turned_field(sign * degrees), start=cases[-1]))
        if not cases[-1].reached:
            break
    return cases


def test_a_field_turned_against_a_dipole_across_the_rod_holds_it_in_two_states():
    """phi = (m B L/GJ) sin(alpha - phi): at alpha = 180 degrees phi = 1.5 sin(phi) has a root on either side.

    The branch ends where 1 + (m B L/GJ) cos(alpha - phi) = 0. Bending is stiffer than twist: it stays straight.
    """
    simulation = wire(3, TWISTED)
    end = np.degrees(np.pi - np.arccos(1.0 / RATIO) + np.sqrt(RATIO**2 - 1.0))  # 195.9
    exact = brentq(lambda p: p - RATIO * np.sin(p), 0.5, 3.0, xtol=1e-15)
    for sign in (1, -1):
        cases = turn_round(simulation, sign)
        assert twist_of(cases[180]) == pytest.approx(sign * exact, abs=1e-9)
        assert len(cases) - 2 == int(end)  # the last that is reached, in degrees
        assert not cases[-1].reached and 1.0 < cases[-1].share < 2.0
        for k, bracket in ((60, (0.0, 1.1)), (195, (np.sqrt(RATIO**2 - 1.0), 1.6))):
            phi = brentq(lambda p, k=k: p - RATIO * np.sin(np.radians(k) - p), *bracket, xtol=1e-15)
            assert twist_of(cases[k]) == pytest.approx(sign * phi, abs=1e-7)  # flat near the end of the branch


def test_where_a_branch_has_ended_the_lost_shape_relaxes_to_another():
    simulation = wire(3, TWISTED)
    lost = turn_round(simulation, 1)[-1]
    case = simulation.equilibrium(lost.field, start=(lost.positions, lost.quaternions))
    exact = brentq(lambda p: p - RATIO * np.sin(np.radians(196.0 - 360.0) - p), -np.pi, 0.0, xtol=1e-15)
    assert case.reached and case.share == 2.0
    assert twist_of(case) == pytest.approx(exact, abs=1e-9)


@pytest.mark.parametrize("sign", [1, -1])
def test_a_shape_relaxes_to_the_branch_on_its_side(sign):
    simulation = wire(3, TWISTED)
    shape = simulation.equilibrium(turned_field(sign * 90.0))
    exact = brentq(lambda p: p - RATIO * np.sin(p), 0.5, 3.0, xtol=1e-15)
    for rotations in (shape.rotations, shape.quaternions, -shape.quaternions):
        case = simulation.equilibrium(turned_field(180.0), start=(shape.positions, rotations))
        assert case.reached
        assert twist_of(case) == pytest.approx(sign * exact, abs=1e-9)


def test_a_shape_that_balances_is_not_called_stable():
    """Untwisted in a field against the magnet, no side is better than the other."""
    simulation = wire(3, TWISTED)
    straight = simulation.equilibrium()
    case = simulation.equilibrium(turned_field(180.0), start=(straight.positions, straight.rotations))
    assert not case.reached and case.share == 1.0
    assert not simulation.equilibrium(turned_field(180.0), start=straight).reached


def test_a_branch_is_the_same_by_any_stable_road():
    """Gravity, a field and a gradient: from zero, round a detour, and relaxed from the straight rod."""
    simulation = wire(4, load_scene("paper4_pdms_tip_magnet"))
    field, slope = (1e-3, 4e-3, 6e-3), 0.1 * np.array([[0.2, 0.1, -0.3], [0.1, -0.5, 0.05], [-0.3, 0.05, 0.3]])
    direct = simulation.equilibrium(field, slope)
    detour = simulation.equilibrium((0.0, -5e-3, 3e-3))
    assert detour.reached
    for start in (detour, simulation.equilibrium(), simulation.equilibrium(gradient=-slope)):
        case = simulation.equilibrium(field, slope, start=start)
        assert case.reached and case.share == 2.0
        np.testing.assert_allclose(case.positions, direct.positions, atol=1e-9 * ROD.length)
        np.testing.assert_array_equal(case.field, field)
        np.testing.assert_array_equal(case.gradient, slope)
    straight = Simulation(simulation.scene, num_elements=4)
    relaxed = simulation.equilibrium(field, slope, start=(straight.positions[0], straight.rotations[0]))
    np.testing.assert_allclose(relaxed.positions, direct.positions, atol=1e-9 * ROD.length)


def test_a_start_that_is_no_equilibrium_of_the_simulation_is_refused():
    simulation = wire(4, load_scene("paper4_pdms_tip_magnet"))
    stiffer = wire(4, load_scene("paper4_pdms_tip_magnet", modulus=1e6))
    with pytest.raises(ValueError, match="start must be an equilibrium of this simulation"):
        simulation.equilibrium((0.0, 0.0, 1e-3), start=stiffer.equilibrium())
    with pytest.raises(ValueError, match="start must be an equilibrium of this simulation"):
        simulation.equilibrium((0.0, 0.0, 1e-3), start=wire(5, simulation.scene).equilibrium())
    with pytest.raises(ValueError, match="start must be an equilibrium that was reached"):
        wire(3, TWISTED).equilibrium(start=wire(3, TWISTED).equilibrium(turned_field(180.0)))
    with pytest.raises(ValueError, match="start must be a pair of positions and rotations"):
        simulation.equilibrium(start="straight")


def test_rotations_of_an_equilibrium_are_those_of_its_quaternions():
    case = wire(4, load_scene("paper4_pdms_tip_magnet")).equilibrium((2e-3, 5e-3, 4e-3))
    assert isinstance(case, Equilibrium)
    turns = Rotation.from_quat(np.roll(case.quaternions, -1, axis=-1)).as_matrix()
    np.testing.assert_allclose(case.rotations, turns, atol=1e-14)
    np.testing.assert_array_equal(case.tangents, case.rotations[:, :, 0])


# ---- frequencies of what is not there


@pytest.mark.parametrize(("plane", "entries"), [(None, 24), ("xz", 12)])
@pytest.mark.parametrize("share", [1.1, 2.5])
def test_frequencies_of_an_equilibrium_that_does_not_exist_are_nan(share, plane, entries):
    """A rod that stands longer than L^3 = 7.8373 EI/(rho A g) falls over under its own weight."""
    critical = (7.8373 * 1.48e6 * 4e-3**2 / (16.0 * 1100.0 * 9.81)) ** (1.0 / 3.0)

    def standing(length):
        rod = Rod.circular(length=length, diameter=4e-3, density=1100.0, youngs_modulus=1.48e6, poissons_ratio=0.5)
        return Simulation(Scene(rod=rod, gravity=(-9.81, 0.0, 0.0)), num_elements=4, plane=plane)

    assert np.isfinite(standing(0.9 * critical).natural_frequencies((0.0, 0.0, 0.0))).all()
    for found in (
        standing(share * critical).natural_frequencies((0.0, 0.0, 0.0)),
        standing(share * critical).natural_frequencies(gradient=np.zeros((3, 3))),
    ):
        assert found.shape == (entries,)
        assert np.isnan(found).all()


def test_frequencies_in_a_gradient_are_those_of_the_motion():
    """Let go beside its equilibrium, nearly in the first mode: the time between zeros of the tip's distance."""
    scene = load_scene("paper4_pdms_tip_magnet").replace(drag_rate=0.0)
    simulation = wire(2, scene)
    field, slope = (8e-3, 0.0, 0.0), 1.0 * np.diag([1.0, -0.5, -0.5])
    frequency = simulation.natural_frequencies(field, slope)[0]
    assert frequency > 1.2 * simulation.natural_frequencies(field)[0]
    simulation.reset(field=field, gradient=slope)
    rest = simulation.tip_position[0]
    aside = scene.replace(gravity=np.add(scene.gravity, (0.0, 1e-3, 0.0)))
    simulation.reset(shape=wire(2, aside).equilibrium(field, slope))
    simulation.advance(0.0, field=field, gradient=slope)
    step, seen = 0.005 / frequency, []
    for _ in range(1000):
        simulation.advance(step)
        seen.append(simulation.tip_position[0, 1] - rest[1])
    seen = np.array(seen)
    up = np.flatnonzero((seen[:-1] < 0) & (seen[1:] >= 0))
    crossings = up + seen[up] / (seen[up] - seen[up + 1])
    np.testing.assert_allclose(1.0 / (np.diff(crossings).mean() * step), frequency, rtol=5e-3)  # other modes ring too
