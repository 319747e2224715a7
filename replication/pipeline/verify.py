"""Prove published files: make them again from their trials, and compare every byte.

What should be there follows from the notebooks, not from the manifests: the files that they
declare, the parameters of the profile, the packages of the lock. Each notebook is executed with its
published table of trials, from which all its other files follow. The trials themselves are for
:mod:`replication.evidence.recompute`.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Sequence
from importlib import metadata
from pathlib import Path

from packaging.requirements import Requirement
from packaging.utils import canonicalize_name

from replication.errors import UserError
from replication.files import read_file, read_text
from replication.pipeline.declaration import MANIFEST, TRIALS
from replication.pipeline.folders import LOCK
from replication.pipeline.index import INDEX, index_texts
from replication.pipeline.inputs import changes
from replication.pipeline.manifest import RUNS, damaged, read_manifest, versions
from replication.pipeline.notebook import RunError
from replication.pipeline.plan import Run
from replication.pipeline.produce import produce
from replication.progress import GIVEN, Display


def verify_folder(runs: Sequence[Run], out: Path) -> Iterator[str]:
    """Yield what is wrong beside the notebooks' folders: what belongs to none, and the index."""
    names = {INDEX, LOCK, RUNS, *(run.name for run in runs)}
    for path in sorted(out.iterdir()) if out.is_dir() else ():
        if path.name not in names:
            yield f"{path.name} belongs to no notebook"
        elif path.is_symlink():
            yield f"{path.name} is a symbolic link"
    before, text = index_texts(out)
    if before != text:
        yield f"{INDEX} is not the page that belongs to these folders"


def verify_records(run: Run) -> Iterator[str]:
    """Yield what is wrong with a notebook's folder as it stands; nothing is executed."""
    there = {path.relative_to(run.folder).as_posix() for path in run.folder.rglob("*")}
    expected = {*run.notebook.published, MANIFEST}
    if not there:
        yield f"{run.name}: nothing is published"
        return
    for name in sorted(there | expected):
        path = run.folder / name
        if name not in there:
            yield f"{run.name}/{name} is missing"
        elif name not in expected:
            yield f"{run.name}/{name} belongs to no notebook"
        elif path.is_symlink() or not path.is_file():
            yield f"{run.name}/{name} is no regular file"
    manifest = read_manifest(run.folder)
    if not manifest:
        if MANIFEST in there:
            yield f"{run.name}/{MANIFEST} cannot be read"
        return
    for change in changes(manifest["inputs"], run.inputs):
        yield f"{run.name} is stale: {change}"
    for output, how in damaged(run.folder, manifest).items():
        yield f"{run.name}/{output} is {how} since its run"
    if manifest.get("versions") != versions():
        yield f"{run.name}/{MANIFEST} names other versions of packages than are installed"


def verify_outputs(
    run: Run, scratch: Path, *, timeout: int, echo: Callable[[str], object]
) -> Iterator[str]:
    """Make a notebook's folder again, from its trials, and yield the files that have other bytes.

    Parameters
    ----------
    run
        The notebook as it is published; :func:`verify_records` found nothing wrong.
    scratch
        An empty folder.
    timeout
        Seconds that a cell may take.
    echo
        Prints a line.
    """
    trials = run.notebook.declared.trials
    stage = scratch / "stage"
    stage.mkdir()
    try:
        with Display(1, bars=False) as display:
            produce(
                run,
                stage,
                store=scratch / "trials.sqlite",
                failed=scratch / "failed.ipynb",
                timeout=timeout,
                display=display,
                settings={GIVEN: str(run.folder.resolve())} if trials else {},
            )
    except (UserError, RunError) as error:
        yield f"{run.name} cannot be made again: {error}"
        return
    names = [*run.notebook.published, MANIFEST]
    wrong = [name for name in names if read_file(stage / name) != read_file(run.folder / name)]
    for name in wrong:
        yield f"{run.name}/{name} has other bytes than its notebook gives"
    if not wrong:
        source = f" from {TRIALS}" if trials else ""
        echo(f"{run.name}: made again{source}, {len(names)} files have the same bytes")


def verify_packages(lock: Path) -> Iterator[str]:
    """Yield how the installed packages differ from those that are pinned in a lock file."""
    for line in read_text(lock).splitlines():
        if not re.match(r"[A-Za-z0-9]", line):
            continue
        pin = Requirement(line.split("\\")[0].strip())
        if pin.marker is not None and not pin.marker.evaluate():
            continue
        name = canonicalize_name(pin.name)
        try:
            installed = metadata.version(name)
        except metadata.PackageNotFoundError:
            yield f"{name} is not installed; the lock pins {pin.specifier}"
            continue
        if not pin.specifier.contains(installed, prereleases=True):
            yield f"{name} {installed} is installed; the lock pins {pin.specifier}"
