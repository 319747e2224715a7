"""Executed notebooks as files: published with links to their outputs, and kept true to their text.

An executed notebook holds its pictures. The one that is published beside the outputs links to them
instead, so that it is small, can be kept under version control and is read without a run.
"""

from __future__ import annotations

import base64
import re
from pathlib import Path
from typing import Any

import nbformat

from replication.pipeline.notebook import INJECTED, Notebook


def linked(executed: Path, files: Path) -> str:
    """Return an executed notebook in which what is also a file of a folder is a link to it.

    Parameters
    ----------
    executed
        The executed notebook.
    files
        The folder with the PNG and HTML files that the notebook wrote.
    """
    pictures = {path.read_bytes(): path.name for path in sorted(files.glob("*.png"))}
    pages = {path.read_text(encoding="utf-8"): path.name for path in sorted(files.glob("*.html"))}
    node = nbformat.read(executed, as_version=4)
    for output in (one for cell in node.cells for one in cell.get("outputs", [])):
        data = output.get("data", {})
        picture = pictures.get(base64.b64decode(data.get("image/png", "")))
        page = pages.get(data.get("text/html", ""))
        if picture is not None:
            alt = output.metadata.get("image/png", {}).get("alt", "")
            output.data = {"text/markdown": f"![{_escaped(alt)}]({picture})"}
            output.metadata = {}
        elif page is not None:
            output.data = {"text/markdown": f"[{page}]({page})"}
            output.metadata = {}
    return str(nbformat.writes(node)) + "\n"


def rendered(notebook: Notebook, executed: Path) -> str:
    """Return an executed notebook with the prose of the notebook; nothing is executed."""
    node = nbformat.read(executed, as_version=4)
    code = [cell for cell in node.cells if cell.cell_type == "code"]
    cells = []
    for at, cell in enumerate(notebook.load().cells):
        drop_empty_tags(cell)
        cells.append(cell)
        if cell.cell_type != "code":
            continue
        done = code.pop(0)
        cell.outputs, cell.execution_count = done.outputs, done.execution_count
        if at == notebook.at and code and _is_injected(code[0]):
            cells.append(code.pop(0))
    node.cells = cells
    return str(nbformat.writes(node)) + "\n"


def drop_empty_tags(cell: Any) -> None:
    """Make cells that papermill has seen equal to those that it has not."""
    if not cell.metadata.get("tags", True):
        del cell.metadata["tags"]


def _is_injected(cell: Any) -> bool:
    return INJECTED in cell.metadata.get("tags", [])


def _escaped(text: str) -> str:
    """Return text that Markdown shows as it is."""
    return re.sub(r"([\\\[\]*_`<])", r"\\\1", text)
