from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from replication import Demos, Maze, demonstrate
from replication.comparisons import F_INDICES, TABLE_1_CLAIMS, Key, method_settings, set_settings
from replication.paper import TABLE_1
from replication.setting import Setting
from replication.tables import (
    claims_table,
    findings,
    markdown,
    pairs_near,
    readable_claims,
    readable_sets,
    readable_summary,
    rows_of,
    sets_table,
    summary_table,
    write_trials,
)

MEANS = {"adaboost": 45, "unified": 40, "unified-incorrect": 36}


def _trials(
    settings: dict[Key, Setting], *, capped: str | None = None, seed: int = 0
) -> pd.DataFrame:
    """Make trials up: each method's iterations scatter around its mean."""
    rng = np.random.default_rng(seed)
    parts = []
    for (_, f), setting in settings.items():
        counts = MEANS[setting.method] + rng.integers(-4, 5, size=40)
        if setting.method == "adaboost":
            counts += rng.integers(-12, 13, size=40)
        columns = {
            "task": setting.demos.task,
            "method": setting.method,
            "trial": np.arange(40),
            "seed": 1,
            "iterations": counts,
            "converged": (np.arange(40) > 0) | (f != capped),
            "steps": 1,
            "choices": setting.choices,
        }
        parts.append(pd.DataFrame(columns))
    return pd.concat(parts)


@pytest.fixture(scope="module")
def settings(small_demos: Demos) -> dict[Key, Setting]:
    """Return the settings of Table I for a small maze."""
    return method_settings(small_demos, {})


def test_summary_is_that_of_the_trials(settings: dict[Key, Setting]) -> None:
    """Mean, SD and quartiles equal those that pandas computes from the rows."""
    trials = _trials(settings)
    table = summary_table(trials, settings, TABLE_1)
    assert len(table) == 5
    for (_, row), setting in zip(table.iterrows(), settings.values(), strict=True):
        counts = rows_of(trials, setting)["iterations"]
        assert row["mean"] == pytest.approx(counts.mean())
        assert row["sd"] == pytest.approx(counts.std())
        assert row["median"] == counts.median()
        assert row["low"] < row["mean"] < row["high"]
        assert row["predicted_low"] < row["paper_mean"] < row["predicted_high"]


def test_capped_trials_are_counted_and_never_averaged(settings: dict[Key, Setting]) -> None:
    """One trial at the cap withholds the mean and makes its comparisons not testable."""
    trials = _trials(settings, capped="updated")
    table = summary_table(trials, settings, TABLE_1).set_index("F")
    assert (table.loc["updated", "capped"] == 1).all()
    assert table.loc["updated", "mean"].isna().all()
    assert table.loc["printed", "mean"].notna().all()
    claims = claims_table(trials, settings, TABLE_1_CLAIMS, TABLE_1).set_index("F")
    assert set(claims.loc["updated", "verdict"]) == {"not testable"}
    assert "not testable" not in set(claims.loc["printed", "verdict"])


def test_made_up_trials_that_follow_the_paper_reproduce_it(settings: dict[Key, Setting]) -> None:
    """Trials drawn with the paper's ordering get "reproduced" for every claim."""
    claims = claims_table(_trials(settings), settings, TABLE_1_CLAIMS, TABLE_1)
    assert len(claims) == len(TABLE_1_CLAIMS) * len(F_INDICES)
    assert set(claims["verdict"]) == {"reproduced"}


def test_made_up_trials_of_one_method_reproduce_nothing(settings: dict[Key, Setting]) -> None:
    """If all methods need the same iterations, no claim holds."""
    trials = _trials(settings)
    trials["iterations"] = 40 + trials["trial"] % 5
    claims = claims_table(trials, settings, TABLE_1_CLAIMS, TABLE_1)
    assert set(claims["verdict"]) == {"not reproduced"}


def test_claims_pair_the_readings(settings: dict[Key, Setting]) -> None:
    """Each row compares settings of one reading; AdaBoost stands in both."""
    trials = _trials(settings)
    trials.loc[trials["choices"] == "F-INDEX=updated", "iterations"] += 100
    claims = claims_table(trials, settings, TABLE_1_CLAIMS, TABLE_1)
    fewer = claims[claims["judged"] == "fewer"]
    against = fewer[fewer["claim"].str.contains("AdaBoost")].set_index("F")["difference"]
    assert against["updated"] - against["printed"] == pytest.approx(100, abs=3)
    among = fewer[~fewer["claim"].str.contains("AdaBoost")].set_index("F")["difference"]
    assert among["updated"] == pytest.approx(among["printed"], abs=3)


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
    sets = set_settings(small_demos, {})
    trials = _trials(sets).drop_duplicates(["method", "choices", "trial"])
    table = sets_table(trials, sets)
    assert len(table) == len(sets)
    empty = table[table["set"] == "none"].set_index("F")["mean"]
    for row in table.itertuples():
        assert row.difference == pytest.approx(row.mean - empty[row.F])
    assert (table[table["set"] == "none"]["verdict"] == "").all()


def test_readable_tables_have_a_row_for_each_row(
    settings: dict[Key, Setting], small_demos: Demos
) -> None:
    """What is printed for readers has as many rows, no NaN, and the same verdicts."""
    trials = _trials(settings, capped="updated")
    summary = summary_table(trials, settings, {"unified": TABLE_1["unified"]})
    claims = claims_table(trials, settings, TABLE_1_CLAIMS, {})
    sets = set_settings(small_demos, {})
    saved = sets_table(_trials(sets).drop_duplicates(["method", "choices", "trial"]), sets)
    for table, readable in (
        (summary, readable_summary(summary)),
        (claims, readable_claims(claims)),
    ):
        assert len(readable) == len(table)
        assert "nan" not in markdown(readable).lower()
    assert readable_claims(claims)["Verdict"].tolist() == claims["verdict"].tolist()
    assert len(readable_sets(saved)) == len(saved) / 2
    assert findings(claims).count("\n") == len(claims)


def test_markdown_is_a_table() -> None:
    """Columns become the head, rows become lines, and the cells line up."""
    assert markdown(pd.DataFrame({"a": [1, 2], "b": ["x", "long"]})) == (
        "| a   | b    |\n| --- | ---- |\n| 1   | x    |\n| 2   | long |\n"
    )


def test_trials_of_other_tasks_are_kept(settings: dict[Key, Setting], tmp_path: Path) -> None:
    """Writing one task's trials replaces its own rows and no others; twice gives the same bytes."""
    path = tmp_path / "trials.csv"
    trials = _trials(settings)
    other = trials.assign(task="other")
    write_trials(other, path)
    write_trials(trials.assign(iterations=1), path)
    write_trials(trials, path)
    once = path.read_bytes()
    write_trials(trials, path)
    assert path.read_bytes() == once
    read = pd.read_csv(path, keep_default_na=False)
    assert len(read) == 2 * len(trials)
    assert (read[read["task"] == "small"]["iterations"] > 1).all()


def test_missing_trials_are_an_error(settings: dict[Key, Setting]) -> None:
    """A setting without rows is not an empty comparison."""
    trials = _trials(settings)
    with pytest.raises(KeyError, match="no trials of unified"):
        rows_of(trials[trials["method"] == "adaboost"], settings["unified", "printed"])
