"""The paper's scenes, and the arithmetic of every correction made to its printed numbers.

Printed numbers are those of Tariverdi et al. 2020, Tables 3-8 and sections 4-5. A printed figure of three
digits is met to within one unit of its last digit: the paper cuts off some and rounds others.
"""

import math

import numpy as np
import pytest

from magrod_env.magnetics import dipole_moment
from magrod_env.scenes import load_scene, nodal_stiffening, paper_scene, scene_names

MILLI = 1e-3
MASS_UNIT = 1e-6  # kg: the milligram, not the gram of the tables' headings
FORCE_PER_LENGTH = MASS_UNIT  # mg/s^2 in kg/s^2
FORCE = MASS_UNIT * MILLI  # mg mm/s^2 in N
STIFFNESS = FORCE * MILLI**2  # mg mm^3/s^2 in N m^2
INERTIA = MASS_UNIT * MILLI  # mg mm in kg m

# name of the scene: M (g/mm), J_d (printed "g mm^2"), F^c (printed "g/s^2"), C1, C2 as printed
TABLES = {
    "paper1_aluminium_in_plane": (8.45e-3, 2.11, 8.29e4, (2.35e14, 0.88e14), (4.42e13, 5.89e13)),  # Table 3
    "paper2_aluminium_out_of_plane": (
        2.11e-3,
        0.13,
        2.07e4,
        (5.89e13, 2.21e13),
        (2.76e12, 3.68e12),
    ),  # Table 4
    "paper3_pdms_no_magnet": (21.62e-3, 33.78, 2.12e5, (7.17e9, 2.39e9), (0.75e10, 1.12e10)),  # Table 5
    "paper4_pdms_tip_magnet": (13.83e-3, 13.83, 1.357e5, (4.58e9, 1.53e9), (3.06e9, 4.59e9)),  # Table 6
    "paper6_two_magnets": (4.40e-3, 1.47, 4.32e4, (1.46e10, 0.49e10), (3.25e9, 4.87e9)),  # Table 7
}
PAPER_NAMES = [name for name in scene_names() if name.startswith("paper")]


def printed(value, got, digits=3):
    """Whether `got` is `value` up to one unit in the last of its printed digits."""
    unit = 10.0 ** (math.floor(math.log10(abs(value))) - digits + 1)
    return abs(got - value) <= 1.001 * unit


@pytest.mark.parametrize("name", TABLES)
def test_tables_are_in_milligrams_except_for_the_mass_per_length(name):
    mass, inertia, weight, (stretch, shear), (twist, bend) = TABLES[name]
    rod = load_scene(name).rod
    assert printed(mass, rod.mass_per_length)  # g/mm is kg/m
    assert printed(inertia, rod.rotary_inertia_per_length / INERTIA, digits=2)
    assert printed(weight, 9.81 * rod.mass_per_length / FORCE_PER_LENGTH)
    assert printed(stretch, rod.axial_stiffness / FORCE)
    assert printed(shear, rod.shear_stiffness / FORCE, digits=2)
    assert printed(twist, rod.torsional_stiffness / STIFFNESS, digits=2)
    assert printed(bend, rod.bending_stiffness / STIFFNESS)


@pytest.mark.parametrize("name", ["paper3_pdms_no_magnet", "paper4_pdms_tip_magnet"])
def test_pdms_modulus_is_in_kilopascal(name):
    rod = load_scene(name).rod
    from_table = TABLES[name][3][0] * FORCE / rod.area
    assert from_table == pytest.approx(365.12e3, rel=2e-3)  # printed: 365.12 MPa


def test_modulus_of_the_square_rod_is_ten_times_that_of_the_text():
    rod = load_scene("paper6_two_magnets").rod
    _, _, _, (stretch, _), (twist, bend) = TABLES["paper6_two_magnets"]
    shear_per_young = rod.shear_modulus / rod.youngs_modulus
    moduli = (
        stretch * FORCE / rod.area,
        bend * STIFFNESS / rod.second_moment,
        twist * STIFFNESS / (rod.polar_moment * shear_per_young),
    )
    np.testing.assert_allclose(moduli, 3.6512e6, rtol=2e-3)
    assert rod.youngs_modulus == pytest.approx(10 * 365.12e3)


def test_square_rod_is_twisted_with_the_polar_moment():
    rod = load_scene("paper6_two_magnets").rod
    torsion_constant = 0.1406 * rod.width**4
    assert torsion_constant / rod.polar_moment == pytest.approx(0.84, abs=0.005)
    from_table = TABLES["paper6_two_magnets"][4][0] * STIFFNESS / rod.shear_modulus
    assert from_table == pytest.approx(rod.polar_moment, rel=2e-3)


def test_remanence_is_in_tesla():
    volume = math.pi * 1e-3**2 * 4e-3  # the paper: V = 4 pi mm^3
    assert volume == pytest.approx(4 * math.pi * 1e-9)
    scene = load_scene("paper5_circle", modulus="effective")
    lever = scene.rod.length / scene.rod.bending_stiffness
    turned = [lever * dipole_moment(remanence, volume) * 14.5e-3 for remanence in (1.345, 1.345e-3)]
    # with tesla, 14.5 mT turn the tip through tens of degrees; with millitesla the circle would be 0.02 mm
    assert turned[0] == pytest.approx(0.63, abs=0.02)
    assert 0.5 * turned[1] * scene.rod.length < 0.03e-3


def test_weight_of_the_last_node_fits_a_magnet_a_thousand_times_too_light():
    rod = load_scene("paper4_pdms_tip_magnet").rod
    h = rod.length / 10
    at_tip = 1.36e5 * FORCE_PER_LENGTH  # Table 6, node a_(N+1); the other nodes: 1.357e5
    with_milligrams, with_grams = (9.81 * (rod.mass_per_length + mass / h) for mass in (0.096e-6, 0.096e-3))
    assert printed(1.36e5, with_milligrams / FORCE_PER_LENGTH)
    assert with_grams > 2 * at_tip


def test_weight_of_the_square_rods_magnets_is_a_thousand_times_too_light_too():
    rod = load_scene("paper6_two_magnets").rod
    with_milligrams = 9.81 * (rod.mass_per_length + 0.072e-6 / (rod.length / 10))
    assert printed(4.33e4, with_milligrams / FORCE_PER_LENGTH)  # Table 7, nodes a_(N+1) and a_3, a_4


def test_middle_magnet_is_not_where_table_7_loads_the_rod():
    scene = load_scene("paper6_two_magnets")
    tip, middle = scene.magnets
    assert tip.position - middle.position == pytest.approx(36.1e-3)  # section 4.3
    below = math.floor(middle.position / (scene.rod.length / 10)) + 1  # the table counts from a_1 at the clamp
    assert below == 6  # between a_6 and a_7; the table: a_3 and a_4


@pytest.mark.parametrize(
    ("name", "factor"),
    [
        ("paper3_pdms_no_magnet", 2.95),
        ("paper4_pdms_tip_magnet", 4.06),
        ("paper6_two_magnets", 19.3),
        ("paper1_aluminium_in_plane", 67.8),
        ("paper2_aluminium_out_of_plane", 268.0),
    ],
)
def test_stiffening_of_the_papers_element(name, factor):
    assert printed(factor, paper_scene(name).stiffening)


def test_stiffening_is_the_energy_of_false_shear_in_pure_bending():
    rod, num_elements, angle = load_scene("paper4_pdms_tip_magnet").rod, 10, 1e-4  # angle per element
    h = rod.length / num_elements
    bending = 0.5 * rod.bending_stiffness * angle**2 / h
    at_each_end = rod.shear_stiffness * math.sin(angle / 2) ** 2  # chord against the section, half the bend
    false_shear = h / 4 * (at_each_end + at_each_end)  # eq. 6
    assert 1 + false_shear / bending == pytest.approx(nodal_stiffening(rod, num_elements), rel=1e-8)


def test_frequency_falls_with_the_root_of_the_stiffening():
    """Section 5: gamma is the square of a ratio of frequencies that go with the root of EI / (rho A L^4)."""
    rod = load_scene("paper4_pdms_tip_magnet").rod
    coarse, fine = (math.sqrt(nodal_stiffening(rod, number)) for number in (10, 1000))
    assert fine == pytest.approx(1.0, abs=2e-4)
    assert (fine / coarse) ** 2 == pytest.approx(1 / paper_scene("paper4_pdms_tip_magnet").stiffening, rel=1e-3)


def test_frequency_scaling_is_the_root_of_the_ratio_of_moduli():
    high, low = (load_scene(f"paper7_frequency_scaling{end}").rod for end in ("", "_low"))
    assert (high.youngs_modulus, low.youngs_modulus) == (5e7, 5e5)
    assert math.sqrt(high.youngs_modulus / low.youngs_modulus) == pytest.approx(10.0)


@pytest.mark.parametrize(
    ("name", "sag"), [("paper1_aluminium_in_plane", 0.3e-3), ("paper2_aluminium_out_of_plane", 1.1e-3)]
)
def test_gravity_hardly_bends_the_aluminium_rods(name, sag):
    rod = load_scene(name).rod
    assert 9.81 * rod.mass_per_length * rod.length**4 / (8 * rod.bending_stiffness) == pytest.approx(sag, rel=0.07)


def test_field_against_gravity_points_upwards():
    """An upward field levels the tip of a rod when m B = w L^2 / 6 + W L / 2, whatever its stiffness."""
    scene, record = load_scene("paper5_circle"), paper_scene("paper5_circle")
    (magnet,) = scene.magnets
    rod_part = 9.81 * scene.rod.mass_per_length * scene.rod.length**2 / 6
    magnet_part = 9.81 * magnet.mass * scene.rod.length / 2
    assert (rod_part + magnet_part) / magnet.moment == pytest.approx(record.gravity_compensation_field, rel=0.08)


def test_axis_across_the_rod_is_e3_in_the_fourth_scene():
    ranges = 0.61 / 0.0335, 0.55 / 0.0116  # mm along E2 and E3: error over its printed share (section 4.2)
    np.testing.assert_allclose(ranges, (18.2, 47.4), rtol=2e-3)
    rise, run = math.sin(math.radians(41.74)), 1 - math.cos(math.radians(41.74))
    assert ranges[0] < 60.55 * rise < ranges[1]  # only E3 has room for the initial deflection across the rod
    assert 60.55 * run < ranges[0]


@pytest.mark.parametrize(
    ("name", "modulus"),
    [("paper3_pdms_no_magnet", 1.08e6), ("paper4_pdms_tip_magnet", 1.48e6), ("paper5_circle", 1.48e6)],
)
def test_effective_modulus_is_usual_for_pdms(name, modulus):
    scene = load_scene(name, modulus="effective")
    assert printed(modulus, scene.rod.youngs_modulus)
    assert scene.replace(rod=load_scene(name).rod) == load_scene(name)  # nothing else changes


def test_effective_modulus_of_aluminium_would_exceed_diamond():
    for name in ("paper1_aluminium_in_plane", "paper2_aluminium_out_of_plane"):
        record = paper_scene(name)
        assert record.scene.rod.youngs_modulus * record.stiffening > 1.2e12


def test_effective_modulus_of_the_square_rod_could_not_bend_as_far_as_reported():
    """Even with every load at its largest and pointing the same way all along the rod."""
    record = paper_scene("paper6_two_magnets")
    rod, length = record.scene.rod, record.scene.rod.length
    stiffness = rod.bending_stiffness * record.stiffening
    assert rod.youngs_modulus * record.stiffening == pytest.approx(70e6, rel=0.01)
    reach = 9.81 * rod.mass_per_length * length**4 / 8
    for magnet in record.scene.magnets:
        arm = magnet.position
        reach += magnet.moment * record.initial_field * arm * (length - arm / 2)
        reach += 9.81 * magnet.mass * arm**2 * (length / 2 - arm / 6)
    moved = 1.00e-3 / 0.0224  # the tip's largest error along E2 over its printed share: 45 mm
    assert 2 * reach / stiffness < moved


@pytest.mark.parametrize("name", [name for name in scene_names() if name[:6] not in ("paper3", "paper4", "paper5")])
def test_effective_modulus_is_refused_where_it_makes_no_sense(name):
    words = rf'modulus="effective" must be asked of a polymer rod of the paper, but got \'{name}\', where .*\.$'
    with pytest.raises(ValueError, match=words):
        load_scene(name, modulus="effective")


def test_any_modulus_can_be_given():
    scene = load_scene("paper1_aluminium_in_plane", modulus=np.float64(70e9))
    assert scene.rod.youngs_modulus == 70e9


@pytest.mark.parametrize("modulus", ["soft", -1.0, True, math.nan, None])
def test_a_bad_modulus_is_told_in_one_sentence(modulus):
    with pytest.raises(ValueError, match=r"modulus, where it is not .* must be a finite number > 0"):
        load_scene("paper3_pdms_no_magnet", modulus=modulus)


def test_unknown_names_list_the_known_ones():
    with pytest.raises(ValueError, match=r"name must be a known scene, but got 'paper9': .*niti_guidewire"):
        load_scene("paper9")
    with pytest.raises(ValueError, match="name must be a scene of the paper, but got 'niti_guidewire'"):
        paper_scene("niti_guidewire")


@pytest.mark.parametrize("name", PAPER_NAMES)
def test_records_carry_their_name_and_the_scene_that_loads(name):
    record = paper_scene(name)
    assert record.name == name
    assert record.scene == load_scene(name)
    assert hash(record) == hash(paper_scene(name))
    assert all(0.0 < error.mean < error.largest < 2e-3 for error in record.reported_errors)


def test_all_seven_scenes_of_the_paper_are_there():
    assert sorted({name[:6] for name in PAPER_NAMES}) == [f"paper{number}" for number in range(1, 8)]


def test_circle_uses_the_rod_with_the_tip_magnet_within_the_coils_limit():
    assert load_scene("paper5_circle") == load_scene("paper4_pdms_tip_magnet")
    record = paper_scene("paper5_circle")
    assert record.gravity_compensation_field + record.rotating_field < record.field_limit


def test_guidewire_is_a_stiff_thin_wire_with_a_tip_dipole():
    scene = load_scene("niti_guidewire")
    np.testing.assert_allclose(scene.magnets[0].dipole_moment, [4e-3, 0.0, 0.0])
    assert (scene.segment_ends, scene.gravity, scene.drag_rate) == ((0.1,), None, 5.0)
    assert scene.rod.bending_stiffness == pytest.approx(60e9 * math.pi / 64 * 0.35e-3**4)
