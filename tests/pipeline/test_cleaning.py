from __future__ import annotations

import fcntl
import threading
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import nbformat
import pytest
from nbformat.v4 import new_code_cell, new_notebook

from replication import files
from replication.pipeline.cleaning import clean
from replication.pipeline.notebook import NotebookError
from replication.pipeline.plan import Run, prepare
from replication.pipeline.provenance import MANIFEST, read_manifest, record

Clean = Callable[..., list[str]]


def write(project: Path, name: str) -> Run:
    """Write a notebook, let it have run, and return it."""
    cell = new_code_cell('out = "x"\nstore = "build/s.sqlite"', metadata={"tags": ["parameters"]})
    node = new_notebook(cells=[cell], metadata={"replication": {"outputs": [f"{name}.csv"]}})
    nbformat.write(node, project / f"{name}.ipynb")
    (run,) = prepare([project / f"{name}.ipynb"], profile="paper")
    for output in run.notebook.published:
        (project / "out" / output).touch()
    record(project / "out", run.notebook, run.inputs, {})
    return run


@pytest.fixture
def out(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Set up a project in which the notebooks `one` and `two` have run, and `two` is gone."""
    monkeypatch.setattr(files, "PROJECT", tmp_path)
    (tmp_path / "environment.lock").touch()
    (tmp_path / "out").mkdir()
    for name in ("one", "two"):
        write(tmp_path, name)
    return tmp_path / "out"


@pytest.fixture
def cleaned(out: Path) -> Clean:
    """Clean the folder for the notebook `one`, and return the lines."""

    def cleaned(folder: Path = out, *, dry_run: bool = False) -> list[str]:
        lines: list[str] = []
        runs = prepare([out.parent / "one.ipynb"], profile="paper")
        clean(runs, folder, dry_run=dry_run, echo=lines.append)
        return lines

    return cleaned


def names(folder: Path) -> set[str]:
    """Return what is in a folder but for the lock."""
    return {path.name for path in folder.iterdir()} - {".lock"}


def test_what_is_left_of_a_lost_notebook_goes(out: Path, cleaned: Clean) -> None:
    """Its files and its entry in the manifest are removed; a dry run only says so."""
    before = names(out)
    words = ["two.csv", "two.ipynb", "the record of two"]
    assert cleaned(dry_run=True) == [f"would remove {word}" for word in words]
    assert names(out) == before
    assert list(read_manifest(out)) == ["one", "two"]
    assert cleaned() == [f"removed {word}" for word in words]
    assert names(out) == {"one.csv", "one.ipynb", MANIFEST}
    assert list(read_manifest(out)) == ["one"]
    assert cleaned() == []


def test_stores_and_folders_stay(out: Path, cleaned: Clean) -> None:
    """Trials that were stored beside the outputs, also damaged ones, are never removed."""
    kept = {"s.sqlite", "s.sqlite-wal", "s.sqlite.damaged-1", "executed"}
    for name in kept - {"executed"}:
        (out / name).touch()
    (out / "executed").mkdir()
    cleaned()
    assert names(out) == kept | {"one.csv", "one.ipynb", MANIFEST}


@pytest.mark.parametrize("content", [None, "{", '{"format": "other"}'])
def test_a_folder_that_is_not_ours_is_refused(
    tmp_path: Path, cleaned: Clean, content: str | None
) -> None:
    """Without a manifest of ours, files may be anybody's, and nothing is removed or made."""
    folder = tmp_path / "mine"
    folder.mkdir()
    (folder / "precious.txt").touch()
    if content is not None:
        (folder / MANIFEST).write_text(content)
    before = list(folder.iterdir())
    with pytest.raises(NotebookError, match=r"mine: has no provenance\.json of ours"):
        cleaned(folder)
    assert list(folder.iterdir()) == before


def test_cleaning_waits_for_a_run(out: Path, cleaned: Clean) -> None:
    """While a run has the folder, nothing is removed."""
    before = names(out)
    found: list[Any] = []
    with (out / ".lock").open("w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        thread = threading.Thread(target=lambda: found.append(cleaned()))
        thread.start()
        time.sleep(0.3)
        assert names(out) == before
        assert not found
    thread.join(timeout=60)
    assert "removed two.csv" in found[0]
