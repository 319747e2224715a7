"""What outputs came from: a manifest beside them, and what has changed since.

The manifest `provenance.json` is the same for identical runs. For each notebook it holds the hashes
of everything that the outputs depend on, and of the outputs. What differs from run to run, such as
times, goes into `run.json` beside the executed notebooks.
"""

from __future__ import annotations

import ast
import hashlib
import importlib.metadata
import json
import platform
import sys
import tomllib
from collections.abc import Iterable, Iterator, Mapping
from contextlib import suppress
from functools import cache
from itertools import chain
from pathlib import Path
from typing import Any

from replication import files
from replication.files import write_file
from replication.pipeline.notebook import Notebook, NotebookError
from replication.source import PACKAGE, bare_source

MANIFEST = "provenance.json"
FORMAT, VERSION = "replication-provenance", 1

NEUTRAL = frozenset({"jobs", "store", "out"})
"""Parameters that leave every result as it is."""

REPORTED = ("matplotlib", "numba", "numpy", "pandas", "pymunk", "scipy")
"""Packages whose versions are named in the manifest; the lock's hash covers all."""

Inputs = dict[str, Any]


def inputs_of(notebook: Notebook, values: Mapping[str, Any]) -> Inputs:
    """Return everything that a notebook's outputs depend on, as names and hashes.

    Prose does not count: not that of the notebook, nor docstrings and comments of the package.

    Parameters
    ----------
    notebook
        The notebook.
    values
        Parameters of the run that differ from the notebook's literals.

    Raises
    ------
    NotebookError
        If a file that the notebook reads does not exist.
    """
    cells = [  # the parameters cell keeps its place among them
        "" if at == notebook.at else cell.source
        for at, cell in enumerate(notebook.cells)
        if cell.kind == "code"
    ]
    parameters = {**notebook.literals, **values}
    listed = [files.PROJECT / name for name in notebook.inputs]
    listed += [
        files.resolve(value)
        for name, value in parameters.items()
        if name not in NEUTRAL and isinstance(value, str) and _is_file_name(value)
    ]
    data = {}
    for file in listed:
        try:
            data[_name(file)] = _data_hash(file)
        except OSError as error:
            said = (error.strerror or str(error)).lower()
            raise NotebookError(f"{file}: cannot be read by {notebook.name}: {said}") from None
    return {
        "cells": text_hash(json.dumps([bare_source(cell) for cell in cells])),
        "parameters": {k: v for k, v in sorted(parameters.items()) if k not in NEUTRAL},
        "outputs": sorted(notebook.outputs),
        "source": _source_hashes(_imported(_trees(cells))),
        "data": dict(sorted(data.items())),
        "lock": file_hash(files.PROJECT / "environment.lock"),
    }


def changes(before: Inputs, now: Inputs) -> list[str]:
    """Say what differs between the inputs of a run and those of now."""
    found = []
    for key, what in (("parameters", "parameter "), ("data", ""), ("source", "")):
        old, new = before.get(key, {}), now[key]
        names = sorted(name for name in {*old, *new} if old.get(name) != new.get(name))
        found += [f"{what}{name} has changed" for name in names]
    labels = {
        "cells": "the notebook's code has changed",
        "outputs": "the notebook declares other outputs",
        "lock": "environment.lock has changed",
    }
    return found + [label for key, label in labels.items() if before.get(key) != now[key]]


def read_manifest(folder: Path) -> dict[str, Any]:
    """Return what the manifest of a folder says of each notebook; empty if there is none.

    What cannot be read counts as not there: its outputs are then made again.
    """
    try:
        document = json.loads((folder / MANIFEST).read_text(encoding="utf-8"))
        if (document["format"], document["version"]) == (FORMAT, VERSION):
            notebooks = dict(document["notebooks"])
            return {name: entry for name, entry in notebooks.items() if _is_entry(entry)}
    except (OSError, ValueError, KeyError, TypeError):
        pass
    return {}


def _is_entry(entry: Any) -> bool:
    """Return whether what a manifest says of a notebook has the parts that are needed."""
    try:
        inputs, outputs = entry["inputs"], entry["outputs"]
        parts = (outputs, inputs["parameters"], inputs["data"], inputs["source"])
    except (KeyError, TypeError):
        return False
    return all(isinstance(part, dict) for part in parts)


def record(folder: Path, notebook: Notebook, inputs: Inputs, shared: Mapping[str, str]) -> None:
    """Enter a finished run into the manifest of the folder that holds its outputs.

    A file that others merge has changed for them, too. Those whose rows were in it before the run
    know it under its new hash; to the others it stays damaged.

    Parameters
    ----------
    folder, notebook, inputs
        The outputs, what has made them, and what they depend on.
    shared
        The hashes that the merged files had when the run began.
    """
    notebooks = read_manifest(folder)
    outputs = {name: file_hash(folder / name) for name in sorted(notebook.published)}
    for other in notebooks.values():
        for name in notebook.merged:
            if name in shared and other["outputs"].get(name) == shared[name]:
                other["outputs"][name] = outputs[name]
    notebooks[notebook.name] = {
        "inputs": inputs,
        "outputs": outputs,
        "versions": versions(),
    }
    _write_manifest(folder, notebooks)


def rehash(folder: Path, notebook: str, name: str, text: str) -> None:
    """Enter the hash of the text that one published file of a notebook is about to hold."""
    notebooks = read_manifest(folder)
    notebooks[notebook]["outputs"][name] = text_hash(text)
    _write_manifest(folder, notebooks)


def forget(folder: Path, names: Iterable[str]) -> None:
    """Remove notebooks from the manifest of a folder."""
    gone = set(names)
    notebooks = {k: v for k, v in read_manifest(folder).items() if k not in gone}
    _write_manifest(folder, notebooks)


def _write_manifest(folder: Path, notebooks: Mapping[str, Any]) -> None:
    document = {"format": FORMAT, "version": VERSION, "notebooks": notebooks}
    text = json.dumps(document, indent=1, sort_keys=True, ensure_ascii=False)
    write_file(folder / MANIFEST, text + "\n")


def versions() -> dict[str, str]:
    """Return what a run ran on, in neutral words."""
    found = {name: importlib.metadata.version(name) for name in REPORTED}
    python = f"{sys.version_info.major}.{sys.version_info.minor}"
    return {
        "python": python,
        "platform": f"{platform.system()} {platform.machine()}",
        **found,
    }


def damaged(folder: Path, entry: Mapping[str, Any]) -> dict[str, str]:
    """Return the outputs of a manifest's entry that are "missing" or "changed" since the run."""
    found = {}
    for name, due in entry["outputs"].items():
        path = folder / name
        if not path.is_file():
            found[name] = "missing"
        elif file_hash(path) != due:
            found[name] = "changed"
    return found


def file_hash(path: Path) -> str:
    """Return the SHA-256 of a file."""
    return hashlib.sha256(path.read_bytes()).hexdigest()


def text_hash(text: str) -> str:
    """Return the SHA-256 of a text."""
    return hashlib.sha256(text.encode()).hexdigest()


def _data_hash(path: Path) -> str:
    """Return the hash of what a data file says: of TOML and JSON without their layout."""
    content = path.read_bytes()
    try:
        if path.suffix == ".toml":
            document = tomllib.loads(content.decode())
            return text_hash(json.dumps(document, sort_keys=True, default=str))
        if path.suffix == ".json":
            return text_hash(json.dumps(json.loads(content), sort_keys=True))
    except ValueError:
        pass  # whoever reads it will say what is wrong
    return hashlib.sha256(content).hexdigest()


def _is_file_name(value: str) -> bool:
    """Return whether a parameter names a file; one of JSON is missed if it is not there."""
    try:
        return value.endswith(".json") or files.resolve(value).is_file()
    except OSError:  # a text that is too long to be a name
        return False


def _trees(cells: Iterable[str]) -> Iterator[ast.Module]:
    """Yield cells as syntax trees, without magics; what is no Python its run will refuse."""
    for cell in cells:
        lines = [line for line in cell.splitlines() if not line.lstrip().startswith(("%", "!"))]
        with suppress(SyntaxError):
            yield ast.parse("\n".join(lines))


def _imported(trees: Iterable[ast.Module]) -> list[str]:
    """Return the names of what some code imports, of modules and of what is in them."""
    names = []
    for node in chain.from_iterable(map(ast.walk, trees)):
        if isinstance(node, ast.Import):
            names += [alias.name for alias in node.names]
        elif isinstance(node, ast.ImportFrom) and node.module:
            names.append(node.module)
            names += [f"{node.module}.{alias.name}" for alias in node.names]
    return names


def _source_hashes(names: Iterable[str]) -> dict[str, str]:
    """Return the hash of each module of the package that is among some names or imported by one."""
    found: dict[str, str] = {}
    waiting = list(names)
    while waiting:
        name = waiting.pop()
        if name not in found and (module := _module(name)) is not None:
            found[name], imports = module
            waiting += imports
    return dict(sorted(found.items()))


def forget_sources() -> None:
    """Let every module be read again, since it may have been edited."""
    _module.cache_clear()


@cache
def _module(name: str) -> tuple[str, list[str]] | None:
    """Return the hash of a module of the package and the names it imports; None for other names.

    Each module is read once, however many notebooks lead to it, and none is imported.
    """
    package, *parts = name.split(".")
    path = Path(__file__).parent.joinpath(*parts)
    for file in (path / "__init__.py", path.with_suffix(".py")):
        if package == PACKAGE and file.is_file():
            text = file.read_text(encoding="utf-8")
            return text_hash(bare_source(text))[:16], _imported([ast.parse(text)])
    return None


def _name(path: Path) -> str:
    inside = path.resolve().is_relative_to(files.PROJECT)
    return path.resolve().relative_to(files.PROJECT).as_posix() if inside else path.name
