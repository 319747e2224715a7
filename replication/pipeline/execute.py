"""Execute one notebook through papermill, in a kernel of our own.

The kernel is always the interpreter that runs this, whatever kernels are installed; it is free of
the user's start-up files. The executed notebook has no times, no paths of this machine and the same
cell ids in every run.
"""

from __future__ import annotations

import json
import logging
import os
import shlex
import sys
import tempfile
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

import nbformat
import papermill
from nbclient.exceptions import CellTimeoutError, DeadKernelError
from nbformat.reader import NotJSONError
from papermill.exceptions import PapermillExecutionError

from replication import files
from replication.files import write_file
from replication.pipeline.engine import ENGINE
from replication.pipeline.notebook import Notebook, RunError, first_line, refuse
from replication.pipeline.provenance import NEUTRAL
from replication.pipeline.rendering import drop_empty_tags
from replication.progress import EVENTS, Display

STARTS = 3
"""Attempts at starting a kernel: now and then another program takes its port."""

KERNEL = "replication"

MISTAKES = frozenset({"ChoiceError", "ClaimError", "DemoError", "MazeError"})
"""What a cell raises when the user's parameters or files are at fault, not the notebook."""

# What papermill logs of a failure is said again, and better, by the error that is raised.
logging.getLogger("papermill").addHandler(logging.NullHandler())


def execute(
    notebook: Notebook,
    values: Mapping[str, Any],
    stage: Path,
    *,
    target: Path,
    executed: Path,
    timeout: int,
    display: Display,
    scheduler: str = "",
) -> None:
    """Execute a notebook; what it writes goes into the folder `stage`.

    Parameters
    ----------
    notebook, values
        What to run, and parameters that differ from its literals.
    stage
        Takes the place of the parameter `out`.
    target
        Where the outputs will be published; the executed notebook names it instead of the stage.
    executed
        The executed notebook's file, which is written after a failure, too.
    timeout
        Seconds that one cell may take.
    display
        Shows the progress of trials.
    scheduler
        Address of a Dask scheduler that trials are sent to; none if it is empty.

    Raises
    ------
    NotebookError
        If a cell refuses a choice, a map or demonstrations.
    RunError
        If a cell failed, took too long or killed its kernel.
    """
    # A kernel that is being killed may still write there.
    with tempfile.TemporaryDirectory(prefix="replicate-", ignore_cleanup_errors=True) as scratch:
        draft, events = (
            Path(scratch) / f"{notebook.name}.ipynb",
            Path(scratch) / "events",
        )
        environment = {EVENTS: str(events)}
        if scheduler:  # otherwise that of the user's own environment, if any
            environment["REPLICATION_SCHEDULER"] = scheduler
        try:
            with display.listen(events), _private_kernel(Path(scratch), environment):
                given = {**values, "out": str(stage)}
                ordered = {name: given[name] for name in notebook.literals if name in given}
                _execute(notebook, ordered, draft, timeout)
        except BaseException:
            # The disk may be full: then the failure itself counts, not that it cannot be shown.
            with suppress(OSError, NotJSONError):
                write_file(executed, _clean(notebook, draft, stage, target))
            raise
        try:
            write_file(executed, _clean(notebook, draft, stage, target))
        except OSError as error:
            raise RunError(f"{executed}: cannot be written: {first_line(error)}") from error


@contextmanager
def _private_kernel(scratch: Path, environment: Mapping[str, str]) -> Iterator[None]:
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
            **environment,
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


def _execute(notebook: Notebook, values: Mapping[str, Any], draft: Path, timeout: int) -> None:
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
                notebook.load(),
                str(draft).replace("{", "{{").replace("}", "}}"),  # papermill fills these in
                parameters=dict(values),
                engine_name=ENGINE,
                kernel_name=KERNEL,
                language="python",
                progress_bar=False,
                execution_timeout=timeout,
                iopub_timeout=60,
                shutdown_kernel="immediate",
                record_timing=False,
                coalesce_streams=True,  # where a stream is cut depends on the time
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


def _clean(notebook: Notebook, draft: Path, stage: Path, target: Path) -> str:
    """Return the executed notebook without what differs between equal runs."""
    node = nbformat.read(draft, as_version=4)
    node.metadata.pop("papermill", None)
    node.metadata.get("language_info", {}).pop(
        "version", None
    )  # the manifest tells it, in two parts
    known = {cell.get("id") for cell in notebook.load().cells}
    added = 0
    for cell in node.cells:
        cell.metadata.pop("papermill", None)
        drop_empty_tags(cell)
        if cell.id not in known:
            added += 1
            cell.id = f"papermill-{added}"
            cell.source = "\n".join(_declared(notebook, line) for line in cell.source.split("\n"))
    inside = target.resolve().is_relative_to(files.PROJECT)
    shown = target.resolve().relative_to(files.PROJECT).as_posix() if inside else target.name
    text = str(nbformat.writes(node))
    return text.replace(json.dumps(str(stage))[1:-1], json.dumps(shown)[1:-1]) + "\n"


def _declared(notebook: Notebook, line: str) -> str:
    """Return a line of the injected parameters; one that changes no result as it is declared."""
    name = line.partition(" = ")[0]
    return f"{name} = {notebook.literals[name]!r}" if name in NEUTRAL - {"out"} else line
