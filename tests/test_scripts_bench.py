"""Smoke tests of scripts/bench.py and scripts/accuracy.py: they run, and what they write has the promised shape."""

import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from scripts.common.cases import CASES, LOADED, STATICS
from scripts.common.report import Check, Report, Table, text_of
from scripts.common.run import least_time
from scripts.common.store import Store
from tests.reference.cases import DYNAMIC, STATIC, TWIST_AND_TENSION

ROOT = Path(__file__).resolve().parents[1]


def run_quick(program, folder):
    """What `python -m program --quick --json FILE` printed and wrote."""
    path = folder / "report.json"
    command = [sys.executable, "-m", program, "--quick", "--json", str(path)]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True)
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout, json.loads(path.read_text())


@pytest.fixture(scope="module")
def accuracy(tmp_path_factory):
    return run_quick("scripts.accuracy", tmp_path_factory.mktemp("accuracy"))


@pytest.fixture(scope="module")
def bench(tmp_path_factory):
    return run_quick("scripts.bench", tmp_path_factory.mktemp("bench"))


def columns(table, *names):
    """Some columns of a table, row by row."""
    return [tuple(row[table["columns"].index(name)] for name in names) for row in table["rows"]]


def assert_well_formed(printed, report, program):
    """The JSON holds the run's facts, and every table has full rows and was printed."""
    assert report["program"] == program and report["quick"] is True
    assert report["command"].startswith(f"python -m {program} --quick")
    assert {"date", "platform", "processor", "cores", "load_average", "python", "numpy", "numba"} <= set(
        report["machine"]
    )
    for table in report["tables"].values():
        assert f"### {table['title']}" in printed
        assert table["rows"] and all(len(row) == len(table["columns"]) for row in table["rows"])
    for check in report["checks"]:
        assert {"figure", "what", "value", "bound", "unit", "met", "timing"} <= set(check)


def test_accuracy_report_is_well_formed(accuracy):
    assert_well_formed(*accuracy, "scripts.accuracy")
    tables = {"free_decay", "driven", "statics", "energy", "order_in_time", "arc", "locking", "loaded_rods"}
    assert set(accuracy[1]["tables"]) == tables


def test_accuracy_figures_are_met(accuracy):
    checks = accuracy[1]["checks"]
    assert {check["figure"] for check in checks} == {"a", "c", "d", "e", "f", "g"}
    assert [check["what"] for check in checks if not check["met"]] == []


def test_accuracy_states_errors_in_millimetres_beside_run_times(accuracy):
    decay = columns(accuracy[1]["tables"]["free_decay"], "element", "N", "RMS, mm", "ms/s")
    errors = {(element, elements): error for element, elements, error, _ in reversed(decay)}  # default steps come first
    assert errors["helical", 6] <= 0.15 and errors["helical", 10] <= 0.04  # the figures of issue 2
    assert errors["nodal", 10] > 10.0  # locks: it swings less than half as far
    assert all(wall > 0.0 for *_, wall in decay)
    ((driven,),) = columns(accuracy[1]["tables"]["driven"], "RMS, mm")
    assert driven <= 0.02  # N = 6; measured 0.008 over 2 s


def test_accuracy_of_equilibria_rises_with_the_elements(accuracy):
    rows = columns(accuracy[1]["tables"]["statics"], "element", "10 mT up and 10 mT aside")
    errors = [error for element, error in rows if element == "helical"]
    assert errors == sorted(errors, reverse=True) and errors[-1] < 1e-3


def assert_same_rod(scene, case):
    """The scene of the package is the reference's case."""
    rod = scene.rod
    found = (rod.length, rod.area, rod.second_moment, rod.density, rod.youngs_modulus, scene.drag_rate or 0.0)
    found += (rod.poissons_ratio,)
    truth = (case.length, case.area, case.second_moment, case.density, case.youngs_modulus, case.drag)
    truth += (case.poisson_ratio,)
    np.testing.assert_allclose(found, truth, rtol=1e-12)
    np.testing.assert_array_equal(scene.gravity or np.zeros(3), case.gravity)
    assert len(scene.magnets) == len(case.magnets)
    for magnet, expected in zip(scene.magnets, case.magnets):
        np.testing.assert_allclose((magnet.position, magnet.mass), (expected.s, expected.mass), rtol=1e-12)
        np.testing.assert_allclose(magnet.dipole_moment, expected.dipole, rtol=1e-9, atol=1e-12)  # rounding of mu0


def test_accuracy_scenes_are_those_of_the_reference():
    assert CASES.keys() == DYNAMIC.keys() and STATICS.keys() == STATIC.keys()
    for name, (scene, field) in CASES.items():
        assert_same_rod(scene, DYNAMIC[name])
        for at in np.linspace(0.0, 2.0, 9):
            np.testing.assert_allclose(np.zeros(3) if field is None else field(at), DYNAMIC[name].field(at), atol=1e-15)
    for name, field in STATICS.items():
        np.testing.assert_array_equal(field, STATIC[name])


def test_accuracy_scenes_of_twist_and_tension_are_those_of_the_reference():
    assert LOADED.keys() == TWIST_AND_TENSION.keys()
    for name, loaded in LOADED.items():
        case = TWIST_AND_TENSION[name]
        assert_same_rod(loaded.scene, case)
        np.testing.assert_allclose(loaded.field, case.field(0.0), rtol=1e-12)
        np.testing.assert_array_equal(np.zeros((3, 3)) if loaded.gradient is None else loaded.gradient, case.gradient)


def test_bench_report_is_well_formed(bench):
    assert_well_formed(*bench, "scripts.bench")
    assert set(bench[1]["tables"]) == {
        "first_step",
        "targets",
        "environments",
        "kernels",
        "features",
        "rods",
        "elements",
        "frames",
        "memory",
    }
    assert [check["figure"] for check in bench[1]["checks"]] == ["g", "g", "error", "error", "speed"]
    assert all(check["timing"] == (check["figure"] != "error") for check in bench[1]["checks"])


def test_configurations_that_are_timed_are_exact_enough(bench):
    assert [check["what"] for check in bench[1]["checks"] if check["figure"] == "error" and not check["met"]] == []


def test_bench_speeds_are_positive(bench):
    tables = bench[1]["tables"]
    for key, name in (("environments", "float64, steps/s"), ("kernels", "ns per step"), ("frames", "frames a second")):
        assert all(value > 0.0 for (value,) in columns(tables[key], name))


def test_bench_memory_of_a_rod_is_about_a_kilobyte(bench):
    ((rods, held),) = columns(bench[1]["tables"]["memory"], "rod's state and constants", "held")
    assert 1000.0 < rods < 2000.0  # N = 5: about 150 numbers of 8 bytes
    assert rods < held < 10 * rods


def test_check_knows_both_directions_and_unmeasured_values():
    assert Check("x", "", 1.0, 2.0, "").met is True and Check("x", "", 3.0, 2.0, "").met is False
    assert Check("x", "", 3.0, 2.0, "", at_least=True).met is True
    assert Check("x", "", None, 2.0, "").met is None


def test_table_is_markdown():
    text = Table("Speeds", ("name", "value"), [("a", 12345.6), ("b", None), ("c", 0.001234)], "note").markdown()
    assert text.splitlines()[0] == "### Speeds" and text.endswith("note")
    assert "| a    | 12,346  |" in text and "| b    | -       |" in text and "| c    | 0.00123 |" in text


def test_least_time_is_that_of_one_call():
    calls = []
    seconds = least_time(lambda: calls.append(None), repeats=2, duration=1e-4)
    assert 0.0 < seconds < 1e-3 and len(calls) >= 4


def test_scripts_import_nothing_from_tests():
    for path in (ROOT / "scripts").rglob("*.py"):
        assert "import tests" not in path.read_text() and "from tests" not in path.read_text(), path


PAGES = ("speed", "precision", "reproduction", "tolerance", "stability", "estimation")


@pytest.mark.parametrize("page", PAGES)
def test_page_keeps_its_text_and_takes_new_tables(page, tmp_path):
    source = ROOT / "docs" / f"{page}.md"
    report = Report("scripts.test", True, source.name, unlisted=("hidden",))
    for key in ("shown", "hidden"):
        with report.table(key, f"Table {key}", "a | b") as table:
            table.add(1, None)
    report.figures["shown"] = tmp_path / "shown.png"
    report.write_page(tmp_path / "page.md")
    written = (tmp_path / "page.md").read_text()
    assert written.startswith(text_of(source)) and text_of(tmp_path / "page.md") == text_of(source)
    assert "![Table shown](shown.png)\n\n## Table shown" in written and "hidden" not in written
    assert written.rstrip().splitlines()[-1].startswith("- command: `python -m scripts.test")


def test_page_without_its_marker_is_refused(tmp_path):
    (tmp_path / "page.md").write_text("# Text")
    with pytest.raises(ValueError, match="must hold the line"):
        text_of(tmp_path / "page.md")


def test_stored_results_are_found_again_and_not_made_anew(tmp_path):
    path, made = tmp_path / "kept" / "lines.jsonl", []
    store = Store(path, Check)
    first = store.get("a", lambda: made.append("a") or Check("x", "y", 1.0, 2.0))
    assert store.get("a", lambda: made.append("again")) is first
    assert Store(path, Check).results == {"a": first} and made == ["a"]
    assert len(path.read_text().splitlines()) == 1
