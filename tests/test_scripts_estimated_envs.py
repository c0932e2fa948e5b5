"""scripts/estimated_envs.py runs and fills its tables."""

import json

from scripts.estimated_envs import SETTINGS, Args, main


def test_quick_run_writes_every_table(tmp_path):
    assert main(Args(quick=True, json=tmp_path / "estimated.json"))
    tables = json.loads((tmp_path / "estimated.json").read_text())["tables"]
    assert len(tables["errors"]["rows"]) == len(SETTINGS)
    assert len(tables["cost"]["rows"]) == 1
