"""Execute notebooks through papermill and publish the files that they declare, or nothing.

A notebook says in its metadata what a run writes into the folder `out`, one of its parameters::

    {
        "replication": {
            "outputs": ["fig04.png"],
            "merged": ["trials.csv"],
            "profiles": {"quick": {"trials": 6}, "paper": {"trials": 100}},
        }
    }

`merged` outputs hold rows of several notebooks: the published file is there when the notebook
starts, and the notebook replaces its own rows. A profile is a set of parameter values; under a
profile that it does not name, a notebook keeps the literals of its parameters cell.
"""

from __future__ import annotations

import ast
import copy
import json
import logging
import math
import os
import re
import shutil
import sys
import tempfile
import time
import warnings
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NoReturn

import joblib
import nbformat
import papermill
from nbclient.exceptions import CellTimeoutError, DeadKernelError
from papermill.exceptions import PapermillExecutionError

from replication import paths
from replication.choices import unknown_name
from replication.files import write_file

TIMEOUT = 3600
"""Seconds that one cell may take unless told otherwise."""

STARTS = 3
"""Attempts at starting a kernel: now and then another program takes its port."""

KERNEL = "replication"

# What papermill logs of a failure is said again, and better, by the error that is raised.
logging.getLogger("papermill").addHandler(logging.NullHandler())


class NotebookError(ValueError):
    """A notebook, or what it was asked for, that cannot be run; the message is one line."""


class RunError(RuntimeError):
    """A run that failed; the message is one line, `details` the failing cell's traceback."""

    def __init__(self, message: str, details: str = "") -> None:
        super().__init__(message)
        self.details = details


# --- what a notebook declares ----------------------------------------------------------------


@dataclass(frozen=True)
class Notebook:
    """A notebook that was read and checked.

    Attributes
    ----------
    path, node
        Its file and contents.
    at
        Index of the parameters cell.
    literals
        The parameters and their values, from the parameters cell.
    outputs, merged
        Files that a run writes; those of them that it shares with other notebooks.
    profiles
        Parameter values by the name of the profile.
    """

    path: Path
    node: Any
    at: int
    literals: Mapping[str, Any]
    outputs: tuple[str, ...]
    merged: tuple[str, ...]
    profiles: Mapping[str, Mapping[str, Any]]

    @property
    def name(self) -> str:
        """The file's name without its suffix."""
        return self.path.stem

    def check(self, values: Mapping[str, Any]) -> None:
        """Refuse values of parameters that the notebook does not have, or of another type.

        Raises
        ------
        NotebookError
            Naming the parameter and, when it is misspelt, the nearest one.
        """
        for name, value in values.items():
            if name not in self.literals:
                _fail(self.path, str(unknown_name(name, list(self.literals), "parameter")))
            literal = self.literals[name]
            if not _is_json(value) or not _same_type(value, literal):
                wanted = f"{_kind(literal)}, such as {json.dumps(literal)}"
                _fail(self.path, f"parameter {name!r} is {wanted}; {value!r} is {_kind(value)}")


def read_notebook(path: Path) -> Notebook:
    """Read a notebook and check what it declares.

    Raises
    ------
    NotebookError
        If the file is no valid notebook, does not have exactly one cell tagged `parameters`, if
        that cell has a line other than `name = literal`, or if the declarations are not usable.
    """
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # older formats have no cell ids
            node = nbformat.read(path, as_version=4)
            nbformat.validate(node)
    except OSError as error:
        _fail(path, f"cannot be read: {(error.strerror or str(error)).lower()}")
    except Exception as error:  # whatever the contents make the reader raise
        _fail(path, f"is not a valid notebook: {_first_line(error)}")

    tagged = [
        at
        for at, cell in enumerate(node.cells)
        if cell.cell_type == "code" and "parameters" in cell.metadata.get("tags", [])
    ]
    if len(tagged) != 1:
        _fail(path, f"{len(tagged)} cells have the tag 'parameters'; exactly one must have it")
    literals = _literals(path, node.cells[tagged[0]].source)
    if not isinstance(literals.get("out"), str):
        _fail(path, "the parameters cell must have out = 'FOLDER', where the outputs go")

    declared = node.metadata.get("replication")
    if not isinstance(declared, dict) or "outputs" not in declared:
        _fail(path, 'its metadata do not declare {"replication": {"outputs": [...]}}')
    for key in declared:
        if key not in ("outputs", "merged", "profiles"):
            known = ["outputs", "merged", "profiles"]
            _fail(path, str(unknown_name(key, known, "declaration")))
    outputs = _file_names(path, "outputs", declared["outputs"])
    merged = _file_names(path, "merged", declared.get("merged", []))
    profiles = declared.get("profiles", {})
    if not isinstance(profiles, dict) or not all(isinstance(p, dict) for p in profiles.values()):
        _fail(path, "'profiles' must hold an object of parameter values for each profile")
    every = tuple(dict.fromkeys((*outputs, *merged)))
    notebook = Notebook(path, node, tagged[0], literals, every, merged, profiles)
    for profile, values in profiles.items():
        if "out" in values:
            _fail(path, f"profile {profile!r} sets 'out', which each run chooses")
        notebook.check(values)
    return notebook


def _literals(path: Path, source: str) -> dict[str, Any]:
    try:
        statements = ast.parse(source).body
    except (SyntaxError, ValueError) as error:
        line = getattr(error, "lineno", 1)
        _fail(path, f"line {line} of the parameters cell is not Python: {_first_line(error)}")
    literals: dict[str, Any] = {}
    for statement in statements:
        line = statement.lineno
        text = source.splitlines()[line - 1].strip()
        name, value = "", None
        try:
            if isinstance(statement, ast.Assign) and isinstance(statement.targets[0], ast.Name):
                name, value = statement.targets[0].id, ast.literal_eval(statement.value)
        except (TypeError, ValueError, RecursionError, MemoryError):
            name = ""
        if not name or len(statement.targets) > 1:  # type: ignore[attr-defined]
            mend = "only `name = literal` may stand there; move it to the next cell"
            _fail(path, f"line {line} of the parameters cell, `{text}`: {mend}")
        if not _is_json(value):
            mend = "a parameter must be a JSON value: null, true, a number, text, a list, an object"
            _fail(path, f"line {line} of the parameters cell, `{text}`: {mend}")
        if name in literals:
            _fail(path, f"line {line} of the parameters cell, `{text}`: {name!r} is there twice")
        literals[name] = value
    return literals


def _file_names(path: Path, key: str, names: Any) -> tuple[str, ...]:
    if not isinstance(names, list):
        _fail(path, f"{key!r} must be a list of file names")
    for name in names:
        if not isinstance(name, str) or not re.fullmatch(r"\w[\w.-]*", name):
            _fail(path, f"{key!r} holds {name!r}, which is not a plain file name without a folder")
        if names.count(name) > 1:
            _fail(path, f"{key!r} holds {name!r} twice")
    return tuple(names)


def _is_json(value: Any) -> bool:
    if isinstance(value, list):
        return all(map(_is_json, value))
    if isinstance(value, dict):
        return all(type(key) is str for key in value) and all(map(_is_json, value.values()))
    if type(value) is float:
        return math.isfinite(value)
    return value is None or type(value) in (bool, int, str)


def _same_type(value: Any, literal: Any) -> bool:
    if literal is None:
        return True
    return type(value) is type(literal) or (type(literal) is float and type(value) is int)


def _kind(value: Any) -> str:
    if value is None:
        return "null"
    kinds = {bool: "true or false", int: "a whole number", float: "a number", str: "text"}
    return (kinds | {list: "a list", dict: "an object"}).get(type(value), "no JSON value")


# --- running ---------------------------------------------------------------------------------


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
        Folder for the outputs; made when missing.
    jobs
        Worker processes, for the parameter `jobs`; None gives those notebooks that have the
        parameter as many as there are usable cores.
    seed
        For the parameter `seed`; None keeps each notebook's own.
    parameters
        Other parameter values, which every notebook must know.
    executed
        Folder for the executed notebooks, of failed runs too; `build/executed` by default. They
        go to its sub-folder named after the profile.
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
        If a notebook cannot be run or a parameter is unknown or of the wrong type; nothing ran.
    RunError
        If a cell failed, took too long or killed its kernel, or if the files in `out` are not the
        declared ones.
    """
    if profile != "paper" and out.resolve() == paths.PROJECT / "figures":
        raise NotebookError(
            f"{out} holds the results of the profile 'paper'; choose another folder for {profile!r}"
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
                _fail(target, f"is a folder, but {notebook.name} writes a file of that name")
        runs.append((notebook, values))
    _check_apart([notebook for notebook, _ in runs])

    folder = (executed or paths.PROJECT / "build" / "executed") / profile
    for needed in (out, folder):
        try:
            needed.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            _fail(needed, f"cannot be used as a folder: {(error.strerror or str(error)).lower()}")

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
        number = "1 output" if len(notebook.outputs) == 1 else f"{len(notebook.outputs)} outputs"
        echo(f"{notebook.name}: {number} in {seconds:.1f} s")
    return published


def _check_apart(notebooks: Sequence[Notebook]) -> None:
    """Refuse notebooks that would overwrite each other's files."""
    owners: dict[str, Notebook] = {}
    for notebook in notebooks:
        own = {f"{notebook.name}.ipynb", *notebook.outputs} - set(notebook.merged)
        for name in sorted(own):
            if name in owners:
                _fail(notebook.path, f"would overwrite {name} of {owners[name].path}")
            owners[name] = notebook
    for notebook in notebooks:
        for name in notebook.merged:
            if name in owners:
                _fail(notebook.path, f"merges {name}, which {owners[name].path} overwrites")


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
            said = f"{error.ename}: {_first_line(error.evalue)}"
            details = "\n".join(error.traceback)
            raise RunError(f"{place(error.cell_index)} failed: {said}", details) from None
        except Exception as error:
            if not begun:
                if attempt < STARTS:
                    continue
                said = f"the kernel does not start: {_first_line(error)}"
                raise RunError(f"{notebook.path}: {said}") from error
            if isinstance(error, DeadKernelError):
                why = "the kernel was killed, perhaps for want of memory; use fewer --jobs"
                raise RunError(f"{place(begun[-1])}: {why}") from None
            if isinstance(error, CellTimeoutError):
                why = f"took more than {timeout} seconds; allow more with --timeout"
                raise RunError(f"{place(begun[-1])} {why}") from None
            raise RunError(f"{place(begun[-1])}: {_first_line(error)}") from error
        if node.cells[begun[-1]].metadata.papermill.exception:  # SystemExit, no error to papermill
            raise RunError(f"{place(begun[-1])} ended the notebook before its last cell")
        return


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


def _first_line(error: object) -> str:
    return (str(error).strip().splitlines() or [type(error).__name__])[0]


def _fail(path: Path, message: str) -> NoReturn:
    raise NotebookError(f"{path}: {message}")
