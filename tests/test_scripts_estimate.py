"""scripts/estimate.py: its truths are what they say, its stand-ins do what they say, its tables and checks can fail."""

import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from magrod_env import Simulation
from magrod_env.estimation import Measurement
from scripts.common.report import Report
from scripts.estimation import studies, tables
from scripts.estimation.follow import FramesAlone, follow
from scripts.estimation.twins import AIR, CASES, NOISE, Truth, brake, make, model_start, truth_options

ROOT = Path(__file__).resolve().parents[1]
RELEASED, BENT = CASES[2], CASES[3]


def test_cases_are_the_papers_experiments_in_order():
    assert [case.record.name[5] for case in CASES] == list("123456")
    assert [case.durations[0] for case in CASES[2:4]] == [case.record.duration for case in CASES[2:4]]
    assert all(case.rate == 100 for case in CASES[2:])


def test_truth_is_finer_damped_and_runs_by_another_integrator():
    model = model_start(RELEASED)
    truth = Simulation(RELEASED.scene, **truth_options(RELEASED, Truth()))
    assert truth.num_elements == 3 * model.num_elements and truth.integrator != model.integrator
    twin, other = make(RELEASED, Truth(), True), make(RELEASED, Truth(0.8), True)
    free = Simulation(RELEASED.scene, **RELEASED.settings)
    free.advance(0.3)
    assert 1e-4 < np.linalg.norm(twin.positions[-1, 0] - free.tip_position[0]) < 5e-3  # damping alone
    assert np.linalg.norm(other.positions[-1, 0] - free.tip_position[0]) > 1e-3  # and the modulus


def test_air_slows_a_body_as_the_closed_form_says():
    simulation = Simulation(RELEASED.scene, **RELEASED.settings)
    velocities = np.zeros((1, 7, 3))
    velocities[:, 1:, 2] = 0.7
    simulation.set_motion(velocities)
    for _ in range(100):
        brake(simulation, 0.01)
    np.testing.assert_allclose(simulation.velocities[0, 1:, 2], 1.0 / (1.0 / 0.7 + AIR * 1.0), rtol=1e-9)


def test_truth_with_a_load_parts_from_the_other_halfway():
    plain, loaded = (make(BENT, Truth(load=load), True).positions[:, 0] for load in (False, True))
    half = len(plain) // 2
    np.testing.assert_array_equal(plain[: half + 1], loaded[: half + 1])
    assert np.linalg.norm(plain[-1] - loaded[-1]) > 1e-3


def test_model_starts_where_the_experiment_does():
    x, _, z = model_start(BENT).tip_position[0]
    assert np.degrees(np.arctan2(z, x)) == pytest.approx(-41.74, abs=0.1)
    assert model_start(CASES[0]).tip_position[0, 2] == pytest.approx(0.2 * np.sin(np.radians(3.69)), rel=0.01)


@pytest.mark.parametrize("way", ["printed", "paper", "ensemble"])
def test_estimators_begin_at_the_known_shape(way):
    run = follow(BENT, make(BENT, Truth(), True), way, noise=None, num_rods=1)
    distance = 1e3 * np.linalg.norm(run.positions[0, 0, :, :], axis=-1)
    assert distance.max() < 0.3  # mm, of a shape that is 38 mm off straight
    lost = follow(BENT, make(BENT, Truth(), True), way, noise=None, num_rods=1, known_start=False, delay=0.2)
    assert 1e3 * np.linalg.norm(lost.positions[0, 0, 0]) > 30.0


def test_frames_alone_hold_extend_and_say_nothing_of_the_unseen():
    held, extended = FramesAlone(RELEASED, 1, False), FramesAlone(RELEASED, 1, True)
    for frames in (held, extended):
        assert np.isnan(frames.positions).all()
        for k in range(2):
            seen = np.array([[[0.06, 0.0, -0.002 * k]]])
            frames.update(Measurement(positions=seen, covariance=NOISE**2 * np.eye(3), time=0.01 * k))
            frames.predict(np.zeros(3), 0.01)
    frames.predict(np.zeros(3), 0.01)
    assert held.positions[0, 0, 2] == pytest.approx(-0.002)
    assert extended.positions[0, 0, 2] == pytest.approx(-0.002 - 0.2 * 0.02)
    assert np.isnan(held.positions[0, 1]).all()


def test_figures_are_those_of_a_known_error():
    twin = make(RELEASED, Truth(), True)
    run = follow(RELEASED, twin, "held", noise=None)
    told = studies.figures(run)
    last = np.repeat(np.arange(0, len(twin.times), 4), 4)[: len(twin.times)]
    by_hand = 1e3 * np.abs(twin.positions[last, 0] - twin.positions[:, 0])
    np.testing.assert_allclose(told["mean"][0][:3], by_hand.mean(axis=0), atol=1e-12)
    np.testing.assert_allclose(told["largest"][0][:3], by_hand.max(axis=0), atol=1e-12)
    assert told["frames"][0][:3] == [0.0, 0.0, 0.0] and told["mean"][1] == [None] * 4


def found_with(mean):
    """Runs of experiment 3, all with this mean error, mm."""
    run = {kind: [[mean] * 4] * 2 for kind in ("mean", "frames", "largest")}
    return {(3, truth.name, way): run for truth in studies.TRUTHS for way in studies.WAYS}


@pytest.mark.parametrize(("mean", "paper", "ensemble"), [(0.02, True, True), (0.04, True, False), (0.06, False, False)])
def test_checks_compare_with_table_8_and_can_fail(mean, paper, ensemble):
    report = Report("scripts.estimate", True)
    tables.table_8(report, found_with(mean))
    met = {check.figure: check.met for check in report.checks}
    assert met == {"paper's filter": paper, "paper's filter, right modulus": paper, "ensemble filter": ensemble}
    assert sorted({check.bound for check in report.checks}) == pytest.approx([0.025, 0.05])


def test_a_figure_is_over_the_truths_of_an_element_or_of_one():
    found = found_with(0.0)
    for factor, mean in ((0.8, 1.0), (1.0, 2.0), (1.2, 6.0)):
        found[3, Truth(factor).name, "paper"] = {"mean": [[mean] * 4] * 2, "largest": [[mean] * 4] * 2}
    assert tables.over(found, 3, "paper", "mean", "tip", "z") == pytest.approx(3.0)
    assert tables.over(found, 3, "paper", "largest", "tip", "z") == 6.0
    assert tables.over(found, 3, "paper", "mean", "tip", "z", tables.TUNED) == 2.0
    assert tables.over(found, 3, "paper", "mean", "tip", "z", "nodal") == 0.0


def test_a_run_that_diverged_meets_no_check():
    report = Report("scripts.estimate", True)
    tables.table_8(report, found_with(None))
    assert all(check.met is None for check in report.checks)


def test_quick_run_prints_every_table_and_is_resumed(tmp_path):
    keep, path = tmp_path / "runs.jsonl", tmp_path / "report.json"
    command = [sys.executable, "-m", "scripts.estimate", "--quick", "--keep", str(keep), "--json", str(path)]
    command += ["--figures", str(tmp_path), "--page", str(tmp_path / "page.md")]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True)
    assert done.returncode == 0, done.stdout + done.stderr
    told = json.loads(path.read_text())["tables"]
    assert told.keys() == {"table_8", "truths", "unseen", "why", "metal", "trouble", "speed", "work"}
    columns = told["truths"]["columns"]
    for row in told["truths"]["rows"]:  # every estimator is of use; the ensemble beats the frames
        means = dict(zip(columns, row))
        assert means["paper's filter"] < means["model alone"] or "nodal" in row[1]
        assert means["ensemble filter"] < means["last two frames extended"]
    drawn = {each.name for each in tmp_path.glob("*.png")}
    assert drawn == {"estimate_errors.png", "estimate_trouble.png", "estimate_work.png"}
    lines = keep.read_text()
    subprocess.run(command, cwd=ROOT, capture_output=True, check=True)
    assert keep.read_text() == lines
