from __future__ import annotations

from pathlib import Path
from typing import Any

import nbformat
import pytest

from replication import files
from replication.pipeline.by_hand import copy_notebook
from replication.pipeline.notebook import NotebookError, read_notebook
from replication.pipeline.plan import prepare
from tests.notebooks import write_notebook

PARAMETERS = 'trials: int = 9  # of each "method" – β\nsets = [\n    "a",\n    "b",\n]\nout = "x"'


def copy(project: Path, profile: str) -> Any:
    """Copy the notebook `toy`; return the copy's contents."""
    declared: dict[str, Any] = {"profiles": {"quick": {"trials": 2, "sets": ["c"]}}}
    given: dict[str, Any] = {"parameters": PARAMETERS, "prose": "see [b](../b.md)", **declared}
    write_notebook(project / "notebooks" / "toy.ipynb", "seen = trials", **given)
    path = project / "notebooks" / "toy.ipynb"
    (run,) = prepare([path], profile=profile, out=project / "build" / profile)
    return nbformat.read(copy_notebook(run), as_version=4)


def test_a_copy_has_the_values_of_its_profile(toy_project: Path) -> None:
    """Only values differ, and their comments stay; what it gives has a folder of its own."""
    expected = '"method" – β\nsets = [\'c\']\nout = "build/hand/toy"'
    cells = copy(toy_project, "quick").cells
    assert cells[1].source == f"trials: int = 2  # of each {expected}"
    made = toy_project / "build" / "hand" / "toy.ipynb"
    assert read_notebook(made).literals == {"trials": 2, "sets": ["c"], "out": "build/hand/toy"}
    assert cells[2].source == "seen = trials"


def test_links_lead_to_the_same_files(toy_project: Path) -> None:
    """A copy lies one folder deeper than the notebook, and so do the links of its text."""
    assert copy(toy_project, "paper").cells[0].source == "see [b](../../b.md)"


def test_no_copy_is_replaced(toy_project: Path) -> None:
    """What somebody has done in a copy stays as it is."""
    copy(toy_project, "paper")
    before = (toy_project / "build" / "hand" / "toy.ipynb").read_bytes()
    with pytest.raises(NotebookError, match=r"toy\.ipynb: is there already; [^\n]+$"):
        copy(toy_project, "quick")
    assert (toy_project / "build" / "hand" / "toy.ipynb").read_bytes() == before


@pytest.mark.parametrize("path", sorted((files.PROJECT / "notebooks").glob("*.ipynb")), ids=str)
def test_every_parameter_has_its_type(path: Path) -> None:
    """The parameters of each notebook name their types, which papermill shows."""
    notebook = read_notebook(path)
    lines = notebook.cells[notebook.at].source.splitlines()
    shown = [line.partition(" = ")[0] for line in lines]
    kinds = {name: type(value).__name__ for name, value in notebook.literals.items()}
    assert shown == [f"{name}: {kind}" for name, kind in kinds.items()]
