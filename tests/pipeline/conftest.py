from __future__ import annotations

import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from replication import files
from replication.pipeline import execute as execution
from replication.pipeline.run import Published, run_notebooks
from tests.notebooks import write_notebook

PARAMETERS = 'trials = 3\nalpha = 0.5\nname = "a"\nchoices = {}\njobs = 1\nseed = 1\nout = "build"'
PRELUDE = "import os, sys\nfrom pathlib import Path\nfolder = Path(out)"

Write = Callable[..., Path]
Run = Callable[..., list[Published]]


@pytest.fixture
def project(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Set up a project with a lock, a data file and no notebook."""
    monkeypatch.setattr(files, "PROJECT", tmp_path)
    (tmp_path / "environment.lock").write_text("numpy==1")
    (tmp_path / "data.toml").write_text("a = 1")
    return tmp_path


@pytest.fixture
def write(project: Path) -> Write:
    """Write a notebook: a headline, the parameters cell, PRELUDE and more code cells."""

    def write(*code: str, name: str = "toy", **given: Any) -> Path:
        path = project / "notebooks" / f"{name}.ipynb"
        given = {"parameters": PARAMETERS, "prose": "# Toy"} | given
        write_notebook(path, PRELUDE, *code, **given)
        return path

    return write


@pytest.fixture
def run(project: Path, monkeypatch: pytest.MonkeyPatch) -> Run:
    """Run notebooks into `figures`; no temporary file or draft may be left."""
    scratch = project / "scratch"
    scratch.mkdir()
    monkeypatch.setattr(tempfile, "tempdir", str(scratch))

    def run(*notebooks: Path, **options: Any) -> list[Published]:
        out = options.setdefault("out", project / "figures")
        defaults: dict[str, Any] = {"profile": "paper", "jobs": 1, "publish": True}
        try:
            return run_notebooks(notebooks, **defaults | options)
        finally:
            assert not list(scratch.iterdir())
            assert not list(out.glob(".draft-*")) + list(out.glob(".aside-*"))

    return run


@pytest.fixture
def no_kernel(monkeypatch: pytest.MonkeyPatch) -> None:
    """Fail when anything is executed."""
    monkeypatch.setattr(execution, "execute", lambda *_, **__: pytest.fail("was executed"))
