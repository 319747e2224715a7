from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pandas as pd
import pytest
from IPython.core.interactiveshell import InteractiveShell

from replication import Demos
from replication.errors import UserError
from replication.evidence.experiments import conditions_of
from replication.evidence.tables import read_table, write_csv
from replication.progress import GIVEN
from replication.report.maze import demonstrations
from replication.report.moving import Player
from replication.report.outputs import Outputs, Shown, Stage
from replication.trials.condition import Condition
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


FEW = {"episodes": 60, "horizon": 40}


@pytest.fixture
def conditions(small_demos: Demos) -> list[Condition]:
    """Return two conditions of a small maze."""
    return list(conditions_of(small_demos, FEW).values())[:2]


@pytest.fixture
def stages(conditions: list[Condition]) -> list[Stage]:
    """Plan two stages: three trials of two conditions, then two of the one that is faster."""

    def first(_: pd.DataFrame) -> list[Group]:
        return [
            Group([one], 3, {"part": "screen", "number": number})
            for number, one in enumerate(conditions)
        ]

    def then(trials: pd.DataFrame) -> list[Group]:
        means = trials.groupby("number")["iterations"].mean()
        fastest = int(means.idxmin())
        return [Group([conditions[fastest]], 2, {"part": "final", "number": fastest})]

    return [(3, first), (5, then)]


def test_trials_are_computed_and_written(
    tmp_path: Path, conditions: list[Condition], store_path: Path
) -> None:
    """The table that everything else is made from is the one that the file has."""
    groups, store = [Group(conditions, 3)], Store(store_path)
    table = Outputs(tmp_path).computed((3, lambda _: groups), errors=True, store=store)
    pd.testing.assert_frame_equal(table, read_table(tmp_path / "trials.csv"))
    expected = computed_table(groups, errors=True, store=store, seed=3)
    pd.testing.assert_frame_equal(table, expected, check_dtype=False)


def test_a_later_stage_is_planned_by_the_trials_before(
    tmp_path: Path, stages: list[Stage], store_path: Path
) -> None:
    """Each stage sees all trials of those before, and its own have the seed of the stage."""
    table = Outputs(tmp_path).computed(*stages, store=Store(store_path))
    pd.testing.assert_frame_equal(table, read_table(tmp_path / "trials.csv"))
    assert table["part"].tolist() == ["screen"] * 6 + ["final"] * 2
    assert table["seed"].tolist() == [3] * 6 + [5] * 2
    screen, final = (table[table["part"] == part] for part in ("screen", "final"))
    means = screen.groupby("number")["iterations"].mean()
    assert set(final["number"]) == {means.idxmin()}


def given(folder: Path, table: pd.DataFrame, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Give a table of trials to notebooks; return its file."""
    monkeypatch.setenv(GIVEN, str(folder / "given"))
    return write_csv(table, folder / "given" / "trials.csv")


def test_given_trials_are_taken_and_not_computed(
    tmp_path: Path, stages: list[Stage], store_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A given table is used as it is, whatever its measures are, if its trials are the planned."""
    table = Outputs(tmp_path).computed(*stages, store=Store(store_path))
    file = given(tmp_path, table.assign(early_errors=99), monkeypatch)
    monkeypatch.setattr("replication.report.outputs.computed_table", None)
    taken = Outputs(tmp_path / "out").computed(*stages, store=None)
    assert set(taken["early_errors"]) == {99}
    assert (tmp_path / "out" / "trials.csv").read_bytes() == file.read_bytes()


def slower(table: pd.DataFrame) -> pd.DataFrame:
    """Let the condition that went on to the second stage be the slower one."""
    chosen = table["number"] == table["number"].iloc[-1]
    raised = chosen & (table["part"] == "screen")
    return table.assign(iterations=table["iterations"].where(~raised, 500))


FORGED: dict[str, tuple[Callable[[pd.DataFrame], pd.DataFrame], str]] = {
    "last one missing": (lambda t: t.iloc[:-1], "has 7 trials instead of 8"),
    "first stage alone": (lambda t: t.iloc[:6], "has 6 trials instead of 8"),
    "half a stage": (lambda t: t.iloc[:4], "has 4 trials instead of 6"),
    "none": (lambda t: t.iloc[:0], "has 0 trials instead of 6"),
    "one more": (lambda t: t.iloc[[*range(8), 7]], "has 9 trials instead of 8"),
    "reordered": (lambda t: t.iloc[[1, 0, *range(2, 8)]], "see its column trial"),
    "reordered later": (lambda t: t.iloc[[*range(6), 7, 6]], "see its column trial"),
    "stages exchanged": (lambda t: t.iloc[[6, 7, *range(6)]], "see its column part"),
    "one twice": (lambda t: t.iloc[[*range(7), 6]], "see its column trial"),
    "seed": (lambda t: t.assign(seed=4), "see its column seed"),
    "seed of the first stage": (lambda t: t.assign(seed=3), "see its column seed"),
    "set": (lambda t: t.assign(set="all"), "see its column set"),
    "number": (lambda t: t.assign(number=1 - t["number"]), "see its column number"),
    "no reading": (lambda t: t.drop(columns="reading"), "see its column reading"),
    "another winner": (slower, "see its column number"),
}


@pytest.fixture(scope="module")
def finished(
    small_demos: Demos, tmp_path_factory: pytest.TempPathFactory
) -> tuple[list[Stage], pd.DataFrame]:
    """Compute both stages once."""
    conditions: Any = list(conditions_of(small_demos, FEW).values())[:2]
    plan: list[Stage] = stages.__wrapped__(conditions)  # type: ignore[attr-defined]
    folder = tmp_path_factory.mktemp("stages")
    return plan, Outputs(folder).computed(*plan, store=Store(folder / "trials.sqlite"))


@pytest.mark.parametrize("forgery", FORGED)
def test_other_trials_than_the_planned_are_refused(
    forgery: str,
    finished: tuple[list[Stage], pd.DataFrame],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Missing, extra, reordered and forged rows are one line, in whichever stage; none is kept."""
    (plan, table), (forge, message) = finished, FORGED[forgery]
    file = given(tmp_path, forge(table), monkeypatch)
    with pytest.raises(UserError, match=message) as caught:
        Outputs(tmp_path / "out").computed(*plan, store=None)
    assert str(caught.value).startswith(f"{file} has ")
    assert "\n" not in str(caught.value)
    assert list((tmp_path / "out").iterdir()) == []
