"""The paper's experiments: what is measured on them, against closed forms, and the quick mode of the program."""

import json
import math
import subprocess
import sys

import numpy as np
import pytest
from scipy.optimize import brentq

from magrod_env import Magnet, Simulation, load_scene
from magrod_env.scenes import paper_scene
from scripts.reproduction import experiments, frequency, runs
from scripts.reproduction.audit import cayley_error
from scripts.reproduction.printed import TABLES, implied_ranges
from tests import test_scenes
from tests.rod.beams import transverse_frequency
from tests.test_scripts_bench import ROOT, assert_well_formed, columns

# ---- frequencies


def slender_frequency(rod, mass_ratio):
    """First frequency (Hz) of the slender cantilever with a tip mass in units of its own.

    1 + cos b cosh b + mass_ratio b (cos b sinh b - sin b cosh b) = 0 (Blevins, Formulas for natural frequency).
    """
    b = brentq(
        lambda b: (
            1.0
            + math.cos(b) * math.cosh(b)
            + mass_ratio * b * (math.cos(b) * math.sinh(b) - math.sin(b) * math.cosh(b))
        ),
        0.1,
        2.0,
    )
    return b**2 / (2.0 * math.pi * rod.length**2) * math.sqrt(rod.bending_stiffness / rod.mass_per_length)


@pytest.mark.parametrize("mass_ratio", [0.0, 0.5])
def test_simulated_frequency_converges_to_the_slender_beam_with_tip_mass(mass_ratio):
    """A rod of 100 diameters: shear and rotary inertia take 5.3e-5."""
    scene = load_scene("paper1_aluminium_in_plane")
    magnet = Magnet.dipole(position=scene.rod.length, moment=0.0, mass=mass_ratio * scene.rod.mass)
    scene = frequency.weightless(scene.replace(magnets=(magnet,)))
    exact = slender_frequency(scene.rod, mass_ratio)
    found = [
        frequency.swing_frequency(Simulation(scene, num_elements=number, plane="xz")) / exact - 1.0
        for number in (2, 4, 8)
    ]
    assert abs(found[0]) > 10.0 * abs(found[2])
    assert abs(found[1]) < 6e-4  # 5.4e-4: what lumped masses take from the first mode of four elements
    assert abs(found[2]) < 7e-5  # 5.4e-5, of which shear and rotary inertia take 5.3e-5


def test_gamma_of_simulated_swings_is_the_closed_form():
    """Within what plain masses take: they lower the frequency of the nodal element by O(1/N^2)."""
    scene = load_scene("paper4_pdms_tip_magnet")
    counted = frequency.count_frequencies(scene, (10, 20), "test")
    true = transverse_frequency(scene.rod, 0, scene.magnets[0].mass)
    np.testing.assert_allclose(counted.found["helical, printed E"], true, rtol=1e-3)
    h = scene.rod.length / np.array([10, 20])
    closed = 1.0 + scene.rod.shear_stiffness * h**2 / (4.0 * scene.rod.bending_stiffness)
    np.testing.assert_allclose(counted.gammas("nodal"), closed, rtol=0.02)
    np.testing.assert_allclose(np.array(counted.found["nodal, shaped"]) / true, 1.0, rtol=0.01)


def test_motions_at_two_moduli_are_one_in_scaled_time():
    for one in frequency.scaled_motion(quick=True).values():
        np.testing.assert_allclose(one.low.times, 10.0 * one.high.times)
        np.testing.assert_allclose(one.low.tip, one.high.tip, atol=1e-11)
        assert np.ptp(one.high.tip[:, 2]) == pytest.approx(2.0 * 0.05, rel=0.05)
        assert 1e-9 < np.abs(one.low_fine.tip - one.high.tip).max() < 1e-4


# ---- what is measured on a course

TIMES = np.linspace(0.0, 3.0, 1501)


def test_frequency_and_decay_of_a_known_swing():
    swing = -2.0 + np.exp(-0.7 * TIMES) * np.cos(2.0 * math.pi * 4.0 * TIMES)
    assert runs.decay_rate(TIMES, swing, rest=-2.0) == pytest.approx(0.7, rel=0.01)
    assert runs.frequency(TIMES, np.sin(2.0 * math.pi * 4.0 * TIMES + 0.3)) == pytest.approx(4.0, rel=1e-5)


def test_what_does_not_swing_has_neither_frequency_nor_decay():
    assert runs.frequency(TIMES, TIMES) is None
    assert runs.decay_rate(TIMES, np.exp(-TIMES), rest=0.0) is None


def test_released_rod_rests_at_its_offset():
    record = paper_scene("paper1_aluminium_in_plane")
    for model, stiffening in ((runs.SHAPED, 1.0), (runs.NODAL, record.stiffening)):
        simulation = runs.build(record, model, plane="xz")
        runs.release(simulation, (0.0, 10e-3), stiffening)
        fastest = 10e-3 * 2.0 * math.pi * simulation.natural_frequencies()[0]
        assert simulation.tip_position[0, 2] == pytest.approx(10e-3, rel=0.02)
        assert abs(simulation.velocities[0, -1, 2]) < 0.03 * fastest


@pytest.mark.parametrize(("angle", "way"), [(-0.5, -1.0), (0.1, 1.0)])
def test_rod_starts_at_the_turning_point_of_its_swing(angle, way):
    """Below and above its sag: there for a moment, then back past the sag."""
    simulation = runs.build(paper_scene("paper4_pdms_tip_magnet"), runs.EFFECTIVE, plane="xz")
    sag = simulation.equilibrium().tip_position[2]
    for measure in (runs.chord_angle, runs.tangent_angle):
        runs.swing_to(simulation, angle, measure)
        assert measure(simulation) == pytest.approx(angle, abs=2e-3)
        run = runs.follow(runs.EFFECTIVE, simulation, 0.1, 1e-3)
        away = way * (run.tip[:, 2] - sag)
        assert away[0] > 0.97 * away.max() and away[-1] < 0.0


def test_angles_of_chord_and_tangent_of_an_arc():
    """A couple on a weightless rod bends it into an arc, whose chord has half of the tangent's angle."""
    scene = load_scene("paper4_pdms_tip_magnet").replace(gravity=(0.0, 0.0, 0.0), drag_rate=0.0)
    simulation = Simulation(scene, num_elements=4, plane="xz")
    simulation.reset(field=(0.0, 0.0, 10e-3))
    assert runs.tangent_angle(simulation) > 0.5
    assert runs.chord_angle(simulation) == pytest.approx(0.5 * runs.tangent_angle(simulation), rel=1e-9)


@pytest.mark.parametrize("name", TABLES)
def test_the_paper_s_step_is_taken_where_it_is_within_the_bound(name):
    record = paper_scene(name)
    for model in (runs.NODAL, runs.SHAPED):
        simulation = runs.build(record, model, plane="xz")
        bound = simulation.stable_time_step
        stable = record.paper_time_step <= bound
        assert simulation.time_step == pytest.approx(record.paper_time_step if stable else 0.9 * bound)
        assert stable or model == runs.NODAL  # with frequency shaping every printed step is stable
    assert simulation.num_elements == record.num_elements


def test_fields_are_those_of_the_paper():
    course = experiments.circling_field(paper_scene("paper5_circle"), 3.0)
    np.testing.assert_allclose(course(0.0), [0.0, 0.0, 7.75e-3])
    np.testing.assert_allclose(course(2.0), [0.0, 14.5e-3, 7.75e-3], atol=1e-8)
    np.testing.assert_allclose(course(2.5), [0.0, 0.0, 22.25e-3], atol=1e-8)
    course = experiments.turning_down_field(paper_scene("paper6_two_magnets"), 7.5)
    np.testing.assert_allclose(course(0.0), [0.0, 0.0, 20e-3], atol=1e-12)
    np.testing.assert_allclose(course(3.75), [19.925e-3, 0.0, 0.0], atol=1e-8)
    np.testing.assert_allclose(course(7.5), [0.0, 0.0, -19.85e-3], atol=1e-12)


# ---- printed numbers


def test_printed_tables_are_those_of_the_scenes_tests():
    """Copied from the paper twice, by two hands."""
    assert TABLES.keys() == test_scenes.TABLES.keys()
    for name, table in TABLES.items():
        mass, inertia, weight, (stretch, shear), (twist, bend) = test_scenes.TABLES[name]
        assert (table.mass, table.inertia, table.weight) == (mass, inertia, weight)
        assert (table.stretch, table.shear, table.twist, table.bend) == (stretch, shear, twist, bend)


def test_implied_ranges_are_errors_over_their_shares():
    ranges = implied_ranges("paper4_pdms_tip_magnet")
    assert ranges["tip", "E2"] == pytest.approx(0.61e-3 / 0.0335)
    assert ranges["tip", "E3"] == pytest.approx(0.55e-3 / 0.0116)
    assert len(implied_ranges("paper6_two_magnets")) == 4


def test_cayley_map_comes_back_with_the_half_only():
    angle = 0.5  # tan(theta/2) of psi = 2 tan(angle/2) with and without the half
    assert cayley_error(0.5) == pytest.approx(0.0, abs=1e-15)
    assert cayley_error(1.0) == pytest.approx(2.0 * math.atan(2.0 * math.tan(angle / 2)) - angle)


# ---- the program


@pytest.fixture(scope="module")
def quick(tmp_path_factory):
    """What `python -m scripts.reproduce_paper --quick` printed, its JSON and its page."""
    folder = tmp_path_factory.mktemp("paper")
    command = [sys.executable, "-m", "scripts.reproduce_paper", "--quick", "--json", str(folder / "a.json")]
    command += ["--figures", str(folder / "figures"), "--page", str(folder / "page.md")]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True)
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout, json.loads((folder / "a.json").read_text()), folder


def test_report_is_well_formed_and_its_checks_are_met(quick):
    printed, report, _ = quick
    assert_well_formed(printed, report, "scripts.reproduce_paper")
    names = {f"experiment_{number}" for number in range(1, 7)}
    names |= {"experiment_4_angle", "scaling", "frequency_section5", "frequency_magnet", "audit", "audit_more", "steps"}
    assert set(report["tables"]) == names
    assert [check["what"] for check in report["checks"] if not check["met"]] == []


def test_page_holds_every_table_and_figure(quick):
    _, report, folder = quick
    page = (folder / "page.md").read_text()
    for table in report["tables"].values():
        assert f"## {table['title']}" in page
    figures = sorted(path.name for path in (folder / "figures").iterdir())
    assert len(figures) == 8
    for name in figures:
        assert f"(figures/{name})" in page


def test_locked_rods_swing_too_fast_by_the_root_of_the_closed_form(quick):
    _, report, _ = quick
    for number, name in ((1, "paper1_aluminium_in_plane"), (2, "paper2_aluminium_out_of_plane")):
        table = report["tables"][f"experiment_{number}"]
        (locked,) = [row for (row,) in columns(table, "nodal")][2:3]
        rod = paper_scene(name).scene.rod
        assert locked / transverse_frequency(rod, 0) == pytest.approx(math.sqrt(paper_scene(name).stiffening), rel=0.02)


def test_effective_modulus_moves_like_the_nodal_element(quick):
    """Where it is defined: ranges of experiments 3 to 5 within a few per cent of the unshaped nodal element's."""
    _, report, _ = quick
    for number, rows, (one, other) in (
        (3, slice(2, 4), ("nodal", "helical, effective E")),
        (4, slice(2, 4), ("nodal", "helical, effective E")),
        (5, slice(0, 3), ("nodal, drag", "helical, effective E, drag")),
    ):
        pairs = np.array(columns(report["tables"][f"experiment_{number}"], one, other)[rows])
        np.testing.assert_allclose(pairs[:, 1] / pairs[:, 0], 1.0, atol=0.04)


def test_audit_finds_the_known_bounds_and_factors(quick):
    _, report, _ = quick
    rows = {row[0]: row[3] for row in report["tables"]["audit"]["rows"]}
    assert rows["Table 3, time step"].startswith("3.26 of the bound; with frequency shaping 0.40")
    assert rows["Table 4, time step"].startswith("6.49 of the bound; with frequency shaping 0.40")
    assert rows["Table 7, time step"].startswith("2.96 of the bound; with frequency shaping 0.67")
    assert "67.8" in rows["section 5, frequency shaping, rod of Table 3"]
    assert "48 mg as printed, 96 mg here" in rows["remark 1, eq. 5 and 16, tip magnet"]
