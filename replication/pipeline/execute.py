"""Execute one notebook through papermill, in a process and a kernel of its own.

The kernel is always the interpreter that runs this, whatever kernels are installed, and it is free
of the user's start-up files. Whoever is interrupted kills the process and all that it has started.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
import time
from collections.abc import Mapping
from contextlib import suppress
from pathlib import Path
from typing import Any

import psutil

from replication.errors import UserError
from replication.files import scratch_folder, write_file
from replication.pipeline.notebook import Notebook, RunError, first_line, refuse
from replication.pipeline.rendering import as_text, clean, link_players, read_executed
from replication.progress import EVENTS, GIVEN, Display

KERNEL = "replication"

TICK = 0.05
"""Seconds between two looks at a notebook that is running."""


def execute(
    notebook: Notebook,
    values: Mapping[str, Any],
    stage: Path,
    *,
    folders: Mapping[Path, Path],
    failed: Path,
    timeout: int,
    display: Display,
    settings: Mapping[str, str] | None = None,
) -> str:
    """Execute a notebook, which writes into `stage`; return the executed one as it is published.

    Parameters
    ----------
    notebook, values
        What to run, and parameters that differ from its literals.
    stage
        Takes the place of the parameter `out`.
    folders
        Folders of this machine, and those that the executed notebook names instead.
    failed
        File for the notebook if it fails.
    timeout
        Seconds that one cell may take.
    display
        Shows the progress of trials.
    settings
        More environment variables, see :mod:`replication.progress`.

    Raises
    ------
    UserError
        If a cell refuses a choice, a map or demonstrations.
    RunError
        If a cell failed, took too long or killed its kernel.
    """
    with scratch_folder() as folder:
        scratch = folder.resolve()
        draft = scratch / f"{notebook.name}.ipynb"
        given = {**values, "out": str(stage)}
        options = {
            "parent": os.getpid(),
            "input_path": _literally(scratch / "source.ipynb"),
            "output_path": _literally(draft),
            "parameters": {k: given[k] for k in notebook.literals if k in given},
            "kernel_name": KERNEL,
            "language": "python",
            "execution_timeout": timeout,
        }
        write_file(scratch / "source.ipynb", as_text(notebook.load()))
        write_file(scratch / "options.json", json.dumps(options))
        _drive(scratch, {**_environment(scratch), **(settings or {})}, display)
        try:
            node = read_executed(draft, folders)
        except (OSError, ValueError):  # it was not begun, or cut off
            node = None
        try:
            _raise_faults(notebook, node, scratch, timeout)
        except (UserError, RunError):
            if node is not None:
                with suppress(OSError):  # on a full disk the failure itself counts
                    write_file(failed, as_text(clean(notebook, node)))
            raise
        return as_text(link_players(clean(notebook, node)))


def _environment(scratch: Path) -> dict[str, str]:
    """Return the environment of a run, in which the only kernel is this interpreter."""
    spec = {
        # its own warnings (that local sockets are not encrypted) do not concern the user
        "argv": [
            *(sys.executable, "-m", "ipykernel_launcher", "-f", "{connection_file}"),
            "--log-level=ERROR",
        ],
        "display_name": KERNEL,
        "language": "python",
    }
    write_file(scratch / "jupyter" / "kernels" / KERNEL / "kernel.json", json.dumps(spec))
    (scratch / "tmp").mkdir()
    path = (str(scratch / "jupyter"), os.environ.get("JUPYTER_PATH"))
    return {
        **os.environ,
        "JUPYTER_PATH": os.pathsep.join(filter(None, path)),
        "JUPYTER_RUNTIME_DIR": str(scratch / "runtime"),
        "IPYTHONDIR": str(scratch / "ipython"),
        "TMPDIR": str(scratch / "tmp"),  # what a killed kernel leaves goes with the folder
        "PYTHONSTARTUP": "",
        "PYTHONHASHSEED": "0",  # sets keep their order from run to run
        EVENTS: str(scratch / "events"),
        GIVEN: "",  # trials are given by who verifies, not by who happens to have it set
    }


def _drive(scratch: Path, environment: Mapping[str, str], display: Display) -> None:
    """Run the driver to its end; if this is interrupted, kill it and all that it has started."""
    command = [sys.executable, "-m", "replication.pipeline.driver", str(scratch)]
    with (scratch / "log").open("wb") as log:
        driver = subprocess.Popen(
            command,
            env=dict(environment),
            stdin=subprocess.DEVNULL,
            stdout=log,
            stderr=log,
            process_group=0,  # Ctrl-C on a terminal is for this process alone
        )
        try:
            while driver.poll() is None:
                display.poll(Path(environment[EVENTS]))
                time.sleep(TICK)
            display.poll(Path(environment[EVENTS]))
        finally:
            _kill(driver)
    if driver.returncode and not (scratch / "fault.json").exists():
        lines = (scratch / "log").read_text(encoding="utf-8", errors="replace").splitlines()
        killed = "it was killed, perhaps for want of memory"
        fault = {"cell": None, "kind": "driver", "message": (lines or [killed])[-1]}
        write_file(scratch / "fault.json", json.dumps(fault))


def _kill(driver: subprocess.Popen[bytes]) -> None:
    """Kill a process and its descendants; it is stopped first, so that it starts no more."""
    if driver.poll() is not None:
        return
    with suppress(psutil.NoSuchProcess):
        root = psutil.Process(driver.pid)
        root.suspend()
        while root.status() not in (psutil.STATUS_STOPPED, psutil.STATUS_ZOMBIE):
            time.sleep(0.001)
        family = [*root.children(recursive=True), root]
        for process in family:
            with suppress(psutil.NoSuchProcess):
                process.kill()
        psutil.wait_procs(family[:-1], timeout=10)
    driver.wait()


def _raise_faults(notebook: Notebook, node: Any, scratch: Path, timeout: int) -> None:
    """Raise what went wrong: what a cell raised stands in the executed notebook."""

    def place(at: int) -> str:
        # papermill puts its own cell behind the parameters cell
        return f"{notebook.path}: cell {at + 1 - (at > notebook.at)}"

    if (scratch / "fault.json").exists():
        fault = json.loads((scratch / "fault.json").read_text(encoding="utf-8"))
        words = first_line(fault["message"])
        if fault["kind"] == "driver":
            raise RunError(f"{notebook.path}: its process failed: {words}")
        if fault["cell"] is None:
            raise RunError(f"{notebook.path}: the kernel does not start: {words}")
        message = {
            "DeadKernelError": ": the kernel was killed, perhaps for want of memory; "
            "use fewer --jobs",
            "CellTimeoutError": f" took more than {timeout} seconds; allow more with --timeout",
        }.get(fault["kind"], f": {words}")
        raise RunError(f"{place(fault['cell'])}{message}")
    if node is None:
        raise RunError(f"{notebook.path}: the executed notebook cannot be read")
    for at, cell in enumerate(node.cells):
        if not cell.metadata.get("papermill", {}).get("exception"):
            continue
        errors = [output for output in cell.outputs if output.output_type == "error"]
        if not errors or errors[-1].ename == "SystemExit":
            raise RunError(f"{place(at)} ended the notebook before its last cell")
        error = errors[-1]
        if error.traceback == [f"error: {error.evalue}"]:  # see errors.UserError
            refuse(notebook.path, first_line(error.evalue))
        message = f"{error.ename}: {first_line(error.evalue)}"
        raise RunError(f"{place(at)} failed: {message}", "\n".join(error.traceback))


def _literally(path: Path) -> str:
    """Return a path for papermill, which would fill in what stands in braces."""
    return str(path).replace("{", "{{").replace("}", "}}")
