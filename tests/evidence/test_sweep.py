from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from replication import Demos
from replication.evidence import sweep
from replication.evidence.experiments import NAMED, NONE, conditions_of
from replication.evidence.sweep import ablations_table, numbers_table
from replication.evidence.tables import pairs_near
from replication.irl import READINGS
from replication.irl.methods import TRACES
from replication.trials.measures import measure_trials
from replication.trials.store import Store
from replication.trials.table import computed_table, planned_table
from tests.evidence.conftest import FEW, Run


def test_limits_reach_the_plan() -> None:
    """A quick look has so many specifications of a part, and so many trials of each condition."""
    groups = sweep.plan(most_trials=3, most_specifications=1)
    parts = [group.labels["part"] for group in groups]
    assert [parts.count(part) for part in ("mazes", "factorial", "soccer")] == [1, 1, 1]
    assert {group.trials for group in groups} == {3}
    full = sweep.plan(most_trials=1000, most_specifications=2)
    assert {group.labels["part"]: group.trials for group in full} == sweep.TRIALS
    table = planned_table(groups, 7)
    assert set(table["seed"]) == {7}
    first = table[(table["part"] == "mazes") & (table["number"] == 0)]
    assert len(first) == 9  # three methods, under one reading of Eq. 9 and with one set


def test_effects_are_those_of_a_part(tmp_path: Path) -> None:
    """The claims declared for a part are evaluated under its own specifications."""
    groups = sweep.plan(most_trials=3, most_specifications=1)
    mazes = [group for group in groups if group.labels["part"] == "mazes"]
    trials = computed_table(mazes, store=Store(tmp_path / "trials.sqlite"), seed=7)
    others = trials.assign(part="factorial", iterations=0)
    table = sweep.effects(pd.concat([others, trials]), "mazes")
    assert table["claim"].tolist() == list(sweep.PLAN.mazes.claims)
    assert set(table["specification"]) == {"default"}
    assert set(table["n"]) == {3}
    assert table.equals(sweep.effects(trials, "mazes"))


def test_ablations_are_summaries_of_the_trials(tiny: Run) -> None:
    """Each row has the mean, SD and median of its own trials, and counts those at the cap."""
    results, conditions = tiny
    every = [condition for run in conditions.values() for condition in run.values()]
    trials = pd.concat(
        measure_trials(results, [condition]).assign(number=number)
        for number, condition in enumerate(every)
    )
    names = [f"choice {number}" for number in range(len(every))]
    table = ablations_table(trials, names)
    assert table["choices"].tolist() == names
    assert table["method"].tolist() == [condition.method for condition in every]
    first = trials.loc[trials["number"] == 0, "iterations"].to_numpy()
    for row, (_, own) in zip(table.itertuples(), trials.groupby("number"), strict=True):
        counts = own["iterations"].to_numpy()
        assert (row.n, row.capped) == (6, (own["converged"] == 0).sum())
        assert (row.mean, row.median) == (counts.mean(), np.median(counts))
        assert row.sd == pytest.approx(counts.std(ddof=1))
        assert row.low <= row.mean <= row.high
        assert row.more == pytest.approx((counts - first).mean())
        assert row.more_low <= row.more <= row.more_high
    assert (table.loc[0, ["more", "more_low", "more_high"]] == 0).all()
    assert table["capped"].iloc[-1] > 0


def test_numbers_save_against_none(small_demos: Demos, tiny: Run) -> None:
    """What n incorrect demonstrations save is against none, over the same seeds and reading."""
    results, _ = tiny
    usual = conditions_of(small_demos, FEW, sets=[NAMED])
    conditions = {
        (n, f): usual["unified-incorrect" if n else "unified", f, NAMED if n else NONE]
        for n in (0, 9)
        for f in (READINGS if n else TRACES)
    }
    measured = [
        measure_trials(results, [condition]).assign(number=place)
        for place, condition in enumerate(conditions.values())
    ]
    trials = pd.concat(measured)
    table = numbers_table(trials, conditions, paper=3.62)
    assert set(table["paper"]) == {3.62}
    assert list(zip(table["number"], table["reading"], strict=True)) == list(conditions)
    places = {key: place for place, key in enumerate(conditions)}
    for row in table.itertuples():
        base = "updated" if row.reading == "updated" else "printed"
        counts, none = (
            measured[places[key]]["iterations"] for key in ((row.number, row.reading), (0, base))
        )
        saved = none - counts
        assert (row.mean, row.saved) == (counts.mean(), saved.mean())
        assert row.low <= row.mean <= row.high
        assert row.saved_low <= row.saved <= row.saved_high
        near = pairs_near(conditions[row.number, row.reading].selected)
        assert (row.pairs, row.leaving) == (near["pairs"], near["leaving"])
        assert row.capped == (measured[places[row.number, row.reading]]["converged"] == 0).sum()
    first = table[table["number"] == 0]
    assert (first[["pairs", "saved", "saved_low", "saved_high"]] == 0).all(axis=None)
