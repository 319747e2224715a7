from __future__ import annotations

from pathlib import Path

import pytest

from replication import Demos, Maze, demonstrate, load_demos
from replication.paths import PROJECT

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


@pytest.fixture
def store_path(tmp_path: Path) -> Path:
    """Name a place for a store that does not exist yet."""
    return tmp_path / "store" / "trials.sqlite"
