"""scripts/tolerance.py: its random trials are what they say, it measures what it says, and it runs and resumes."""

import json
import math
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from magrod_env.simulation.resolution import Resolution
from scripts.tolerance.scenes import FAMILIES, LARGEST_FIELD, LOADS, NUM_RODS, field_course, make_trial
from scripts.tolerance.trial import Record, cost, distances, finer, measure, simulate

ROOT = Path(__file__).resolve().parents[1]
TRIALS = [make_trial(7, index) for index in range(60)]


def test_trial_follows_from_seed_and_index_alone():
    again = make_trial(7, 11)
    assert again.scene == TRIALS[11].scene and again.plane == TRIALS[11].plane
    np.testing.assert_array_equal(again.fields, TRIALS[11].fields)
    assert make_trial(8, 11).scene != again.scene


def test_families_take_turns_and_keep_their_ranges():
    assert [trial.family for trial in TRIALS[:8]] == 2 * list(FAMILIES)
    for trial in TRIALS:
        family, rod = FAMILIES[trial.family], trial.scene.rod
        for value, (low, high) in (
            (rod.youngs_modulus, family.youngs_modulus),
            (rod.width, family.diameter),
            (rod.length, family.length),
            (rod.density, family.density),
            (rod.poissons_ratio, family.poissons_ratio),
        ):
            assert low * (1 - 1e-12) <= value <= high * (1 + 1e-12)


def test_magnets_are_where_and_as_large_as_stated():
    assert {len(trial.scene.magnets) for trial in TRIALS} == {1, 2, 3}
    for trial in TRIALS:
        length, (low, high) = trial.scene.rod.length, FAMILIES[trial.family].magnet_diameter
        tip, *others = trial.scene.magnets
        assert tip.position == length and tip.direction == (1.0, 0.0, 0.0)
        places = sorted(magnet.position / length for magnet in others)
        assert all(0.3 <= place <= 0.8 for place in places)
        assert len(places) < 2 or places[1] - places[0] >= 0.1 - 1e-12
        for magnet in trial.scene.magnets:
            assert low <= magnet.diameter / trial.scene.rod.width <= high
            volume = math.pi / 4.0 * magnet.diameter**2 * magnet.length
            assert magnet.mass == pytest.approx(7500.0 * volume)
            assert 1.2 <= magnet.moment * 4e-7 * math.pi / volume <= 1.4
    assert {magnet.direction[0] for trial in TRIALS for magnet in trial.scene.magnets} == {-1.0, 1.0}


def test_fields_stay_within_the_expected_field_and_the_plane():
    assert {trial.plane for trial in TRIALS} == {None, "xz"}
    for trial in TRIALS:
        assert trial.fields.shape == (100, NUM_RODS, 3)
        largest = np.linalg.norm(trial.fields, axis=2).max(axis=0)
        assert np.all(largest <= trial.magnitude * (1 + 1e-12)) and np.all(largest >= 0.5 * trial.magnitude)
        if trial.plane == "xz":
            assert not trial.fields[:, :, 1].any()
        simulate(trial)  # would refuse a scene that leaves its plane


def test_loads_are_in_range_unless_the_field_would_be_too_strong():
    for trial in TRIALS:
        assert trial.magnitude <= LARGEST_FIELD and trial.load <= LOADS[1] * (1 + 1e-12)
        assert trial.load >= LOADS[0] * (1 - 1e-12) or trial.magnitude == LARGEST_FIELD


def test_field_course_starts_from_nothing():
    course = field_course(np.random.default_rng(3), planar=False)
    assert np.linalg.norm(course[0]) < 0.05 and np.linalg.norm(np.diff(course, axis=0), axis=1).max() < 0.6


def test_finer_has_more_elements_less_conditioning_and_shorter_steps():
    coarse = simulate(TRIALS[1], num_elements=5, axial_softening=9.0, rotary_scaling=17.0)
    fine = finer(TRIALS[1], coarse)
    assert fine.resolution == Resolution(
        num_elements=10, time_step=fine.time_step, axial_softening=2.0, rotary_scaling=3.0
    )
    assert fine.time_step <= 0.5 * coarse.time_step and cost(fine) > 4.0 * cost(coarse) * 0.99


def test_distances_are_rms_and_infinite_where_a_rod_was_lost():
    truth = np.zeros((4, 3, 3))
    found = truth.copy()
    found[:, 0, 1], found[:2, 1, 2], found[3, 2] = 2.0, 1.0, np.nan
    np.testing.assert_array_equal(distances(found, truth), [2.0, math.sqrt(0.5), np.inf])


def test_refusal_and_too_dear_a_reference_are_told_apart():
    trial = TRIALS[0]
    assert measure(trial, 1e-12, budget=1e9).outcome == "refused"
    dear = measure(trial, 1e-3, budget=1.0)
    assert dear.outcome == "too dear" and math.isnan(dear.error) and dear.reference_cost > dear.cost


def test_record_with_a_lost_rod_has_an_infinite_error():
    facts = {"plane": None, "num_magnets": 1, "load": 1.0, "magnitude": 0.1, "outcome": "measured", "choosing_time": 1}
    record = Record(seed=0, index=0, family="NiTi wire", tolerance=1e-3, errors=[1e-4, None], doubt=2e-3, **facts)
    assert record.error == math.inf and record.sensitive


@pytest.fixture(scope="module")
def quick(tmp_path_factory):
    """What `python -m scripts.tolerance --quick` printed and wrote on two scenes, and the command."""
    folder = tmp_path_factory.mktemp("tolerance")
    command = [sys.executable, "-m", "scripts.tolerance", "--quick", "--scenes", "2", "--json", str(folder / "a.json")]
    command += ["--resume", str(folder / "lines.jsonl")]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True)
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout, folder, command


def test_report_is_well_formed(quick):
    printed, folder, _ = quick
    report = json.loads((folder / "a.json").read_text())
    assert report["program"] == "scripts.tolerance" and report["quick"] is True
    assert set(report["tables"]) == {"promises", "broken", "prices", "references"}
    for table in report["tables"].values():
        assert f"### {table['title']}" in printed
        assert all(len(row) == len(table["columns"]) for row in table["rows"])
    assert [check["met"] for check in report["checks"]] == [True, True]


def test_one_line_a_scene_and_tolerance_and_none_is_measured_twice(quick):
    _, folder, command = quick
    lines = (folder / "lines.jsonl").read_text()
    records = [Record(**json.loads(line)[1]) for line in lines.splitlines()]
    assert [(each.tolerance, each.index) for each in records] == [(1e-3, 0), (1e-3, 1), (1e-4, 0), (1e-4, 1)]
    for each in records:
        assert each.outcome == "measured" and 0.0 < each.error <= each.tolerance and not each.sensitive
        assert each.best_cost is None or each.cost >= 0.5 * each.best_cost
    assert records[2].cost > records[0].cost and records[2].error < records[0].error
    subprocess.run(command, cwd=ROOT, capture_output=True, check=True)
    assert (folder / "lines.jsonl").read_text() == lines
