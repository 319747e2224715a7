from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import pytest

CODEMETA = {"referencePublication"}
"""The terms that CodeMeta adds to those of schema.org, among those that we use."""


@pytest.fixture
def document(exported: Mapping[str, bytes]) -> dict[str, Any]:
    """Return the description of the package."""
    return dict(json.loads(exported["codemeta.json"]))


def test_it_describes_the_package(document: dict[str, Any]) -> None:
    """Name, version and licence are the package's, and each dependency has its versions."""
    assert document["@context"] == "https://w3id.org/codemeta/3.0"
    assert document["name"] == "unified-irl-replication"
    assert document["license"] == "https://spdx.org/licenses/MIT"
    needed = {each["name"]: each.get("version") for each in document["softwareRequirements"]}
    assert needed["numpy"] == ">=2.0"
    assert len(document["referencePublication"]["author"]) == 5


def terms(value: Any) -> set[str]:
    """Return all types and properties of a document."""
    if isinstance(value, list):
        return {term for item in value for term in terms(item)}
    if not isinstance(value, dict):
        return set()
    own = {*value.keys() - {"@type", "@context"}, value["@type"]}
    return own | {term for item in value.values() for term in terms(item)}


def test_every_term_is_a_term(document: dict[str, Any]) -> None:
    """All types and properties are those of schema.org, or of CodeMeta."""
    rocrate = pytest.importorskip("rocrate", reason="it has the vocabulary of schema.org")
    text = (Path(rocrate.__file__).parent / "data" / "schema.jsonld").read_text(encoding="utf-8")
    known = {entry["@id"].removeprefix("schema:") for entry in json.loads(text)["@graph"]}
    assert terms(document) - known == CODEMETA
