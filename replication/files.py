"""Files that are never half-written, and where the project's files are."""

from __future__ import annotations

import os
import tempfile
from pathlib import Path

from replication.errors import UserError


def write_file(path: str | os.PathLike[str], content: str | bytes) -> Path:
    """Write a whole file or leave what is there; the folder is made when missing.

    Text is written as UTF-8 with the line ends it has.

    Raises
    ------
    OSError
        If the folder or the file cannot be written.
    """
    target = Path(path)
    target.parent.mkdir(parents=True, exist_ok=True)
    data = content.encode() if isinstance(content, str) else content
    with tempfile.TemporaryDirectory(prefix=".draft-", dir=target.parent) as folder:
        draft = Path(folder) / "draft"
        try:
            draft.write_bytes(data)
            draft.replace(target)
        except OSError as error:
            error.filename = str(target)  # a full disk names no file, or the draft
            raise
    return target


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


def shown_as(path: Path) -> str:
    """Return a path for readers: from the project on, or only its name if it lies elsewhere."""
    absolute = path.resolve()
    inside = absolute.is_relative_to(PROJECT)
    return absolute.relative_to(PROJECT).as_posix() if inside else path.name


ROOM = 1_000_000
"""Bytes that :func:`check_writable` asks for: more than most results take."""


def check_writable(folder: Path) -> None:
    """Make a folder, and check that it can be written and that the disk has room.

    It is called before anything is computed, so that no result is lost.

    Raises
    ------
    UserError
        If the folder cannot be made or written.
    """
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=folder) as probe:  # is gone even if this is killed
            probe.write(os.urandom(ROOM))
    except OSError as error:
        reason = (error.strerror or str(error)).lower()
        if isinstance(error, FileExistsError | NotADirectoryError):
            reason = "it is not a folder"
        raise UserError(f"{folder} cannot be written: {reason}; choose another one") from None
