"""Smoke tests of scripts/ensemble_twins.py: its tables on runs of a few frames, and the members it compares with."""

import numpy as np
import pytest

from scripts.common.report import Report
from scripts.ensemble_twins import Members, PlainMembers, accuracy, cost, lateness, make_twin, mixing, sudden_load


@pytest.mark.parametrize(
    ("table", "make", "count"),
    [
        ("accuracy", lambda report, count: accuracy(report, count, 1), 3),
        ("lateness", lambda report, count: lateness(report, count, 1), 8),
        ("load", lambda report, count: sudden_load(report, count, 1), 80),
        ("mixing", mixing, 3),
        ("cost", cost, 3),
    ],
)
def test_a_table_has_figures_in_every_row(table, make, count):
    report = Report("scripts.ensemble_twins", True)
    make(report, count)
    rows = report.tables[table].rows
    assert rows and all(len(row) == len(report.tables[table].columns) for row in rows)
    assert sum(value is None for row in rows for value in row) < 0.3 * sum(len(row) for row in rows)


def test_a_twin_is_off_the_model_by_more_than_the_noise():
    twin = make_twin("release", 0.8, 10)
    assert twin.tips.shape == (11, 3) and twin.blind[-1] > 5e-4


def test_members_mixed_by_nodes_are_put_back_where_they_were():
    members = Members(make_twin("circle", 1.0, 1).scene, {}, 1, 8, 4, {"num_elements": 4, "num_threads": 1})
    members.advance(np.array([[0.0, 5e-3, 9e-3]]), 0.1)
    members.__class__ = PlainMembers
    before = members.simulation.positions, members.simulation.rotations
    members.join(*members.split())
    for found, expected in zip((members.simulation.positions, members.simulation.rotations), before):
        np.testing.assert_allclose(found, expected, atol=1e-12)
