"""Run notebooks that are not up to date, and publish the files that they declare, or nothing.

A notebook is fresh if nothing that its outputs depend on has changed since they were made, see
:mod:`replication.pipeline.provenance`. Trials that finished stay in the store, so that a run that broke off
goes on from there.
"""

from __future__ import annotations

import datetime
import json
import os
import platform
import shutil
import socket
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any
from urllib.parse import urlsplit

import joblib

from replication import files
from replication.files import write_file
from replication.pipeline import provenance
from replication.pipeline.folders import DRAFT, exclusive, executed_folder, store_file
from replication.pipeline.freshness import FRESH, PROSE, read_runs, remember, state_of
from replication.pipeline.notebook import Notebook, NotebookError, RunError, first_line, refuse
from replication.pipeline.plan import Run, departures, prepare, run_name

TIMEOUT = 3600
"""Seconds that one cell may take unless told otherwise."""


def run_notebooks(
    notebooks: Sequence[Path],
    *,
    profile: str,
    out: Path,
    jobs: int | None = None,
    seed: int | None = None,
    parameters: Mapping[str, Any] | None = None,
    executed: Path | None = None,
    timeout: int = TIMEOUT,
    force: bool = False,
    here: bool = False,
    scheduler: str = "",
    progress: bool | None = None,
    echo: Callable[[str], object] = print,
) -> list[Path]:
    """Run those notebooks that are not up to date and publish their outputs.

    Everything is checked before the first one runs. The outputs of a notebook are published
    together, after it has run to its end and has written what it declares and nothing else; when
    it fails, earlier outputs stay as they were and the remaining notebooks do not run. A second
    run into the same folder waits for the first.

    Parameters
    ----------
    notebooks
        Their files.
    profile
        "paper", or another name that notebooks may have parameter values for.
    out
        Folder for the outputs; made when missing. The project's `figures` hold what the profile
        "paper" gives, unchanged, and take nothing else.
    jobs
        Worker processes, for the parameter `jobs`; None gives those notebooks that have the
        parameter as many as there are usable cores.
    seed
        For the parameter `seed`; None keeps each notebook's own.
    parameters
        Other parameter values, which every notebook must know.
    executed
        Folder for the executed notebooks, of failed runs too, see :func:`executed_folder`.
    timeout
        Seconds that one cell may take.
    force
        Whether to run what is up to date, too, and to compute every trial again.
    here
        Whether to run what is up to date, too, if it was made elsewhere, as in a fresh clone.
    scheduler
        Address of a Dask scheduler that trials are sent to.
    progress
        Whether progress bars are drawn; None draws them on a terminal only.
    echo
        Prints a line.

    Returns
    -------
    list of Path
        The published files.

    Raises
    ------
    NotebookError
        If a notebook cannot be run, a parameter is unknown or of the wrong type, or `figures`
        would take another run's results; nothing ran. Also if a cell refuses a choice, a map or
        demonstrations: then earlier notebooks ran.
    ClaimError, ChoiceError
        If the claims or the specifications that a notebook reads cannot be used; nothing ran.
    RunError
        If a cell failed, took too long or killed its kernel, or if the files in `out` are not the
        declared ones or cannot be written.
    """
    changes = departures(seed, parameters)
    if profile != "paper":
        changes.insert(0, f"--profile {profile}")
    if changes and out.resolve().is_relative_to((files.PROJECT / "figures").resolve()):
        raise NotebookError(
            f"{out} holds the results of the profile 'paper', unchanged; choose another folder "
            f"for a run with {', '.join(changes)}"
        )
    asked: dict[str, Any] = {"profile": profile, "jobs": jobs, "seed": seed}
    runs = prepare(notebooks, parameters=parameters, **asked)
    folder = executed or executed_folder(out, run_name(profile, seed=seed, parameters=parameters))
    for run in runs:
        for target in (out / name for name in run.notebook.published):
            if target.is_dir():
                refuse(
                    target,
                    f"is a folder, but {run.notebook.name} writes a file of that name",
                )
    with exclusive((out, folder), echo) as waited:
        if waited:  # for how long, and what was edited meanwhile, nobody knows
            runs = prepare(notebooks, parameters=parameters, **asked)
        known = {run.notebook.name for run in runs} if not here else read_runs(folder).keys()
        waiting = [
            run
            for run in runs
            if force or run.notebook.name not in known or not _is_fresh(run, out, folder, echo)
        ]
        if not waiting:
            return []
        _check_plans(waiting)
        bars = sys.stderr.isatty() if progress is None else progress
        options = {"timeout": timeout, "scheduler": scheduler}
        return _run_all(waiting, out, folder, force=force, bars=bars, echo=echo, **options)


def _check_plans(runs: Sequence[Run]) -> None:
    """Check the frozen claims and the declared specifications if a notebook reads them."""
    named = {name for run in runs for name in run.notebook.inputs}
    if "replication/claims.toml" in named:
        from replication.evidence.claims import load_claims

        load_claims()
    if "replication/specifications.toml" in named:
        from replication.evidence.specifications import check_declared

        check_declared()


def _is_fresh(run: Run, out: Path, folder: Path, echo: Callable[[str], object]) -> bool:
    """Return whether a notebook need not be executed; bring its text up to date then."""
    state = state_of(run, out, folder)
    if state.kind == FRESH:
        echo(f"{run.notebook.name}: fresh, nothing to do")
    elif state.kind == PROSE:
        refresh_text(run.notebook, out, folder)
        echo(f"{run.notebook.name}: fresh; its text is brought up to date, nothing is executed")
    return state.kind in (FRESH, PROSE)


def _run_all(
    runs: Sequence[Run],
    out: Path,
    folder: Path,
    *,
    force: bool,
    bars: bool,
    echo: Callable[[str], object],
    **options: Any,
) -> list[Path]:
    """Run notebooks one after another; `options` are those of `execution.execute`."""
    from replication.pipeline.execute import execute  # loads papermill, which takes a second
    from replication.progress import Display

    for run in runs:
        run.notebook.load()  # refuses one that is not valid before the first one runs
    _check_scheduler(options["scheduler"])
    where = _where()
    published: list[Path] = []
    with (
        Display(len(runs), bars=bars) as display,
        # A kernel that is being killed may still write there.
        tempfile.TemporaryDirectory(prefix="replicate-", ignore_cleanup_errors=True) as scratch,
    ):
        for run in runs:
            notebook, values = run.notebook, dict(run.values)
            shown = ", ".join(f"{name} = {json.dumps(value)}" for name, value in values.items())
            echo(f"{notebook.name}: running, {shown}" if shown else f"{notebook.name}: running")
            if "store" in notebook.literals:
                store = store_file(values.get("store", notebook.literals["store"]), out)
                values["store"] = str(Path(scratch) / "trials.sqlite" if force else store)
            display.begin(notebook.name)
            remember(folder, notebook.name, None)
            began, inputs = time.monotonic(), run.again().inputs
            stage = Path(scratch) / notebook.name
            stage.mkdir()
            stamps = _copy_merged(notebook, out, stage)
            shared = {name: provenance.file_hash(stage / name) for name in stamps}
            execute(
                notebook,
                values,
                stage,
                target=out,
                executed=folder / notebook.executed,
                display=display,
                **options,
            )
            _check_outputs(notebook, stage, stamps)
            _check_inputs(notebook, provenance.changes(inputs, run.again().inputs))
            compared = _compared(notebook, stage, out)
            published += _publish(notebook, stage, out, folder)
            provenance.record(out, notebook, inputs, shared)
            shutil.rmtree(stage)
            seconds = time.monotonic() - began
            circumstances = {"seconds": round(seconds, 1), "finished": _now()}
            remember(folder, notebook.name, where | circumstances)
            display.end()
            echo(f"{notebook.name}: {_number(notebook)} in {seconds:.1f} s{compared}")
    return list(dict.fromkeys(published))


def _check_scheduler(address: str) -> None:
    """Refuse the address of a Dask scheduler at which nothing answers."""
    from replication.trials.run import SCHEDULER

    address = address or os.environ.get(SCHEDULER, "")
    if not address:
        return
    try:
        url = urlsplit(address)
        if url.hostname is None or url.port is None:
            raise ValueError("it is not of the form tcp://HOST:PORT")
        socket.create_connection((url.hostname, url.port), timeout=5).close()
    except (OSError, ValueError) as error:
        raise NotebookError(
            f"no Dask scheduler answers at {address}: {first_line(error)}"
        ) from None


def _where() -> dict[str, Any]:
    """Return what a run runs on: the commit, whether nothing was changed since, the machine."""
    commit, clean = _commit()
    machine = f"{platform.system()} {platform.machine()}, {joblib.cpu_count()} cores"
    return {"commit": commit, "clean": clean, "machine": machine}


def _now() -> str:
    return datetime.datetime.now(datetime.UTC).isoformat(timespec="seconds")


def refresh_text(notebook: Notebook, out: Path, folder: Path) -> None:
    """Bring the text of the executed notebook up to date, the full one and the published one."""
    from replication.pipeline.rendering import rendered

    full, published = folder / notebook.executed, out / notebook.executed
    if full.exists():
        write_file(full, rendered(notebook, full))
    text = rendered(notebook, published)
    # The manifest goes first: if this is killed before the file, the next run finds out.
    provenance.rehash(out, notebook.name, notebook.executed, text)
    write_file(published, text)


def _commit() -> tuple[str, bool]:
    """Return the project's commit, and whether nothing was changed since; empty without git."""
    try:
        said = [
            subprocess.run(
                ["git", *words],
                cwd=files.PROJECT,
                capture_output=True,
                text=True,
                check=True,
            ).stdout.strip()
            for words in (("rev-parse", "HEAD"), ("status", "--porcelain"))
        ]
    except (OSError, subprocess.CalledProcessError):
        return "", False
    return said[0], not said[1]


# --- what a run leaves -----------------------------------------------------------------------


def _number(notebook: Notebook) -> str:
    """Say what a notebook wrote; what it shares with others is named, not counted."""
    own = len(notebook.outputs) - len(notebook.merged)
    number = "1 output" if own == 1 else f"{own} outputs"
    return " and rows of ".join((number, *notebook.merged))


def _compared(notebook: Notebook, stage: Path, out: Path) -> str:
    """Say whether outputs that were there before have the same bytes now.

    A shared file also changes with the rows of others, and is left out.
    """
    own = [name for name in notebook.outputs if name not in notebook.merged]
    there = [name for name in own if (out / name).is_file()]
    if not there:
        return ""
    other = [name for name in there if (out / name).read_bytes() != (stage / name).read_bytes()]
    return f"; {len(other)} of them differ from before" if other else "; all bytes as before"


def _copy_merged(notebook: Notebook, out: Path, stage: Path) -> dict[str, int]:
    """Copy published merged files into the stage; return their time stamps, by name."""
    stamps = {}
    for name in notebook.merged:
        if (out / name).exists():
            shutil.copyfile(out / name, stage / name)
            stamps[name] = (stage / name).stat().st_mtime_ns
    return stamps


def _check_outputs(notebook: Notebook, stage: Path, stamps: Mapping[str, int]) -> None:
    """Compare the stage with the declarations."""
    missing = [
        name
        for name in notebook.outputs
        if not (stage / name).is_file() or (stage / name).stat().st_mtime_ns == stamps.get(name)
    ]
    if missing:
        raise RunError(f"{notebook.path}: declared but not written: {', '.join(missing)}")
    extra = sorted({path.name for path in stage.iterdir()} - set(notebook.outputs))
    if extra:
        raise RunError(f"{notebook.path}: written but not declared: {', '.join(extra)}")


def _check_inputs(notebook: Notebook, changed: Sequence[str]) -> None:
    """Refuse to publish what nobody knows whether it was made before or after a change."""
    if changed:
        said = ", ".join(f"{one} during the run" for one in changed)
        raise RunError(f"{notebook.path}: {said}: nothing is published; run it again")


def _publish(notebook: Notebook, stage: Path, out: Path, folder: Path) -> list[Path]:
    """Move all outputs to `out`: copies first, which may fail, then only renaming.

    The executed notebook in `folder` is among them, with links to the other ones.
    """
    from replication.pipeline.rendering import linked

    try:
        write_file(stage / notebook.executed, linked(folder / notebook.executed, stage))
        with tempfile.TemporaryDirectory(prefix=DRAFT, dir=out) as drafts:
            for name in notebook.published:
                shutil.copyfile(stage / name, Path(drafts) / name)
            for name in notebook.published:
                (Path(drafts) / name).replace(out / name)
    except OSError as error:
        said = error.strerror or str(error)  # which file of the stage it was helps nobody
        raise RunError(f"{notebook.path}: cannot publish to {out}: {said}") from error
    return [out / name for name in notebook.published]
