from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from replication import Demos, Maze, demonstrate
from replication.evidence.experiments import Key, method_conditions, set_conditions
from replication.evidence.statistics import compare, holm
from replication.evidence.tables import (
    PAIRS,
    contrasts_table,
    markdown,
    pairs_near,
    read_table,
    readable_ablations,
    readable_contrasts,
    readable_levels,
    readable_outcomes,
    readable_sets,
    readable_summary,
    readable_verdicts,
    rows_of,
    sets_table,
    summary_table,
    verdict_lines,
    write_csv,
    write_trials,
)
from replication.evidence.verdicts import overall
from replication.files import PROJECT
from replication.irl import READINGS
from replication.paper.published import TABLE_1
from replication.trials.condition import Condition

MEANS = {"adaboost": 45, "unified": 40, "unified-incorrect": 36}


def _trials(
    conditions: dict[Key, Condition], *, capped: str | None = None, seed: int = 0
) -> pd.DataFrame:
    """Make trials up: each method's iterations scatter around its mean."""
    rng = np.random.default_rng(seed)
    parts = []
    for (_, f), condition in conditions.items():
        counts = MEANS[condition.method] + rng.integers(-4, 5, size=40)
        if condition.method == "adaboost":
            counts += rng.integers(-12, 13, size=40)
        columns = {
            "task": condition.demos.task,
            "method": condition.method,
            "trial": np.arange(40),
            "seed": 1,
            "iterations": counts,
            "converged": (np.arange(40) > 0) | (f != capped),
            "steps": 1,
            "choices": condition.choices,
        }
        parts.append(pd.DataFrame(columns))
    return pd.concat(parts)


@pytest.fixture(scope="module")
def conditions(small_demos: Demos) -> dict[Key, Condition]:
    """Return the conditions of Table I for a small maze."""
    return method_conditions(small_demos, {})


def test_summary_is_that_of_the_trials(conditions: dict[Key, Condition]) -> None:
    """Mean, SD and quartiles equal those that pandas computes from the rows."""
    trials = _trials(conditions)
    table = summary_table(trials, conditions, TABLE_1)
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
    trials = _trials(conditions, capped="updated")
    table = summary_table(trials, conditions, TABLE_1).set_index("F")
    assert (table.loc["updated", "capped"] == 1).all()
    assert table.loc["updated", "mean"].isna().all()
    assert table.loc["printed", "mean"].notna().all()
    contrasts = contrasts_table(trials, conditions).set_index("F")
    numbers = contrasts.columns.drop(["x", "y", "n"])
    assert contrasts.loc["updated", numbers].isna().all(axis=None)
    assert contrasts.loc["printed", numbers].notna().all(axis=None)
    assert set(contrasts["n"]) == {40}


def test_contrasts_are_paired_comparisons(conditions: dict[Key, Condition]) -> None:
    """Each row compares two conditions of one reading trial by trial; AdaBoost stands in both."""
    trials = _trials(conditions)
    trials.loc[trials["choices"] == "F-INDEX=updated", "iterations"] += 100
    table = contrasts_table(trials.sample(frac=1.0, random_state=1), conditions)
    keys = list(table[["x", "y", "F"]].itertuples(index=False, name=None))
    assert keys == [(x, y, f) for x, y in PAIRS for f in READINGS]
    for row in table.to_dict("records"):
        one = conditions[row["x"], row["F"]]
        other = conditions.get((row["y"], row["F"]), conditions.get((row["y"], "")))
        assert other is not None
        x, y = (rows_of(trials, each)["iterations"] for each in (one, other))
        found = compare(x, y)
        for name in ("difference", "low", "high", "fewer", "sd_ratio", "p_wilcoxon", "p_spread"):
            assert row[name] == getattr(found, name)
    against = table[table["y"] == "adaboost"].set_index("F")["difference"]
    assert against["updated"] - against["printed"] == pytest.approx(100, abs=3)


def test_contrasts_without_a_method_are_left_out(conditions: dict[Key, Condition]) -> None:
    """In robot soccer, where AdaBoost-IRL is not run, there is nothing to compare it with."""
    fewer = {key: one for key, one in conditions.items() if key[0] != "adaboost"}
    table = contrasts_table(_trials(conditions), fewer)
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
    trials = _trials(sets).drop_duplicates(["method", "choices", "trial"])
    table = sets_table(trials, sets)
    assert len(table) == len(sets)
    empty = table[table["set"] == "none"].set_index("F")["mean"]
    for row in table.itertuples():
        assert row.difference == pytest.approx(row.mean - empty[row.F])
    tested = table["set"] != "none"
    assert table[~tested][["p", "p_holm"]].isna().all(axis=None)
    assert table[tested]["p_holm"].tolist() == holm(table[tested]["p"].tolist()).tolist()


def test_readable_tables_have_a_row_for_each_row(
    conditions: dict[Key, Condition], small_demos: Demos
) -> None:
    """What is printed for readers has as many rows and no NaN."""
    trials = _trials(conditions, capped="updated")
    summary = summary_table(trials, conditions, {"unified": TABLE_1["unified"]})
    contrasts = contrasts_table(trials, conditions)
    sets = set_conditions(small_demos, {})
    saved = sets_table(_trials(sets).drop_duplicates(["method", "choices", "trial"]), sets)
    for table, readable in (
        (summary, readable_summary(summary)),
        (contrasts, readable_contrasts(contrasts)),
    ):
        assert len(readable) == len(table)
        assert "nan" not in markdown(readable).lower()
    assert len(readable_sets(saved)) == len(saved) / 2


def test_readable_contrasts_by_hand(conditions: dict[Key, Condition]) -> None:
    """Methods have their labels, numbers their intervals, and small p-values no false digits."""
    table = contrasts_table(_trials(conditions), conditions).head(1)
    names = ["difference", "low", "high", "sd_ratio", "sd_low", "sd_high", "fewer"]
    table[names] = [-4.0, -6.5, -1.255, 0.5, 0.25, 0.751, 0.8]
    table[["p_wilcoxon", "p_spread"]] = [0.00099, 0.04]
    assert readable_contrasts(table).iloc[0].tolist() == [
        "Unified, without incorrect against AdaBoost-IRL (R1)",
        "Fᵢ (printed)",
        "-4.00 [-6.50, -1.25]",
        "0.50 [0.25, 0.75]",
        "0.80",
        "< 0.001",
        "0.040",
    ]


# --- judged claims ---------------------------------------------------------------------------

JUDGED = pd.DataFrame(
    [
        ("A", "It is faster", "mean-difference", "printed", -4.0, -5.0, -3.0, -4.84, "reproduced"),
        ("A", "It is faster", "mean-difference", "updated", -3.0, -4.0, -2.0, -4.84, "reproduced"),
        ("B", "It is steadier", "sd-ratio", "printed", 0.5, 0.4, 0.6, 0.46, "reproduced"),
        ("B", "It is steadier", "sd-ratio", "updated", 0.9, 0.8, 1.1, 0.46, "undecided"),
        ("C", "Q grows", "mean", "printed", 0.1, -0.1, 0.3, np.nan, "not reproduced"),
        ("C", "Q grows", "mean", "updated", 0.2, -0.1, 0.5, np.nan, "not reproduced"),
        ("D", "Mean", "published-mean", "", 44.0, 43.0, 45.0, 44.94, "not testable"),
        ("E", "A run", "published-run", "printed", 41.0, 30.5, 55.0, 47.0, "not testable"),
        ("E", "A run", "published-run", "updated", np.nan, np.nan, np.nan, 47.0, "not testable"),
        ("F", "SD", "published-sd", "printed", 6.8, 6.0, 7.7, 4.73, "not testable"),
        ("F", "SD", "published-sd", "updated", 5.5, 4.8, 6.3, 4.73, "reproduced"),
    ],
    columns=["id", "claim", "statistic", "F", "effect", "low", "high", "paper", "verdict"],
).assign(
    place="Fig. 6",
    why=["", "", "", "a", "", "", "it was used", "two capped", "all capped", "calibrated", ""],
)


def test_readable_verdicts_by_hand() -> None:
    """One row a claim: effects of both readings in their own unit, and the verdict of both."""
    found = readable_verdicts(JUDGED)
    assert found.columns.tolist() == [
        "Claim",
        "Place",
        "Paper",
        "Fᵢ (printed)",
        "Fᵢ₊₁ (updated)",
        "Verdict",
    ]
    assert found.drop(columns="Place").to_numpy().tolist() == [
        [
            "It is faster",
            "-4.84",
            "-4.00 [-5.00, -3.00]",
            "-3.00 [-4.00, -2.00]",
            "**reproduced**",
        ],
        [
            "It is steadier",
            "× 0.46",
            "× 0.50 [0.40, 0.60]",
            "× 0.90 [0.80, 1.10]",
            "partly (Fᵢ reproduced, Fᵢ₊₁ undecided)",
        ],
        ["Q grows", "–", "0.10 [-0.10, 0.30]", "0.20 [-0.10, 0.50]", "not reproduced"],
        ["Mean", "44.94", "44.00 [43.00, 45.00]", "–", "not testable: it was used"],
        ["A run", "47.00", "median 41; 30 to 55", "–", "not testable: two capped"],
        ["SD", "4.73", "6.80 [6.00, 7.70]", "5.50 [4.80, 6.30]", "not testable: calibrated"],
    ]


def test_verdict_lines_have_the_verdict_first() -> None:
    """On a terminal there is a line a claim: verdict, the paper's value, ours, and the claim."""
    head, *found = verdict_lines(JUDGED.replace({"id": {"B": "STEADIER"}}))
    assert head.split() == ["verdict", "paper", "Fᵢ", "(printed)", "Fᵢ₊₁", "(updated)", "claim"]
    assert re.split(r"  +", found[1]) == [
        "partly",
        "× 0.46",
        "× 0.50 [0.40, 0.60]",
        "× 0.90 [0.80, 1.10]",
        "steadier than AdaBoost-IRL",
    ]
    for line, (id, part) in zip(found, JUDGED.groupby("id"), strict=True):
        assert line[:16].rstrip() == overall(part["verdict"].tolist())
        assert line.endswith(str(id)) or id == "B"


def test_published_verdicts_fit_on_a_terminal() -> None:
    """No line of the published verdicts is longer than 100 columns, and no two columns touch."""
    for line in verdict_lines(read_table(PROJECT / "figures" / "claims.csv")):
        assert len(line) <= 100
        assert len(re.split(r"  +", line)) == 5


def test_verdicts_read_the_same_from_a_file(tmp_path: Path) -> None:
    """What readers see of judged claims follows from the file alone."""
    stored = read_table(write_csv(JUDGED, tmp_path / "claims.csv"))
    pd.testing.assert_frame_equal(readable_verdicts(stored), readable_verdicts(JUDGED))
    assert verdict_lines(stored) == verdict_lines(JUDGED)


# --- specifications --------------------------------------------------------------------------


def test_readable_outcomes_by_hand() -> None:
    """Each claim and group has its counts and the range of its effects."""
    table = pd.DataFrame(
        {
            "claim": ["FASTER", "FASTER"],
            "group": ["single", "factorial"],
            "specifications": [44, 240],
            "holds": [40, 200],
            "open": [3, 30],
            "reversed": [1, 9],
            "undefined": [0, 1],
            "share": [0.9, 0.8],
            "with_caps": [0, 7],
            "uncapped": [44, 232],
            "holds_uncapped": [40, 194],
            "unchanged": [5, 0],
            "median": [-4.0, -3.456],
            "lowest": [-9.0, -20.0],
            "highest": [1.0, 2.5],
        }
    )
    assert readable_outcomes(table).to_numpy().tolist() == [
        ["FASTER", "one at a time", 44, 40, 3, 1, 0, 0, "40 of 44", 5, "-4.00 (-9.00, 1.00)"],
        ["FASTER", "all at once", 240, 200, 30, 9, 1, 7, "194 of 232", 0, "-3.46 (-20.00, 2.50)"],
    ]


def test_readable_levels_are_of_one_claim() -> None:
    """The default value is marked, shares are in percent, a missing effect is a dash."""
    table = pd.DataFrame(
        {
            "claim": ["FASTER", "FASTER", "STEADIER"],
            "choice": "ALPHA",
            "value": [0.1, 0.3, 0.3],
            "default": [False, True, True],
            "specifications": 60,
            "mean_effect": [-4.0, np.nan, 1.0],
            "holds": [0.8, 0.05, 1.0],
            "reversed": [0.0, 0.111, 0.0],
        }
    )
    assert readable_levels(table, "FASTER").to_numpy().tolist() == [
        ["ALPHA", "0.1", "-4.00", "80%", "0%"],
        ["ALPHA", "0.3 (default)", "–", "5%", "11%"],
    ]


def test_readable_ablations_by_hand() -> None:
    """A row a condition: mean with its interval, SD, median and how many trials are at the cap."""
    table = pd.DataFrame(
        {
            "setting": ["default"],
            "n": [30],
            "capped": [2],
            "mean": [40.0],
            "low": [38.0],
            "high": [42.0],
            "sd": [4.5],
            "median": [39.5],
            "more": [1.0],
            "more_low": [-0.5],
            "more_high": [2.5],
        }
    )
    assert readable_ablations(table).iloc[0].tolist() == [
        "default",
        "40.00 [38.00, 42.00]",
        "4.50",
        "39.5",
        "2 of 30",
        "1.00 [-0.50, 2.50]",
    ]


# --- files -----------------------------------------------------------------------------------


def test_tables_are_read_as_they_were_written(tmp_path: Path) -> None:
    """Numbers, truth values and words come back; missing numbers are NaN, missing words empty."""
    table = pd.DataFrame(
        {
            "F": ["", "printed"],
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
    for name in ("F", "why", "n", "default"):
        assert found[name].tolist() == table[name].tolist(), name
    for name in ("effect", "p", "divergence"):
        due = pytest.approx(table[name].tolist(), nan_ok=True, rel=1e-9)
        assert found[name].tolist() == due, name
    assert write_csv(found, tmp_path / "again.csv").read_bytes() == path.read_bytes()


def test_column_f_is_text_even_if_it_is_empty(tmp_path: Path) -> None:
    """A table of a method without a trace has an empty reading of Eq. 9, not a missing number."""
    table = pd.DataFrame({"F": ["", ""], "n": [1, 2]})
    assert read_table(write_csv(table, tmp_path / "table.csv"))["F"].tolist() == ["", ""]


def test_markdown_is_a_table() -> None:
    """Columns become the head, rows become lines, and the cells line up."""
    assert markdown(pd.DataFrame({"a": [1, 2], "b": ["x", "long"]})) == (
        "| a   | b    |\n| --- | ---- |\n| 1   | x    |\n| 2   | long |\n"
    )


def test_trials_of_other_tasks_are_kept(conditions: dict[Key, Condition], tmp_path: Path) -> None:
    """Writing one task's trials replaces its own rows and no others; twice gives the same bytes."""
    path = tmp_path / "trials.csv"
    trials = _trials(conditions)
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


def test_missing_trials_are_an_error(conditions: dict[Key, Condition]) -> None:
    """A condition without rows is not an empty comparison."""
    trials = _trials(conditions)
    with pytest.raises(KeyError, match="no trials of unified"):
        rows_of(trials[trials["method"] == "adaboost"], conditions["unified", "printed"])
