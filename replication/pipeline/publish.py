"""Publish by swapping one folder: a draft takes the place of what was published before.

The swap is not one atomic step: the old folder is renamed aside, then the new one is renamed in. A
process that is killed between the two leaves the old folder aside; the next start puts it back. So
a reader sees the old outputs, the new ones, or for a moment none, but never a mixture.
"""

from __future__ import annotations

import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from replication.files import LARGEST, remove_left, scratch_folder
from replication.pipeline.declaration import MANIFEST
from replication.pipeline.manifest import hashes, output_hash, read_manifest
from replication.pipeline.notebook import Notebook, RunError, refuse

ASIDE = ".aside-"
"""What the name of a folder begins with that was renamed aside."""


@contextmanager
def draft_folder(out: Path) -> Iterator[Path]:
    """Make a folder in `out` for what is not published yet; unless it is, it is removed."""
    with scratch_folder(out) as scratch:
        draft = scratch / "draft"  # unlike its parent, others may enter it
        draft.mkdir()
        yield draft


def swap(draft: Path, target: Path) -> None:
    """Put a folder in the place of another one, which need not exist.

    Raises
    ------
    OSError
        If a folder cannot be renamed; the old one is in its place then.
    """
    aside = target.with_name(f"{ASIDE}{target.name}")
    if target.exists():
        target.rename(aside)
    try:
        draft.rename(target)
    except BaseException:
        if aside.exists() and not target.exists():
            aside.rename(target)
        raise
    shutil.rmtree(aside, ignore_errors=True)


def recover(out: Path) -> None:
    """Put back or remove what killed processes left in a folder, and in that of the system."""
    for aside in out.glob(f"{ASIDE}*"):
        target = out / aside.name.removeprefix(ASIDE)
        if target.exists():
            shutil.rmtree(aside)
        else:
            aside.rename(target)
    for folder in (None, out, *out.glob("[!.]*/")):
        remove_left(folder)


def check_target(notebook: Notebook, target: Path) -> None:
    """Refuse to replace a file, or a folder with files that no run has published.

    Raises
    ------
    NotebookError
        If something else than outputs is there.
    """
    if not target.exists():
        return
    if not target.is_dir():
        refuse(target, f"is a file, but {notebook.name} publishes a folder of that name")
    foreign = sorted({path.name for path in target.iterdir()} - {*notebook.published})
    if foreign and not (target / MANIFEST).exists():
        refuse(target, f"holds {foreign[0]}, which no run has published; choose another --out")


def check_outputs(notebook: Notebook, stage: Path) -> None:
    """Compare what a notebook has written with what it declares.

    Raises
    ------
    RunError
        If they differ.
    """
    declared = notebook.declared.outputs
    if missing := [name for name in declared if not (stage / name).is_file()]:
        raise RunError(f"{notebook.path}: declared but not written: {', '.join(missing)}")
    if large := [name for name in declared if (stage / name).stat().st_size > LARGEST]:
        most = f"{LARGEST // 1_000_000} MB"
        raise RunError(f"{notebook.path}: written, but larger than {most}: {', '.join(large)}")
    if extra := sorted({path.name for path in stage.iterdir()} - set(declared)):
        raise RunError(f"{notebook.path}: written but not declared: {', '.join(extra)}")


def differing(stage: Path, target: Path, names: tuple[str, ...]) -> list[str] | None:
    """Return the files that are not as they were published before; None if nothing was.

    A file that is not there counts as what the manifest says of it.
    """
    before: dict[str, str] = dict(read_manifest(target).get("outputs", {}))
    if target.is_dir():
        there = [path for path in target.iterdir() if path.is_file() and path.name != MANIFEST]
        before |= {path.name: output_hash(path) for path in there}
    if not before:
        return None
    now = hashes(stage, names)
    return sorted(name for name in {*before, *now} if before.get(name) != now.get(name))
