from __future__ import annotations

from pathlib import Path
from typing import Any

import nbformat
import pytest
from nbformat.v4 import new_output

from replication.pipeline import execute as execution
from replication.pipeline.index import INDEX, shown_outputs, write_index
from replication.pipeline.run import run_notebooks
from tests.conftest import Spoil


@pytest.fixture
def out(write: Any, project: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Publish a notebook that shows a figure and a table, and writes data."""

    def execute(notebook: Any, values: Any, stage: Path, **_: Any) -> str:
        for name in notebook.declared.outputs:
            (stage / name).touch()
        node = notebook.load()
        for cell, kind, name in ((3, "figure", "fig05"), (4, "table", "sets")):
            metadata = {"replication": {"kind": kind, "name": name}}
            node.cells[cell].outputs = [new_output("display_data", {}, metadata=metadata)]
        return str(nbformat.writes(node))

    monkeypatch.setattr(execution, "execute", execute)
    declared = {"figures": ["fig05"], "tables": ["sets"], "data": ["trials.csv"]}
    path = write("1", "2", prose="# Toy\n\n## Which mistakes help", **declared)
    run_notebooks([path], profile="paper", out=project / "figures", seed=None, jobs=1)
    return project / "figures"


def lines(out: Path) -> list[str]:
    """Return what the page says of the notebook, but for the head of the table."""
    text = (out / INDEX).read_text().partition("\n## ")[2]
    return [line for line in text.splitlines() if line and "what" not in line and "---" not in line]


def test_each_output_has_a_row(out: Path) -> None:
    """What is shown stands in the notebook's order, with its files; what is not shown follows."""
    assert lines(out) == [
        "[toy](toy/notebook.ipynb)",
        "seed 1, trials 3",
        "| [Fig. 5](toy/fig05.png) | [csv](toy/fig05.csv), [svg](toy/fig05.svg) |",
        "| [Which mistakes help](toy/sets.md) | [csv](toy/sets.csv) |",
        "| [trials](toy/trials.csv) |  |",
    ]


def test_a_page_that_is_right_is_not_written(out: Path) -> None:
    """Nothing is written where nothing has changed."""
    before = (out / INDEX).stat().st_mtime_ns
    write_index(out)
    assert (out / INDEX).stat().st_mtime_ns == before


def test_whatever_is_in_the_place_of_the_page_is_replaced(out: Path, spoil: Spoil) -> None:
    """A page that cannot be read is written anew, also where a notebook cannot be read, either."""
    spoil(out / INDEX)
    if (out / INDEX).is_dir():
        (out / INDEX).rmdir()
    spoil(out / "toy" / "notebook.ipynb")
    write_index(out)
    assert "| [Fig. 5](toy/fig05.png) |" in (out / INDEX).read_text()


def test_what_is_shown_comes_with_its_heading(out: Path) -> None:
    """The nearest heading above an output is its own."""
    shown = [(entry["name"], heading) for entry, heading in shown_outputs(out / "toy")]
    assert shown == [("fig05", "Which mistakes help"), ("sets", "Which mistakes help")]
