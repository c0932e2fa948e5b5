"""scripts/estimated_envs.py runs and fills its tables."""

from scripts.common.command import Options
from scripts.estimated_envs import SETTINGS, measure


def test_quick_run_writes_every_table():
    tables = measure(Options(quick=True)).tables
    assert len(tables["errors"].rows) == len(SETTINGS)
    assert len(tables["cost"].rows) == 1
