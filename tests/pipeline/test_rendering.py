from __future__ import annotations

import base64
import json
from pathlib import Path
from typing import Any

import nbformat
import pytest
from nbformat.v4 import new_code_cell, new_markdown_cell, new_notebook, new_output

from replication import files
from replication.pipeline.notebook import Notebook, read_notebook
from replication.pipeline.rendering import as_text, clean, link_players, read_executed, rendered

PICTURE = base64.b64encode(b"\x89PNG one").decode()


def shown(data: dict[str, str], **metadata: Any) -> Any:
    """Return the output of a cell."""
    return new_output("execute_result", data, metadata=metadata, execution_count=1)


@pytest.fixture
def executed(tmp_path: Path) -> Path:
    """Write an executed notebook with a figure, a player, a table and some text."""
    figure, player = ({"kind": kind, "name": kind} for kind in ("figure", "player"))
    outputs = [
        shown({"image/png": PICTURE}, replication=figure | {"alt": "d is 0"}),
        shown({"text/html": "<p>moves</p>"}, replication=player | {"alt": "it moves"}),
        shown({"text/html": "<p>a table</p>"}),
        new_output("stream", name="stdout", text="printed"),
    ]
    injected = new_code_cell("trials = 5", metadata={"tags": ["injected-parameters"]})
    cells = [new_markdown_cell("# Toy"), parameters(), injected]
    cells.append(new_code_cell("show()", outputs=outputs))
    nbformat.write(new_notebook(cells=cells), tmp_path / "executed.ipynb")
    return tmp_path / "executed.ipynb"


def parameters() -> Any:
    """Return a parameters cell."""
    return new_code_cell('out = "x"', metadata={"tags": ["parameters"]})


def notebook(folder: Path, *cells: Any) -> Notebook:
    """Write and read a notebook that was not executed."""
    node = new_notebook(cells=cells, metadata={"replication": {}})
    nbformat.write(node, folder / "source.ipynb")
    return read_notebook(folder / "source.ipynb")


def test_players_are_links(executed: Path) -> None:
    """A player is a link with its words; figures stay embedded, and what is no file stays."""
    node = nbformat.read(executed, as_version=4)
    before = nbformat.read(executed, as_version=4).cells[-1].outputs
    link_players(node)
    nbformat.validate(node)
    outputs = node.cells[-1].outputs
    assert outputs[1].data == {"text/markdown": "[it moves](player.html)"}
    assert outputs[1].metadata == before[1].metadata
    assert [outputs[at] for at in (0, 2, 3)] == [before[at] for at in (0, 2, 3)]


def test_what_differs_between_equal_runs_goes(tmp_path: Path) -> None:
    """New cells, and those of a format without ids, have ids by their places; no time is left."""
    document = new_notebook(cells=[parameters()], metadata={"replication": {}})
    document.nbformat_minor = 4
    del document.cells[0]["id"]
    (tmp_path / "source.ipynb").write_text(json.dumps(document))
    source = read_notebook(tmp_path / "source.ipynb")

    def run() -> str:
        node = nbformat.v4.upgrade(source.load())  # which makes random ids
        node.cells.append(new_code_cell("1", metadata={"papermill": {"duration": 1}, "tags": []}))
        node.metadata["papermill"] = {"start_time": 1}
        return as_text(clean(source, node))

    assert run() == run()
    assert "papermill-2" in run()
    assert "time" not in run()


def test_folders_are_named_for_everybody(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A stage is named as its target: from the project on, or by its name if it lies elsewhere."""
    monkeypatch.setattr(files, "PROJECT", tmp_path / "project")
    cell = new_code_cell(f"# {tmp_path / 'stage' / 'a.txt'}")
    nbformat.write(new_notebook(cells=[cell]), tmp_path / "executed.ipynb")
    for target, shown in (("project/build/toy", "build/toy"), ("elsewhere/toy", "toy")):
        folders = {tmp_path / "stage": tmp_path / target}
        node = read_executed(tmp_path / "executed.ipynb", folders)
        assert node.cells[0].source == f"# {shown}/a.txt"


def test_links_lead_out_of_the_published_folder(tmp_path: Path) -> None:
    """A published notebook lies one folder deeper than its source, and so do links of its text."""
    source = notebook(tmp_path, new_markdown_cell("[a](../b.toml) [c](d)"), parameters())
    assert source.load().cells[0].source == "[a](../../b.toml) [c](d)"
    assert source.shows(as_text(source.load()))
    assert not source.shows(source.text)


def test_shows_tells_text_apart(executed: Path, tmp_path: Path) -> None:
    """New text, new code or a new cell is seen; what papermill has injected is not."""
    text = executed.read_text()
    same = [new_markdown_cell("# Toy"), parameters(), new_code_cell("show()")]
    assert notebook(tmp_path, *same).shows(text)
    for other in ("# Game", "# Toy\n"):
        assert not notebook(tmp_path, new_markdown_cell(other), *same[1:]).shows(text)
    assert not notebook(tmp_path, *same, new_markdown_cell("The end")).shows(text)


def test_new_text_keeps_outputs(executed: Path, tmp_path: Path) -> None:
    """The published notebook gets new text and layout, and keeps its outputs."""
    before = nbformat.read(executed, as_version=4)
    source = notebook(
        tmp_path, new_markdown_cell("# Game"), parameters(), new_code_cell("show()  # all")
    )
    assert not source.shows(executed.read_text())
    text = rendered(source, executed)
    assert source.shows(text)
    assert nbformat.reads(text, as_version=4).cells[-1].outputs == before.cells[-1].outputs
    executed.write_text(text)
    assert rendered(source, executed) == text == as_text(nbformat.reads(text, as_version=4))
