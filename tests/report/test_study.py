from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest

from replication import Demos, save_demos
from replication.errors import UserError
from replication.evidence.experiments import GENERAL, NAMED, NONE, Key
from replication.evidence.tables import means_table, sets_table
from replication.paper.published import FIGURE_5, TABLE_1
from replication.paper.register import ChoiceError
from replication.report.study import Study
from replication.trials.measures import ALONG
from replication.trials.results import digest

FEW = {"episodes": 60, "horizon": 40}


def make(folder: Path, demos: str, experiment: str = "open-maze", **changed: object) -> Study:
    """Make a study of very few trials."""
    given: dict[str, Any] = {"trials": 3, "sets": ("opposite", NAMED), "set_trials": 2, **changed}
    place: dict[str, Any] = {"store": str(folder / "trials.sqlite"), "out": str(folder / "out")}
    given = {"choices": FEW} | given
    return Study(experiment, demos, seed=4, jobs=1, **place, **given)


@pytest.fixture
def own(small_demos: Demos, tmp_path: Path) -> str:
    """Write a user's own maze."""
    save_demos(small_demos, tmp_path / "small.json")
    return str(tmp_path / "small.json")


@pytest.fixture
def study(own: str, tmp_path: Path) -> Study:
    """Make a study of it."""
    return make(tmp_path, own)


def test_the_table_has_the_sets_beside_the_methods(study: Study) -> None:
    """The methods have all trials, other sets as many as they are run with, and no row is twice."""
    keys = ["method", "reading", "set"]
    assert not study.trials.duplicated([*keys, "trial"]).any()
    counts = study.trials.groupby(keys).size()
    for reading in ("printed", "updated", "at-once"):
        assert counts["unified-incorrect", reading, NAMED] == 3
        assert counts["unified-incorrect", reading, GENERAL] == 3
        assert counts["unified-incorrect", reading, "opposite"] == 2
    assert study.trials.head(len(study.main)).equals(study.main)
    saved = sets_table(study.trials, {**study.conditions, **study.sets})
    assert dict(zip(saved["set"], saved["n"], strict=True)) == {"opposite": 2, NAMED: 3, GENERAL: 3}


def test_q_along_the_path_is_there_if_asked_for(study: Study, own: str, tmp_path: Path) -> None:
    """The table of the open maze has it, others are not made larger by it."""
    assert not {*ALONG} & {*study.trials}
    assert {*ALONG} <= {*make(tmp_path, own, path=True).trials}


def test_methods_have_equally_many_trials_of_their_own(own: str, tmp_path: Path) -> None:
    """Where sets have more trials than the methods, a set that is judged has no more of its own."""
    study = make(tmp_path, own, trials=2, set_trials=3)
    assert set(study.main.groupby(["method", "reading", "set"]).size()) == {2}
    assert len(study.trials) == 9 * 2 + 6 * 1 + 3 * 3


def test_without_sets_there_are_the_methods_alone(own: str, tmp_path: Path) -> None:
    """Nothing else is run than what the paper is judged by."""
    study = make(tmp_path, own, sets=(), set_trials=0)
    assert study.sets == {}
    assert study.trials.equals(study.main)


def test_nothing_is_published_for_a_task_of_ones_own(study: Study, tmp_path: Path) -> None:
    """Published numbers stand beside the paper's own task only."""
    assert (study.published, study.published_curves) == ({}, {})
    stored = make(tmp_path, "data/demos/open_maze.json")
    assert (stored.published, stored.published_curves) == (TABLE_1, FIGURE_5)
    other = make(tmp_path, "data/demos/obstacle_maze.json", "obstacle-maze")
    assert other.published_curves == {}


@pytest.mark.parametrize(
    ("reading", "set", "shown"),
    [
        ("updated", NAMED, [("unified", "updated", NONE), ("unified-incorrect", "updated", NAMED)]),
        (
            "at-once",
            GENERAL,
            [("unified", "printed", NONE), ("unified-incorrect", "at-once", GENERAL)],
        ),
        ("printed", NONE, [("unified", "printed", NONE)]),
    ],
)
def test_traced_trials_are_those_of_a_cell(
    study: Study, reading: str, set: str, shown: list[Key]
) -> None:
    """Each method has one trial, which counts under the reading and with the set; all is kept."""
    traced = study.traced(reading, set)
    assert list(traced) == [("adaboost", "", NONE), *shown]
    assert all(trial.snapshots is not None for trial in traced.values())


def test_a_trial_is_replayed_with_its_snapshots(study: Study) -> None:
    """A trial that is computed again is that of the table, and keeps every iteration."""
    key = "unified-incorrect", "at-once", GENERAL
    trial = study.replayed(key, 2)
    rows = study.trials.set_index(["method", "reading", "set", "trial"])
    assert digest(trial) == rows.loc[(*key, 2), "digest"]
    assert trial.snapshots is not None
    assert len(trial.snapshots.weights) == trial.iterations + 1


def test_rows_of_methods(study: Study) -> None:
    """The rows of some methods have all of their readings and judged sets."""
    rows = study.of("unified", "unified-incorrect")
    assert rows.loc[rows["method"] == "unified", "reading"].unique().tolist() == [
        "printed",
        "updated",
    ]
    given = rows[rows["method"] == "unified-incorrect"]
    assert given["reading"].unique().tolist() == ["printed", "updated", "at-once"]
    assert given["set"].unique().tolist() == [NAMED, GENERAL]


def test_a_report_is_checked(small_demos: Demos, tmp_path: Path) -> None:
    """What is asked of a report is a registered choice, refused in one line if it is not."""
    with pytest.raises(ChoiceError, match="surface"):
        make(tmp_path, "data/demos/open_maze.json", surface="least")


def test_tables_are_shown_as_markdown(study: Study) -> None:
    """A table that is only shown is Markdown with its columns as the head."""
    assert study.show(means_table(study.main)).data.startswith("| Method ")


@pytest.mark.parametrize("text", ['{"alpha": 0.1', "alpha", '["alpha"]', "3", "[" * 500])
def test_choices_may_be_json_text(own: str, tmp_path: Path, text: str) -> None:
    """What papermill passes on counts like the object that it says; no other text does."""
    study = make(tmp_path, own, choices=json.dumps(FEW | {"alpha": 0.1}))
    assert study.choices == study.choices | FEW | {"alpha": 0.1}
    with pytest.raises(UserError, match=r"^choices = [^\n]* is no JSON object such as [^\n]*$"):
        make(tmp_path, own, choices=text)
