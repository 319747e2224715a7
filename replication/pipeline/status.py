"""What is published against what is declared: what is up to date, and what is left over."""

from __future__ import annotations

import datetime
import shlex
from collections.abc import Callable, Sequence
from pathlib import Path

from replication.pipeline.declaration import MANIFEST
from replication.pipeline.folders import exclusive, is_published
from replication.pipeline.index import write_index
from replication.pipeline.manifest import (
    FRESH,
    MISSING,
    State,
    damaged,
    published_folders,
    read_manifest,
    read_runs,
)
from replication.pipeline.notebook import NotebookError, refuse
from replication.pipeline.plan import Run


def status_lines(
    runs: Sequence[Run], out: Path, options: Sequence[str] = (), *, all: bool = False
) -> list[str]:
    """Return what is not up to date and why, and what to do; one line when all is well.

    `runs` are all notebooks as they are now, `out` holds their folders. The commands that are
    recommended have the `options` that choose these outputs. With `all`, every notebook and each
    of its figures and tables has a line.
    """
    recorded = read_runs(out)
    lines, due, edited = [], [], False
    for run in runs:
        state, last = run.state, recorded.get(run.name)
        if state.kind != FRESH:
            due.append(run.name)
            edited |= is_published(out) and bool(run.edits)
        if all or state.kind != FRESH:
            when = f" ({last['seconds']:.0f} s, {_age(last['finished'])})" if last else ""
            lines.append(f"{run.name}: {state.kind}{when}")
            lines += [f"    because {reason}" for reason in _shortened(state.why)]
        lines += _output_lines(run, state) if all else []
    left = gone(runs, out)
    lines += [f"{name}: its notebook is gone" for name in left]
    lines += [""] if lines else []
    if due:
        words = ["--publish"] if edited else []
        lines.append(f"to bring {out.name} up to date: {_command('run', *due, *options, *words)}")
    else:
        lines.append(f"everything is fresh; {_command('verify', *options)} proves it")
    if left:
        lines.append(f"to remove what is left of {', '.join(left)}: {_command('clean', *options)}")
    return lines


def check_fresh(runs: Sequence[Run]) -> None:
    """Refuse to go on from results that are not up to date.

    Raises
    ------
    NotebookError
        Naming the first notebook that is missing or stale, with the reason and what to do.
    """
    for run in runs:
        state = run.state
        if state.kind != FRESH:
            why = f": {state.why[0]}" if state.why else ""
            raise NotebookError(f"{run.name} is {state.kind}{why}; first: replicate run {run.name}")


def _output_lines(run: Run, state: State) -> list[str]:
    """Return the state of each figure and table of a notebook."""
    manifest = read_manifest(run.folder)
    lost = damaged(run.folder, manifest) if manifest else {}
    lines = []
    for stem, names in _by_stem(run.notebook.declared.outputs).items():
        states = {lost.get(name, state.kind) for name in names}
        text = ", ".join(sorted(states - {state.kind})) or state.kind
        if not any((run.folder / name).exists() for name in names):
            text = MISSING
        suffixes = " ".join(name.removeprefix(stem) for name in names)
        lines.append(f"    {text:<9}{stem} {suffixes}")
    return lines


def gone(runs: Sequence[Run], out: Path) -> list[str]:
    """Return the published folders whose notebooks are not there any more."""
    return sorted(published_folders(out).keys() - {run.name for run in runs})


def clean(runs: Sequence[Run], out: Path, *, dry_run: bool, echo: Callable[[str], object]) -> None:
    """Remove files that none of all notebooks declares from the notebooks' folders in `out`.

    Of a notebook that is gone, only what its manifest names is removed, and the folder if it is
    empty then. Everything else in `out` stays, such as stored trials. A dry run only says what
    would be removed.

    Raises
    ------
    NotebookError
        If nothing there was published by a run, so that the files may be anybody's.
    """
    if not published_folders(out):
        refuse(out, f"has no folder with a {MANIFEST} of ours, so nothing is removed there")
    with exclusive(out, echo):
        manifests = published_folders(out)
        declared = {run.name: {*run.notebook.published, MANIFEST} for run in runs}
        for name, manifest in manifests.items():
            there = {path.name for path in (out / name).iterdir() if path.is_file()}
            listed = {*manifest["outputs"], MANIFEST}
            surplus = there - declared[name] if name in declared else there & listed
            for file in sorted(surplus, key=lambda file: (file == MANIFEST, file)):
                if not dry_run:
                    (out / name / file).unlink()
                echo(f"{'would remove' if dry_run else 'removed'} {name}/{file}")
            if not dry_run and not any((out / name).iterdir()):
                (out / name).rmdir()
        if not dry_run:
            write_index(out)


def _command(*words: str) -> str:
    return shlex.join(("replicate", *words))


def _shortened(reasons: Sequence[str]) -> list[str]:
    """Return at most six reasons, or five and the number of the others."""
    return [*reasons[:5], f"{len(reasons) - 5} more"] if len(reasons) > 6 else list(reasons)


def _by_stem(names: Sequence[str]) -> dict[str, list[str]]:
    stems: dict[str, list[str]] = {}
    for name in sorted(names):
        stems.setdefault(Path(name).stem, []).append(name)
    return stems


def _age(finished: str) -> str:
    """Return how long ago something was; a clock that was set back makes nothing younger than now.

    Examples
    --------
    >>> _age("2999-01-01T00:00:00+00:00")
    'just now'
    """
    now = datetime.datetime.now(datetime.UTC)
    seconds = (now - datetime.datetime.fromisoformat(finished)).total_seconds()
    for unit, size in (("day", 86400), ("hour", 3600), ("minute", 60)):
        number = int(seconds // size)
        if number > 0:
            return f"{number} {unit}{'s' if number > 1 else ''} ago"
    return "just now"
