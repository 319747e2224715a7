"""What goes into a notebook's outputs: code, parameters, data, source and lock, as hashes.

Prose does not count: not that of the notebook, nor docstrings and comments of the package.
"""

from __future__ import annotations

import hashlib
import json
import tomllib
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from replication import files
from replication.files import FileError, parse_json, read_file
from replication.pipeline.notebook import Notebook, NotebookError
from replication.source import bare_source, imports_of, module_hashes

NEUTRAL = frozenset({"jobs", "store", "out", "results"})
"""Parameters that leave every result as it is."""

LARGEST_JSON = 10_000_000
"""Bytes of a file of demonstrations; the reader refuses one that is larger, whatever it says."""

Inputs = dict[str, Any]


def inputs_of(notebook: Notebook, values: Mapping[str, Any], results: Path) -> Inputs:
    """Return everything that a notebook's outputs depend on, as names and hashes.

    Parameters
    ----------
    notebook, values
        What is run, and parameters that differ from its literals.
    results
        The folder that holds the published folders of the notebooks that it needs.

    Raises
    ------
    NotebookError
        If a file that the notebook reads cannot be read.
    """
    cells = [  # the parameters cell keeps its place among them
        "" if at == notebook.at else cell.source
        for at, cell in enumerate(notebook.cells)
        if cell.kind == "code"
    ]
    parameters = {**notebook.literals, **values}
    read = {name: files.PROJECT / name for name in notebook.declared.inputs}
    for name, value in parameters.items():
        if name not in NEUTRAL and isinstance(value, str) and _is_file_name(value):
            read[files.shown_as(files.resolve(value))] = files.resolve(value)
    for need in notebook.declared.needs:
        read |= {f"{need}/{path.name}": path for path in (results / need).glob("*.csv")}
    data = {}
    for name, file in sorted(read.items()):
        try:
            data[name] = data_hash(file)
        except FileError as error:
            raise NotebookError(f"{error}; {notebook.name} reads it") from None
    return {
        "cells": text_hash(json.dumps([bare_source(cell) for cell in cells])),
        "parameters": {k: v for k, v in sorted(parameters.items()) if k not in NEUTRAL},
        "outputs": sorted(notebook.declared.outputs),
        "source": module_hashes(name for cell in cells for name in imports_of(cell)),
        "data": data,
        "lock": file_hash(files.PROJECT / "environment.lock"),
    }


def changes(before: Inputs, now: Inputs) -> list[str]:
    """Return what differs between the inputs of a run and those of now, in words."""
    differing = []
    for key, what in (("parameters", "parameter "), ("data", ""), ("source", "")):
        old, new = before.get(key, {}), now[key]
        names = sorted(name for name in {*old, *new} if old.get(name) != new.get(name))
        differing += [f"{what}{name} has changed" for name in names]
    labels = {
        "cells": "the notebook's code has changed",
        "outputs": "the notebook declares other outputs",
        "lock": "environment.lock has changed",
    }
    return differing + [label for key, label in labels.items() if before.get(key) != now[key]]


def file_hash(path: Path) -> str:
    """Return the SHA-256 of a file."""
    return hashlib.sha256(read_file(path)).hexdigest()


def text_hash(text: str) -> str:
    """Return the SHA-256 of a text."""
    return hashlib.sha256(text.encode()).hexdigest()


def data_hash(path: Path) -> str:
    """Return the hash of what a data file says: of TOML and JSON without their layout.

    What a strict reader refuses may look like something that it takes, and has a hash of its own.
    """
    content = read_file(path)
    try:
        if path.suffix == ".toml":
            document = tomllib.loads(content.decode())
            return text_hash(json.dumps(document, sort_keys=True, default=str))
        if path.suffix == ".json" and len(content) <= LARGEST_JSON:
            return text_hash(json.dumps(parse_json(content), sort_keys=True))
    except (ValueError, RecursionError):
        pass  # whoever reads it reports what is wrong
    return hashlib.sha256(content).hexdigest()


def _is_file_name(value: str) -> bool:
    """Return whether a parameter names a file; a missing .json file still counts."""
    try:
        return value.endswith(".json") or files.resolve(value).is_file()
    except OSError:  # a text that is too long to be a name
        return False
