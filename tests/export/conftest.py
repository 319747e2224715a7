from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from socket import socket
from typing import Any

import pytest

from replication import files
from replication.export import about as about_module
from replication.export.about import About
from replication.export.write import contents
from replication.files import PROJECT
from tests.export.names import NAMES


@pytest.fixture(scope="session")
def about() -> About:
    """Return what names the package; a copy without git knows no date, so it is given."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(about_module, "committed", lambda: "2026-01-31")
        return about_module.about()


@pytest.fixture(scope="session")
def exported(about: About) -> Mapping[str, bytes]:
    """Return all files of the export of what is published."""
    return contents(about, NAMES)


@pytest.fixture(scope="session")
def entities(exported: Mapping[str, bytes]) -> Mapping[str, dict[str, Any]]:
    """Return the entities of the crate, by id."""
    graph = json.loads(exported["ro-crate-metadata.json"])["@graph"]
    found = {entity["@id"]: entity for entity in graph}
    assert len(found) == len(graph)
    return found


@pytest.fixture
def linked(exported: Mapping[str, bytes], tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Set up a project with links to all files that are exported, in place of the project."""
    for name in exported:
        if (PROJECT / name).exists():
            link = tmp_path / name
            link.parent.mkdir(parents=True, exist_ok=True)
            link.symlink_to(PROJECT / name)
    monkeypatch.setattr(files, "PROJECT", tmp_path)
    return tmp_path


@pytest.fixture
def no_network(monkeypatch: pytest.MonkeyPatch) -> None:
    """Let whatever opens a connection fail."""

    def connect(*_: Any) -> None:
        raise AssertionError("this needs no network")

    monkeypatch.setattr(socket, "connect", connect)
