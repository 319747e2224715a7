from __future__ import annotations

from pathlib import Path

import pandas as pd
from IPython.core.interactiveshell import InteractiveShell

from replication import Demos
from replication.report.maze import demonstrations
from replication.report.moving import Player
from replication.report.outputs import Outputs, Shown


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
