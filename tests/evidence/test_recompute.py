from __future__ import annotations

import math
import sqlite3
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy import stats

from replication import Demos, save_demos
from replication.evidence import bound, calibration, comparison, limits, rounding, sweep
from replication.evidence.experiments import EXPERIMENTS, Experiment
from replication.evidence.recompute import (
    DESIGNS,
    declared_condition,
    recompute_trials,
    sampled,
)
from replication.evidence.tables import write_csv
from replication.files import PROJECT
from replication.trials.compute import trial_key
from replication.trials.store import Store
from replication.trials.table import Group, computed_table, planned_table

MEASURED = (
    *("iterations", "converged", "early_collisions", "early_errors", "q_growth", "reward_growth"),
    *("acted", "acted_at_first", "with_hit", "with_detour"),
)
FEW = {"episodes": 60, "horizon": 40, "max_iterations": 20}
HEAD = "task,method,reading,set,trial,seed\n"


@pytest.fixture
def table(tmp_path: Path, small_demos: Demos, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Return the trials.csv of a small task, with its store beside it."""
    save_demos(small_demos, tmp_path / "small.json")
    methods = ("adaboost", "unified", "unified-incorrect")
    experiment = Experiment(tmp_path / "small.json", FEW, methods, ("hit+detour",))
    monkeypatch.setitem(EXPERIMENTS, "small", experiment)
    groups = [Group(list(experiment.conditions().values()), 2)]
    store = Store(tmp_path / "s.sqlite")
    trials = computed_table(groups, errors=True, path=True, store=store, seed=4)
    return write_csv(trials, tmp_path / "trials.csv")


def trials_of(table: Path) -> pd.DataFrame:
    """Return a table of trials as text."""
    return pd.read_csv(table, dtype=str, keep_default_na=False)


def wrong(table: Path, *, seed: int = 1, every: int = 1, **options: Any) -> list[str]:
    """Return what is wrong with a table; by default all of it is computed again."""
    store = table.with_name("s.sqlite")
    return list(recompute_trials({"t": table}, store, seed=seed, every=every, **options))


def test_what_was_computed_here_agrees(table: Path) -> None:
    """All trials are computed again, with or without a store, by any number of workers."""
    told: list[int] = []
    assert wrong(table, report=told.append) == []
    assert told == [6 * 2]
    assert wrong(table, jobs=2) == []
    table.with_name("s.sqlite").unlink()
    assert wrong(table) == []
    assert not table.with_name("s.sqlite").exists()


@given(rows=st.integers(1, 200), every=st.integers(1, 40), seed=st.integers(0, 2**32))
def test_a_sample_is_random_and_has_the_size_that_is_said(rows: int, every: int, seed: int) -> None:
    """One row in so many is drawn, at least one, none twice, and by the seed alone."""
    (first,), (again,), (other,) = (sampled([rows], root, every) for root in (seed, seed, seed + 1))
    assert first.tolist() == again.tolist() == sorted(set(first.tolist()))
    assert len(first) == math.ceil(rows / every)
    assert 0 <= first.min() <= first.max() < rows
    assert len(other) == len(first)


def test_each_row_is_as_likely_as_any_other() -> None:
    """Over many seeds each row is drawn equally often: a forger cannot know which are safe."""
    counts = np.zeros(40)
    for seed in range(2000):
        counts[sampled([40], seed, 20)[0]] += 1
    assert counts.sum() == 4000
    assert stats.chisquare(counts).pvalue > 0.001


@pytest.mark.parametrize("column", [*MEASURED, "seed", "trial", "steps", "digest", "errors"])
def test_a_changed_number_is_found(table: Path, column: str) -> None:
    """Whatever of a sampled row is not what its trial gives, the row and the column are named."""
    trials = trials_of(table)
    value = trials.loc[5, column]
    trials.loc[5, column] = f"{value[:-1]}{(int(value[-1], 16) + 1) % 2}"
    trials.to_csv(table, index=False)
    (message,) = wrong(table)
    assert message.startswith("t, row 6: its trial gives another ")
    assert column in message or column in ("seed", "trial")


@pytest.mark.parametrize(
    ("method", "column", "found"),
    [
        *((name, "digest", 0) for name in ("mwal", "max-entropy", "from-failure", "ranking")),
        ("max-entropy", "steps", 0),
        ("max-entropy", "iterations", 1),
        ("mwal", "converged", 1),
        ("perceptron", "digest", 1),
    ],
)
def test_what_a_processor_may_decide_is_not_compared(
    tmp_path: Path, method: str, column: str, found: int
) -> None:
    """Of a method that takes exponentials other bits are no forgery; other iterations are."""
    published = pd.read_csv(
        PROJECT / "figures" / "beyond" / "trials.csv", dtype=str, keep_default_na=False
    )
    row = published[(published["method"] == method) & (published["task"] == "open-maze")].head(1)
    value = row[column].item()
    file = tmp_path / "trials.csv"
    row.assign(**{column: f"{value[:-1]}{(int(value[-1], 16) + 1) % 2}"}).to_csv(file, index=False)
    assert len(wrong(file)) == found


def test_tables_of_several_tasks_agree(tmp_path: Path) -> None:
    """What a table has for other tasks only is empty in a maze's row, and no difference."""
    published = PROJECT / "figures" / "sensitivity" / "trials.csv"
    trials = pd.read_csv(published, dtype=str, keep_default_na=False)
    assert "visits_overspeed" in trials
    trials[trials["task"] == "open-maze"].head(2).to_csv(tmp_path / "trials.csv", index=False)
    assert wrong(tmp_path / "trials.csv") == []


def test_rows_in_other_words_are_found(table: Path) -> None:
    """A column that is not there, or one too many, is a difference of every row."""
    trials_of(table).drop(columns="q_growth").assign(note="good").to_csv(table, index=False)
    messages = wrong(table)
    assert len(messages) == 12
    assert all("gives another note, q_growth" in message for message in messages)


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (b"", "No columns to parse"),
        (b"\xff\xfe\x00", "codec can't decode"),
        (b'task,"method\n', "EOF inside string"),
        (b"task,method\n1,2\n", "it has no column reading"),
        (HEAD.encode(), "it has no trials"),
    ],
)
def test_a_damaged_file_is_one_line(table: Path, content: bytes, message: str) -> None:
    """A file that holds no trials is an error that is told, not a traceback."""
    table.write_bytes(content)
    (line,) = wrong(table)
    assert line.startswith("t cannot be read: ")
    assert message in line
    assert "\n" not in line


@pytest.mark.parametrize(
    ("row", "message"),
    [
        ("small,unified,printed,none,one,4", "invalid literal"),
        ("small,unified,printed,none,,4", "invalid literal"),
        ("small,unified,printed,none,0,-4", ": its trial or seed has an impossible number"),
        ("small,unified,printed,none,1000000000,4", "impossible number"),
        ("small,unheard,printed,none,0,4", "unheard"),
        ("small,unified,unheard,none,0,4", "unheard"),
        ("small,unified,at-once,none,0,4", "no reading 'at-once'"),
        ("small,unified,printed,hit+detour,0,4", "with the set 'hit+detour'"),
        ("small,unified-incorrect,printed,unheard,0,4", "unheard"),
        ("other,unified,printed,none,0,4", "unknown task"),
    ],
)
def test_a_row_that_means_nothing_is_found(table: Path, row: str, message: str) -> None:
    """A row that no trial belongs to is named."""
    table.write_text(f"{HEAD}{row}\n")
    (line,) = wrong(table)
    assert line.startswith("t, row 1: no such trial: ")
    assert message in line


def test_a_changed_stored_trial_is_found(table: Path) -> None:
    """One bit of a stored result, or a record that cannot be read, is found."""
    store = Store(table.with_name("s.sqlite"))
    row = trials_of(table).iloc[0]
    key = trial_key(declared_condition(row.to_dict()), int(row["seed"]), int(row["trial"]))
    trial = store.get(key)
    weights = trial.weights.copy()
    weights[0, 0] = np.nextafter(weights[0, 0], 1)
    store.drop(key)
    store.put([(key, replace(trial, weights=weights))])
    expected = ["s.sqlite: t, row 1: the stored trial has other bits"]
    assert wrong(table) == expected
    connection = sqlite3.connect(store.path)
    with connection:
        connection.execute("UPDATE trials SET record = x'00' WHERE key = ?", (key,))
    connection.close()
    assert wrong(table) == expected


# --- conditions ------------------------------------------------------------------------------


def planned() -> list[Group]:
    """Return some groups of every notebook that has a table of parts."""
    (_, screen), *_ = calibration.stages(screen_trials=1)
    finalist = calibration.condition(calibration.points()[77])
    return [
        *sweep.plan(most_trials=1, most_specifications=3),
        *screen(pd.DataFrame())[:3],
        Group([finalist], 1, {"part": "final", "number": 77}),
        *rounding.plan(1)[:4],
        *comparison.plan(1)[::9],
        *bound.plan(1)[::9],
        *limits.plan(1)[::9],
    ]


def test_conditions_of_all_parts_come_back() -> None:
    """A row with a part and a number belongs to the condition that was planned there."""
    groups = planned()
    assert {group.labels["part"] for group in groups} == {
        *sweep.TRIALS,
        *("screen", "final", "rounding", "comparison", "bound", "limits"),
    }
    for group in groups:
        table = planned_table([group], 7)
        for row, condition in zip(
            table.astype(str).to_dict("records"), group.conditions, strict=True
        ):
            again = declared_condition({str(name): value for name, value in row.items()})
            assert trial_key(again, 7, 0) == trial_key(condition, 7, 0)


@pytest.mark.parametrize("part", DESIGNS)
def test_a_table_of_a_part_agrees(tmp_path: Path, part: str) -> None:
    """Trials that a part and a number name are computed again, whatever design they belong to."""
    group = Group([DESIGNS[part](1)], 2, {"part": part, "number": 1})
    trials = computed_table([group], errors=True, store=Store(tmp_path / "s.sqlite"), seed=4)
    told: list[int] = []
    assert wrong(write_csv(trials, tmp_path / "trials.csv"), report=told.append) == []
    assert told == [2]


@pytest.mark.parametrize(
    ("part", "number"),
    [
        *(("mazes", "-1"), ("mazes", "1000"), ("numbers", "99"), ("unheard", "0")),
        *(("screen", "480"), ("final", "480"), ("fits", "960"), ("fits", "-1"), ("rounding", "90")),
        *(("comparison", "999"), ("bound", "999")),
    ],
)
def test_what_was_not_declared_has_no_condition(part: str, number: str) -> None:
    """A part or a number that nothing was declared for is refused."""
    row = {"part": part, "number": number, "task": "open-maze", "method": "unified"}
    with pytest.raises(LookupError):
        declared_condition(row | {"reading": "printed", "set": "none"})


def test_a_condition_of_another_part_is_named() -> None:
    """A method, reading and set that are not among those of the part and number are refused."""
    row = {"part": "mazes", "number": "0", "task": "open-maze", "method": "unified"}
    with pytest.raises(LookupError, match=r"^mazes 0 has no open-maze unified printed all$"):
        declared_condition(row | {"reading": "printed", "set": "all"})


@pytest.mark.parametrize("task", list(EXPERIMENTS))
def test_conditions_of_the_experiments_come_back(task: str) -> None:
    """A row of a table of trials has all that is needed to make its condition again."""
    for key, condition in EXPERIMENTS[task].conditions().items():
        row = dict(zip(("task", "method", "reading", "set"), (task, *key), strict=True))
        again = declared_condition(row)
        assert trial_key(again, 1, 0) == trial_key(condition, 1, 0)
