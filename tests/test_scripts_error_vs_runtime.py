"""The comparison of error against run time: its bookkeeping, its ablations, and a quick run of it."""

import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from scripts import precision
from scripts.common.store import Store
from scripts.peers import Problem
from scripts.precision.outcomes import Outcome, cheapest, front
from scripts.precision.trials import SAMPLES, Setup, build, independent, trials

ROOT = Path(__file__).resolve().parents[1]


def outcome(wall, error, line="helical"):
    return Outcome("scene", "magrod", line, f"{wall}", error, wall)


def test_front_holds_what_nothing_beats():
    runs = [outcome(1.0, 1.0), outcome(2.0, 2.0), outcome(2.0, 0.5), outcome(3.0, 0.5), outcome(None, None)]
    assert [(o.wall, o.error) for o in front(runs)] == [(1.0, 1.0), (2.0, 0.5)]


def test_cheapest_is_the_quickest_within_the_error():
    runs = [outcome(1.0, 1.0), outcome(2.0, 0.05), outcome(5.0, 0.01), outcome(None, None)]
    assert cheapest(runs, 0.06).wall == 2.0
    assert cheapest(runs, 0.001) is None


def test_finished_runs_are_kept_and_found_again(tmp_path):
    store = Store(tmp_path / "kept" / "runs.jsonl", Outcome)
    for each in (outcome(1.0, 0.5), outcome(None, None, line="nodal")):
        store.keep(each.key, each)
    assert Store(tmp_path / "kept" / "runs.jsonl", Outcome).results == store.results and len(store.results) == 2


@pytest.mark.parametrize("trial", trials(), ids=lambda trial: trial.name)
def test_every_scene_has_an_independent_reference(trial):
    tips = independent(trial.name)
    assert tips.shape == (SAMPLES, 3)
    np.testing.assert_allclose(tips[0], [trial.scene.rod.length, 0.0, 0.0], atol=1e-12)


@pytest.mark.parametrize("number", [4, 5, 6], ids=["fast_step", "aluminium", "niti"])
def test_our_scenes_are_those_of_the_reference(number):
    """Ten elements come within a hundredth of the swing."""
    trial = trials()[number]
    tips = precision.trace(build(trial, Setup("helical", {"num_elements": 10})), trial)
    truth = independent(trial.name)
    assert np.sqrt(np.mean(np.sum((tips - truth) ** 2, axis=-1))) < 0.01 * np.ptp(truth, axis=0).max()


def test_leaving_out_the_corrections_gives_shear_and_trapezoidal_masses():
    trial = trials()[0]
    rod = trial.scene.rod
    bare = build(trial, Setup("", {"num_elements": 4}, without=("flexibility", "masses")))
    whole = rod.mass_per_length * rod.length / 4.0
    np.testing.assert_allclose(bare.node_masses[0, 1:], [whole] * 3 + [whole / 2 + trial.scene.magnets[0].mass])
    assert bare.stable_time_step < build(trial, Setup("", {"num_elements": 4})).stable_time_step


def test_peers_get_the_same_rod():
    trial = trials()[1]
    told = Problem(trial.scene, trial.field)
    assert told.scene is trial.scene and told.drag_rate == 5.0 and not told.twists and not told.gravity.any()
    np.testing.assert_array_equal(told.field_at(trial.times[:3]), [trial.field(at) for at in trial.times[:3]])


def test_quick_run_writes_tables_and_figures(tmp_path):
    command = [sys.executable, "-m", "scripts.error_vs_runtime", "--quick", "--no-peers", "--scene", "rotating_field"]
    command += [
        "--json",
        str(tmp_path / "report.json"),
        "--figures",
        str(tmp_path),
        "--page",
        str(tmp_path / "page.md"),
    ]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True)
    assert done.returncode == 0, done.stdout + done.stderr
    report = json.loads((tmp_path / "report.json").read_text())
    rows = report["tables"]["rotating_field"]["rows"]
    errors = {(row[1], row[2]): row[3] for row in rows}
    assert errors["helical, default step", "num elements 6"] < 0.006  # mm
    assert errors["nodal (paper)", "num elements 10, 0.9 of the bound"] > 1.0
    assert (tmp_path / "precision_rotating_field.png").stat().st_size > 10_000
    assert "precision_rotating_field.png" in (tmp_path / "page.md").read_text()
