"""A copy of a notebook to work on by hand: saving it changes nothing that is kept."""

from __future__ import annotations

import ast
import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from replication import files
from replication.files import shown_as, write_file
from replication.pipeline.notebook import assignment, refuse
from replication.pipeline.plan import Run

HAND = "build/hand"
"""The folder of the copies, and of what they give."""


def copy_notebook(run: Run) -> Path:
    """Copy a notebook with the parameters of a run in its cell; return the copy's file.

    What the copy gives goes to a folder of its name beside it.

    Raises
    ------
    NotebookError
        If there is a copy, which may have been worked on.
    """
    copy = files.PROJECT / HAND / f"{run.name}.ipynb"
    if copy.exists():
        refuse(copy, "is there already; go on with it, or move it away first")
    notebook = run.notebook
    places = {"out": f"{HAND}/{run.name}", "results": shown_as(run.out)}
    node = notebook.load()  # whose links are right here, too: it lies as deep as what is published
    cell = node.cells[notebook.at]
    cell.source = with_values(cell.source, {**run.values, **places})
    from replication.pipeline.rendering import as_text  # loads nbformat

    return write_file(copy, as_text(node))


def with_values(source: str, values: Mapping[str, Any]) -> str:
    """Return the text of a parameters cell with other values in it.

    Examples
    --------
    >>> with_values("trials: int = 1000  # of each method", {"trials": 4})
    'trials: int = 4  # of each method'
    """
    lines = [line.encode() for line in source.split("\n")]  # ast counts bytes
    for statement in reversed(ast.parse(source).body):
        name, old = assignment(statement)
        if name in values:
            first, last = old.lineno - 1, (old.end_lineno or old.lineno) - 1
            value = values[name]
            text = json.dumps(value, ensure_ascii=False) if isinstance(value, str) else repr(value)
            new = lines[first][: old.col_offset] + text.encode() + lines[last][old.end_col_offset :]
            lines[first : last + 1] = [new]
    return b"\n".join(lines).decode()
