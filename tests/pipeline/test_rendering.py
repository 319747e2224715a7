from __future__ import annotations

import base64
from pathlib import Path
from typing import Any

import nbformat
import pytest
from nbformat.v4 import new_code_cell, new_markdown_cell, new_notebook, new_output

from replication.pipeline.notebook import Notebook, read_notebook
from replication.pipeline.rendering import linked, rendered

PICTURE, OTHER = b"\x89PNG one", b"\x89PNG two"


def shown(data: dict[str, str], **metadata: Any) -> Any:
    """Return the output of a cell."""
    return new_output("execute_result", data, metadata=metadata, execution_count=1)


def picture(content: bytes, alt: str) -> Any:
    """Return a picture as a notebook shows it."""
    data = {"image/png": base64.encodebytes(content).decode(), "text/plain": "<Image>"}
    return shown(data, **{"image/png": {"alt": alt, "width": 700}})


@pytest.fixture
def executed(tmp_path: Path) -> Path:
    """Write the executed notebook `toy` with outputs, and two of these as files beside it."""
    (tmp_path / "fig.png").write_bytes(PICTURE)
    (tmp_path / "film.html").write_text("<p>moves</p>", encoding="utf-8")
    outputs = [
        picture(PICTURE, "d is 0 [all trials]"),
        picture(OTHER, "not a file"),
        shown({"text/html": "<p>moves</p>"}),
        shown({"text/html": "<p>a table</p>"}),
        new_output("stream", name="stdout", text="said"),
    ]
    injected = new_code_cell("trials = 5", metadata={"tags": ["injected-parameters"]})
    cells = [new_markdown_cell("# Toy"), parameters(), injected]
    cells.append(new_code_cell("show()", outputs=outputs))
    nbformat.write(new_notebook(cells=cells), tmp_path / "toy.ipynb")
    return tmp_path / "toy.ipynb"


def parameters() -> Any:
    """Return a parameters cell."""
    return new_code_cell('out = "x"', metadata={"tags": ["parameters"]})


def notebook(folder: Path, *cells: Any) -> Notebook:
    """Write and read a notebook that was not executed."""
    node = new_notebook(cells=cells, metadata={"replication": {"outputs": []}})
    nbformat.write(node, folder / "source.ipynb")
    return read_notebook(folder / "source.ipynb")


def test_what_is_a_file_is_linked(executed: Path) -> None:
    """A picture keeps its words, its bytes are left to the file, and what is no file stays."""
    node = nbformat.reads(linked(executed, executed.parent), as_version=4)
    outputs = node.cells[-1].outputs
    assert outputs[0].data == {"text/markdown": r"![d is 0 \[all trials\]](fig.png)"}
    assert outputs[0].metadata == {}
    assert outputs[2].data == {"text/markdown": "[film.html](film.html)"}
    before = nbformat.read(executed, as_version=4).cells[-1].outputs
    assert [outputs[at] for at in (1, 3, 4)] == [before[at] for at in (1, 3, 4)]


def test_linked_notebook_has_the_same_cells(executed: Path) -> None:
    """Text, code and their order are those of the executed notebook."""
    node = nbformat.reads(linked(executed, executed.parent), as_version=4)
    nbformat.validate(node)
    before = nbformat.read(executed, as_version=4)
    assert [(c.id, c.source) for c in node.cells] == [(c.id, c.source) for c in before.cells]


def test_shows_tells_text_apart(executed: Path, tmp_path: Path) -> None:
    """New text, new code or a new cell is seen; what papermill has injected is not."""
    same = [new_markdown_cell("# Toy"), parameters(), new_code_cell("show()")]
    assert notebook(tmp_path, *same).is_shown_by(executed)
    for other in ("# Game", "# Toy\n"):
        assert not notebook(tmp_path, new_markdown_cell(other), *same[1:]).is_shown_by(executed)
    more = notebook(tmp_path, *same, new_markdown_cell("The end"))
    assert not more.is_shown_by(executed)


def test_render_works_on_a_linked_notebook(executed: Path, tmp_path: Path) -> None:
    """The published notebook gets new text like the full one, and keeps its links."""
    links = linked(executed, tmp_path)
    executed.write_text(links, encoding="utf-8")
    source = notebook(
        tmp_path, new_markdown_cell("# Game"), parameters(), new_code_cell("show()  # all")
    )
    assert not source.is_shown_by(executed)
    executed.write_text(rendered(source, executed), encoding="utf-8")
    assert source.is_shown_by(executed)
    outputs = nbformat.read(executed, as_version=4).cells[-1].outputs
    assert outputs == nbformat.reads(links, as_version=4).cells[-1].outputs
