from __future__ import annotations

from pathlib import Path

import pandas as pd

from replication import Demos
from replication.evidence.experiments import conditions_of
from replication.trials.measures import measure_trials
from replication.trials.run import run_trials
from replication.trials.store import Store
from replication.trials.table import Group, computed_table, planned_table


def test_what_is_computed_is_what_was_planned(small_demos: Demos, store_path: Path) -> None:
    """The plan's rows are the table's, in order, each once, with the labels of the group first."""
    conditions = list(conditions_of(small_demos, {"episodes": 60, "horizon": 40}).values())
    groups = [
        Group(conditions[:2], 3, {"part": "a", "number": 0}),
        Group(conditions[1:], 2, {"part": "b", "number": 0}),
    ]
    store = Store(store_path)
    table = computed_table(groups, errors=True, store=store, seed=5)
    planned = planned_table(groups, 5)
    assert table.columns.tolist()[:2] == ["part", "number"]
    pd.testing.assert_frame_equal(table[list(planned)], planned)
    assert table["part"].tolist() == ["a"] * 6 + ["b"] * 16
    results = run_trials(conditions, trials=3, store=store, seed=5)
    expected = measure_trials(results, conditions[:2], errors=True)
    pd.testing.assert_frame_equal(table.head(6).drop(columns=["part", "number"]), expected)


def test_equal_trials_without_labels_are_one_row(small_demos: Demos, store_path: Path) -> None:
    """A condition of two groups, as the default set of incorrect demonstrations, is there once."""
    conditions = list(conditions_of(small_demos, {"episodes": 60, "horizon": 40}).values())
    groups = [Group(conditions[:2], 3), Group(conditions[1:2], 2)]
    assert len(planned_table(groups, 5)) == 6
    assert len(computed_table(groups, store=Store(store_path), seed=5)) == 6
