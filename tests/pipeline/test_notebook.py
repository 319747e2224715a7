from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from replication.pipeline.notebook import NotebookError, read_notebook
from tests.conftest import Spoil
from tests.notebooks import write_notebook

PARAMETERS = 'trials = 3\nalpha = 0.5\nname = "a"\nchoices = {}\njobs = 1\nseed = 1\nout = "build"'

Write = Callable[..., Path]


@pytest.fixture
def write(tmp_path: Path) -> Write:
    """Write a notebook: a headline, the parameters cell, and declarations."""

    def write(*, parameters: str = PARAMETERS, **declared: Any) -> Path:
        write_notebook(tmp_path / "toy.ipynb", parameters=parameters, prose="# Toy", **declared)
        return tmp_path / "toy.ipynb"

    return write


@pytest.mark.parametrize(
    ("parameters", "message"),
    [
        (
            'out = "x"\nn = 2 + 3',
            "line 2 of the parameters cell, `n = 2 + 3`: only `name = literal`",
        ),
        ('out = "x"\nimport os', "line 2 of the parameters cell, `import os`"),
        ('out = "x"\na = b = 1', "line 2 of the parameters cell, `a = b = 1`"),
        ('out = "x"\na, b = 1, 2', "line 2 of the parameters cell"),
        ('out = "x"\na = 1\na = 2', "line 3 of the parameters cell, `a = 2`: 'a' is there twice"),
        ('out = "x"\nn: int', "line 2 of the parameters cell, `n: int`: only `name = literal`"),
        ('out = "x"\npair = (1, 2)', "a parameter must be a JSON value"),
        ('out = "x"\nhuge = 1e999', "a parameter must be a JSON value"),
        ('out = "x"\n%matplotlib', "line 2 of the parameters cell is not Python"),
        ("trials = 3", "must have out = 'FOLDER'"),
    ],
)
def test_parameters_cell_holds_json_literals_only(
    write: Write, parameters: str, message: str
) -> None:
    """Any other line of the parameters cell is named and refused."""
    with pytest.raises(NotebookError, match=re.escape(message)):
        read_notebook(write(parameters=parameters))


def test_literals_are_read_with_comments_and_signs(write: Write) -> None:
    """Types, comments, negative numbers, null and nested values may stand in the cell."""
    source = (
        'out: str = "x"  # a folder\n# more\nn = -2\nnone = None\nsets = {"a": [1, {"b": True}]}'
    )
    expected = {"out": "x", "n": -2, "none": None, "sets": {"a": [1, {"b": True}]}}
    assert read_notebook(write(parameters=source)).literals == expected


@pytest.mark.parametrize(
    ("declared", "message"),
    [
        ({"data": ["../a.png"]}, "'../a.png' is not a plain name"),
        ({"figures": ["/a"]}, "'/a' is not a plain name"),
        ({"tables": [".."]}, "'..' is not a plain name"),
        ({"data": [1]}, "'data.0': Input should be a valid string"),
        ({"data": ["a.png", "a.png"]}, "'a.png' stands there twice"),
        ({"data": ["notebook.ipynb"]}, "'notebook.ipynb' is written by every run"),
        ({"players": "a"}, "'players': Input should be a valid tuple"),
        ({"inputs": "a.toml"}, "'inputs': Input should be a valid tuple"),
        ({"figure": ["a"]}, "unknown declaration 'figure' (did you mean 'figures'?)"),
        ({"needs": ["a"]}, "must have results = 'FOLDER'"),
        ({"profiles": {"quick": 3}}, "'profiles.quick': Input should be a valid dictionary"),
        ({"profiles": {"quick": {"trails": 3}}}, "(did you mean 'trials'?)"),
        ({"profiles": {"quick": {"trials": 0.5}}}, "'trials' is a whole number"),
        ({"profiles": {"quick": {"out": "x"}}}, "sets 'out'"),
    ],
)
def test_declarations_are_checked(write: Write, declared: dict[str, Any], message: str) -> None:
    """A declaration that cannot be honoured is named and refused, in one line."""
    with pytest.raises(NotebookError, match=re.escape(message)) as caught:
        read_notebook(write(**declared))
    assert "\n" not in str(caught.value)


def test_names_stand_for_files(write: Write) -> None:
    """A figure, table or player is a name; its files are counted once each."""
    given: dict[str, Any] = {"figures": ["fig05", "sets"], "tables": ["sets"], "players": ["film"]}
    notebook = read_notebook(write(**given, data=["film.gif", "trials.csv"], inputs=["x/y.toml"]))
    assert notebook.declared.outputs == (
        *("fig05.csv", "fig05.png", "fig05.svg", "sets.csv", "sets.png", "sets.svg", "sets.md"),
        *("film.csv", "film.html", "film.gif", "trials.csv"),
    )
    assert notebook.published == (*notebook.declared.outputs, "notebook.ipynb")
    assert (notebook.name, notebook.at, notebook.declared.inputs) == ("toy", 1, ("x/y.toml",))
    assert read_notebook(write()).declared.outputs == ()


def test_a_notebook_must_declare_something(write: Write) -> None:
    """Metadata without a declaration are refused with an example."""
    path = write()
    path.write_text(path.read_text().replace('"replication"', '"other"'))
    with pytest.raises(NotebookError, match="do not declare"):
        read_notebook(path)


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (None, "cannot be read (no such file"),
        (b"no JSON", "is not a valid notebook"),
        (b"[]", "is not a valid notebook"),
        (b"\xff\xfe", "is not UTF-8 text (byte 1)"),
        (b'{"nbformat": 4, "nbformat_minor": 5, "cells": 3, "metadata": {}}', "not a valid"),
        (b'{"nbformat": 4, "nbformat_minor": 5, "cells": [], "metadata": {}}', "0 cells have"),
    ],
)
def test_file_that_is_no_notebook_is_refused(
    tmp_path: Path, content: bytes | None, message: str
) -> None:
    """Whatever the file holds, the error is one line with its name."""
    path = tmp_path / "broken.ipynb"
    if content is not None:
        path.write_bytes(content)
    with pytest.raises(NotebookError, match=re.escape(message)) as caught:
        read_notebook(path)
    assert str(path) in str(caught.value)
    assert "\n" not in str(caught.value)


def test_whatever_is_in_the_place_of_a_notebook(write: Write, spoil: Spoil) -> None:
    """A pipe, a device, a folder, a huge file and JSON that is none are refused in one line."""
    path = write()
    spoil(path)
    with pytest.raises(NotebookError, match=r"toy\.ipynb: is [^\n]+$"):
        read_notebook(path)


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ('"nbformat": 4,', '"nbformat": 4, "nbformat": 3,', "the field 'nbformat' appears twice"),
        (
            '"nbformat": 4,',
            '"nbformat": 4, "x": ' + "[" * 200 + "]" * 200 + ",",
            "nested too deeply",
        ),
    ],
)
def test_json_of_a_notebook_is_read_strictly(
    write: Write, old: str, new: str, message: str
) -> None:
    """What other readers may read differently, or not at all, is refused before anything runs."""
    path = write()
    path.write_text(path.read_text().replace(old, new, 1))
    with pytest.raises(NotebookError, match=f"is not a valid notebook: .*{message}"):
        read_notebook(path)
