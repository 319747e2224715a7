"""Run stale notebooks; publish all their declared outputs, or none.

A notebook is fresh if nothing that its outputs depend on has changed since they were made, see
:mod:`replication.pipeline.manifest`. Finished trials stay in the store, so a run that was cut off
goes on from there.
"""

from __future__ import annotations

import json
import os
import socket
import sys
import tempfile
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from urllib.parse import urlsplit

from replication import files
from replication.files import check_writable, read_text, scratch_folder, write_file
from replication.pipeline.declaration import EXECUTED
from replication.pipeline.folders import (
    EDITED,
    exclusive,
    failed_notebook,
    is_published,
    outputs_folder,
)
from replication.pipeline.index import write_index
from replication.pipeline.manifest import FRESH, read_runs, record_run
from replication.pipeline.notebook import NotebookError, RunError, first_line
from replication.pipeline.plan import (
    Run,
    check_unedited,
    departures,
    foreign,
    prepare,
    run_name,
)
from replication.pipeline.produce import produce, store_of, unpublished
from replication.pipeline.publish import check_target, differing, draft_folder, swap
from replication.progress import SCHEDULER, Display

TIMEOUT = 3600
"""Seconds that one cell may take by default."""

Echo = Callable[[str], object]


@dataclass(frozen=True)
class Published:
    """All files that a run has published; `changed` are those with other bytes, or gone now."""

    files: tuple[Path, ...]
    changed: tuple[Path, ...]


def destination(
    notebooks: Sequence[Path], *, profile: str, publish: bool, **asked: Any
) -> tuple[Path, str]:
    """Return where the outputs of a run go by default, and why not to `figures`, if so.

    What is published in `figures` is replaced only if nothing that it depends on was edited, or if
    `publish` says so.
    """
    name = run_name(profile, seed=asked["seed"], parameters=asked["parameters"])
    if why := foreign(notebooks):
        return outputs_folder("custom" if name == "paper" else name), why
    out = outputs_folder(name)
    if publish or not is_published(out):
        return out, ""
    runs = prepare(notebooks, profile=profile, out=out, **asked)
    try:
        check_unedited(runs)
    except NotebookError as error:
        return files.PROJECT / EDITED, str(error)
    return out, ""


def run_notebooks(
    notebooks: Sequence[Path],
    *,
    profile: str,
    out: Path,
    timeout: int = TIMEOUT,
    force: bool = False,
    here: bool = False,
    publish: bool = False,
    scheduler: str = "",
    checks: Mapping[str, Callable[[], object]] | None = None,
    echo: Echo = print,
    **asked: Any,
) -> list[Published]:
    """Run those notebooks that are not up to date and publish their outputs.

    Everything is checked before the first one runs. The outputs of a notebook are published
    together, after it has run to its end and has written what it declares and nothing else; when
    it fails, earlier outputs stay as they were and the remaining notebooks do not run. A second
    run into the same folder waits for the first.

    Parameters
    ----------
    notebooks, profile, out, **asked
        See :func:`plan.prepare`. The project's `figures` take nothing but what the profile "paper"
        gives.
    timeout
        Seconds that one cell may take.
    force
        Whether to run what is up to date, too, and to compute every trial again.
    here
        Whether to run what is up to date, too, if it was made elsewhere, as in a fresh clone.
    publish
        Whether results in `figures` may be replaced by those of an edited notebook, of other data,
        code or packages.
    scheduler
        Address of a Dask scheduler that trials are sent to.
    checks
        Functions that check files which notebooks declare as `inputs`, by the name of the file;
        they are called before a run of a notebook that reads the file.
    echo
        Prints a line.

    Raises
    ------
    UserError
        If a notebook cannot be run, a parameter is unknown or of the wrong type, a check refuses
        its file, or `figures` would take another run's results; nothing ran. Also if a cell
        refuses a choice, a map or demonstrations: then earlier notebooks ran.
    RunError
        If a cell failed, took too long or killed its kernel, or if its outputs are not the
        declared ones or cannot be written.
    """
    if is_published(out) and (why := foreign(notebooks)):
        raise NotebookError(f"{why}, so nothing of it is published in {out}; choose another")
    other = [] if profile == "paper" else [f"--profile {profile}"]
    other += departures(asked.get("seed"), asked.get("parameters"))
    if other and is_published(out):
        raise NotebookError(
            f"{out} holds the results of the profile 'paper', unchanged; choose another folder "
            f"for a run with {', '.join(other)}"
        )

    def prepared() -> list[Run]:
        runs = prepare(notebooks, profile=profile, out=out, **asked)
        if is_published(out) and not publish:
            check_unedited(runs)
        return runs

    runs = prepared()
    for run in runs:
        check_target(run.notebook, run.folder)
    with exclusive(out, echo) as waited:
        if waited:  # notebooks may have been edited meanwhile
            runs = prepared()
        elsewhere = {run.name for run in runs} - read_runs(out).keys() if here else set()

        def is_due(run: Run) -> bool:
            return force or run.name in elsewhere or run.state.kind != FRESH

        due = {run.name for run in runs if is_due(run)}
        for run in runs:  # what a notebook needs may come out differently
            if due.intersection(run.notebook.declared.needs):
                due.add(run.name)
        _check([run for run in runs if run.name in due], checks or {}, scheduler)
        published = []
        bars = sys.stderr.isatty() and sys.stdout.isatty()  # not behind `| tee`
        with Display(len(due), bars=bars) as display:
            for run in map(Run.again, runs):
                if not is_due(run):
                    echo(f"{run.name}: fresh, nothing to do")
                    render_text(run)
                    continue
                display.begin(run.name)
                settings = {SCHEDULER: scheduler} if scheduler else {}
                options = {"timeout": timeout, "settings": settings, "display": display}
                published.append(_run_one(run, force=force, echo=echo, **options))
                display.end()
        write_index(out)
    return published


def _check(runs: Sequence[Run], checks: Mapping[str, Callable[[], object]], scheduler: str) -> None:
    """Check what is about to run, as far as it can be checked in a second."""
    named = {name for run in runs for name in run.notebook.declared.inputs}
    for name in named & checks.keys():
        checks[name]()
    for run in runs:
        run.notebook.load()  # refuses one that is not valid before the first one runs
        for folder in (Path(tempfile.gettempdir()), run.out, store_of(run).parent):
            check_writable(folder)
    address = scheduler or os.environ.get(SCHEDULER, "")
    if not runs or not address:
        return
    try:
        url = urlsplit(address)
        if url.hostname is None or url.port is None:
            raise ValueError("it is not of the form tcp://HOST:PORT")
        socket.create_connection((url.hostname, url.port), timeout=5).close()
    except (OSError, ValueError) as error:
        message = f"no Dask scheduler answers at {address}: {first_line(error)}"
        raise NotebookError(message) from None


def _run_one(run: Run, *, force: bool, echo: Echo, **options: Any) -> Published:
    """Make a notebook's folder and publish it; `options` are those of `execute.execute`."""
    notebook, began = run.notebook, time.monotonic()
    given = ", ".join(f"{name} = {json.dumps(value)}" for name, value in run.values.items())
    echo(f"{run.name}: running, {given}" if given else f"{run.name}: running")
    failed = failed_notebook(run.name, run.out)
    with (
        draft_folder(run.out) as stage,
        scratch_folder() as scratch,
    ):
        store = scratch / "trials.sqlite" if force else store_of(run)
        try:
            produce(run, stage, store=store, failed=failed, **options)
        except RunError:
            if failed.exists():
                echo(f"{run.name}: failed; as far as it ran: {failed}")
            raise
        try:
            differ = differing(stage, run.folder, notebook.published)
            swap(stage, run.folder)
        except OSError as error:
            raise unpublished(run, error) from error
    seconds = time.monotonic() - began
    record_run(run.out, run.name, seconds)
    failed.unlink(missing_ok=True)
    number = len(notebook.declared.outputs)
    compared = "" if differ is None else "; all bytes as before"
    if differ:
        compared = f"; other bytes than before: {', '.join(differ)}"
    echo(f"{run.name}: {number} output{'s' * (number != 1)} in {seconds:.1f} s{compared}")
    whole = (run.folder / name for name in notebook.published)
    return Published(tuple(whole), tuple(run.folder / name for name in differ or ()))


def render_text(run: Run) -> None:
    """Bring the text of a published notebook up to date; nothing is executed."""
    published = run.folder / EXECUTED
    before = read_text(published)
    if run.notebook.shows(before):
        return
    from replication.pipeline.rendering import rendered  # loads nbformat

    write_file(published, rendered(run.notebook, published))
