"""What a notebook declares: its parameters, what a run publishes, what it reads, and its profiles.

A notebook has one cell tagged `parameters`, which holds literals only; `out`, the folder that it
writes to, is one of them. Its metadata declare what it writes there::

    {
        "replication": {
            "figures": ["fig05"],
            "tables": ["table1"],
            "players": ["player"],
            "data": ["trials.csv"],
            "needs": [],
            "inputs": ["replication/paper/choices.toml"],
            "profiles": {"quick": {"trials": 6}, "paper": {"trials": 100}},
        }
    }

See :class:`Declaration` for each of them.
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
from typing import Annotated, Any, NoReturn

from pydantic import AfterValidator, BaseModel, ConfigDict, ValidationError

from replication.errors import UserError, unknown

EXECUTED = "notebook.ipynb"
"""The executed notebook, in the folder of its outputs."""

MANIFEST = "provenance.json"
"""What the outputs came from, in the same folder."""

INJECTED = "injected-parameters"
"""The tag that papermill gives to its own cell."""

SUFFIXES = {
    "figures": (".csv", ".png", ".svg"),
    "tables": (".csv", ".md"),
    "players": (".csv", ".html"),
    "data": ("",),
}


class NotebookError(UserError):
    """A notebook, or what it was asked for, that cannot be run; the message is one line."""


class RunError(RuntimeError):
    """A run that failed; the message is one line, `details` the failing cell's traceback."""

    def __init__(self, message: str, details: str = "") -> None:
        super().__init__(message)
        self.details = details


def _plain(names: tuple[str, ...]) -> tuple[str, ...]:
    for name in names:
        if not re.fullmatch(r"\w[\w.-]*", name):
            raise ValueError(f"{name!r} is not a plain name without a folder")
        if name in (EXECUTED, MANIFEST):
            raise ValueError(f"{name!r} is written by every run")
        if names.count(name) > 1:
            raise ValueError(f"{name!r} stands there twice")
    return names


Names = Annotated[tuple[str, ...], AfterValidator(_plain)]


class Declaration(BaseModel):
    """The metadata `replication` of a notebook.

    Attributes
    ----------
    figures, tables, players
        Outputs by their names without suffix: a figure is NAME.png, NAME.svg and its numbers
        NAME.csv, a table NAME.md and NAME.csv, a player NAME.html and NAME.csv.
    data
        Other files that it writes.
    needs
        Notebooks whose published folders it reads, from the folder in its parameter `results`.
    inputs
        Files of the project that it reads without having them as parameters.
    profiles
        Parameter values by the name of the profile; a profile that is not among them keeps the
        literals of the parameters cell.
    """

    model_config = ConfigDict(extra="forbid", frozen=True)

    figures: Names = ()
    tables: Names = ()
    players: Names = ()
    data: Names = ()
    needs: Names = ()
    inputs: tuple[str, ...] = ()
    profiles: dict[str, dict[str, Any]] = {}

    @property
    def outputs(self) -> tuple[str, ...]:
        """The names of all files."""
        groups = ((getattr(self, kind), suffixes) for kind, suffixes in SUFFIXES.items())
        names = [
            stem + suffix for stems, suffixes in groups for stem in stems for suffix in suffixes
        ]
        return tuple(dict.fromkeys(names))


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
    declared
        What it declares.
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

    def shows(self, executed: str) -> bool:
        """Return whether the text of an executed notebook's file has this text and code."""
        _, cells = _parsed(executed)
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
                expected = f"{_kind(literal)}, such as {json.dumps(literal)}"
                message = f"parameter {name!r} is {expected}; {value!r} is {_kind(value)}"
                refuse(self.path, message)


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
        match statement:
            case ast.Assign(targets=[ast.Name(id=name)], value=node):
                pass
            case _:
                name, node = "", ast.Constant(None)
        try:
            value = ast.literal_eval(node)
        except (TypeError, ValueError, RecursionError, MemoryError):
            name, value = "", None
        if not name:
            only = "only `name = literal` is allowed here; move other code to the next cell"
            refuse(path, f"{place}: {only}")
        if not _is_json(value):
            kinds = "null, true, a number, text, a list, an object"
            refuse(path, f"{place}: a parameter must be a JSON value: {kinds}")
        if name in literals:
            refuse(path, f"{place}: {name!r} is there twice")
        literals[name] = value
    return literals


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


def first_line(error: object) -> str:
    """Return the first line of an error's message, or its name if it has none."""
    return (str(error).strip().splitlines() or [type(error).__name__])[0]


def refuse(path: Path, message: str) -> NoReturn:
    """Raise a :class:`NotebookError` about a file."""
    raise NotebookError(f"{path}: {message}")
