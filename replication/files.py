"""Files: the one door for reading, writing whole or not at all, and where the project is.

One file because a door is only one if nothing else opens what a user may have put somewhere.
"""

from __future__ import annotations

import json
import os
import platform
import re
import shutil
import stat
import tempfile
import tomllib
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import IO, Any

import psutil

from replication.errors import UserError, show, unknown

LARGEST = 100_000_000
"""Bytes that a file may have."""

DEEPEST = 100
"""Levels that a JSON file may have."""


class FileError(UserError):
    """A file that cannot be used; the message is one line, `reason` is the part behind its name."""

    def __init__(self, path: str | os.PathLike[str], reason: str) -> None:
        super().__init__(f"{printable(path)}: {reason}")
        self.reason = reason


def read_file(path: str | os.PathLike[str], largest: int = LARGEST) -> bytes:
    """Return the content of a file; whatever is in its place, this takes no longer than a read.

    Everything that a user may have put there is read through this function, a test asserts it.

    Raises
    ------
    FileError
        If it is missing, unreadable, no regular file, or larger than so many bytes.
    """
    content = None
    try:
        number = os.open(path, os.O_RDONLY | os.O_NONBLOCK | os.O_NOCTTY)  # a pipe would block
        try:
            if stat.S_ISREG(os.fstat(number).st_mode):
                with os.fdopen(number, "rb", closefd=False) as file:
                    content = file.read(largest + 1)
        finally:
            os.close(number)
    except (OSError, ValueError) as error:
        raise FileError(path, f"cannot be read ({reason(error)})") from None
    if content is None:
        raise FileError(path, "is not a regular file; give the path of one")
    if len(content) > largest:
        raise FileError(path, f"is larger than {largest // 1_000_000} MB; give a smaller file")
    return content


def read_text(path: str | os.PathLike[str]) -> str:
    """Return the content of a text file.

    Raises
    ------
    FileError
        If it cannot be read, see :func:`read_file`, or is not UTF-8.
    """
    try:
        return read_file(path).decode()
    except UnicodeDecodeError as error:
        message = f"is not UTF-8 text (byte {error.start + 1}); save it as UTF-8"
        raise FileError(path, message) from None


def read_json(path: str | os.PathLike[str]) -> Any:
    """Return what a JSON file says.

    Raises
    ------
    FileError
        If it cannot be read, see :func:`read_file`, or is not JSON, see :func:`parse_json`.
    """
    content = read_file(path)
    try:
        return parse_json(content)
    except ValueError as error:
        raise FileError(path, f"is not JSON: {error}") from None


def read_toml(path: str | os.PathLike[str]) -> dict[str, Any]:
    """Return what a TOML file says.

    Raises
    ------
    FileError
        If it cannot be read, see :func:`read_text`, or is not TOML.
    """
    try:
        return tomllib.loads(read_text(path))
    except tomllib.TOMLDecodeError as error:
        raise FileError(path, f"is not TOML: {error}") from None


def parse_json(content: str | bytes) -> Any:
    """Return what JSON text says, if it has one meaning and no more levels than anyone needs.

    Raises
    ------
    ValueError
        If it is not UTF-8, not JSON, nested too deeply, or has a field twice; in one line.
    """
    text = content if isinstance(content, str) else content.decode("utf-8-sig")
    with suppress(RecursionError):
        value = json.loads(text, object_pairs_hook=fields)
        inner = [value]
        for _ in range(DEEPEST):
            if not (inner := [item for outer in inner for item in _items(outer)]):
                return value
    raise ValueError(f"it is nested too deeply; {DEEPEST} levels are allowed")


def fields(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    """Return the fields of a JSON object; raises `ValueError` if one is there twice."""
    found: dict[str, Any] = {}
    for name, value in pairs:
        if name in found:
            raise ValueError(f"the field {show(name)} appears twice in one object; keep one")
        found[name] = value
    return found


def _items(value: Any) -> Iterator[Any]:
    if isinstance(value, dict):
        yield from value.values()
    elif isinstance(value, list):
        yield from value


def open_lock(path: Path) -> IO[bytes]:
    """Open a file, made when missing, that processes lock to take turns.

    Raises
    ------
    OSError
        If it can be neither made nor opened.
    """
    return os.fdopen(os.open(path, os.O_RDWR | os.O_CREAT | os.O_NONBLOCK, 0o666), "rb")


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
    with scratch_folder(target.parent) as folder:
        draft = folder / "draft"
        try:
            draft.write_bytes(data)
            draft.replace(target)
        except OSError as error:
            error.filename = str(target)  # a full disk names no file, or the draft
            raise
    return target


@contextmanager
def scratch_folder(parent: Path | None = None) -> Iterator[Path]:
    """Make a folder for what is not finished, hidden in `parent` or else where the system has them.

    It is removed at the end. What killed processes left there is removed first.

    Raises
    ------
    OSError
        If it cannot be made.
    """
    remove_left(parent)
    with tempfile.TemporaryDirectory(
        # of one length, so that no text is broken elsewhere because it holds this name
        prefix=f"{_prefix(parent)}{os.getpid():07d}-",
        dir=parent,
        ignore_cleanup_errors=True,  # a kernel that is being killed may still write there
    ) as name:
        yield Path(name)


def remove_left(parent: Path | None = None) -> None:
    """Remove the folders of :func:`scratch_folder` whose processes are gone."""
    ours = re.compile(re.escape(_prefix(parent)) + r"(\d{7})-\w+")
    with suppress(OSError):  # not everyone may list the folder
        for left in Path(parent or tempfile.gettempdir()).iterdir():
            match = ours.fullmatch(left.name)
            if match and not _lives(int(match[1])):
                shutil.rmtree(left, ignore_errors=True)


def _prefix(parent: Path | None) -> str:
    """Return how the names begin; with that of the machine, since others may see the folder."""
    machine = platform.node().partition(".")[0]
    return f"{'.draft' if parent else 'replicate'}-{machine}-"


def _lives(pid: int) -> bool:
    try:
        return psutil.Process(pid).status() != psutil.STATUS_ZOMBIE
    except psutil.NoSuchProcess:
        return False
    except psutil.Error:  # another user's
        return True


def printable(path: str | os.PathLike[str]) -> str:
    """Return a path for a message of one line."""
    text = os.fsdecode(path)
    return text if text.isprintable() else repr(text)


def reason(error: Exception) -> str:
    """Return why a file cannot be read or written."""
    text = getattr(error, "strerror", None) or str(error)
    return text[:1].lower() + text[1:]


PROJECT = Path(__file__).resolve().parents[1]
"""The project folder, which holds `notebooks/`, `data/` and `figures/`.

:meta hide-value:
"""


def check_clone() -> None:
    """Check that the package lies in a clone of the repository, which has the notebooks.

    Raises
    ------
    UserError
        If it is not, with the commands that make one.
    """
    if not any((PROJECT / "notebooks").glob("*.ipynb")):
        raise UserError(
            "there are no notebooks beside the installed package; clone the repository and work "
            "there: git clone <its address> replication && cd replication && make"
        )


STORED = ("open_maze", "obstacle_maze", "soccer")
"""The names of the demonstrations that come with the package."""


def stored(name: str) -> Path:
    """Return the file of demonstrations that come with the package, in a clone that of `data`.

    Parameters
    ----------
    name
        `open_maze`, `obstacle_maze` or `soccer`.

    Raises
    ------
    UserError
        If there are none of that name.

    Examples
    --------
    >>> stored("open_maze").name
    'open_maze.json'
    """
    if name not in STORED:
        raise UserError(unknown(name, STORED, "demonstrations"))
    own = PROJECT / "data" / "demos" / f"{name}.json"
    return own if own.exists() else Path(__file__).parent / "stored" / own.name


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


def check_writable(folder: Path, size: int = ROOM) -> None:
    """Make a folder, and check that it can be written and that the disk has room for `size` bytes.

    It is called before anything is computed, so that no result is lost.

    Raises
    ------
    UserError
        If the folder cannot be made or written.
    """
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=folder) as probe:  # is gone even if this is killed
            probe.write(os.urandom(size))
    except OSError as error:
        folder_missing = isinstance(error, FileExistsError | NotADirectoryError)
        why = "it is not a folder" if folder_missing else reason(error)
        raise UserError(f"{folder} cannot be written: {why}; choose another one") from None
