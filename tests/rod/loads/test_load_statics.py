"""Equilibria under listed loads against published numbers, closed forms and the elastica, integrated here."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp, trapezoid
from scipy.optimize import brentq

from magrod_env import FluidDrag, PointLoad, Scene, Simulation
from rod.beams import CLAMPED_FREE
from rod.loads.loaded import FORCE, LENGTH, MOMENT, STIFFNESS, WIRE, listed, wire


def rest(num_elements, scene):
    case = Simulation(scene, num_elements=num_elements, time_step=1e-9).equilibrium()
    assert case.reached
    return case


def elastica(end_angle, force):
    """Inextensible planar rod of unit length and stiffness, from its free tip at the angle ``end_angle`` to its clamp.

    ``force(angle)`` gives the force per length (x, z) on a section, beside a force (x, z) at the tip that is its own
    argument. Returns the angle at the clamp and the tip's position seen from there, in the world of the angles.
    """
    line, tip = force

    def slopes(s, y):  # s from the tip; angle, moment, force of the outer part, position
        angle, moment, fx, fz, x, z = y
        qx, qz = line(angle)
        cosine, sine = np.cos(angle), np.sin(angle)
        return [-moment, cosine * fz - sine * fx, qx, qz, -cosine, -sine]

    start = [end_angle, 0.0, *tip, 0.0, 0.0]
    y = solve_ivp(slopes, (0.0, 1.0), start, rtol=1e-10, atol=1e-12).y[:, -1]
    return y[0], -y[4:]


def shot(line, tip, bracket):
    """Tip (x, z) of the rod whose clamp lies along x, by the angle of its tip."""
    angle = brentq(lambda a: elastica(a, (line, tip))[0], *bracket, xtol=1e-12)
    return elastica(angle, (line, tip))[1]


def nothing(angle):
    return 0.0, 0.0


# K. Mattiasson, Numerical results from large deflection beam and frame problems analysed by means of elliptic
# integrals, Int. J. Numer. Meth. Eng. 17, 145-153, 1981, table I: P L^2/EI, w/L, u/L
MATTIASSON = [(1.0, 0.30172, 0.05643), (2.0, 0.49346, 0.16064), (5.0, 0.71379, 0.38763), (10.0, 0.81061, 0.55500)]


@pytest.mark.parametrize(("load", "deflection", "shortening"), MATTIASSON)
def test_a_dead_force_at_the_tip_gives_mattiassons_cantilever(load, deflection, shortening):
    """Published to five digits; 40 elements are as exact."""
    tip = rest(40, wire(tip={"force": (0.0, 0.0, -load * FORCE)})).tip_position / LENGTH
    np.testing.assert_allclose((1.0 - tip[0], -tip[2]), (shortening, deflection), atol=1.2e-5)


@pytest.mark.parametrize("load", [3.0, 12.0])
def test_a_force_that_follows_the_tip_gives_the_elastica_turned_back_from_its_tip(load):
    """Seen from the tip's section its load is known: one integration, turned so that the clamp lies along x."""
    turn, (x, z) = elastica(0.0, (nothing, (0.0, load)))
    exact = np.array([np.cos(turn) * x + np.sin(turn) * z, np.cos(turn) * z - np.sin(turn) * x])
    force = {"force": (0.0, 0.0, load * FORCE), "follows": True}
    tip = rest(40, wire(tip=force, follows=True)).tip_position / LENGTH
    np.testing.assert_allclose(tip[[0, 2]], exact, atol=3e-5)
    np.testing.assert_allclose(tip[1], 0.0, atol=1e-9)


@pytest.mark.parametrize("follows", [False, True])
@pytest.mark.parametrize("turns", [0.5, 1.0])
def test_a_moment_at_the_tip_winds_the_rod_into_a_circle(follows, turns):
    """M = EI theta/L, fixed in the world or in the section alike in a plane; exact for every number of elements."""
    theta = 2.0 * np.pi * turns
    case = rest(10, wire(tip={"moment": (0.0, -theta * MOMENT, 0.0), "follows": follows}, follows=True))
    exact = LENGTH / theta * np.array([np.sin(theta), 0.0, 1.0 - np.cos(theta)])
    np.testing.assert_allclose(case.tip_position, exact, atol=1e-8 * LENGTH)


def test_a_small_force_per_length_gives_the_beams_parabola_of_fourth_degree():
    """w(s) = f s^2 (6 L^2 - 4 L s + s^2)/(24 EI), at the tip f L^4/8 EI, with a quadrature's weights."""
    scene = wire(line=(0.0, 1e-4 * FORCE / LENGTH, 0.0))
    simulation = Simulation(scene, num_elements=12, time_step=1e-9)
    case, s = simulation.equilibrium(), simulation.arc_lengths / LENGTH
    np.testing.assert_allclose(case.positions[-1, 1], 1e-4 * LENGTH / 8.0, rtol=1e-4)
    exact = 1e-4 * LENGTH * s**2 * (6.0 - 4.0 * s + s**2) / 24.0
    np.testing.assert_allclose(case.positions[:, 1], exact, atol=1e-4 * exact[-1])


def test_a_large_force_per_length_gives_the_elastica():
    x, z = shot(lambda angle: (0.0, -8.0), (0.0, 0.0), (-1.55, -0.1))
    tip = rest(40, wire(line=(0.0, 0.0, -8.0 * FORCE / LENGTH))).tip_position / LENGTH
    np.testing.assert_allclose(tip[[0, 2]], (x, z), atol=3e-5)


def test_a_pressure_that_follows_the_rod_gives_the_elastica():
    """A force per length across each section, turning with it: shot from the tip, which knows its load."""
    turn, (x, z) = elastica(0.0, (lambda angle: (-6.0 * np.sin(angle), 6.0 * np.cos(angle)), (0.0, 0.0)))
    exact = np.array([np.cos(turn) * x + np.sin(turn) * z, np.cos(turn) * z - np.sin(turn) * x])
    tip = rest(40, wire(line=(0.0, 0.0, 6.0 * FORCE / LENGTH), follows=True)).tip_position / LENGTH
    np.testing.assert_allclose(tip[[0, 2]], exact, atol=3e-5)


@pytest.mark.parametrize("place", [0.37, 0.5, 0.9])
def test_a_small_force_at_a_point_bends_the_beam_there_and_leaves_the_rest_straight(place):
    """F s^2 (3 a - s)/(6 EI) up to a, then straight on; exact at the nodes, of which one lies at a."""
    scene = wire(point=(0.0, 0.0, 1e-4 * FORCE), place=place * LENGTH)
    simulation = Simulation(scene, num_elements=7, time_step=1e-9)
    case, s = simulation.equilibrium(), simulation.arc_lengths / LENGTH
    assert np.isclose(s, place, atol=1e-12).any()
    inner = np.minimum(s, place)
    exact = 1e-4 * LENGTH * (inner**2 * (3.0 * place - inner) / 6.0 + (s - inner) * place**2 / 2.0)
    np.testing.assert_allclose(case.positions[:, 2], exact, atol=1e-6 * exact[-1])


def test_a_cross_flow_bends_a_light_rod_as_the_elastica_with_its_drag_does():
    """Force per length (C_n/2) rho d U^2 cos^2 across and C_t pi/2 rho d U^2 sin |sin| along, of the present angle."""
    pressure = 0.5 * 1000.0 * WIRE.width  # kg/m^2
    speed = np.sqrt(5.0 * FORCE / LENGTH / pressure)
    fluid = {"density": 1000.0, "normal_coefficient": 1.0, "tangential_coefficient": 0.05, "flow": (0.0, 0.0, speed)}

    def line(angle):
        across, along = (
            5.0 * np.cos(angle) * abs(np.cos(angle)),
            5.0 * np.pi * 0.05 * np.sin(angle) * abs(np.sin(angle)),
        )
        return along * np.cos(angle) - across * np.sin(angle), along * np.sin(angle) + across * np.cos(angle)

    exact = shot(line, (0.0, 0.0), (0.1, 1.5))
    tip = rest(40, wire(fluid=fluid, follows=True)).tip_position / LENGTH
    np.testing.assert_allclose(tip[[0, 2]], exact, atol=3e-5)


def test_loads_add_up_in_the_reaction_at_the_clamp():
    """The first element bears all: its force and moment at the clamp are those of the loads at the deformed places."""
    tip, line, point = np.array([0.2, 0.4, -1.0]), np.array([0.0, 0.5, 0.3]), np.array([0.0, -0.6, 0.4])
    scene = wire(tip={"force": tuple(FORCE * tip)}, line=tuple(FORCE / LENGTH * line), point=tuple(FORCE * point))
    simulation = Simulation(scene, num_elements=24, time_step=1e-9)
    case = simulation.equilibrium()
    places, nodes = case.positions / LENGTH, simulation.arc_lengths / LENGTH
    carried = np.full(25, 1.0 / 24.0)
    carried[0] *= 0.5
    carried[-4:] = np.array([739.0 / 720.0, 211.0 / 240.0, 299.0 / 240.0, 251.0 / 720.0]) / 24.0
    middle = np.argmin(np.abs(nodes - 0.5))
    moment = np.cross(places[-1], tip) + np.cross(places[middle], point)
    moment = moment + np.sum(carried[:, None] * np.cross(places, line), axis=0)
    rotation = case.rotations[1]  # of the first element over the length h: bend/h = moment in the middle/EI
    turn = np.array([rotation[2, 1] - rotation[1, 2], rotation[0, 2] - rotation[2, 0], rotation[1, 0] - rotation[0, 1]])
    outer = tip + point + np.sum(carried[1:], axis=0) * line
    at_middle = moment - np.cross(0.5 * (places[0] + places[1]), outer)
    np.testing.assert_allclose(12.0 * turn[1:], at_middle[1:], rtol=0.02)  # sines in the place of angles


def test_becks_column_flutters_at_its_published_load():
    """A follower force along the column: no divergence, flutter at 20.05 EI/L^2 (Beck 1952), here 20 to 20.2."""
    for load, fluttering in ((20.0, False), (20.2, True)):
        tip = {"force": (-load * FORCE, 0.0, 0.0), "follows": True}
        simulation = Simulation(wire(tip=tip, follows=True), num_elements=16, time_step=1e-9)
        case = simulation.equilibrium()
        assert case.reached
        np.testing.assert_allclose(case.tip_position, [LENGTH, 0.0, 0.0], atol=1e-6 * LENGTH)
        assert np.isnan(simulation.natural_frequencies((0.0, 0.0, 0.0))).any() == fluttering


@pytest.mark.parametrize("following", [False, True])
def test_eulers_column_buckles_at_its_load(following):
    """A dead force along the column: pi^2/4 EI/L^2, also where another load makes the tangent unsymmetric."""
    for load, stands in ((2.4, True), (2.5, False)):
        scene = wire(tip={"force": (-load * FORCE, 0.0, 0.0)}, follows=following)
        assert Simulation(scene, num_elements=16, time_step=1e-9).equilibrium().reached == stands


def test_a_small_pull_raises_the_first_frequency_by_rayleighs_quotient():
    """omega^2 rises by the part P integral of w'^2 over EI lambda^4 integral of w^2, w the cantilever's first mode."""
    number = CLAMPED_FREE[0]
    s = np.linspace(0.0, 1.0, 4001)
    ratio = (np.cosh(number) + np.cos(number)) / (np.sinh(number) + np.sin(number))
    mode = np.cosh(number * s) - np.cos(number * s) - ratio * (np.sinh(number * s) - np.sin(number * s))
    slope = np.gradient(mode, s, edge_order=2)
    squares = []
    for load in (0.0, 0.02):
        scene = wire(tip={"force": (load * FORCE, 0.0, 0.0)})
        simulation = Simulation(scene, num_elements=16, time_step=1e-9)
        squares.append(simulation.natural_frequencies((0.0, 0.0, 0.0))[0] ** 2)
    rise = 0.02 * trapezoid(slope**2, s) / trapezoid(mode**2, s) / number**4
    np.testing.assert_allclose(squares[1] / squares[0] - 1.0, rise, rtol=0.01)


def test_a_point_load_may_share_the_node_of_a_magnet_or_the_tip():
    loads = listed(place=LENGTH * (1.0 - 1e-12))
    scene = Scene(rod=WIRE, loads=(*loads, PointLoad(position=0.3 * LENGTH, force=(0.0, 0.0, STIFFNESS))))
    assert scene.segment_ends == (0.3 * LENGTH, LENGTH)
    assert isinstance(scene.acting_loads[3], FluidDrag) and scene.acting_loads[3].diameter == WIRE.width
