"""Prove published files: they are whole, and what they came from is as it was."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from importlib import metadata
from pathlib import Path

from packaging.requirements import Requirement
from packaging.utils import canonicalize_name

from replication.files import read_text
from replication.pipeline.declaration import MANIFEST
from replication.pipeline.inputs import changes
from replication.pipeline.manifest import damaged, published_folders, read_manifest
from replication.pipeline.plan import Run
from replication.pipeline.status import gone


def verify_outputs(out: Path) -> Iterator[str]:
    """Yield what is wrong with the published files, held against their manifests."""
    published = published_folders(out)
    if not published:
        yield f"no folder in {out} has a {MANIFEST} that can be read: nothing can be proved"
    for name, manifest in published.items():
        for output, how in damaged(out / name, manifest).items():
            yield f"{name}/{output} is {how} since its run"


def verify_inputs(runs: Sequence[Run], out: Path) -> Iterator[str]:
    """Yield what has changed, since they were made, of what the published files depend on."""
    for run in runs:
        if manifest := read_manifest(run.folder):
            for change in changes(manifest["inputs"], run.inputs):
                yield f"{run.name} is stale: {change}"
        elif run.folder.is_dir():
            yield f"{run.folder / MANIFEST} is missing or cannot be read"
    for name in gone(runs, out):
        yield f"{name} made outputs, and is no notebook of this project any more"


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
