from __future__ import annotations

import json
import sqlite3
from dataclasses import replace
from importlib import metadata
from pathlib import Path
from typing import Any

import nbformat
import numpy as np
import pandas as pd
import pytest
from nbformat.v4 import new_code_cell, new_notebook

from replication import Demos, save_demos
from replication.evidence.experiments import EXPERIMENTS, Experiment
from replication.evidence.tables import write_trials
from replication.files import PROJECT, write_file
from replication.paper.params import Params
from replication.paper.register import load_choices
from replication.pipeline import provenance
from replication.pipeline import verify as verification
from replication.pipeline.plan import prepare
from replication.pipeline.verify import (
    sampled_trials,
    setting_of,
    verify,
    verify_inputs,
    verify_outputs,
    verify_packages,
    verify_trials,
)
from replication.trials.compute import trial_key
from replication.trials.condition import Condition
from replication.trials.run import run_trials
from replication.trials.store import Store

INPUTS: dict[str, Any] = {"parameters": {}, "data": {}, "source": {}}
FEW = {"episodes": 60, "horizon": 40, "max_iterations": 20}
TRIALS = 5
HEAD = b"task,method,trial,seed,iterations,converged,steps,choices,digest\n"


@pytest.fixture
def out(tmp_path: Path, small_demos: Demos, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Return a folder with the trials.csv of a small task, and its store beside it."""
    save_demos(small_demos, tmp_path / "small.json")
    experiment = Experiment(str(tmp_path / "small.json"), FEW, ("adaboost", "unified"))
    monkeypatch.setattr(verify, "EXPERIMENTS", {"small": experiment})
    monkeypatch.setattr(verify, "EVERY", 3)
    conditions = list(experiment.conditions().values())
    results = run_trials(conditions, trials=TRIALS, store=Store(tmp_path / "s.sqlite"), seed=4)
    (tmp_path / "out").mkdir()
    write_trials(results.frame(), tmp_path / "out" / "trials.csv")
    return tmp_path / "out"


def wrong(out: Path, **options: Any) -> list[str]:
    """Return what is wrong with the trials of a folder."""
    return list(verify_trials(out, out.parent / "s.sqlite", **options))


# --- outputs ---------------------------------------------------------------------------------


def test_outputs_are_held_against_the_manifest(tmp_path: Path) -> None:
    """Every file that changed or is gone is named, with the notebook that made it."""
    assert "provenance.json is missing" in next(verify_outputs(tmp_path))
    for name in ("a.csv", "b.csv", "c.csv"):
        (tmp_path / name).write_text(name)
    hashes = {name: provenance.file_hash(tmp_path / name) for name in ("a.csv", "b.csv", "c.csv")}
    document = {
        "format": provenance.FORMAT,
        "version": provenance.VERSION,
        "notebooks": {"toy": {"inputs": INPUTS, "outputs": hashes}},
    }
    write_file(tmp_path / provenance.MANIFEST, json.dumps(document))
    assert list(verify_outputs(tmp_path)) == []
    (tmp_path / "a.csv").write_text("a.csv ")
    (tmp_path / "b.csv").unlink()
    assert list(verify_outputs(tmp_path)) == [
        "a.csv is changed since toy made it",
        "b.csv is missing since toy made it",
    ]


def test_what_changed_since_is_stale(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Outputs that are whole, but of other inputs than those of now, are named."""
    monkeypatch.setattr("replication.files.PROJECT", tmp_path)
    (tmp_path / "environment.lock").touch()
    cells = [new_code_cell('out = "x"\ntrials = 3', metadata={"tags": ["parameters"]})]
    node = new_notebook(cells=cells, metadata={"replication": {"outputs": []}})
    for name in ("one", "two"):
        nbformat.write(node, tmp_path / f"{name}.ipynb")
    runs = prepare([tmp_path / "one.ipynb", tmp_path / "two.ipynb"], profile="paper")
    for run in runs:
        (tmp_path / run.notebook.executed).touch()
        provenance.record(tmp_path, run.notebook, run.inputs, {})
    assert list(verify_inputs(runs, tmp_path)) == []
    (tmp_path / "environment.lock").write_text("numpy==3")
    assert list(verify_inputs([runs[0].again()], tmp_path)) == [
        "one is stale: environment.lock has changed",
        "two made outputs, and is no notebook of this project any more",
    ]


# --- packages --------------------------------------------------------------------------------


def test_packages_are_held_against_the_lock(tmp_path: Path) -> None:
    """Another version and a package that is missing are named; other platforms' pins are not."""
    version = metadata.version("numpy")
    lock = tmp_path / "environment.lock"
    lock.write_text(
        f"# a comment\nnumpy=={version} \\\n    --hash=sha256:00 \\\n    --hash=sha256:11\n"
        f"NumPy=={version}\npandas==0.1 ; python_version > '3'\n"
        "no-such-package==1.0\nno-such-other==1 ; sys_platform == 'none'\n    # via numpy\n"
    )
    pandas = metadata.version("pandas")
    assert list(verify_packages(lock)) == [
        f"pandas {pandas} is installed; the lock pins ==0.1",
        "no-such-package is not installed; the lock pins ==1.0",
    ]


def test_the_projects_lock_can_be_read() -> None:
    """Each pin of environment.lock is understood."""
    for said in verify_packages(PROJECT / "environment.lock"):
        assert "the lock pins ==" in said


# --- trials ----------------------------------------------------------------------------------


def test_what_was_computed_here_agrees(out: Path) -> None:
    """A sample is computed again, with or without a store, by any number of workers."""
    told: list[int] = []
    assert wrong(out, report=told.append) == []
    assert told == [len(sampled_trials(out))] == [5]
    assert wrong(out, jobs=2) == []
    (out.parent / "s.sqlite").unlink()
    assert wrong(out) == []
    assert not (out.parent / "s.sqlite").exists()


@pytest.mark.parametrize("column", ["iterations", "converged", "steps", "seed", "trial", "digest"])
def test_a_changed_row_is_found(out: Path, column: str) -> None:
    """Whatever of a sampled row is not what its trial gives, the row is named."""
    table = pd.read_csv(out / "trials.csv", keep_default_na=False)
    value = table.loc[3, column]
    special = {"converged": not value, "digest": table.loc[6, "digest"]}
    table.loc[3, column] = special[column] if column in special else value + 1
    table.to_csv(out / "trials.csv", index=False)
    (said,) = wrong(out)
    assert said.startswith("trials.csv: small, adaboost, EPISODES=60 HORIZON=40 ITERATION-CAP=20, ")
    assert f"trial {table.loc[3, 'trial']}: " in said


@pytest.mark.parametrize(
    ("content", "said"),
    [
        (b"", "No columns to parse"),
        (b"\xff\xfe\x00", "codec can't decode"),
        (b'task,"method\n', "EOF inside string"),
        (b"task,method,trial,seed,iterations,converged,steps,choices\n", "digest"),
        (HEAD + b"small,unified,one,4,1,True,1,,x\n", "invalid literal"),
        (HEAD + b"small,unified,,4,1,True,1,,x\n", "invalid literal"),
        (HEAD + b"small,unified,0,-4,1,True,1,,x\n", "impossible number"),
        (HEAD + b"small,unified,1000000000,4,1,True,1,,x\n", "impossible number"),
    ],
)
def test_a_damaged_file_is_one_line(out: Path, content: bytes, said: str) -> None:
    """A trials.csv that holds no trials is an error that is told, not a traceback."""
    (out / "trials.csv").write_bytes(content)
    (line,) = wrong(out)
    assert line.startswith("trials.csv cannot be read: ")
    assert said in line
    assert "\n" not in line


@pytest.mark.parametrize("choices", ["NO-CHOICE=1", "EPISODES=many", "ALPHA", "MAP-OPEN=x"])
def test_a_row_that_means_nothing_is_found(out: Path, choices: str) -> None:
    """A row that no condition belongs to is named, and the others are computed."""
    table = pd.read_csv(out / "trials.csv", keep_default_na=False)
    table.loc[0, "choices"] = choices
    table.to_csv(out / "trials.csv", index=False)
    (said,) = wrong(out)
    assert said.startswith(f"trials.csv: small, adaboost, {choices}: no such setting")


def test_a_changed_stored_trial_is_found(out: Path) -> None:
    """One bit of a stored result, or a record that cannot be read, is found."""
    store = Store(out.parent / "s.sqlite")
    row = next(sampled_trials(out).itertuples())
    condition = setting_of(row.task, row.method, row.choices)
    key = trial_key(condition, row.seed, row.trial)
    trial = store.get(key)
    weights = trial.weights.copy()
    weights[0, 0] = np.nextafter(weights[0, 0], 1)
    store.drop(key)
    store.put([(key, replace(trial, weights=weights))])
    due = "s.sqlite: small, adaboost, EPISODES=60 HORIZON=40 ITERATION-CAP=20, trial 0: "
    assert wrong(out) == [f"{due}the stored trial has other bits"]
    connection = sqlite3.connect(store.path)
    with connection:
        connection.execute("UPDATE trials SET record = x'00' WHERE key = ?", (key,))
    connection.close()
    assert wrong(out) == [f"{due}the stored trial has other bits"]


def test_rows_of_other_tasks_are_left_out(out: Path) -> None:
    """Only what belongs to an experiment is sampled; a table of defaults has empty choices."""
    table = pd.read_csv(out / "trials.csv", keep_default_na=False)
    assert set(sampled_trials(out).index) == {0, 3, 6, 9, 12}
    table.assign(task="other").to_csv(out / "trials.csv", index=False)
    assert len(sampled_trials(out)) == 0
    assert wrong(out) == []
    table.assign(choices="").to_csv(out / "trials.csv", index=False)
    assert sampled_trials(out)["choices"].tolist() == [""] * 5


def test_one_trial_in_twenty_is_sampled() -> None:
    """The sample is 5 %."""
    assert verification.EVERY == 20


# --- the conditions behind rows ----------------------------------------------------------------


@pytest.mark.parametrize("task", list(EXPERIMENTS))
def test_settings_of_the_experiments_come_back(task: str) -> None:
    """A row of trials.csv has all that is needed to make its condition again."""
    for condition in EXPERIMENTS[task].conditions().values():
        again = setting_of(condition.demos.task, condition.method, condition.choices)
        assert trial_key(again, 1, 0) == trial_key(condition, 1, 0)
        assert again.params == condition.params


FIELDS = {
    entry.field.split(".")[1]: entry
    for entry in load_choices().values()
    if entry.field and entry.field.split(".")[1] in Params().values()
}


@pytest.mark.parametrize("name", sorted(FIELDS))
def test_every_value_of_a_choice_comes_back(name: str) -> None:
    """Words, whole numbers and numbers of all digits survive the text of the row."""
    entry = FIELDS[name]
    values: list[Any] = list(entry.alternatives)
    if entry.range is not None:
        low, high = entry.range
        values = [low, high, low + (high - low) / 3]
        if isinstance(entry.default, int):
            values = [int(low), int(high), int(low) + 1]
    demos = EXPERIMENTS["open-maze"].conditions()["unified", "printed"].demos
    for value in values:
        condition = Condition(demos, "unified", Params.of(**{name: value}))
        again = setting_of("open-maze", "unified", condition.choices)
        assert again.params == condition.params
        assert again.choices == condition.choices


# --- all together ----------------------------------------------------------------------------


def test_everything_is_checked_and_told(out: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The lines say what is being done, and all that is wrong comes back."""
    monkeypatch.setattr(verify, "PROJECT", out.parent)
    (out.parent / "environment.lock").write_text("numpy==0.1\n")
    told: list[str] = []
    found = verify([], out, out.parent / "s.sqlite", jobs=1, echo=told.append)
    assert [said.split()[0] for said in told] == ["hashing", "comparing", "recomputing"]
    assert len(found) == 2
    assert "provenance.json is missing" in found[0]
    assert found[1].startswith("numpy ")
