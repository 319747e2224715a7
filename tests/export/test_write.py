from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import pytest

from replication.errors import UserError
from replication.export import write
from replication.export.about import About
from replication.export.write import contents, write_export
from replication.pipeline import execute
from replication.pipeline.run import run_notebooks
from tests.export.names import NAMES
from tests.notebooks import write_notebook

FILES = {
    "ro-crate-metadata.json": b"{}",
    "codemeta.json": b"{}",
    "croissant.json": b"{}",
    "figures/toy/seen.md": b"seen",
}


@pytest.fixture
def project(toy_project: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Set up a project with a published notebook, whose export has some files."""
    notebook = toy_project / "notebooks" / "toy.ipynb"
    write_notebook(notebook, "x = 1", data=["seen.md"])
    run_notebooks([notebook], profile="paper", out=toy_project / "figures")
    monkeypatch.setattr(execute, "execute", lambda *_, **__: pytest.fail("executed"))
    monkeypatch.setattr(write, "about", lambda: None)
    monkeypatch.setattr(write, "contents", lambda *_: FILES)
    return toy_project


def export(project: Path) -> Path:
    """Export the notebook; return the folder."""
    out = project / "build" / "export"
    made = write_export([project / "notebooks" / "toy.ipynb"], out, echo=lambda _: None)
    assert made == out / "ro-crate-metadata.json"
    return out


def files_in(folder: Path) -> dict[str, bytes]:
    """Return the content of all files in a folder."""
    return {
        path.relative_to(folder).as_posix(): path.read_bytes()
        for path in folder.rglob("*")
        if path.is_file()
    }


def test_the_same_bytes_twice(exported: Mapping[str, bytes], about: About) -> None:
    """Nothing in an export depends on when it is made, in whatever order notebooks are named."""
    assert contents(about, NAMES[::-1]) == exported


def test_the_folder_is_replaced_as_a_whole(project: Path) -> None:
    """It holds the files of the export, and none that an export before had; nothing beside it."""
    out = export(project)
    assert files_in(out) == FILES
    (out / "figures" / "gone.png").touch()
    assert files_in(export(project)) == FILES
    assert [path.name for path in out.parent.iterdir()] == ["export"]


def test_a_stale_or_missing_result_is_refused(project: Path) -> None:
    """It is named in one line, with the reason and what to do; the export that is there stays."""
    out = export(project)
    write_notebook(project / "notebooks" / "toy.ipynb", "x = 2", data=["seen.md"])
    first = "first: replicate run toy$"
    with pytest.raises(UserError, match=f"^toy is stale: the notebook's code .*; {first}"):
        export(project)
    write_notebook(project / "notebooks" / "toy.ipynb", "x = 1", data=["seen.md"])
    (project / "figures" / "toy" / "seen.md").write_text("forged")
    with pytest.raises(UserError, match=f"^toy is stale: seen.md is changed; {first}"):
        export(project)
    for path in (project / "figures" / "toy").iterdir():
        path.unlink()
    with pytest.raises(UserError, match=f"^toy is missing; {first}"):
        export(project)
    assert files_in(out) == FILES


def test_other_folders_are_left_alone(project: Path) -> None:
    """A file, or a folder that holds something else, is refused, and nothing in it is touched."""
    out = project / "build" / "export"
    out.parent.mkdir(exist_ok=True)
    out.write_text("years of work")
    with pytest.raises(UserError, match=r"is not a folder; choose another one$"):
        export(project)
    assert out.read_text() == "years of work"
    out.unlink()
    out.mkdir()
    (out / "ro-crate-metadata.json").write_text("another crate")
    with pytest.raises(
        UserError, match=r"holds other files than an export; choose another folder$"
    ):
        export(project)
    assert files_in(out) == {"ro-crate-metadata.json": b"another crate"}
