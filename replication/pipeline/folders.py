"""The folders of a run: where outputs, executed notebooks and trials go, for one run at a time."""

from __future__ import annotations

import fcntl
import os
import shutil
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, contextmanager
from pathlib import Path

from replication import files
from replication.pipeline.notebook import refuse

LOCK = ".lock"

DRAFT = ".draft-"
"""What the names of folders with half-written files begin with."""


def outputs_folder(name: str) -> Path:
    """Return where the outputs of a run go unless told otherwise, see :func:`runs.run_name`."""
    return files.PROJECT / ("figures" if name == "paper" else f"build/{name}")


def executed_folder(out: Path, name: str) -> Path:
    """Return where executed notebooks go: below `build`, or beside outputs in another place."""
    if out.resolve() == outputs_folder(name).resolve():
        return files.PROJECT / "build" / "executed" / name
    return out / "executed"


def store_file(store: str, out: Path) -> Path:
    """Return the store's file: in `out` where the project cannot be written."""
    path = files.resolve(store)
    folder = path.parent
    while not folder.exists():
        folder = folder.parent
    return path if os.access(folder, os.W_OK) else out.resolve() / path.name


@contextmanager
def exclusive(folders: Sequence[Path], echo: Callable[[str], object]) -> Iterator[bool]:
    """Keep other runs out of folders, which are made when missing.

    What a killed run left half-written there is removed.

    Yields
    ------
    bool
        Whether this had to wait for another run.

    Raises
    ------
    NotebookError
        If a folder cannot be used.
    """
    with ExitStack() as locks:
        waited = False
        for folder in dict.fromkeys(folders):
            try:
                folder.mkdir(parents=True, exist_ok=True)
                waited |= locks.enter_context(_locked(folder, echo))
                for draft in folder.glob(f"{DRAFT}*"):
                    shutil.rmtree(draft)
            except OSError as error:
                said = (error.strerror or str(error)).lower()
                refuse(folder, f"cannot be used as a folder: {said}")
        yield waited


@contextmanager
def _locked(folder: Path, echo: Callable[[str], object]) -> Iterator[bool]:
    """Keep other runs out of a folder; wait for one that is there, and yield whether one was."""
    with (folder / LOCK).open("w") as file:
        try:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
            waited = False
        except BlockingIOError:
            echo(f"another run writes to {folder}: waiting until it ends")
            fcntl.flock(file, fcntl.LOCK_EX)
            waited = True
        yield waited
