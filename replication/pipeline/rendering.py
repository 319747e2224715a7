"""Executed notebooks as files: free of what differs between equal runs, and true to their text."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import nbformat

from replication import files
from replication.files import read_text
from replication.pipeline.inputs import NEUTRAL
from replication.pipeline.notebook import INJECTED, Notebook

GIVEN = "# Parameters of this run, instead of those above"
"""The first line of the cell in which papermill has put the parameters of a run."""

ERROR = "papermill-error-cell-tag"
"""The tag of cells in which papermill points to an error."""


def read_executed(file: Path, folders: Mapping[Path, Path]) -> Any:
    """Return the notebook that papermill has written, without the cells that it adds for an error.

    `folders` maps folders whose paths may be in it to those that it shall name instead.
    """
    text = read_text(file)
    for folder, other in folders.items():
        text = text.replace(json.dumps(str(folder))[1:-1], json.dumps(files.shown_as(other))[1:-1])
    node = nbformat.reads(text, as_version=4)
    node.cells = [cell for cell in node.cells if ERROR not in _tags(cell)]
    return node


def clean(notebook: Notebook, node: Any) -> Any:
    """Remove from an executed notebook what differs between equal runs, and return it."""
    node.metadata.pop("papermill", None)
    # recorded in the manifest as major.minor
    node.metadata.get("language_info", {}).pop("version", None)
    known = {cell.get("id") for cell in notebook.load().cells}
    unknown = [cell for cell in node.cells if cell.get("id") not in known]
    for number, cell in enumerate(unknown, start=1):
        cell.id = f"papermill-{number}"
    for cell in node.cells:
        cell.metadata.pop("papermill", None)
        _drop_empty_tags(cell)
        if INJECTED in _tags(cell):
            lines = [GIVEN, *cell.source.split("\n")[1:]]
            cell.source = "\n".join(_as_declared(notebook, line) for line in lines)
    return node


def link_players(node: Any) -> Any:
    """Replace each player in an executed notebook, which is large, by a link to its file."""
    for output in (output for cell in node.cells for output in cell.get("outputs", [])):
        shown = output.get("metadata", {}).get("replication", {})
        if shown.get("kind") == "player":
            file = f"{shown['name']}.html"
            output.data = {"text/markdown": f"[{shown.get('alt') or file}]({file})"}
    return node


def rendered(notebook: Notebook, executed: Path) -> str:
    """Return a published notebook with the text and the code of the notebook; nothing is executed.

    The code may differ in comments and layout only.
    """
    node = nbformat.reads(read_text(executed), as_version=4)
    code = [cell for cell in node.cells if cell.cell_type == "code"]
    cells = []
    for at, cell in enumerate(notebook.load().cells):
        _drop_empty_tags(cell)
        cells.append(cell)
        if cell.cell_type != "code":
            continue
        done = code.pop(0)
        cell.outputs, cell.execution_count = done.outputs, done.execution_count
        if at == notebook.at and code and INJECTED in _tags(code[0]):
            cells.append(code.pop(0))
    node.cells = cells
    return as_text(node)


def as_text(node: Any) -> str:
    """Return a notebook as the text of its file."""
    return str(nbformat.writes(node)) + "\n"


def _as_declared(notebook: Notebook, line: str) -> str:
    """Return a line of the injected parameters; one that changes no result as it is declared."""
    name = line.partition(" = ")[0]
    return f"{name} = {notebook.literals[name]!r}" if name in NEUTRAL - {"out"} else line


def _drop_empty_tags(cell: Any) -> None:
    """Make cells that papermill has seen equal to those that it has not."""
    if not cell.metadata.get("tags", True):
        del cell.metadata["tags"]


def _tags(cell: Any) -> list[str]:
    return list(cell.metadata.get("tags", []))
