from __future__ import annotations

from pathlib import Path

import pandas as pd
import pytest
from IPython.core.interactiveshell import InteractiveShell

from replication import Demos
from replication.errors import UserError
from replication.evidence.experiments import method_conditions
from replication.evidence.tables import read_table, write_csv
from replication.progress import GIVEN
from replication.report.maze import demonstrations
from replication.report.moving import Player
from replication.report.outputs import Outputs, Shown
from replication.trials.store import Store
from replication.trials.table import Group, computed_table


def published(shown: Shown) -> tuple[dict[str, object], dict[str, object]]:
    """Return what Jupyter would store of an output: its data, and our metadata."""
    formatter = InteractiveShell.instance().display_formatter
    assert formatter is not None
    data, metadata = formatter.format(shown)
    return data, metadata["replication"]


def test_a_figure_is_written_with_its_numbers(tmp_path: Path, small_demos: Demos) -> None:
    """A figure is shown as it is written, and its metadata names files, words and code."""
    picture = demonstrations(small_demos)
    data, metadata = published(Outputs(tmp_path / "out").figure(picture, "map"))
    assert data["image/png"] == (tmp_path / "out" / "map.png").read_bytes()
    assert {path.name for path in (tmp_path / "out").iterdir()} == {"map.png", "map.svg", "map.csv"}
    assert metadata == {
        "kind": "figure",
        "name": "map",
        "alt": picture.words,
        "code": "replication.report.maze.draw_demonstrations",
    }


def test_a_table_is_written_in_full_and_for_reading(tmp_path: Path) -> None:
    """A table's CSV has ten digits; its Markdown is what is shown."""
    table, readable = pd.DataFrame({"x": [1 / 3]}), pd.DataFrame({"x": ["0.33"]})
    data, metadata = published(Outputs(tmp_path).table(table, "numbers", readable=readable))
    assert data["text/markdown"] == (tmp_path / "numbers.md").read_text(encoding="utf-8")
    assert (tmp_path / "numbers.csv").read_text(encoding="utf-8") == "x\n0.3333333333\n"
    assert metadata == {"kind": "table", "name": "numbers"}


def test_a_player_is_written_with_its_numbers(tmp_path: Path) -> None:
    """A player's page is what is shown, and its words are those that stand for it."""
    player = Player("<b>moves</b>", pd.DataFrame({"x": [1]}), "It moves.")
    data, metadata = published(Outputs(tmp_path).player(player, "film"))
    assert data["text/html"] == (tmp_path / "film.html").read_text(encoding="utf-8")
    assert (tmp_path / "film.csv").read_text(encoding="utf-8") == "x\n1\n"
    assert metadata == {"kind": "player", "name": "film", "alt": "It moves."}


def test_data_are_written_and_not_shown(tmp_path: Path) -> None:
    """A table that nobody reads on the page is a file only."""
    Outputs(tmp_path).data(pd.DataFrame({"x": [1]}), "trials")
    assert [path.name for path in tmp_path.iterdir()] == ["trials.csv"]


# --- trials ----------------------------------------------------------------------------------


@pytest.fixture
def groups(small_demos: Demos) -> list[Group]:
    """Plan two conditions of a small maze, of three trials each."""
    conditions = method_conditions(small_demos, {"episodes": 60, "horizon": 40})
    return [Group(list(conditions.values())[:2], 3)]


def test_trials_are_computed_and_written(
    tmp_path: Path, groups: list[Group], store_path: Path
) -> None:
    """The table that everything else is made from is the one that the file has."""
    table = Outputs(tmp_path).computed(groups, errors=True, store=Store(store_path), seed=3)
    pd.testing.assert_frame_equal(table, read_table(tmp_path / "trials.csv"))
    expected = computed_table(groups, errors=True, store=Store(store_path), seed=3)
    pd.testing.assert_frame_equal(table, expected, check_dtype=False)


def test_given_trials_are_taken_and_not_computed(
    tmp_path: Path, groups: list[Group], store_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A given table is used as it is, if its rows are those that were planned, in their order."""
    store = Store(store_path)
    given = tmp_path / "given" / "trials.csv"
    changed = computed_table(groups, store=store, seed=3).assign(iterations=99)
    write_csv(changed, given)
    monkeypatch.setenv(GIVEN, str(given.parent))
    table = Outputs(tmp_path / "out").computed(groups, store=store, seed=3)
    assert set(table["iterations"]) == {99}
    assert (tmp_path / "out" / "trials.csv").read_bytes() == given.read_bytes()
    for rows, seed, message in (
        (changed, 4, "see its column seed"),
        (changed.iloc[:-1], 3, "5 trials instead of 6"),
        (changed.iloc[[1, 0, 2, 3, 4, 5]], 3, "see its column trial"),
        (changed.iloc[[0, 1, 2, 3, 4, 4]], 3, "see its column trial"),
        (changed.assign(set="all"), 3, "see its column set"),
        (changed.drop(columns="reading"), 3, "see its column reading"),
    ):
        write_csv(rows, given)
        with pytest.raises(UserError, match=message):
            Outputs(tmp_path / "out").computed(groups, store=store, seed=seed)
