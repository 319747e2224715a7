from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from replication import Demos, Maze, demonstrate
from replication.evidence.experiments import Key, method_conditions, set_conditions
from replication.evidence.statistics import compare, holm
from replication.evidence.tables import (
    contrasts_table,
    marked_table,
    means_table,
    pairs_near,
    read_table,
    rows_of,
    sets_table,
    summary_table,
    write_csv,
)
from replication.irl import READINGS
from replication.irl.expectations import visited
from replication.paper.params import Params
from replication.paper.published import TABLE_1
from replication.trials.compute import TRACED_TRIAL
from replication.trials.condition import Condition
from replication.trials.measures import factors
from replication.trials.run import run_trials
from replication.trials.store import Store

MEANS = {"adaboost": 45, "unified": 40, "unified-incorrect": 36}


def made(
    conditions: Mapping[Key, Condition], *, capped: str | None = None, seed: int = 0
) -> pd.DataFrame:
    """Make trials up: each method's iterations scatter around its mean."""
    rng = np.random.default_rng(seed)
    parts = []
    for (_, reading), condition in conditions.items():
        counts = MEANS[condition.method] + rng.integers(-4, 5, size=40)
        if condition.method == "adaboost":
            counts += rng.integers(-12, 13, size=40)
        columns = {
            **factors(condition),
            "trial": np.arange(40),
            "iterations": counts,
            "converged": ((np.arange(40) > 0) | (reading != capped)).astype(int),
            "steps": 1,
        }
        parts.append(pd.DataFrame(columns))
    return pd.concat(parts, ignore_index=True)


@pytest.fixture(scope="module")
def conditions(small_demos: Demos) -> dict[Key, Condition]:
    """Return the conditions of Table I for a small maze."""
    return method_conditions(small_demos, {})


def test_summary_is_that_of_themade(conditions: dict[Key, Condition]) -> None:
    """Mean, SD and quartiles equal those that pandas computes from the rows."""
    trials = made(conditions)
    table = summary_table(trials, TABLE_1)
    assert len(table) == 5
    for (_, row), condition in zip(table.iterrows(), conditions.values(), strict=True):
        counts = rows_of(trials, condition)["iterations"]
        assert row["mean"] == pytest.approx(counts.mean())
        assert row["sd"] == pytest.approx(counts.std())
        assert row["median"] == counts.median()
        assert row["low"] < row["mean"] < row["high"]
        assert row["predicted_low"] < row["paper_mean"] < row["predicted_high"]


def test_capped_trials_are_counted_and_never_averaged(conditions: dict[Key, Condition]) -> None:
    """One trial at the cap withholds the mean and leaves its contrasts without numbers."""
    trials = made(conditions, capped="updated")
    table = summary_table(trials, TABLE_1).set_index("reading")
    assert (table.loc["updated", "capped"] == 1).all()
    assert table.loc["updated", "mean"].isna().all()
    assert table.loc["printed", "mean"].notna().all()
    contrasts = contrasts_table(trials).set_index("reading")
    numbers = contrasts.columns.drop(["x", "y", "n"])
    assert contrasts.loc["updated", numbers].isna().all(axis=None)
    assert contrasts.loc["printed", numbers].notna().all(axis=None)
    assert set(contrasts["n"]) == {40}


def test_contrasts_are_paired_comparisons(conditions: dict[Key, Condition]) -> None:
    """Each row compares two conditions of one reading trial by trial; AdaBoost stands in both."""
    trials = made(conditions)
    trials.loc[trials["reading"] == "updated", "iterations"] += 100
    table = contrasts_table(trials.sample(frac=1.0, random_state=1))
    keys = list(table[["x", "y", "reading"]].itertuples(index=False, name=None))
    pairs = (("unified", "adaboost"), ("unified-incorrect", "unified"))
    assert keys == [(x, y, reading) for x, y in pairs for reading in READINGS]
    for row in table.to_dict("records"):
        one = conditions[row["x"], row["reading"]]
        other = conditions.get((row["y"], row["reading"]), conditions.get((row["y"], "")))
        assert other is not None
        x, y = (rows_of(trials, each)["iterations"] for each in (one, other))
        found = compare(x, y)
        for name in ("difference", "low", "high", "fewer", "sd_ratio", "p", "p_spread"):
            assert row[name] == getattr(found, name)
    against = table[table["y"] == "adaboost"].set_index("reading")["difference"]
    assert against["updated"] - against["printed"] == pytest.approx(100, abs=3)


def test_contrasts_without_a_method_are_left_out(conditions: dict[Key, Condition]) -> None:
    """In robot soccer, where AdaBoost-IRL is not run, there is nothing to compare it with."""
    fewer = {key: one for key, one in conditions.items() if key[0] != "adaboost"}
    table = contrasts_table(made(fewer))
    assert table["x"].tolist() == ["unified-incorrect"] * 2


def test_pairs_near_by_hand() -> None:
    """In a corridor with a bay the marked pairs are counted by hand."""
    maze = Maze.from_text(
        """
        ...
        S.G
        """
    )
    demos = demonstrate("bay", maze)
    kinds = {demo.kind for demo in demos.incorrect}
    assert kinds == {"opposite"}
    # The one incorrect demonstration goes right and back left; right is the expert's own pair.
    assert pairs_near(demos) == {"pairs": 1, "leaving": 1, "beside": 0}


def test_stored_sets_differ_in_nearness(stored_demos: Demos) -> None:
    """Near detours mark more pairs beside the path than far ones; opposite only on it."""
    near, far, opposite = (
        pairs_near(stored_demos.select(kind)) for kind in ("near-detour", "far-detour", "opposite")
    )
    assert near["beside"] > far["beside"]
    assert far["pairs"] > near["pairs"]
    assert opposite["leaving"] == opposite["pairs"]


def test_sets_compare_with_no_incorrect_demonstrations(small_demos: Demos) -> None:
    """Each set's difference is from the empty set of the same reading."""
    sets = set_conditions(small_demos, {})
    table = sets_table(made(sets), sets)
    assert len(table) == len(sets)
    empty = table[table["set"] == "none"].set_index("reading")["mean"]
    for row in table.itertuples():
        assert row.difference == pytest.approx(row.mean - empty[row.reading])
    tested = table["set"] != "none"
    assert table[~tested][["p", "p_holm"]].isna().all(axis=None)
    assert table[tested]["p_holm"].tolist() == holm(table[tested]["p"].tolist()).tolist()


def test_sets_are_compared_over_the_trials_of_all(small_demos: Demos) -> None:
    """Where the default set has more trials than the others, only the common ones count."""
    sets = set_conditions(small_demos, {})
    trials = made(sets)
    few = trials[(trials["trial"] < 9) | trials["set"].isin(["none", "hit+detour"])]
    table = sets_table(few.sample(frac=1.0, random_state=1), sets)
    assert set(table["n"]) == {9}
    pd.testing.assert_frame_equal(table, sets_table(trials[trials["trial"] < 9], sets))


def test_means_have_a_row_for_each_condition(conditions: dict[Key, Condition]) -> None:
    """Means at a glance: whole steps, two decimals, one row a condition."""
    means = means_table(made(conditions, capped="updated"))
    rows = means[["method", "reading"]].itertuples(index=False, name=None)
    assert list(rows) == list(conditions)
    assert set(means["steps"]) == {1}
    assert means["converged"].tolist() == [1.0, 1.0, 1.0, 0.98, 0.98]


def test_marked_pairs_by_iteration(small_demos: Demos, store_path: Path) -> None:
    """Of the pairs that only the agent visits, those are marked that a mistake shows."""
    condition = Condition(
        small_demos, "unified-incorrect", Params.of(episodes=60, horizon=40, max_iterations=9)
    )
    results = run_trials([condition], trials=1, store=Store(store_path), seed=5)
    trial = results.trial(condition, TRACED_TRIAL)
    table = marked_table(trial, condition)
    assert table["decisions"].tolist() == [len(episode.actions) for episode in trial.episodes]
    assert table["error"].tolist() == trial.errors.round(4).tolist()
    assert (table["again"] <= table["marked"]).all()
    assert table["again"].iloc[0] == 0
    expert = visited(condition.selected.correct, shape=condition.agent.shape)
    shown = visited(condition.selected.incorrect, shape=condition.agent.shape)
    for row, (states, actions, _) in zip(table.itertuples(), trial.episodes, strict=True):
        pairs = {*zip(states.tolist(), actions.tolist(), strict=False)}
        wrong = {pair for pair in pairs if not expert[pair]}
        assert (row.wrong, row.marked) == (len(wrong), sum(shown[pair] for pair in wrong))


def test_missing_trials_are_an_error(conditions: dict[Key, Condition]) -> None:
    """A condition without rows is not an empty comparison."""
    trials = made(conditions)
    with pytest.raises(KeyError, match="no trials of small unified printed none"):
        rows_of(trials[trials["method"] == "adaboost"], conditions["unified", "printed"])


# --- files -----------------------------------------------------------------------------------


def test_tables_are_read_as_they_were_written(tmp_path: Path) -> None:
    """Numbers, truth values and words come back; missing numbers are NaN, missing words empty."""
    table = pd.DataFrame(
        {
            "reading": ["", "printed"],
            "why": ["", "nan"],
            "n": [30, 100],
            "effect": [1 / 3, np.nan],
            "p": [np.nan, np.nan],
            "default": [True, False],
            "divergence": [0.5, np.inf],
        }
    )
    path = write_csv(table, tmp_path / "table.csv")
    found = read_table(path)
    assert found.columns.tolist() == table.columns.tolist()
    for name in ("reading", "why", "n", "default"):
        assert found[name].tolist() == table[name].tolist(), name
    for name in ("effect", "p", "divergence"):
        due = pytest.approx(table[name].tolist(), nan_ok=True, rel=1e-9)
        assert found[name].tolist() == due, name
    assert write_csv(found, tmp_path / "again.csv").read_bytes() == path.read_bytes()


def test_readings_are_text_even_if_all_are_empty(tmp_path: Path) -> None:
    """A table of a method without a trace has an empty reading of Eq. 9, not a missing number."""
    table = pd.DataFrame({"reading": ["", ""], "n": [1, 2]})
    assert read_table(write_csv(table, tmp_path / "table.csv"))["reading"].tolist() == ["", ""]
