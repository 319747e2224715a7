"""Where the project's files are, from whatever folder a program or a notebook is started."""

from __future__ import annotations

import os
from pathlib import Path

PROJECT = Path(__file__).resolve().parents[1]
"""The project folder, which holds `notebooks/`, `data/` and `figures/`.

:meta hide-value:
"""


def resolve(path: str | os.PathLike[str]) -> Path:
    """Find a file: as given in the working folder if it is there, else in the project folder.

    An absolute path is returned as it is. Whether anything exists at the result is not checked.

    Examples
    --------
    >>> resolve("data/demos/open_maze.json").name
    'open_maze.json'
    """
    given = Path(path)
    return Path.cwd() / given if given.exists() else PROJECT / given
