"""What is up to date in a folder of outputs, in words, and what to do next."""

from __future__ import annotations

import datetime
import shlex
from collections.abc import Sequence
from pathlib import Path

from replication.pipeline import provenance
from replication.pipeline.cleaning import gone
from replication.pipeline.freshness import FRESH, MISSING, PROSE, read_runs, state_of
from replication.pipeline.plan import Run


def status_lines(
    runs: Sequence[Run], out: Path, folder: Path, options: Sequence[str] = ()
) -> list[str]:
    """Return the state of every figure and table, notebook by notebook, a line each.

    Parameters
    ----------
    runs
        The notebooks with their parameters and inputs of now.
    out, folder
        The outputs, and the executed notebooks.
    options
        The options that choose these outputs, for the commands that are recommended.
    """
    remembered, manifest = read_runs(folder), provenance.read_manifest(out)
    lines, due = [], []
    for run in runs:
        notebook, state = run.notebook, state_of(run, out, folder)
        done = remembered.get(notebook.name)
        when = f" ({done['seconds']:.0f} s, {_age(done['finished'])})" if done else ""
        said = FRESH if state.kind == PROSE else state.kind
        lines.append(f"{notebook.name}: {said}{when}")
        lines += [f"    because {reason}" for reason in _reasons(state.why)]
        if state.kind == PROSE:
            lines.append("    only its text has changed, which is not executed")
        if state.kind != FRESH:
            due.append(notebook.name)
        lost = provenance.damaged(out, manifest[notebook.name]) if notebook.name in manifest else {}
        for stem, names in _by_stem(notebook.outputs).items():
            own = {lost.get(name, said) for name in names}
            states = ", ".join(sorted(own - {said})) or said
            if not any((out / name).exists() for name in names):
                states = MISSING
            suffixes = " ".join(name.removeprefix(stem) for name in names)
            lines.append(f"    {states:<9}{stem} {suffixes}")
    left = gone(runs, out)
    lines += [f"{name}: its notebook is gone" for name in left]
    lines.append("")
    if due:
        lines.append(f"to bring {out.name} up to date: {_command('run', *due, *options)}")
    else:
        lines.append(f"everything is fresh; {_command('verify', *options)} proves it")
    if left:
        lines.append(f"to remove what is left of {', '.join(left)}: {_command('clean', *options)}")
    return lines


def _command(*words: str) -> str:
    return shlex.join(("replicate", *words))


def _reasons(why: Sequence[str]) -> list[str]:
    """Shorten a long list of reasons."""
    return [*why[:5], f"{len(why) - 5} more"] if len(why) > 6 else list(why)


def _by_stem(names: Sequence[str]) -> dict[str, list[str]]:
    found: dict[str, list[str]] = {}
    for name in sorted(names):
        found.setdefault(Path(name).stem, []).append(name)
    return found


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
