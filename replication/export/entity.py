"""Entities of an RO-Crate: flat objects that refer to each other by id."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

Entity = dict[str, Any]

PYTHON = "#python"


def refs(ids: Iterable[str]) -> Any:
    """Return references to some entities; a single one is no list, as RO-Crate 1.2 recommends.

    Examples
    --------
    >>> refs(["#a"]), refs(["#a", "#b"])
    ({'@id': '#a'}, [{'@id': '#a'}, {'@id': '#b'}])
    """
    found = [{"@id": id} for id in ids]
    return found[0] if len(found) == 1 else found


def ids_in(value: Any) -> list[str]:
    """Return the ids of what :func:`refs` returned."""
    return [ref["@id"] for ref in (value if isinstance(value, list) else [value])]


def types_of(entity: Entity) -> list[str]:
    """Return the types of an entity."""
    kinds = entity["@type"]
    return kinds if isinstance(kinds, list) else [kinds]


def file_entity(name: str, what: str, words: str) -> Entity:
    """Return a file of the crate, with what it is called and what it is."""
    return {"@id": name, "@type": "File", "description": words, "name": what}


def code_entity(name: str, what: str, words: str) -> Entity:
    """Return a file with code in Python."""
    kinds = {"@type": ["File", "SoftwareSourceCode"], "programmingLanguage": refs([PYTHON])}
    return file_entity(name, what, words) | kinds


def properties(owner: str, values: dict[str, dict[str, Any]]) -> list[Entity]:
    """Return named values that belong to an entity, as entities of their own."""
    return [
        {
            "@id": f"{owner}/{name}",
            "@type": "PropertyValue",
            "name": name,
            "propertyID": name,
            **value,
        }
        for name, value in values.items()
    ]
