from __future__ import annotations

import base64
import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import nbformat
import pytest
from nbformat.v4 import new_output

from replication.pipeline import execute as execution
from replication.pipeline.notebook import NotebookError
from replication.pipeline.redraw import redraw
from replication.pipeline.run import run_notebooks
from tests.notebooks import damage

Redraw = Callable[..., list[str]]


@pytest.fixture
def out(write: Any, project: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Publish two notebooks with a figure each, drawn in a style that the test can change."""

    def execute(notebook: Any, values: Any, stage: Path, **_: Any) -> str:
        (name,) = notebook.declared.figures
        (stage / f"{name}.csv").write_text(name)
        for suffix, content in picture("code.of", stage / f"{name}.csv").items():
            (stage / f"{name}{suffix}").write_bytes(content)
        node = notebook.load()
        png = base64.b64encode((stage / f"{name}.png").read_bytes()).decode() + "\n"
        metadata = {"replication": {"kind": "figure", "name": name, "code": "code.of"}}
        shown = {"image/png": png, "text/plain": "words"}
        node.cells[-1].outputs = [new_output("display_data", shown, metadata=metadata)]
        return str(nbformat.writes(node)) + "\n"

    monkeypatch.setattr(execution, "execute", execute)
    paths = [write("1", name=f"n{figure}", figures=[figure]) for figure in ("a", "b")]
    run_notebooks(paths, profile="paper", out=project / "figures", jobs=1)
    return project / "figures"


def picture(code: str, table: Path, style: str = "old") -> dict[str, bytes]:
    """Return what is drawn of a table."""
    return {s: f"{s} {style} {code} {table.read_text()}".encode() for s in (".png", ".svg")}


@pytest.fixture
def redrawn(out: Path) -> Redraw:
    """Redraw figures in some style, and return the lines."""

    def redrawn(*names: str, style: str = "old") -> list[str]:
        lines: list[str] = []
        draw = lambda code, table: picture(code, table, style)  # noqa: E731
        redraw(out, names, draw=draw, echo=lines.append)
        return lines

    return redrawn


def content(out: Path) -> dict[str, bytes]:
    """Return all files of the folders of notebooks."""
    return {f"{p.parent.name}/{p.name}": p.read_bytes() for p in out.glob("n*/*")}


def test_the_same_code_gives_the_same_bytes(out: Path, redrawn: Redraw) -> None:
    """Where nothing has changed, no file is written."""
    before = {path: path.stat().st_mtime_ns for path in out.rglob("*")}
    assert redrawn() == ["2 figures drawn; the others have the same bytes"]
    after = {path: path.stat().st_mtime_ns for path in out.rglob("*")}
    assert {p for p in before if before[p] != after[p]} <= {out, out / ".lock"}


def test_a_change_of_style_changes_pictures_only(out: Path, redrawn: Redraw) -> None:
    """Files, embedded picture and hashes are new, and going back gives the old bytes."""
    before = content(out)
    assert redrawn(style="new")[:2] == [
        "na/a: redrawn, other bytes than before",
        "nb/b: redrawn, other bytes than before",
    ]
    changed = {name for name, data in content(out).items() if data != before[name]}
    files = ("png", "svg")
    expected = {f"n{x}/{x}.{suffix}" for x in "ab" for suffix in files}
    expected |= {f"n{x}/{file}" for x in "ab" for file in ("notebook.ipynb", "provenance.json")}
    assert changed == expected
    assert (out / "na" / "a.png").read_bytes() == b".png new code.of a"
    assert damage(out) == []
    redrawn(style="old")
    assert content(out) == before


def test_single_figures_are_redrawn(out: Path, redrawn: Redraw) -> None:
    """A figure is chosen by its name, or by that of its notebook."""
    assert redrawn("a", style="new")[0].startswith("na/a: ")
    assert redrawn("nb", style="new")[0].startswith("nb/b: ")
    assert len(redrawn("na/a", style="newer")) == 2
    with pytest.raises(NotebookError, match=r"unknown figure 'aa' \(did you mean 'na/a'"):
        redrawn("aa")


@pytest.mark.parametrize("file", ["a.csv", "notebook.ipynb"])
def test_what_was_edited_is_not_drawn(out: Path, redrawn: Redraw, file: str) -> None:
    """What is drawn is what the run has written, or nothing."""
    (out / "na" / file).write_text("mine")
    before = content(out)
    with pytest.raises(NotebookError, match=rf"{file}: is changed since its run.*run na$"):
        redrawn("a", style="new")
    assert content(out) == before


def test_a_notebook_that_the_manifest_does_not_name_is_not_read(out: Path, redrawn: Redraw) -> None:
    """What no run has written may hold anything."""
    path = out / "na" / "provenance.json"
    manifest = json.loads(path.read_text())
    del manifest["outputs"]["notebook.ipynb"]
    path.write_text(json.dumps(manifest))
    (out / "na" / "notebook.ipynb").write_text("{}")
    with pytest.raises(NotebookError, match=r"notebook\.ipynb: is not in the manifest since"):
        redrawn("a", style="new")


def test_a_figure_that_cannot_be_drawn_is_named(out: Path) -> None:
    """Whatever the drawing code raises is one line, and nothing is changed."""
    before = content(out)
    with pytest.raises(NotebookError, match=r"a\.csv: code\.of cannot draw it: KeyError: 'x'"):
        redraw(out, ["a"], draw=lambda code, table: {"y": {}}["x"], echo=lambda _: None)
    assert content(out) == before
    assert json.loads((out / "na" / "provenance.json").read_text())["version"] == 2
