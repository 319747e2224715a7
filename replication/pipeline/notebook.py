"""What a notebook declares: its parameters, what a run writes, and its profiles.

A notebook has one cell tagged `parameters`, which holds literals only, and says in its metadata
what a run writes into the folder `out`, one of the parameters::

    {
        "replication": {
            "outputs": ["fig04.png"],
            "merged": ["trials.csv"],
            "inputs": ["replication/choices.toml"],
            "profiles": {"quick": {"trials": 6}, "paper": {"trials": 100}},
        }
    }

`inputs` are files of the project that the notebook reads without having them as parameters.
`merged` outputs hold rows of several notebooks: the published file is there when the notebook
starts, and the notebook replaces its own rows. A profile is a set of parameter values; under a
profile that it does not name, a notebook keeps the literals of its parameters cell.
"""

from __future__ import annotations

import ast
import json
import math
import re
import warnings
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NoReturn

from replication.errors import UserError, unknown

INJECTED = "injected-parameters"
"""The tag that papermill gives to its own cell."""


class NotebookError(UserError):
    """A notebook, or what it was asked for, that cannot be run; the message is one line."""


class RunError(RuntimeError):
    """A run that failed; the message is one line, `details` the failing cell's traceback."""

    def __init__(self, message: str, details: str = "") -> None:
        super().__init__(message)
        self.details = details


@dataclass(frozen=True)
class Cell:
    """The kind of a cell ("code", "markdown" or "raw"), its text and its tags."""

    kind: str
    source: str
    tags: tuple[str, ...]


@dataclass(frozen=True)
class Notebook:
    """A notebook that was read, and whose declarations were checked.

    Attributes
    ----------
    path, text
        Its file and what that holds.
    cells
        Its cells.
    at
        Index of the parameters cell.
    literals
        The parameters and their values, from the parameters cell.
    outputs, merged
        Files that a run writes; those of them that it shares with other notebooks.
    inputs
        Files that it reads, from the project's folder on.
    profiles
        Parameter values by the name of the profile.
    """

    path: Path
    text: str
    cells: tuple[Cell, ...]
    at: int
    literals: Mapping[str, Any]
    outputs: tuple[str, ...]
    merged: tuple[str, ...]
    inputs: tuple[str, ...]
    profiles: Mapping[str, Mapping[str, Any]]

    @property
    def name(self) -> str:
        """The file's name without its suffix."""
        return self.path.stem

    @property
    def executed(self) -> str:
        """Name of the executed notebook's file, wherever it is written."""
        return f"{self.name}.ipynb"

    @property
    def published(self) -> tuple[str, ...]:
        """All files that a run publishes: the outputs, and the executed notebook."""
        return (*self.outputs, self.executed)

    def load(self) -> Any:
        """Return the contents as nbformat has them.

        Raises
        ------
        NotebookError
            If nbformat finds them invalid.
        """
        import nbformat  # takes a second, which what is up to date need not wait for

        try:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")  # older formats have no cell ids
                node = nbformat.reads(self.text, as_version=4)
                nbformat.validate(node)
        except Exception as error:  # whatever the contents make the reader raise
            refuse(self.path, f"is not a valid notebook: {first_line(error)}")
        return node

    def is_shown_by(self, executed: Path) -> bool:
        """Return whether an executed notebook has the same text and code as this one."""
        _, cells = _parsed(executed.read_text(encoding="utf-8"))
        shown = [cell.source for cell in cells if INJECTED not in cell.tags]
        return shown == [cell.source for cell in self.cells]

    def check(self, values: Mapping[str, Any]) -> None:
        """Refuse values of parameters that the notebook does not have, or of another type.

        Raises
        ------
        NotebookError
            Naming the parameter and, when it is misspelt, the nearest one.
        """
        for name, value in values.items():
            if name not in self.literals:
                refuse(self.path, unknown(name, self.literals, "parameter"))
            literal = self.literals[name]
            if not _is_json(value) or not _same_type(value, literal):
                wanted = f"{_kind(literal)}, such as {json.dumps(literal)}"
                refuse(
                    self.path,
                    f"parameter {name!r} is {wanted}; {value!r} is {_kind(value)}",
                )


def read_notebook(path: Path) -> Notebook:
    """Read a notebook and check what it declares.

    Raises
    ------
    NotebookError
        If the file is no notebook, does not have exactly one cell tagged `parameters`, if that
        cell has a line other than `name = literal`, or if the declarations are not usable.
    """
    try:
        text = path.read_text(encoding="utf-8")
        metadata, cells = _parsed(text)
    except OSError as error:
        refuse(path, f"cannot be read: {(error.strerror or str(error)).lower()}")
    except Exception as error:  # whatever the contents make the reader raise
        refuse(path, f"is not a valid notebook: {first_line(error)}")

    tagged = [
        at for at, cell in enumerate(cells) if cell.kind == "code" and "parameters" in cell.tags
    ]
    if len(tagged) != 1:
        refuse(
            path,
            f"{len(tagged)} cells have the tag 'parameters'; exactly one must have it",
        )
    literals = _literals(path, cells[tagged[0]].source)
    if not isinstance(literals.get("out"), str):
        refuse(path, "the parameters cell must have out = 'FOLDER', where the outputs go")

    declared = metadata.get("replication")
    if not isinstance(declared, dict) or "outputs" not in declared:
        refuse(path, 'its metadata do not declare {"replication": {"outputs": [...]}}')
    for key in declared:
        known = ["outputs", "merged", "inputs", "profiles"]
        if key not in known:
            refuse(path, unknown(key, known, "declaration"))
    outputs = _file_names(path, "outputs", declared["outputs"])
    merged = _file_names(path, "merged", declared.get("merged", []))
    profiles = declared.get("profiles", {})
    if not isinstance(profiles, dict) or not all(isinstance(p, dict) for p in profiles.values()):
        refuse(path, "'profiles' must hold an object of parameter values for each profile")
    inputs = declared.get("inputs", [])
    if not isinstance(inputs, list) or not all(isinstance(name, str) for name in inputs):
        refuse(path, "'inputs' must be a list of files")
    every = tuple(dict.fromkeys((*outputs, *merged)))
    notebook = Notebook(
        path, text, cells, tagged[0], literals, every, merged, tuple(inputs), profiles
    )
    for profile, values in profiles.items():
        if "out" in values:
            refuse(path, f"profile {profile!r} sets 'out', which each run chooses")
        notebook.check(values)
    return notebook


def _parsed(text: str) -> tuple[dict[str, Any], tuple[Cell, ...]]:
    """Return the metadata and the cells of a notebook's file, which is plain JSON."""
    document = json.loads(text)
    if document["nbformat"] != 4:
        raise ValueError(f"its format is {document['nbformat']}, not 4")
    cells = [
        Cell(
            cell["cell_type"],
            "".join(cell["source"]),  # one text, or its lines
            tuple(cell["metadata"].get("tags", ())),
        )
        for cell in document["cells"]
    ]
    return dict(document["metadata"]), tuple(cells)


def _literals(path: Path, source: str) -> dict[str, Any]:
    try:
        statements = ast.parse(source).body
    except (SyntaxError, ValueError) as error:
        line = getattr(error, "lineno", 1)
        refuse(
            path,
            f"line {line} of the parameters cell is not Python: {first_line(error)}",
        )
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
            refuse(path, f"line {line} of the parameters cell, `{text}`: {mend}")
        if not _is_json(value):
            mend = "a parameter must be a JSON value: null, true, a number, text, a list, an object"
            refuse(path, f"line {line} of the parameters cell, `{text}`: {mend}")
        if name in literals:
            refuse(
                path,
                f"line {line} of the parameters cell, `{text}`: {name!r} is there twice",
            )
        literals[name] = value
    return literals


def _file_names(path: Path, key: str, names: Any) -> tuple[str, ...]:
    if not isinstance(names, list):
        refuse(path, f"{key!r} must be a list of file names")
    for name in names:
        if not isinstance(name, str) or not re.fullmatch(r"\w[\w.-]*", name):
            refuse(
                path,
                f"{key!r} holds {name!r}, which is not a plain file name without a folder",
            )
        if names.count(name) > 1:
            refuse(path, f"{key!r} holds {name!r} twice")
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
    kinds = {
        bool: "true or false",
        int: "a whole number",
        float: "a number",
        str: "text",
    }
    return (kinds | {list: "a list", dict: "an object"}).get(type(value), "no JSON value")


def first_line(error: object) -> str:
    """Return the first line of an error's message, or its name if it has none."""
    return (str(error).strip().splitlines() or [type(error).__name__])[0]


def refuse(path: Path, message: str) -> NoReturn:
    """Raise a :class:`NotebookError` about a file."""
    raise NotebookError(f"{path}: {message}")
