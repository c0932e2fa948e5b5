"""scripts/cameras.py runs, and its quick checks are met."""

import json

from scripts.cameras import PLACES, measure, set_ups
from scripts.common.command import Options


def test_quick_run_meets_its_checks_and_writes_every_table(tmp_path):
    assert measure(Options(quick=True)).finish(tmp_path / "cameras.json")
    report = json.loads((tmp_path / "cameras.json").read_text())
    assert report["quick"] and len(report["checks"]) == 2
    rows = {key: len(table["rows"]) for key, table in report["tables"].items()}
    assert rows == {"places": len(PLACES), "set_ups": len(set_ups()), "hidden": 3, "times": 1}
