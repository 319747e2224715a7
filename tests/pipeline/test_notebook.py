from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import nbformat
import pytest
from nbformat.v4 import new_code_cell, new_markdown_cell, new_notebook

from replication.pipeline.notebook import NotebookError, read_notebook

PARAMETERS = 'trials = 3\nalpha = 0.5\nname = "a"\nchoices = {}\njobs = 1\nseed = 1\nout = "build"'

Write = Callable[..., Path]


@pytest.fixture
def write(tmp_path: Path) -> Write:
    """Write a notebook: a headline, the parameters cell, and declarations."""

    def write(*, parameters: str = PARAMETERS, **declared: Any) -> Path:
        cells = [new_markdown_cell("# Toy"), new_code_cell(parameters)]
        cells[1].metadata["tags"] = ["parameters"]
        node = new_notebook(cells=cells, metadata={"replication": {"outputs": []} | declared})
        path = tmp_path / "toy.ipynb"
        nbformat.write(node, path)
        return path

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
    """Comments, negative numbers, null and nested values may stand in the parameters cell."""
    source = 'out = "x"  # a folder\n# more\nn = -2\nnone = None\nsets = {"a": [1, {"b": True}]}'
    expected = {"out": "x", "n": -2, "none": None, "sets": {"a": [1, {"b": True}]}}
    assert read_notebook(write(parameters=source)).literals == expected


@pytest.mark.parametrize(
    ("declared", "message"),
    [
        ({"outputs": ["../a.png"]}, "'../a.png', which is not a plain file name"),
        ({"outputs": ["/a.png"]}, "'/a.png', which is not a plain file name"),
        ({"outputs": [".."]}, "'..', which is not a plain file name"),
        ({"outputs": [1]}, "1, which is not a plain file name"),
        ({"outputs": ["a.png", "a.png"]}, "'a.png' twice"),
        ({"outputs": "a.png"}, "'outputs' must be a list"),
        ({"inputs": "a.toml"}, "'inputs' must be a list of files"),
        ({"inputs": [1]}, "'inputs' must be a list of files"),
        ({"merge": ["a.csv"]}, "unknown declaration 'merge' (did you mean 'merged'?)"),
        ({"profiles": {"quick": 3}}, "'profiles' must hold an object"),
        ({"profiles": {"quick": {"trails": 3}}}, "(did you mean 'trials'?)"),
        ({"profiles": {"quick": {"trials": 0.5}}}, "'trials' is a whole number"),
        ({"profiles": {"quick": {"out": "x"}}}, "sets 'out'"),
    ],
)
def test_declarations_are_checked(write: Write, declared: dict[str, Any], message: str) -> None:
    """A declaration that cannot be honoured is named and refused."""
    with pytest.raises(NotebookError, match=re.escape(message)):
        read_notebook(write(**declared))


def test_declarations_are_read(write: Write) -> None:
    """What is declared comes back; a merged file counts as an output, once."""
    found = read_notebook(write(outputs=["a", "b"], merged=["b", "c"], inputs=["x/y.toml"]))
    assert (found.outputs, found.merged) == (("a", "b", "c"), ("b", "c"))
    assert (found.name, found.at, found.inputs) == ("toy", 1, ("x/y.toml",))
    assert read_notebook(write()).inputs == ()


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (None, "cannot be read: no such file"),
        (b"no JSON", "is not a valid notebook"),
        (b"[]", "is not a valid notebook"),
        (b"\xff\xfe", "is not a valid notebook"),
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
