"""The folders of a run: where outputs, failed notebooks and trials go, for one run at a time."""

from __future__ import annotations

import fcntl
import os
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

from replication import files
from replication.files import open_lock
from replication.pipeline.notebook import refuse
from replication.pipeline.publish import recover

LOCK = ".lock"

PAPER = "figures"
"""The folder of the results of the profile "paper"."""

EDITED = "build/edited"
"""The folder of what would be the paper's results, had nothing been edited."""


def outputs_folder(name: str) -> Path:
    """Return where the outputs of a run go by default, see :func:`plan.run_name`."""
    return files.PROJECT / (PAPER if name == "paper" else f"build/{name}")


def failed_notebook(name: str, out: Path) -> Path:
    """Return where the notebook of a failed run is kept."""
    return writable(files.PROJECT / "build" / "failed", out / "failed") / f"{name}.ipynb"


def store_file(store: str, out: Path) -> Path:
    """Return the store's file: in `out` where the project cannot be written."""
    path = files.resolve(store)
    return writable(path.parent, out.resolve()) / path.name


def is_published(out: Path) -> bool:
    """Return whether a folder is that of the paper's results, or lies in it."""
    return out.resolve().is_relative_to((files.PROJECT / PAPER).resolve())


def writable(folder: Path, otherwise: Path) -> Path:
    """Return a folder that can be written or made, or another one instead."""
    there = folder
    while not there.exists():
        there = there.parent
    return folder if os.access(there, os.W_OK) else otherwise


@contextmanager
def exclusive(folder: Path, echo: Callable[[str], object]) -> Iterator[bool]:
    """Keep other runs out of a folder, which is made when missing; wait for one that is there.

    What a killed run left there is put right, see :func:`publish.recover`.

    Yields
    ------
    bool
        Whether this had to wait for another run.

    Raises
    ------
    NotebookError
        If the folder cannot be used.
    """
    try:
        folder.mkdir(parents=True, exist_ok=True)
        lock = open_lock(folder / LOCK)
    except OSError as error:
        refuse(folder, f"cannot be used as a folder: {(error.strerror or str(error)).lower()}")
    with lock:
        waited = False
        try:
            fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            echo(f"another run writes to {folder}: waiting until it ends")
            fcntl.flock(lock, fcntl.LOCK_EX)
            waited = True
        recover(folder)
        yield waited
