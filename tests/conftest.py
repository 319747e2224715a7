from __future__ import annotations

from pathlib import Path
from typing import Any

import nbformat
import pytest

from replication import Demos, Maze, demonstrate, files, load_demos
from replication.files import PROJECT
from replication.pipeline import execute as execution
from replication.pipeline.notebook import Notebook

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
