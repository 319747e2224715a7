"""Run notebooks that are not up to date, and publish the files that they declare, or nothing.

A notebook is fresh if nothing that its outputs depend on has changed since they were made, see
:mod:`replication.provenance`. Trials that finished stay in the store, so that a run that broke off
goes on from there.
"""

from __future__ import annotations

import datetime
import fcntl
import json
import os
import platform
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import joblib

from replication import paths, provenance
from replication.executed import linked, render, shows
from replication.files import write_file
from replication.notebooks import Notebook, NotebookError, RunError, read_notebook, refuse

TIMEOUT = 3600
"""Seconds that one cell may take unless told otherwise."""

RUNS = "run.json"
"""What differs from run to run, beside the executed notebooks."""

LOCK = ".lock"

FRESH, STALE, MISSING, PROSE = "fresh", "stale", "missing", "prose"


@dataclass(frozen=True)
class Run:
    """A notebook with the parameters of a run, and everything that its outputs depend on."""

    notebook: Notebook
    values: Mapping[str, Any]
    inputs: provenance.Inputs


@dataclass(frozen=True)
class State:
    """Whether the outputs of a notebook are up to date.

    `kind` is "fresh", "stale", "missing", or "prose" where only text has changed that is not
    executed; `why` says what has changed.
    """

    kind: str
    why: tuple[str, ...] = ()


# --- running ---------------------------------------------------------------------------------


def run_name(
    profile: str,
    *,
    seed: int | None = None,
    parameters: Mapping[str, Any] | None = None,
) -> str:
    """Name what a run is: its profile, or "custom" where a result may differ from the profile's.

    Examples
    --------
    >>> run_name("paper", parameters={"jobs": 2}), run_name("paper", parameters={"trials": 2})
    ('paper', 'custom')
    """
    return "custom" if _changes(seed, parameters) else profile


def _changes(seed: int | None, parameters: Mapping[str, Any] | None) -> list[str]:
    """Return the options by which a run departs from its profile."""
    named = [f"-p {name}" for name in parameters or {} if name not in provenance.NEUTRAL]
    return named if seed is None else [*named, "--seed"]


def prepare(
    notebooks: Sequence[Path],
    *,
    profile: str,
    jobs: int | None = None,
    seed: int | None = None,
    parameters: Mapping[str, Any] | None = None,
) -> list[Run]:
    """Read notebooks and check everything that can be checked before one runs.

    Raises
    ------
    NotebookError
        If a notebook cannot be run, or a parameter is unknown or of the wrong type.
    """
    if parameters and "out" in parameters:
        raise NotebookError("'out' is the folder that the outputs are published from; use --out")
    runs = []
    for notebook in map(read_notebook, notebooks):
        values = {**notebook.profiles.get(profile, {}), **(parameters or {})}
        if jobs is not None:
            values.setdefault("jobs", jobs)
        elif "jobs" in notebook.literals:
            values.setdefault("jobs", joblib.cpu_count())
        if seed is not None:
            values["seed"] = seed
        notebook.check(values)
        runs.append(Run(notebook, values, provenance.inputs_of(notebook, values)))
    _check_apart([run.notebook for run in runs])
    return runs


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
    changes = _changes(seed, parameters)
    if profile != "paper":
        changes.insert(0, f"--profile {profile}")
    if changes and out.resolve().is_relative_to((paths.PROJECT / "figures").resolve()):
        raise NotebookError(
            f"{out} holds the results of the profile 'paper', unchanged; choose another folder "
            f"for a run with {', '.join(changes)}"
        )
    runs = prepare(notebooks, profile=profile, jobs=jobs, seed=seed, parameters=parameters)
    folder = executed or executed_folder(out, run_name(profile, seed=seed, parameters=parameters))
    for run in runs:
        for target in (out / name for name in run.notebook.published):
            if target.is_dir():
                refuse(
                    target,
                    f"is a folder, but {run.notebook.name} writes a file of that name",
                )
    with ExitStack() as locks:
        for needed in dict.fromkeys((out, folder)):
            try:
                needed.mkdir(parents=True, exist_ok=True)
                locks.enter_context(_exclusive(needed, echo))
            except OSError as error:
                said = (error.strerror or str(error)).lower()
                refuse(needed, f"cannot be used as a folder: {said}")
        waiting = []
        for run in runs:
            name, state = run.notebook.name, state_of(run, out, folder)
            if state.kind == FRESH and not force:
                echo(f"{name}: fresh, nothing to do")
            elif state.kind == PROSE and not force:
                refresh_text(run, out, folder)
                echo(f"{name}: fresh; its text is brought up to date, nothing is executed")
            else:
                waiting.append(run)
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
        from replication.claims import claims

        claims()
    if "replication/specifications.toml" in named:
        from replication.specifications import check_declared

        check_declared()


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
    from replication.execution import execute  # loads papermill, which takes a second
    from replication.progress import Display

    commit, clean = _commit()
    machine = f"{platform.system()} {platform.machine()}, {joblib.cpu_count()} cores"
    where: dict[str, Any] = {"commit": commit, "clean": clean, "machine": machine}
    published: list[Path] = []
    with (
        Display(len(runs), bars=bars) as display,
        tempfile.TemporaryDirectory(prefix="replicate-") as scratch,
    ):
        for run in runs:
            notebook, values = run.notebook, dict(run.values)
            shown = ", ".join(f"{name} = {json.dumps(value)}" for name, value in values.items())
            echo(f"{notebook.name}: running, {shown}" if shown else f"{notebook.name}: running")
            if "store" in notebook.literals:
                store = _store(values.get("store", notebook.literals["store"]), out)
                values["store"] = str(Path(scratch) / "trials.sqlite" if force else store)
            display.begin(notebook.name)
            _remember(folder, notebook.name, None)
            began = time.monotonic()
            stage = Path(scratch) / notebook.name
            stage.mkdir()
            stamps = _copy_merged(notebook, out, stage)
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
            published += _publish(notebook, stage, out, folder)
            provenance.record(out, notebook, run.inputs)
            shutil.rmtree(stage)
            seconds = time.monotonic() - began
            circumstances = {"seconds": round(seconds, 1), "finished": _now()}
            _remember(folder, notebook.name, where | circumstances)
            display.end()
            echo(f"{notebook.name}: {_number(notebook)} in {seconds:.1f} s")
    return list(dict.fromkeys(published))


def executed_folder(out: Path, name: str) -> Path:
    """Return where executed notebooks go: below `build`, or beside outputs outside the project."""
    if out.resolve().is_relative_to(paths.PROJECT):
        return paths.PROJECT / "build" / "executed" / name
    return out / "executed"


def _store(store: str, out: Path) -> Path:
    """Return the store's file: in `out` where the project cannot be written."""
    path = paths.resolve(store)
    folder = path.parent
    while not folder.exists():
        folder = folder.parent
    return path if os.access(folder, os.W_OK) else out.resolve() / path.name


# --- what is up to date ----------------------------------------------------------------------


def state_of(run: Run, out: Path, folder: Path) -> State:
    """Return whether a notebook's outputs in `out`, executed in `folder`, are up to date."""
    name = run.notebook.name
    entry = provenance.read_manifest(out).get(name)
    if entry is None:
        own = set(run.notebook.outputs) - set(run.notebook.merged)
        some = any((out / output).exists() for output in own)
        unknown = ("there is no record of how they were made",)
        return State(STALE, unknown) if some else State(MISSING)
    lost = provenance.damaged(out, entry)
    if len(lost) == len(entry["outputs"]) and set(lost.values()) == {"missing"}:
        return State(MISSING)
    why = provenance.changes(entry["inputs"], run.inputs)
    why += [f"{output} is {how}" for output, how in lost.items()]
    if run.notebook.executed not in entry["outputs"]:
        why.append("its executed notebook was not published")
    if why:
        return State(STALE, tuple(why))
    if (folder / run.notebook.executed).exists() and name not in read_runs(folder):
        return State(STALE, ("its last run did not finish",))
    return State(FRESH if shows(out / run.notebook.executed, run.notebook) else PROSE)


def read_runs(folder: Path) -> dict[str, Any]:
    """Return what is remembered of the last run of each notebook, by name."""
    try:
        return dict(json.loads((folder / RUNS).read_text(encoding="utf-8")))
    except (OSError, ValueError, TypeError):
        return {}


def _remember(folder: Path, name: str, entry: Mapping[str, Any] | None) -> None:
    """Write down a notebook's last run, or that there is none."""
    runs = {key: value for key, value in read_runs(folder).items() if key != name}
    if entry is not None:
        runs[name] = entry
    write_file(folder / RUNS, json.dumps(runs, indent=1, sort_keys=True) + "\n")


def _now() -> str:
    return datetime.datetime.now(datetime.UTC).isoformat(timespec="seconds")


def refresh_text(run: Run, out: Path, folder: Path) -> None:
    """Bring the text of the executed notebook up to date, the published one and the full one."""
    name = run.notebook.executed
    for executed in (path for path in (folder / name, out / name) if path.exists()):
        render(run.notebook, executed)
    provenance.rehash(out, run.notebook.name, name)


def _commit() -> tuple[str, bool]:
    """Return the project's commit, and whether nothing was changed since; empty without git."""
    try:
        said = [
            subprocess.run(
                ["git", *words],
                cwd=paths.PROJECT,
                capture_output=True,
                text=True,
                check=True,
            ).stdout.strip()
            for words in (("rev-parse", "HEAD"), ("status", "--porcelain"))
        ]
    except (OSError, subprocess.CalledProcessError):
        return "", False
    return said[0], not said[1]


@contextmanager
def _exclusive(folder: Path, echo: Callable[[str], object]) -> Iterator[None]:
    """Keep other runs out of a folder; wait for one that is there."""
    with (folder / LOCK).open("w") as file:
        try:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            echo(f"another run writes to {folder}: waiting until it ends")
            fcntl.flock(file, fcntl.LOCK_EX)
        yield


# --- what a run leaves -----------------------------------------------------------------------


def _number(notebook: Notebook) -> str:
    """Say what a notebook wrote; what it shares with others is named, not counted."""
    own = len(notebook.outputs) - len(notebook.merged)
    number = "1 output" if own == 1 else f"{own} outputs"
    return " and rows of ".join((number, *notebook.merged))


def _check_apart(notebooks: Sequence[Notebook]) -> None:
    """Refuse notebooks that would overwrite each other's files."""
    owners: dict[str, Notebook] = {}
    for notebook in notebooks:
        own = set(notebook.published) - set(notebook.merged)
        for name in sorted(own):
            if name in owners:
                refuse(notebook.path, f"would overwrite {name} of {owners[name].path}")
            owners[name] = notebook
    for notebook in notebooks:
        for name in notebook.merged:
            if name in owners:
                refuse(
                    notebook.path,
                    f"merges {name}, which {owners[name].path} overwrites",
                )


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


def _publish(notebook: Notebook, stage: Path, out: Path, folder: Path) -> list[Path]:
    """Move all outputs to `out`: copies first, which may fail, then only renaming.

    The executed notebook in `folder` is among them, with links to the other ones.
    """
    drafts = {out / name: out / f".{name}.{os.getpid()}" for name in notebook.published}
    try:
        write_file(stage / notebook.executed, linked(folder / notebook.executed, stage))
        for target, draft in drafts.items():
            shutil.copyfile(stage / target.name, draft)
        for target, draft in drafts.items():
            draft.replace(target)
    except OSError as error:
        raise RunError(f"{notebook.path}: cannot publish to {out}: {error}") from error
    finally:
        for draft in drafts.values():
            draft.unlink(missing_ok=True)
    return list(drafts)
