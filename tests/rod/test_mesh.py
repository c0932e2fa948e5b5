"""Nodes, lumped masses and residual bending flexibility: quadrature rules, and beams exact at the nodes."""

import numpy as np
import pytest

from magrod_env import Rod, Simulation, load_scene
from magrod_env.rod.mesh import arc_lengths, lumped_lengths, split_elements
from rod.beams import CLAMPED_FREE, slender_rod, transverse_frequency, weightless, with_tip

ROD = slender_rod()


# ---- elements and nodes


def test_elements_are_shared_out_so_that_the_longest_is_as_short_as_it_can_be():
    rng = np.random.default_rng(1)
    for _ in range(200):
        lengths = rng.uniform(0.02, 1.0, rng.integers(1, 5))
        total = len(lengths) + rng.integers(0, 12)
        counts = split_elements(np.cumsum(lengths), total)
        assert counts.sum() == total
        assert counts.min() >= 1
        longest = (lengths / counts).max()
        # shorter everywhere would take more elements than there are
        assert np.ceil(lengths / (longest * (1 - 1e-9))).sum() > total


def test_a_segment_without_an_element_is_refused():
    with pytest.raises(ValueError, match="num_elements must be at least 3"):
        split_elements([0.1, 0.2, 0.3], 2)


def test_a_node_sits_at_every_segment_end():
    ends = np.array([0.013, 0.05, 0.06])
    counts = split_elements(ends, 9)
    arc = arc_lengths(ends, counts)
    assert arc[0] == 0.0
    assert len(arc) == 10
    np.testing.assert_array_equal(arc[np.cumsum(counts)], ends)
    for start, first, last in zip([0.0, *ends], [0, *np.cumsum(counts)], np.cumsum(counts)):
        np.testing.assert_allclose(np.diff(arc[first : last + 1]), (arc[last] - start) / (last - first), rtol=1e-14)


# ---- lumped masses


def uniform_weights(num_elements):
    """Weights in units of the element's length."""
    return lumped_lengths(np.linspace(0.0, 1.0, num_elements + 1), True) * num_elements


@pytest.mark.parametrize("num_elements", [5, 6, 10, 20])
def test_the_free_end_of_a_uniform_rod_has_gregorys_weights(num_elements):
    weights = uniform_weights(num_elements)
    np.testing.assert_allclose(weights[-1:-5:-1], [251 / 720, 299 / 240, 211 / 240, 739 / 720], rtol=1e-12)
    np.testing.assert_allclose(weights[1:-4], 1.0, rtol=1e-12)


def test_three_elements_take_the_slope_of_three_nodes():
    np.testing.assert_allclose(uniform_weights(3)[1:], [23 / 24, 7 / 6, 3 / 8], rtol=1e-12)


@pytest.mark.parametrize("num_elements", [2, 3, 4, 7, 20])
def test_corrected_weights_integrate_motions_of_a_clamped_rod(num_elements):
    """1 and s^2, whose slope is zero at the clamp, exactly; there the rule has no end term to correct."""
    arc = np.linspace(0.0, 1.0, num_elements + 1)
    weights = lumped_lengths(arc, True)
    np.testing.assert_allclose(weights.sum(), 1.0, rtol=1e-14)
    np.testing.assert_allclose(weights @ arc**2, 1 / 3, rtol=1e-13)


def test_one_element_carries_what_a_turning_rod_does():
    """The second moment L^3/3 of a rod about its clamp; the clamp's own node does not move."""
    np.testing.assert_allclose(lumped_lengths(np.array([0.0, 0.7]), True)[1] * 0.7**2, 0.7**3 / 3, rtol=1e-14)


def test_plain_weights_are_the_trapezoidal_rule():
    arc = np.array([0.0, 0.1, 0.3, 0.35, 1.0])
    np.testing.assert_allclose(lumped_lengths(arc, False), [0.05, 0.15, 0.125, 0.35, 0.325], rtol=1e-14)


@pytest.mark.parametrize("counts", [(3, 2), (4, 4), (6, 3)])
def test_corrected_weights_keep_their_order_where_the_spacing_changes(counts):
    """Two segments of different spacing, refined by 32: the mean square of the first mode, a quarter of its tip's."""
    ends, errors = np.array([0.55, 1.0]), []
    for refine in (1, 32):
        arc = arc_lengths(ends, refine * np.array(counts))
        errors.append(abs(lumped_lengths(arc, True) @ mode_shape(arc) ** 2 - 0.25))
    assert np.log2(errors[0] / errors[1]) / 5 > 3.5  # the slope at the change is from three nodes, of third order


def mode_shape(s):
    """First mode of the clamped-free beam of length 1, 1 at the tip."""
    b = CLAMPED_FREE[0]
    ratio = (np.cosh(b) + np.cos(b)) / (np.sinh(b) + np.sin(b))
    return (np.cosh(b * s) - np.cos(b * s) - ratio * (np.sinh(b * s) - np.sin(b * s))) / 2.0


def test_weights_stay_positive_and_complete_with_magnets_anywhere():
    rng = np.random.default_rng(2)
    lightest = np.inf
    for _ in range(3000):
        ends = np.sort(np.append(rng.uniform(1e-3, 0.999, rng.integers(1, 4)), 1.0))
        num_elements = len(ends) + rng.integers(0, 12)
        arc = arc_lengths(ends, split_elements(ends, num_elements))
        weights, plain = lumped_lengths(arc, True), lumped_lengths(arc, False)
        lightest = min(lightest, (weights[1:] / plain[1:]).min())
        np.testing.assert_allclose(weights.sum(), 1.0, rtol=1e-12)
    assert lightest > 0.49  # no node is lighter than half of what it would be without correction


def test_masses_of_a_simulation_hold_the_magnets():
    scene = load_scene("paper6_two_magnets")
    simulation = Simulation(scene, num_elements=10)
    line = scene.rod.mass_per_length * lumped_lengths(simulation.arc_lengths, True)
    for magnet, node in zip(scene.magnets, simulation.magnet_nodes, strict=True):
        line[node] += magnet.mass
    np.testing.assert_allclose(simulation.node_masses[0, 1:], line[1:], rtol=1e-14)
    assert simulation.node_masses[0, 0] == 0.0


# ---- static deflections


@pytest.mark.parametrize("num_elements", [1, 2, 3, 7])
@pytest.mark.parametrize(
    "rod", [ROD, Rod.square(length=0.1, edge=0.02, density=1.0, youngs_modulus=1e6, poissons_ratio=0.5)]
)
def test_a_cantilever_is_exact_at_its_tip_for_an_end_load(rod, num_elements):
    """P L^3/(3 EI) + P L/GA at every number of elements, also for a stubby rod that shears."""
    scene = weightless(rod, mass=1e-6).replace(gravity=(0.0, 0.0, -1e-3))
    load = 1e-9
    exact = load * (rod.length**3 / (3 * scene.rod.bending_stiffness) + rod.length / scene.rod.shear_stiffness)
    tip = Simulation(scene, num_elements=num_elements).equilibrium().tip_position
    np.testing.assert_allclose(-tip[2], exact, rtol=1e-6)  # the rod's own mass of 1e-9 of it, and round-off of Newton


@pytest.mark.parametrize("num_elements", [2, 3, 7])
def test_a_cantilever_is_exact_at_every_node_for_an_end_load(num_elements):
    scene = weightless(ROD, mass=1e-6).replace(gravity=(0.0, -1e-3, 0.0))
    simulation = Simulation(scene, num_elements=num_elements)
    s, L, load = simulation.arc_lengths, ROD.length, 1e-9
    bending, shear = scene.rod.bending_stiffness, scene.rod.shear_stiffness
    exact = load * (s**2 * (3 * L - s) / (6 * bending) + s / shear)
    np.testing.assert_allclose(-simulation.equilibrium().positions[:, 1], exact, atol=1e-6 * exact[-1])


@pytest.mark.parametrize("element", ["helical", "nodal"])
def test_a_pull_along_the_rod_stretches_it_by_its_stiffness(element):
    """A dipole m in a gradient g along its axis is pulled by m g, here a tenth of the shear stiffness 12 EI/h^2."""
    rod, moment, slope = slender_rod(youngs_modulus=1e6), 1e-4, 0.5
    simulation = Simulation(weightless(rod, moment=moment), num_elements=3, element=element)
    gradient = slope * np.diag([1.0, -0.5, -0.5])
    tip = simulation.equilibrium(gradient=gradient).tip_position
    np.testing.assert_allclose(tip, [rod.length * (1 + moment * slope / rod.axial_stiffness), 0.0, 0.0], rtol=1e-12)


# ---- frequencies


@pytest.mark.parametrize(
    ("tip_mass", "numbers", "order"),
    [(0.0, (12, 24, 48), 3.75), (0.0, (16, 32), 3.94), (1.0, (8, 16, 32), 5.09)],
)
def test_bending_frequencies_converge_with_the_fourth_power_of_the_element(tip_mass, numbers, order):
    """Against the Timoshenko beam, its tip mass in units of the rod's; orders as found. Without a tip mass the error
    changes sign at 8 elements; with one its leading terms cancel.
    """
    errors = first_frequency_errors(tip_mass * ROD.mass, numbers)
    assert np.log2(errors[:-1] / errors[1:]).min() > order - 0.1


def test_second_bending_frequencies_of_a_few_elements():
    """Weights of four nodes at the free end: with those of three, 4 elements err by 3.3e-2 in place of 4.2e-3."""
    exact, scene = transverse_frequency(ROD, 1), with_tip(ROD)
    for num_elements, tolerance in ((4, 5e-3), (6, 5e-3), (8, 1.5e-3), (16, 6e-5)):
        found = Simulation(scene, num_elements=num_elements, plane="xz").natural_frequencies()[1]
        np.testing.assert_allclose(found, exact, rtol=tolerance)


@pytest.mark.parametrize(
    ("num_elements", "tip_mass", "tolerance"),
    [
        (1, 0.0, 0.15),
        (2, 0.0, 0.012),
        (3, 0.0, 5e-4),
        (4, 0.0, 6e-4),  # 5.9e-4; weights of three nodes at the free end have 8.5e-5, but worse higher modes
        (5, 0.0, 1.4e-4),
        (6, 0.0, 3.5e-5),
        (8, 0.0, 5e-6),
        (1, 1.0, 0.04),
        (2, 1.0, 4e-3),
        (3, 1.0, 3e-4),
        (4, 1.0, 2e-4),
        (6, 1.0, 3e-5),  # 2.6e-5; weights of three nodes have 1.1e-5
        (8, 1.0, 7e-6),
    ],
)
def test_first_frequency_of_a_few_elements(num_elements, tip_mass, tolerance):
    assert first_frequency_errors(tip_mass * ROD.mass, (num_elements,))[0] < tolerance


def first_frequency_errors(tip_mass, numbers):
    """Relative errors of the first bending frequency."""
    exact, scene = transverse_frequency(ROD, 0, tip_mass), with_tip(ROD, mass=tip_mass)
    found = [Simulation(scene, num_elements=n, plane="xz").natural_frequencies()[0] for n in numbers]
    return np.abs(np.array(found) / exact - 1.0)


@pytest.mark.parametrize("mode", [0, 1, 2])
def test_frequencies_are_those_of_the_slender_beam(mode):
    """beta L = 1.8751, 4.6941, 7.8548 within what shear and rotary inertia take at a length of 100 widths."""
    unit = np.sqrt(ROD.bending_stiffness / ROD.mass_per_length) / (2 * np.pi * ROD.length**2)
    found = Simulation(with_tip(ROD), num_elements=24, plane="xy").natural_frequencies()[mode]
    np.testing.assert_allclose(found, CLAMPED_FREE[mode] ** 2 * unit, rtol=1e-3)


def test_axial_and_torsional_frequencies_are_those_of_a_clamped_free_bar():
    """c/(4 L) with c = sqrt(E/rho) and sqrt(G/rho), as stiffness and inertia share the polar moment; second order."""
    speeds = np.sqrt(np.array([ROD.youngs_modulus, ROD.shear_modulus]) / ROD.density)
    for speed in speeds:
        errors = []
        for num_elements in (8, 16, 32):
            found = Simulation(with_tip(ROD), num_elements=num_elements).natural_frequencies()
            errors.append(np.abs(found / (speed / (4 * ROD.length)) - 1.0).min())
        assert errors[-1] < 2e-4
        np.testing.assert_allclose(np.log2(np.array(errors[:-1]) / errors[1:]), 2.0, atol=0.1)


# ---- the paper's element locks

LOCKING = {  # scene: elements and stiffening of bending at the paper's settings
    "paper3_pdms_no_magnet": (10, 2.95),
    "paper4_pdms_tip_magnet": (10, 4.06),
    "paper6_two_magnets": (10, 19.3),
    "paper1_aluminium_in_plane": (15, 67.8),
    "paper2_aluminium_out_of_plane": (15, 268.0),
}


@pytest.mark.parametrize(("name", "num_elements", "factor"), [(name, *value) for name, value in LOCKING.items()])
def test_the_nodal_element_is_too_stiff_by_its_locking_factor(name, num_elements, factor):
    """A small tip couple m B turns the tip by m B L/(EI factor); shaping divides E by the factor."""
    rod = load_scene(name).rod
    scene = with_tip(rod, moment=1e-3)
    turn, field = 1e-6, 1e-6 * rod.bending_stiffness / (rod.length * 1e-3)
    for shaping, stiffening in ((False, factor), (True, 1.0)):
        simulation = Simulation(scene, num_elements=num_elements, element="nodal", frequency_shaping=shaping)
        tangent = simulation.equilibrium((0.0, 0.0, field)).tangents[-1]
        np.testing.assert_allclose(turn / tangent[2], stiffening, rtol=2e-3)  # the factors have three digits


@pytest.mark.parametrize("name", LOCKING)
def test_the_nodal_element_vibrates_faster_by_the_root_of_its_locking_factor(name):
    """Within 2 %, which its plain masses take."""
    num_elements, factor = LOCKING[name]
    rod = load_scene(name).rod
    simulation = Simulation(with_tip(rod), num_elements=num_elements, element="nodal", plane="xz")
    ratio = simulation.natural_frequencies()[0] / transverse_frequency(rod, 0)
    np.testing.assert_allclose(ratio**2, factor, rtol=0.02)
