from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest

from replication.pipeline import manifest
from replication.pipeline.declaration import EXECUTED, MANIFEST
from replication.pipeline.manifest import (
    damaged,
    output_hash,
    published_folders,
    read_manifest,
    save_manifest,
    state_of,
    write_manifest,
)
from tests.conftest import Spoil

INPUTS: dict[str, Any] = {
    "cells": "0",
    "parameters": {"seed": 1},
    "outputs": ["a.csv"],
    "source": {},
    "data": {},
    "lock": "0",
}


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """Publish one table."""
    folder = tmp_path / "toy"
    folder.mkdir()
    (folder / "a.csv").write_text("1")
    (folder / EXECUTED).write_text("{}")
    write_manifest(folder, INPUTS, ("a.csv", EXECUTED))
    return folder


def test_equal_runs_have_equal_manifests(folder: Path, tmp_path: Path) -> None:
    """The same outputs in another folder, later, give the same bytes, without any path."""
    other = tmp_path / "other"
    other.mkdir()
    (other / "a.csv").write_text("1")
    (other / EXECUTED).write_text("{}")
    write_manifest(other, dict(reversed(INPUTS.items())), ("a.csv", EXECUTED))
    assert (other / MANIFEST).read_bytes() == (folder / MANIFEST).read_bytes()
    assert str(tmp_path) not in (folder / MANIFEST).read_text()
    assert list(published_folders(tmp_path)) == ["other", "toy"]


def test_damage_is_told_apart(folder: Path) -> None:
    """A file that was edited, or is gone, is named."""
    known = read_manifest(folder)
    assert damaged(folder, known) == {}
    (folder / "a.csv").write_text("2")
    assert damaged(folder, known) == {"a.csv": "changed"}
    (folder / "a.csv").unlink()
    assert damaged(folder, known) == {"a.csv": "missing"}


def test_a_record_names_every_declared_file(folder: Path) -> None:
    """A file that was taken out of the manifest, and may have been changed, is not fresh."""
    manifest = read_manifest(folder)
    for name in ("a.csv", EXECUTED):
        outputs = {other: value for other, value in manifest["outputs"].items() if other != name}
        save_manifest(folder, manifest | {"outputs": outputs})
        assert state_of(folder, INPUTS).why == (f"{name} is not in provenance.json",)


def test_states_are_told_apart(folder: Path, tmp_path: Path) -> None:
    """Fresh, stale for a reason, without a record, and missing."""
    assert state_of(folder, INPUTS).kind == "fresh"
    stale = state_of(folder, INPUTS | {"lock": "1"})
    assert (stale.kind, stale.why) == ("stale", ("environment.lock has changed",))
    for name in ("a.csv", EXECUTED):
        (folder / name).unlink()
    assert state_of(folder, INPUTS).kind == "missing"
    (folder / MANIFEST).write_text("{")
    assert state_of(folder, INPUTS).why == ("there is no record of how they were made",)
    assert state_of(tmp_path / "none", INPUTS).kind == "missing"


@pytest.mark.parametrize(
    "content",
    [
        None,
        b"",
        b"{",
        b"\xff",
        b"[]",
        b"3",
        b"{}",
        b'{"format": "replication-provenance", "version": 2}',
        b'{"format": "replication-provenance", "version": 2, "inputs": {}, "outputs": {}}',
        b'{"format": "replication-provenance", "version": 2, "outputs": [1], '
        b'"inputs": {"parameters": {}, "data": {}, "source": {}}}',
        b'{"format": "replication-provenance", "version": 1, "outputs": {}, '
        b'"inputs": {"parameters": {}, "data": {}, "source": {}}}',
        b'{"format": "other", "version": 2, "outputs": {}, '
        b'"inputs": {"parameters": {}, "data": {}, "source": {}}}',
    ],
)
def test_a_manifest_that_cannot_be_used_counts_as_none(folder: Path, content: bytes | None) -> None:
    """Whatever the file holds, its outputs are unknown."""
    (folder / MANIFEST).unlink()
    if content is not None:
        (folder / MANIFEST).write_bytes(content)
    assert read_manifest(folder) == {}
    assert published_folders(folder.parent) == {}


def test_whatever_is_in_the_place_of_a_published_file(folder: Path, spoil: Spoil) -> None:
    """A manifest and a record of runs that cannot be read count as none, an output as damaged."""
    known = read_manifest(folder)
    spoil(folder / "a.csv")
    assert damaged(folder, known)["a.csv"] in ("changed", "missing")
    spoil(folder / MANIFEST)
    assert read_manifest(folder) == {}
    assert state_of(folder, INPUTS).kind == "stale"
    spoil(folder / "notebook.ipynb")
    assert output_hash(folder / "notebook.ipynb") == "unreadable"
    spoil(folder.parent / manifest.RUNS)
    assert manifest.read_runs(folder.parent) == {}


def test_text_of_a_notebook_is_not_hashed(tmp_path: Path) -> None:
    """Of an executed notebook what a run gives counts: outputs, numbers, injected parameters."""
    path = tmp_path / "notebook.ipynb"
    code = {"cell_type": "code", "metadata": {}, "execution_count": 1, "outputs": [1], "source": []}
    injected = code | {"metadata": {"tags": ["injected-parameters"]}, "source": ["seed = 1"]}
    text = {"cell_type": "markdown", "metadata": {}, "source": "# Toy"}

    def hashed(*cells: Any) -> str:
        path.write_text(json.dumps({"cells": cells, "metadata": {"version": len(cells)}}))
        return output_hash(path)

    before = hashed(text, code, injected)
    assert hashed(code | {"source": "x = 1  # one"}, injected) == before
    assert hashed(text, code) != before
    assert hashed(text, code, injected | {"source": "seed = 2"}) != before
    assert hashed(text, code | {"outputs": [2]}, injected) != before
    assert hashed(text, code | {"execution_count": 2}, injected) != before
    path.write_text("{")
    assert output_hash(path) != before


def test_versions_are_named_in_neutral_words() -> None:
    """The packages that compute and draw are named, and nothing that the lock does not pin."""
    found = manifest.versions()
    assert {"numpy", "numba", "pymunk", "matplotlib"} <= set(found)
    assert all(isinstance(value, str) and "/" not in value for value in found.values())


@pytest.mark.parametrize(
    "entry",
    [
        *("3", "{}", '{"seconds": 1}', '{"seconds": "x", "finished": "y"}'),
        '{"seconds": "5", "finished": "2026-01-01T00:00:00+00:00"}',
    ],
)
def test_a_record_that_cannot_be_used_counts_as_none(tmp_path: Path, entry: str) -> None:
    """A run that lacks what is shown is not known, and the others are."""
    manifest.record_run(tmp_path, "b", 1)
    path = tmp_path / manifest.RUNS
    path.write_text(path.read_text().replace("{", f'{{"a": {entry}, ', 1))
    assert list(manifest.read_runs(tmp_path)) == ["b"]
