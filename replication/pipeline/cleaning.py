"""Remove what notebooks left behind that are gone, or that no longer write it."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path

from replication.pipeline import provenance
from replication.pipeline.folders import LOCK, exclusive
from replication.pipeline.notebook import refuse
from replication.pipeline.plan import Run


def clean(runs: Sequence[Run], out: Path, *, dry_run: bool, echo: Callable[[str], object]) -> None:
    """Remove files that no notebook declares, and from the manifest the notebooks that are gone.

    Stores of trials and folders stay.

    Parameters
    ----------
    runs
        All notebooks.
    out
        A folder of outputs.
    dry_run
        Whether only to say what would be removed.
    echo
        Prints a line.

    Raises
    ------
    NotebookError
        If the folder has no manifest, so that its files may be anybody's.
    """
    if not provenance.read_manifest(out):
        refuse(out, f"has no {provenance.MANIFEST} of ours, so nothing is removed there")
    word = "would remove" if dry_run else "removed"
    with exclusive([out], echo):
        for path in undeclared(runs, out):
            if not dry_run:
                path.unlink()
            echo(f"{word} {path.name}")
        names = gone(runs, out)
        if names and not dry_run:
            provenance.forget(out, names)
        for name in names:
            echo(f"{word} the record of {name}")


def undeclared(runs: Sequence[Run], out: Path) -> list[Path]:
    """Return the files in a folder of outputs that no notebook declares."""
    declared = {provenance.MANIFEST, LOCK}
    declared |= {name for run in runs for name in run.notebook.published}
    stores = tuple(
        Path(run.notebook.literals["store"]).name
        for run in runs
        if run.notebook.literals.get("store")
    )
    return sorted(
        path
        for path in out.iterdir()
        if path.is_file() and path.name not in declared and not path.name.startswith(stores)
    )


def gone(runs: Sequence[Run], out: Path) -> list[str]:
    """Return the notebooks that the manifest names and that are not there any more."""
    return sorted(provenance.read_manifest(out).keys() - {run.notebook.name for run in runs})
