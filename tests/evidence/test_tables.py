from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from replication import Demos, Maze, demonstrate
from replication.evidence.experiments import GENERAL, NAMED, NONE, SETS, Key, conditions_of
from replication.evidence.statistics import compare, mean_prediction
from replication.evidence.tables import (
    contrasts_table,
    kinds_table,
    marked_table,
    means_table,
    pairs_near,
    read_table,
    rows_of,
    sets_table,
    summary_table,
    write_csv,
)
from replication.irl.expectations import visited
from replication.paper.params import Params
from replication.paper.published import TABLE_1, Published
from replication.trials.compute import TRACED_TRIAL
from replication.trials.condition import Condition
from replication.trials.measures import factors
from replication.trials.run import run_trials
from replication.trials.store import Store

MEANS = {"adaboost": 45, "unified": 40, "unified-incorrect": 36}
N = 40


def made(
    conditions: Mapping[Key, Condition], *, capped: Key | None = None, n: int = N, seed: int = 0
) -> pd.DataFrame:
    """Make trials up: each method's iterations scatter around its mean."""
    rng = np.random.default_rng(seed)
    parts = []
    for key, condition in conditions.items():
        counts = MEANS[condition.method] + rng.integers(-4, 5, size=n)
        if condition.method == "adaboost":
            counts += rng.integers(-12, 13, size=n)
        columns = {
            **factors(condition),
            "trial": np.arange(n),
            "iterations": counts,
            "converged": ((np.arange(n) > 0) | (key != capped)).astype(int),
            "steps": 1000 * counts + rng.integers(0, 999, n),
            "acted": rng.integers(0, 9, n),
            "acted_at_first": rng.integers(0, 99, n),
            "with_hit": rng.integers(0, 5, n),
            "with_opposite": rng.integers(0, 15, n),
            "visits_hit": rng.random(n),
            "visits_opposite": 9 * rng.random(n),
            "wrong_visits": 10.0,
        }
        parts.append(pd.DataFrame(columns))
    return pd.concat(parts, ignore_index=True)


def keys_of(table: pd.DataFrame, *names: str) -> list[tuple[str, ...]]:
    """Return some columns of a table, as tuples."""
    return list(table[list(names)].itertuples(index=False, name=None))


@pytest.fixture(scope="module")
def conditions(small_demos: Demos) -> dict[Key, Condition]:
    """Return the conditions of Table I for a small maze."""
    return conditions_of(small_demos, {})


# --- means -----------------------------------------------------------------------------------


def test_summary_is_that_of_the_trials(conditions: dict[Key, Condition]) -> None:
    """Mean, SD and quartiles equal those that pandas computes from the rows, in every cell."""
    trials = made(conditions)
    table = summary_table(trials, TABLE_1)
    assert keys_of(table, "method", "reading", "set") == list(conditions)
    for (_, row), condition in zip(table.iterrows(), conditions.values(), strict=True):
        counts = rows_of(trials, condition)["iterations"]
        paper = TABLE_1[condition.method]
        assert row["mean"] == pytest.approx(counts.mean())
        assert row["sd"] == pytest.approx(counts.std())
        assert row["median"] == counts.median()
        assert row["low"] < row["mean"] < row["high"]
        assert (row["paper_mean"], row["paper_sd"]) == (paper.mean, paper.sd)
        expected = mean_prediction(paper.mean, paper.sd, 100, N)
        assert (row["predicted_low"], row["predicted_high"]) == expected


def test_summary_shows_the_first_hundred_apart(conditions: dict[Key, Condition]) -> None:
    """As many as the paper has, by their numbers and not by their places, beside all of ours."""
    trials = made(conditions, n=250)
    table = summary_table(trials.sample(frac=1.0, random_state=1), TABLE_1)
    table = table.set_index(["method", "reading", "set"])
    for key, condition in conditions.items():
        counts = rows_of(trials, condition)["iterations"].to_numpy()
        row = table.loc[key]
        assert row["n"] == 250
        assert row["mean"] == pytest.approx(counts.mean())
        assert row["first_mean"] == pytest.approx(counts[:100].mean())
        assert row["first_sd"] == pytest.approx(counts[:100].std(ddof=1))
        assert row["first_mean"] != row["mean"]


def test_published_single_runs_predict_nothing(conditions: dict[Key, Condition]) -> None:
    """A curve of one trial stands beside ours without an interval; other methods have none."""
    runs = {"unified": Published("Fig. 12", 15.0, np.nan, 1)}
    table = summary_table(made(conditions), runs).set_index("method")
    assert (table.loc["unified", "paper_mean"] == 15.0).all()
    assert "predicted_low" not in table
    assert table.loc[["adaboost", "unified-incorrect"], "paper_mean"].isna().all()


def test_capped_trials_are_counted_and_never_averaged(conditions: dict[Key, Condition]) -> None:
    """One trial at the cap withholds its cell's mean, and all contrasts with that cell."""
    trials = made(conditions, capped=("unified", "updated", NONE))
    table = summary_table(trials, TABLE_1).set_index(["method", "reading"]).sort_index()
    capped = table.loc[[("unified", "updated")]]
    assert capped["capped"].tolist() == [1]
    assert capped[["mean", "low", "sd", "first_mean", "first_sd"]].isna().all(axis=None)
    others = table.drop(index=("unified", "updated"))
    assert (others["capped"] == 0).all()
    assert others[["mean", "first_mean"]].notna().all(axis=None)
    contrasts = contrasts_table(trials).set_index(["x", "reading"]).sort_index()
    numbers = ["saved", "low", "high", "p", "fewer", "sd_ratio", "p_spread"]
    for x in ("unified", "unified-incorrect"):
        assert contrasts.loc[(x, "updated"), numbers].isna().all(axis=None)
        assert contrasts.loc[(x, "printed"), numbers].notna().all(axis=None)
    assert contrasts.loc[("unified-incorrect", "at-once"), numbers].notna().all(axis=None)
    assert set(contrasts["n"]) == {N}


def test_means_have_a_row_for_each_condition(conditions: dict[Key, Condition]) -> None:
    """Means at a glance: whole steps, two decimals, one row a condition."""
    key = ("unified", "updated", NONE)
    trials = made(conditions, capped=key)
    means = means_table(trials)
    assert keys_of(means, "method", "reading", "set") == list(conditions)
    assert means["converged"].tolist() == [0.98 if each == key else 1.0 for each in conditions]
    own = rows_of(trials, conditions[key])
    row = means[keys_of(means, "method", "reading", "set").index(key) :].iloc[0]
    assert row["iterations"] == round(own["iterations"].mean(), 2)
    assert row["steps"] == int(round(own["steps"].mean(), 2))


# --- contrasts -------------------------------------------------------------------------------


def test_contrasts_are_paired_comparisons(conditions: dict[Key, Condition]) -> None:
    """Each cell against its baseline under the same reading, trial by trial; saved is positive."""
    trials = made(conditions)
    trials.loc[trials["reading"] == "updated", "iterations"] += 100
    table = contrasts_table(
        trials.sample(frac=1.0, random_state=1).sort_values("set", kind="stable")
    )
    expected = {
        ("unified", "adaboost", "printed", NONE): ("adaboost", "", NONE),
        ("unified", "adaboost", "updated", NONE): ("adaboost", "", NONE),
    }
    for set in (NAMED, GENERAL):
        for f, base in (("printed", "printed"), ("updated", "updated"), ("at-once", "printed")):
            expected["unified-incorrect", "unified", f, set] = ("unified", base, NONE)
    assert {*keys_of(table, "x", "y", "reading", "set")} == {*expected}
    assert len(table) == len(expected) == 8
    for row in table.to_dict("records"):
        one = conditions[row["x"], row["reading"], row["set"]]
        other = conditions[expected[row["x"], row["y"], row["reading"], row["set"]]]
        x, y = (rows_of(trials, each) for each in (one, other))
        found = compare(x["iterations"], y["iterations"])
        for name in ("fewer", "sd_ratio", "sd_low", "sd_high", "p", "p_spread", "n"):
            assert row[name] == getattr(found, name)
        d = y["iterations"].to_numpy() - x["iterations"].to_numpy()
        assert row["saved"] == pytest.approx(d.mean())
        assert (row["low"], row["high"]) == pytest.approx((-found.high, -found.low))
        assert row["low"] < row["saved"] < row["high"]
        assert row["steps_saved"] == pytest.approx(1 - x["steps"].sum() / y["steps"].sum())
    against = table[table["y"] == "adaboost"].set_index("reading")["saved"]
    assert against["printed"] - against["updated"] == pytest.approx(100, abs=3)
    assert (table[table["y"] == "unified"]["saved"] > 0).all()  # 36 against 40


def test_contrasts_without_a_method_are_left_out(conditions: dict[Key, Condition]) -> None:
    """In robot soccer, where AdaBoost-IRL is not run, there is nothing to compare it with."""
    fewer = {key: one for key, one in conditions.items() if key[0] != "adaboost"}
    table = contrasts_table(made(fewer))
    assert table["x"].tolist() == ["unified-incorrect"] * 6


# --- sets and kinds --------------------------------------------------------------------------


def test_sets_compare_with_no_incorrect_demonstrations(small_demos: Demos) -> None:
    """Each set saves against the method without, same reading; fewest demonstrations first."""
    sets = conditions_of(small_demos, {}, ["unified", "unified-incorrect"], SETS)
    trials = made(sets)
    table = sets_table(trials, sets)
    assert {*keys_of(table, "reading", "set")} == {(f, set) for _, f, set in sets if set != NONE}
    assert len(table) == 9 * 3
    assert table["demonstrations"].is_monotonic_increasing
    for row in table.to_dict("records"):
        condition = sets["unified-incorrect", row["reading"], row["set"]]
        base = sets["unified", "updated" if row["reading"] == "updated" else "printed", NONE]
        x, y = (rows_of(trials, each).reset_index() for each in (condition, base))
        assert row["demonstrations"] == len(condition.selected.incorrect)
        near = pairs_near(condition.selected)
        assert {name: row[name] for name in near} == near
        assert row["saved"] == pytest.approx((y["iterations"] - x["iterations"]).mean())
        assert (row["acted"], row["acted_at_first"]) == pytest.approx(
            (x["acted"].mean(), x["acted_at_first"].mean())
        )


def test_sets_are_compared_over_the_trials_of_both(small_demos: Demos) -> None:
    """Where the named set has more trials than the others, only common ones count."""
    sets = conditions_of(small_demos, {}, ["unified", "unified-incorrect"], SETS)
    trials = made(sets)
    few = trials[(trials["trial"] < 9) | trials["set"].isin([NONE, NAMED])]
    table = sets_table(few.sample(frac=1.0, random_state=1), sets)
    assert dict(zip(table["set"], table["n"], strict=True)) == {
        set: N if set == NAMED else 9 for set in SETS if set != NONE
    }
    whole = sets_table(trials[trials["trial"] < 9], sets)
    same = table["set"] != NAMED
    pd.testing.assert_frame_equal(table[same], whole[same])


def test_kinds_by_hand(conditions: dict[Key, Condition]) -> None:
    """How many wrong trajectories take a kind's pair, and its part in the wrong visits."""
    trials = made(conditions)
    own = (trials["method"] == "unified") & (trials["reading"] == "printed")
    names = ["iterations", "with_hit", "with_opposite", "visits_hit", "visits_opposite"]
    trials.loc[own, [*names, "wrong_visits"]] = [11, 2, 5, 1.0, 6.0, 8.0]
    at = trials.index[own]
    trials.loc[at[0], ["iterations", "with_hit"]] = [1, 0]  # right after one update: none wrong
    trials.loc[at[1], "converged"] = 0  # at the cap: its last one is wrong, too
    table = kinds_table(trials.sample(frac=1.0, random_state=1))
    assert {*table["reading"]} == {"printed", "updated"}
    printed = table[table["reading"] == "printed"].set_index("kind")
    assert (printed["trajectories"] == 38 * 10).all()
    assert printed["share"].to_dict() == {"hit": 76 / 380, "opposite": 195 / 380}
    assert printed["weight"].to_dict() == {"hit": 1 / 8, "opposite": 6 / 8}
    trials["iterations"] = 1
    assert kinds_table(trials)["share"].isna().all()


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
    before: set[tuple[int, int]] = set()
    for row, (states, actions, _) in zip(table.itertuples(), trial.episodes, strict=True):
        pairs = {*zip(states.tolist(), actions.tolist(), strict=False)}
        wrong = {pair for pair in pairs if not expert[pair]}
        marked = {pair for pair in wrong if shown[pair]}
        assert (row.wrong, row.marked, row.again) == (
            len(wrong),
            len(marked),
            len(marked & before),
        )
        before |= marked


def test_missing_trials_are_an_error(conditions: dict[Key, Condition]) -> None:
    """A condition without rows is not an empty comparison."""
    trials = made(conditions)
    with pytest.raises(KeyError, match="no trials of small unified printed none"):
        rows_of(trials[trials["method"] == "adaboost"], conditions["unified", "printed", NONE])


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
