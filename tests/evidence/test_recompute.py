from __future__ import annotations

import sqlite3
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest

from replication import Demos, save_demos
from replication.evidence import recompute
from replication.evidence.experiments import EXPERIMENTS, Experiment, condition_of
from replication.evidence.recompute import recompute_trials, sampled_trials
from replication.trials.compute import trial_key
from replication.trials.condition import Condition
from replication.trials.results import Results, digest
from replication.trials.run import run_trials
from replication.trials.store import Store

FEW = {"episodes": 60, "horizon": 40, "max_iterations": 20}
TRIALS = 5
HEAD = b"task,method,reading,set,trial,seed,iterations,converged,steps,digest\n"


def table_of(results: Results, conditions: dict[tuple[str, str], Condition]) -> pd.DataFrame:
    """Return the columns of a table of trials that a recomputation reads."""
    rows = []
    for (method, reading), condition in conditions.items():
        for k in range(results.trials):
            trial = results.trial(condition, k)
            name = ("small", method, reading, "none", k, 4)
            made = (trial.iterations, int(trial.converged), trial.steps, digest(trial))
            rows.append(name + made)
    return pd.DataFrame(rows, columns=list(recompute.COLUMNS))


@pytest.fixture
def out(tmp_path: Path, small_demos: Demos, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Return a folder with the trials.csv of a small task, and its store beside it."""
    save_demos(small_demos, tmp_path / "small.json")
    experiment = Experiment(str(tmp_path / "small.json"), FEW, ("adaboost", "unified"))
    monkeypatch.setitem(EXPERIMENTS, "small", experiment)
    monkeypatch.setattr(recompute, "EVERY", 3)
    conditions = experiment.conditions()
    results = run_trials(
        list(conditions.values()), trials=TRIALS, store=Store(tmp_path / "s.sqlite"), seed=4
    )
    (tmp_path / "out" / "small").mkdir(parents=True)
    table_of(results, conditions).to_csv(tmp_path / "out" / "small" / "trials.csv", index=False)
    return tmp_path / "out"


def trials_of(out: Path) -> pd.DataFrame:
    """Return the table of trials."""
    return pd.read_csv(out / "small" / "trials.csv", keep_default_na=False)


def wrong(out: Path, **options: Any) -> list[str]:
    """Return what is wrong with the trials of a folder."""
    return list(recompute_trials(out, out.parent / "s.sqlite", **options))


def test_what_was_computed_here_agrees(out: Path) -> None:
    """A sample is computed again, with or without a store, by any number of workers."""
    told: list[int] = []
    assert wrong(out, report=told.append) == []
    assert told == [len(sampled_trials(out / "small" / "trials.csv"))] == [5]
    assert wrong(out, jobs=2) == []
    (out.parent / "s.sqlite").unlink()
    assert wrong(out) == []
    assert not (out.parent / "s.sqlite").exists()


@pytest.mark.parametrize("column", ["iterations", "converged", "steps", "seed", "trial", "digest"])
def test_a_changed_row_is_found(out: Path, column: str) -> None:
    """Whatever of a sampled row is not what its trial gives, the row is named."""
    table = trials_of(out)
    value = table.loc[3, column]
    special = {"converged": 1 - int(value) if column == "converged" else 0}
    special |= {"digest": table.loc[6, "digest"]}
    table.loc[3, column] = special[column] if column in special else value + 1
    table.to_csv(out / "small" / "trials.csv", index=False)
    (message,) = wrong(out)
    name = f"small/trials.csv: adaboost, -, none, trial {table.loc[3, 'trial']}: "
    assert message.startswith(name)


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (b"", "No columns to parse"),
        (b"\xff\xfe\x00", "codec can't decode"),
        (b'task,"method\n', "EOF inside string"),
        (HEAD.replace(b",digest", b""), "digest"),
        (HEAD + b"small,unified,printed,none,one,4,1,1,1,x\n", "invalid literal"),
        (HEAD + b"small,unified,printed,none,,4,1,1,1,x\n", "invalid literal"),
        (HEAD + b"small,unified,printed,none,0,-4,1,1,1,x\n", "impossible number"),
        (HEAD + b"small,unified,printed,none,1000000000,4,1,1,1,x\n", "impossible number"),
    ],
)
def test_a_damaged_file_is_one_line(out: Path, content: bytes, message: str) -> None:
    """A trials.csv that holds no trials is an error that is told, not a traceback."""
    (out / "small" / "trials.csv").write_bytes(content)
    (line,) = wrong(out)
    assert line.startswith("small/trials.csv cannot be read: ")
    assert message in line
    assert "\n" not in line


@pytest.mark.parametrize("column", ["method", "reading", "set"])
def test_a_row_that_means_nothing_is_found(out: Path, column: str) -> None:
    """A row that no condition belongs to is named, and the others are computed."""
    table = trials_of(out)
    row = 6  # of a method with a trace
    table.loc[row, column] = "unheard"
    table.loc[row, "method"] = "unheard" if column == "method" else "unified-incorrect"
    table.to_csv(out / "small" / "trials.csv", index=False)
    (message,) = wrong(out)
    assert message.startswith("small/trials.csv: un")
    assert ": no such condition: " in message


def test_a_changed_stored_trial_is_found(out: Path) -> None:
    """One bit of a stored result, or a record that cannot be read, is found."""
    store = Store(out.parent / "s.sqlite")
    row = trials_of(out).iloc[0]
    condition = condition_of(row["task"], row["method"], row["reading"], row["set"])
    key = trial_key(condition, int(row["seed"]), int(row["trial"]))
    trial = store.get(key)
    weights = trial.weights.copy()
    weights[0, 0] = np.nextafter(weights[0, 0], 1)
    store.drop(key)
    store.put([(key, replace(trial, weights=weights))])
    expected = (
        "s.sqlite: small/trials.csv: adaboost, -, none, trial 0: the stored trial has other bits"
    )
    assert wrong(out) == [expected]
    connection = sqlite3.connect(store.path)
    with connection:
        connection.execute("UPDATE trials SET record = x'00' WHERE key = ?", (key,))
    connection.close()
    assert wrong(out) == [expected]


def test_rows_of_other_tasks_are_left_out(out: Path) -> None:
    """Only what belongs to an experiment is sampled; without a table there is nothing."""
    trials_of(out).assign(task="other").to_csv(out / "small" / "trials.csv", index=False)
    assert wrong(out) == []
    (out / "small" / "trials.csv").unlink()
    assert wrong(out) == []


def test_one_trial_in_twenty_is_sampled() -> None:
    """The sample is 5 %."""
    assert recompute.EVERY == 20


@pytest.mark.parametrize("task", list(EXPERIMENTS))
def test_conditions_of_the_experiments_come_back(task: str) -> None:
    """A row of a table of trials has all that is needed to make its condition again."""
    for (method, reading), condition in EXPERIMENTS[task].conditions().items():
        used = (
            condition.params.demonstrations.incorrect if condition.rule.uses_incorrect else "none"
        )
        again = condition_of(task, method, reading, used)
        assert trial_key(again, 1, 0) == trial_key(condition, 1, 0)
