from __future__ import annotations

from pathlib import Path

import pytest

from replication import Demos, save_demos
from replication.evidence.tables import sets_table
from replication.paper.published import FIGURE_5, TABLE_1
from replication.paper.register import ChoiceError
from replication.report.study import Study

FEW = {"episodes": 60, "horizon": 40}


def make(folder: Path, demos: str, experiment: str = "open-maze", **changed: object) -> Study:
    """Make a study of very few trials."""
    report = {"trials": 3, "set_trials": 2, **changed}
    place = {"store": str(folder / "trials.sqlite"), "out": str(folder / "out")}
    return Study(experiment, demos, FEW, seed=4, jobs=1, **place, **report)  # type: ignore[arg-type]


@pytest.fixture
def study(small_demos: Demos, tmp_path: Path) -> Study:
    """Make a study of a user's own maze."""
    path = tmp_path / "small.json"
    save_demos(small_demos, path)
    return make(tmp_path, str(path))


def test_the_table_has_the_sets_beside_the_methods(study: Study) -> None:
    """The methods have all trials, other sets as many as they are run with, and no row is twice."""
    keys = ["method", "reading", "set"]
    assert not study.trials.duplicated([*keys, "trial"]).any()
    counts = study.trials.groupby(keys).size()
    assert counts["unified-incorrect", "printed", "hit+detour"] == 3
    assert counts["unified-incorrect", "printed", "opposite"] == 2
    assert study.trials.head(len(study.main)).equals(study.main)
    assert set(sets_table(study.trials, study.sets)["n"]) == {2}


def test_nothing_is_published_for_a_task_of_ones_own(study: Study, tmp_path: Path) -> None:
    """Published numbers stand beside the paper's own task only."""
    assert (study.published, study.published_curves) == ({}, {})
    stored = make(tmp_path, "data/demos/open_maze.json")
    assert (stored.published, stored.published_curves) == (TABLE_1, FIGURE_5)
    other = make(tmp_path, "data/demos/obstacle_maze.json", "obstacle-maze")
    assert other.published_curves == {}


def test_traced_trials_are_those_under_a_reading(study: Study) -> None:
    """Each method has one trial under a reading of Eq. 9, with every iteration."""
    traced = study.traced("updated")
    assert list(traced) == [
        ("adaboost", ""),
        ("unified", "updated"),
        ("unified-incorrect", "updated"),
    ]
    assert all(trial.snapshots is not None for trial in traced.values())
    assert study.of("unified")["reading"].unique().tolist() == ["printed", "updated"]


def test_a_report_is_checked(small_demos: Demos, tmp_path: Path) -> None:
    """What is asked of a report is a registered choice, refused in one line if it is not."""
    with pytest.raises(ChoiceError, match="surface"):
        make(tmp_path, "data/demos/open_maze.json", surface="least")


def test_tables_are_shown_as_markdown(study: Study) -> None:
    """A table that is only shown is Markdown with its columns as the head."""
    assert study.show(study.main.head(1)).data.startswith("| task  | method")
