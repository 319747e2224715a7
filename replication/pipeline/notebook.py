"""Notebooks as files: one cell tagged `parameters`, code and text, and what they declare.

The parameters cell holds literals only, each perhaps with its type; `out`, the folder that the
notebook writes to, is one of them.
"""

from __future__ import annotations

import ast
import json
import warnings
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple, NoReturn

from pydantic import ValidationError

from replication.errors import UserError, unknown
from replication.files import FileError, parse_json, read_text
from replication.pipeline.declaration import EXECUTED, Declaration

INJECTED = "injected-parameters"
"""The tag that papermill gives to its own cell."""

KINDS: dict[type, str] = {
    type(None): "null",
    bool: "true or false",
    int: "a whole number",
    float: "a number",
    str: "text",
    list: "a list",
    dict: "an object",
}


class NotebookError(UserError):
    """A notebook, or what it was asked for, that cannot be run; the message is one line."""


class RunError(RuntimeError):
    """A run that failed; the message is one line, `details` the failing cell's traceback."""

    def __init__(self, message: str, details: str = "") -> None:
        super().__init__(message)
        self.details = details


class Cell(NamedTuple):
    """The kind of a cell ("code", "markdown" or "raw"), its text and its tags."""

    kind: str
    source: str
    tags: tuple[str, ...]


@dataclass(frozen=True)
class Notebook:
    """A notebook's file, its text and cells, and what it declares; all of it was checked.

    `at` is the index of the parameters cell, and `literals` are the values in it.
    """

    path: Path
    text: str
    cells: tuple[Cell, ...]
    at: int
    literals: Mapping[str, Any]
    declared: Declaration

    @property
    def name(self) -> str:
        """The file's name without its suffix: also that of the folder of its outputs."""
        return self.path.stem

    @property
    def published(self) -> tuple[str, ...]:
        """All files that a run publishes but for the manifest."""
        return (*self.declared.outputs, EXECUTED)

    def load(self) -> Any:
        """Return the contents as nbformat has them, with links as in a published notebook.

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
        for cell in node.cells:
            cell.source = as_published(cell.cell_type, cell.source)
        return node

    def shows(self, executed: str) -> bool:
        """Return whether the text of an executed notebook's file has this text and code."""
        _, cells = _parsed(executed)
        shown = [cell.source for cell in cells if INJECTED not in cell.tags]
        return shown == [as_published(cell.kind, cell.source) for cell in self.cells]

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
            types = {type(literal), type(value)}
            fits = len(types) == 1 or (types == {float, int} and type(value) is int)
            if not _is_json(value) or not (fits or literal is None):
                expected = f"{_kind(literal)}, such as {json.dumps(literal)}"
                message = f"parameter {name!r} is {expected}; {value!r} is {_kind(value)}"
                refuse(self.path, message)


def as_published(kind: str, source: str) -> str:
    """Return a cell's text; a published notebook lies one folder deeper, and so do its links.

    Examples
    --------
    >>> as_published("markdown", "see [choices](../replication/paper/choices.toml)")
    'see [choices](../../replication/paper/choices.toml)'
    """
    return source.replace("](../", "](../../") if kind == "markdown" else source


def read_notebook(path: Path) -> Notebook:
    """Read a notebook and check what it declares.

    Raises
    ------
    NotebookError
        If the file is no notebook, does not have exactly one cell tagged `parameters`, if that
        cell has a line other than `name = literal`, or if the declarations are not usable.
    """
    try:
        text = read_text(path)
        metadata, cells = _parsed(text)
    except FileError as error:
        raise NotebookError(str(error)) from None
    except Exception as error:  # whatever the contents make the reader raise
        refuse(path, f"is not a valid notebook: {first_line(error)}")
    tagged = [
        at for at, cell in enumerate(cells) if cell.kind == "code" and "parameters" in cell.tags
    ]
    if len(tagged) != 1:
        refuse(path, f"{len(tagged)} cells have the tag 'parameters'; exactly one must have it")
    literals = _literals(path, cells[tagged[0]].source)
    declared = _declared(path, metadata.get("replication"))
    if not isinstance(literals.get("out"), str):
        refuse(path, "the parameters cell must have out = 'FOLDER', where the outputs go")
    if declared.needs and not isinstance(literals.get("results"), str):
        refuse(path, "the parameters cell must have results = 'FOLDER', where what it needs is")
    notebook = Notebook(path, text, cells, tagged[0], literals, declared)
    for profile, values in declared.profiles.items():
        for name in {"out", "results"} & values.keys():
            refuse(path, f"profile {profile!r} sets {name!r}, which each run chooses")
        notebook.check(values)
    return notebook


def _parsed(text: str) -> tuple[dict[str, Any], tuple[Cell, ...]]:
    """Return the metadata and the cells of a notebook's file, which is plain JSON."""
    document = parse_json(text)
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


def _declared(path: Path, metadata: Any) -> Declaration:
    """Check the declaration; what is wrong is told in one line."""
    if not isinstance(metadata, dict):
        refuse(path, 'its metadata do not declare {"replication": {"figures": [...]}}')
    try:
        return Declaration.model_validate(metadata)
    except ValidationError as error:
        first = error.errors()[0]
        place = ".".join(map(str, first["loc"]))
        if first["type"] == "extra_forbidden":
            refuse(path, unknown(place, Declaration.model_fields, "declaration"))
        message = first["msg"].removeprefix("Value error, ")
        refuse(path, f"declaration {place!r}: {message}")


def _literals(path: Path, source: str) -> dict[str, Any]:
    try:
        statements = ast.parse(source).body
    except (SyntaxError, ValueError) as error:
        line = getattr(error, "lineno", 1)
        refuse(path, f"line {line} of the parameters cell is not Python: {first_line(error)}")
    literals: dict[str, Any] = {}
    for statement in statements:
        text = source.splitlines()[statement.lineno - 1].strip()
        place = f"line {statement.lineno} of the parameters cell, `{text}`"
        try:
            name, node = assignment(statement)
            value = ast.literal_eval(node)
        except (TypeError, ValueError, RecursionError, MemoryError):
            only = "only `name = literal` is allowed here; move other code to the next cell"
            refuse(path, f"{place}: {only}")
        if not _is_json(value):
            kinds = "null, true, a number, text, a list, an object"
            refuse(path, f"{place}: a parameter must be a JSON value: {kinds}")
        if name in literals:
            refuse(path, f"{place}: {name!r} is there twice")
        literals[name] = value
    return literals


def assignment(statement: ast.stmt) -> tuple[str, ast.expr]:
    """Return the name and the value of `name = value` or `name: type = value`."""
    match statement:
        case ast.Assign(targets=[ast.Name(id=name)], value=value):
            return name, value
        case ast.AnnAssign(target=ast.Name(id=name), value=ast.expr() as value):
            return name, value
    raise ValueError("it is no assignment of one value to one name")


def _is_json(value: Any) -> bool:
    try:
        return bool(json.loads(json.dumps(value, allow_nan=False)) == value)
    except (TypeError, ValueError, RecursionError):
        return False


def _kind(value: Any) -> str:
    return KINDS.get(type(value), "no JSON value")


def first_line(error: object) -> str:
    """Return the first line of an error's message, or its name if it has none."""
    return (str(error).strip().splitlines() or [type(error).__name__])[0]


def refuse(path: Path, message: str) -> NoReturn:
    """Raise a :class:`NotebookError` about a file."""
    raise NotebookError(f"{path}: {message}")
