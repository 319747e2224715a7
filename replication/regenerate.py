"""Execute notebooks through papermill and publish the files that they declare, or nothing."""

from __future__ import annotations

import copy
import json
import logging
import os
import re
import shlex
import shutil
import sys
import tempfile
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import joblib
import nbformat
import papermill
from nbclient.exceptions import CellTimeoutError, DeadKernelError
from papermill.exceptions import PapermillExecutionError

from replication import paths
from replication.files import write_file
from replication.notebooks import Notebook, NotebookError, first_line, read_notebook, refuse

TIMEOUT = 3600
"""Seconds that one cell may take unless told otherwise."""

STARTS = 3
"""Attempts at starting a kernel: now and then another program takes its port."""

KERNEL = "replication"

NEUTRAL = frozenset({"jobs", "store"})
"""Parameters that leave every result as it is."""

MISTAKES = frozenset({"ChoiceError", "DemoError", "MazeError"})
"""What a cell raises when the user's parameters or files are at fault, not the notebook."""

# What papermill logs of a failure is said again, and better, by the error that is raised.
logging.getLogger("papermill").addHandler(logging.NullHandler())


class RunError(RuntimeError):
    """A run that failed; the message is one line, `details` the failing cell's traceback."""

    def __init__(self, message: str, details: str = "") -> None:
        super().__init__(message)
        self.details = details


# --- running ---------------------------------------------------------------------------------


def run_name(
    profile: str, *, seed: int | None = None, parameters: Mapping[str, Any] | None = None
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
    named = [f"-p {name}" for name in parameters or {} if name not in NEUTRAL]
    return named if seed is None else [*named, "--seed"]


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
    progress: bool | None = None,
    echo: Callable[[str], object] = print,
) -> list[Path]:
    """Run notebooks one after another and publish their outputs.

    Everything is checked before the first one runs. The outputs of a notebook are published
    together, after it has run to its end and has written what it declares and nothing else; when
    it fails, earlier outputs stay as they were and the remaining notebooks do not run.

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
        Folder for the executed notebooks, of failed runs too; `build/executed` by default. They
        go to its sub-folder named by :func:`run_name`.
    timeout
        Seconds that one cell may take.
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
    RunError
        If a cell failed, took too long or killed its kernel, or if the files in `out` are not the
        declared ones.
    """
    changes = _changes(seed, parameters)
    if profile != "paper":
        changes.insert(0, f"--profile {profile}")
    if changes and out.resolve().is_relative_to((paths.PROJECT / "figures").resolve()):
        raise NotebookError(
            f"{out} holds the results of the profile 'paper', unchanged; choose another folder "
            f"for a run with {', '.join(changes)}"
        )
    runs = []
    for notebook in map(read_notebook, notebooks):
        values = {**notebook.profiles.get(profile, {}), **(parameters or {})}
        if parameters and "out" in parameters:
            raise NotebookError(
                "'out' is the folder that the outputs are published from; use --out"
            )
        if jobs is not None:
            values.setdefault("jobs", jobs)
        elif "jobs" in notebook.literals:
            values.setdefault("jobs", joblib.cpu_count())
        if seed is not None:
            values["seed"] = seed
        notebook.check(values)
        for target in (out / name for name in notebook.outputs):
            if target.is_dir():
                refuse(target, f"is a folder, but {notebook.name} writes a file of that name")
        runs.append((notebook, values))
    _check_apart([notebook for notebook, _ in runs])

    name = run_name(profile, seed=seed, parameters=parameters)
    folder = (executed or paths.PROJECT / "build" / "executed") / name
    for needed in (out, folder):
        try:
            needed.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            refuse(needed, f"cannot be used as a folder: {(error.strerror or str(error)).lower()}")

    drawn = sys.stderr.isatty() if progress is None else progress
    published: list[Path] = []
    for notebook, values in runs:
        shown = ", ".join(f"{name} = {json.dumps(value)}" for name, value in values.items())
        echo(f"{notebook.name}: running, {shown}" if shown else f"{notebook.name}: running")
        began = time.perf_counter()
        with tempfile.TemporaryDirectory(prefix="replicate-") as scratch:
            stage = Path(scratch) / "out"
            stage.mkdir()
            stamps = _copy_merged(notebook, out, stage)
            draft = Path(scratch) / f"{notebook.name}.ipynb"
            try:
                with _private_kernel(Path(scratch), progress=drawn):
                    _execute(notebook, {**values, "out": str(stage)}, draft, timeout, drawn)
            finally:
                if draft.exists():
                    text = _clean(notebook, draft, stage, out)
                    write_file(folder / f"{notebook.name}.ipynb", text)
            _check_outputs(notebook, stage, stamps)
            published += _publish(notebook, stage, out)
        seconds = time.perf_counter() - began
        echo(f"{notebook.name}: {_number(notebook)} in {seconds:.1f} s")
    return list(dict.fromkeys(published))


def _number(notebook: Notebook) -> str:
    """Say what a notebook wrote; what it shares with others is named, not counted."""
    own = len(notebook.outputs) - len(notebook.merged)
    number = "1 output" if own == 1 else f"{own} outputs"
    return " and rows of ".join((number, *notebook.merged))


def _check_apart(notebooks: Sequence[Notebook]) -> None:
    """Refuse notebooks that would overwrite each other's files."""
    owners: dict[str, Notebook] = {}
    for notebook in notebooks:
        own = {f"{notebook.name}.ipynb", *notebook.outputs} - set(notebook.merged)
        for name in sorted(own):
            if name in owners:
                refuse(notebook.path, f"would overwrite {name} of {owners[name].path}")
            owners[name] = notebook
    for notebook in notebooks:
        for name in notebook.merged:
            if name in owners:
                refuse(notebook.path, f"merges {name}, which {owners[name].path} overwrites")


@contextmanager
def _private_kernel(scratch: Path, *, progress: bool) -> Iterator[None]:
    """Make the running interpreter the kernel, free of the user's own start-up files."""
    spec = {
        # its own warnings (that local sockets are not encrypted) are no concern of the user
        "argv": [
            *(sys.executable, "-m", "ipykernel_launcher", "-f", "{connection_file}"),
            "--log-level=ERROR",
        ],
        "display_name": KERNEL,
        "language": "python",
        "env": {
            "IPYTHONDIR": str(scratch / "ipython"),
            "PYTHONSTARTUP": "",
            "PYTHONHASHSEED": "0",  # sets keep their order from run to run
            "REPLICATION_PROGRESS": str(int(progress)),
        },
    }
    write_file(scratch / "jupyter" / "kernels" / KERNEL / "kernel.json", json.dumps(spec))
    changed = {
        "JUPYTER_PATH": os.pathsep.join(
            filter(None, (str(scratch / "jupyter"), os.environ.get("JUPYTER_PATH")))
        ),
        "JUPYTER_RUNTIME_DIR": str(scratch / "runtime"),
    }
    before = {name: os.environ.get(name) for name in changed}
    os.environ.update(changed)
    try:
        yield
    finally:
        for name, value in before.items():
            if value is None:
                del os.environ[name]
            else:
                os.environ[name] = value


def _execute(
    notebook: Notebook, values: Mapping[str, Any], draft: Path, timeout: int, progress: bool
) -> None:
    """Execute into the file `draft`, which is there after a failure too."""
    begun: list[int] = []

    def begin(cell: Any, cell_index: int) -> None:
        begun.append(cell_index)

    def place(at: int) -> str:
        # papermill puts its own cell behind the parameters cell
        return f"{notebook.path}: cell {at + 1 - (at > notebook.at)}"

    for attempt in range(1, STARTS + 1):
        try:
            node = papermill.execute_notebook(
                copy.deepcopy(notebook.node),
                str(draft),
                parameters=dict(values),
                kernel_name=KERNEL,
                language="python",
                progress_bar=False,
                stderr_file=sys.stderr if progress else None,
                execution_timeout=timeout,
                iopub_timeout=60,
                shutdown_kernel="immediate",
                record_timing=False,
                on_cell_execute=begin,
            )
        except PapermillExecutionError as error:
            said = first_line(error.evalue)
            if error.ename in MISTAKES:
                refuse(notebook.path, said + _example(notebook, values, said))
            said = f"{error.ename}: {said}"
            details = "\n".join(error.traceback)
            raise RunError(f"{place(error.cell_index)} failed: {said}", details) from None
        except Exception as error:
            if not begun:
                if attempt < STARTS:
                    continue
                said = f"the kernel does not start: {first_line(error)}"
                raise RunError(f"{notebook.path}: {said}") from error
            if isinstance(error, DeadKernelError):
                why = "the kernel was killed, perhaps for want of memory; use fewer --jobs"
                raise RunError(f"{place(begun[-1])}: {why}") from None
            if isinstance(error, CellTimeoutError):
                why = f"took more than {timeout} seconds; allow more with --timeout"
                raise RunError(f"{place(begun[-1])} {why}") from None
            raise RunError(f"{place(begun[-1])}: {first_line(error)}") from error
        if node.cells[begun[-1]].metadata.papermill.exception:  # SystemExit, no error to papermill
            raise RunError(f"{place(begun[-1])} ended the notebook before its last cell")
        return


def _example(notebook: Notebook, values: Mapping[str, Any], said: str) -> str:
    """Show how to take the kinds that a file has, if it lacks one that was asked for."""
    if "has no incorrect demo of kind" not in said or "choices" not in notebook.literals:
        return ""
    choices = {**values.get("choices", {}), "incorrect": "all"}
    return f", such as -p choices {shlex.quote(json.dumps(choices))}"


# --- what a run leaves -----------------------------------------------------------------------


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


def _publish(notebook: Notebook, stage: Path, out: Path) -> list[Path]:
    """Move all outputs to `out`: copies first, which may fail, then only renaming."""
    drafts = {out / name: out / f".{name}.{os.getpid()}" for name in notebook.outputs}
    try:
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


def _clean(notebook: Notebook, draft: Path, stage: Path, out: Path) -> str:
    """Return the executed notebook without what differs between equal runs."""
    node = nbformat.read(draft, as_version=4)
    node.metadata.pop("papermill", None)
    known = {cell.get("id") for cell in notebook.node.cells}
    for at, cell in enumerate(node.cells):
        cell.metadata.pop("papermill", None)
        if cell.id not in known:
            cell.id = f"papermill-{at}"
        if cell.cell_type == "code":
            cell.outputs = _without_bars(cell.outputs)
    text = str(nbformat.writes(node))
    return text.replace(json.dumps(str(stage))[1:-1], json.dumps(str(out))[1:-1]) + "\n"


def _without_bars(outputs: Sequence[Any]) -> list[Any]:
    """Join what was written to stderr in pieces, and keep what a terminal would show of it."""
    kept: list[Any] = []
    for output in outputs:
        stderr = output.output_type == "stream" and output.name == "stderr"
        if stderr and kept and kept[-1].get("name") == "stderr":
            kept[-1].text += output.text
        else:
            kept.append(output)
    for output in kept:
        if output.get("name") == "stderr":
            lines = [line.rpartition("\r")[2] for line in output.text.split("\n")]
            output.text = "\n".join(line for line in lines if not re.search(r"\d+%\|.*\|", line))
    return [output for output in kept if output.get("name") != "stderr" or output.text.strip()]
