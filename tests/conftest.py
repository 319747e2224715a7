from __future__ import annotations

import os
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import nbformat
import pytest
from hypothesis import HealthCheck, settings

from replication import Demos, Maze, demonstrate, files, load_demos
from replication.files import PROJECT
from replication.pipeline import execute as execution
from replication.pipeline.notebook import Notebook

# A slow machine fails no test.
settings.register_profile("patient", deadline=None, suppress_health_check=[HealthCheck.too_slow])
settings.load_profile("patient")

SMALL = """
    .......
    .....G.
    ...#...
    .......
    .S.....
    .......
"""


@pytest.fixture(scope="session")
def small_demos() -> Demos:
    """Demonstrations of every kind in a maze of 42 cells."""
    return demonstrate("small", Maze.from_text(SMALL))


@pytest.fixture(scope="session", params=["open_maze", "obstacle_maze"])
def stored_demos(request: pytest.FixtureRequest) -> Demos:
    """Each of the two stored mazes."""
    return load_demos(PROJECT / "data" / "demos" / f"{request.param}.json")


@pytest.fixture(scope="session")
def soccer_demos() -> Demos:
    """Load the stored demonstrations of soccer."""
    return load_demos(PROJECT / "data" / "demos" / "soccer.json")


Spoil = Callable[[Path], None]


@pytest.fixture(params=["pipe", "device", "folder", "large", "nested", "bytes"])
def spoil(request: pytest.FixtureRequest) -> Spoil:
    """Return a function that puts something in a file's place which no reader can use."""

    def spoil(path: Path) -> None:
        if path.is_dir():
            shutil.rmtree(path)
        path.unlink(missing_ok=True)
        match request.param:
            case "pipe":
                os.mkfifo(path)
            case "device":
                path.symlink_to("/dev/zero")
            case "folder":
                path.mkdir()
            case "large":
                path.touch()
                os.truncate(path, 2 * 10**9)  # a hole, which takes no space on the disk
            case "nested":
                path.write_text("[" * 100_000)
            case "bytes":
                path.write_bytes(b"\xb8")

    return spoil


@pytest.fixture
def toy_project(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Set up a project in which "executing" a notebook writes each of its outputs."""

    def execute(notebook: Notebook, values: Any, stage: Path, **_: Any) -> str:
        for name in notebook.declared.outputs:
            (stage / name).write_text(notebook.name)
        return str(nbformat.writes(notebook.load()))

    monkeypatch.setattr(files, "PROJECT", tmp_path)
    monkeypatch.setattr(execution, "execute", execute)
    (tmp_path / "environment.lock").touch()
    return tmp_path


@pytest.fixture
def begun(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """Run notebooks in this process, which is fast; return the names of those that began."""
    begun: list[str] = []

    def execute(notebook: Notebook, values: Any, stage: Path, **_: Any) -> str:
        begun.append(notebook.name)
        names: dict[str, Any] = {}
        node = notebook.load()
        for at, cell in enumerate(node.cells):
            if cell.cell_type == "code":
                cell.execution_count = at
                exec(cell.source, names)
            if at == notebook.at:
                names |= {**values, "out": str(stage)}
        return str(nbformat.writes(node)) + "\n"

    monkeypatch.setattr(execution, "execute", execute)
    return begun


@pytest.fixture
def store_path(tmp_path: Path) -> Path:
    """Name a place for a store that does not exist yet."""
    return tmp_path / "store" / "trials.sqlite"
