"""Smoke test of scripts/prediction_filter.py: it runs, and the filter helps its twins."""

import json
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]


def test_quick_run_prints_every_table(tmp_path):
    path = tmp_path / "report.json"
    command = [sys.executable, "-m", "scripts.prediction_filter", "--quick", "--json", str(path)]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True)
    assert done.returncode == 0, done.stdout + done.stderr
    tables = json.loads(path.read_text())["tables"]
    assert tables.keys() == {"tips", "middle", "honesty", "rates", "latency", "weights", "rest", "speeds"}
    columns = tables["tips"]["columns"]
    for row in tables["tips"]["rows"]:
        without, replayed = (
            float(row[columns.index(name)].split(" / ")[0]) for name in ("no frames", "replay, K of all nodes")
        )
        assert replayed < without
    first, last = tables["rest"]["rows"][0], tables["rest"]["rows"][-1]
    assert abs(first[1] - last[1]) < 0.01 * first[1]  # nothing moves: nothing is corrected
