from __future__ import annotations

import pytest

from replication.export.entity import ids_in, properties, refs, types_of


@pytest.mark.parametrize("ids", [[], ["#a"], ["#a", "b/"]])
def test_references_can_be_followed(ids: list[str]) -> None:
    """The ids of references are those that were referred to, however many."""
    assert ids_in(refs(ids)) == ids


def test_types_are_a_list() -> None:
    """An entity may have one type or several."""
    assert types_of({"@type": "File"}) == ["File"]
    assert types_of({"@type": ["File", "Dataset"]}) == ["File", "Dataset"]


def test_properties_belong_to_their_owner() -> None:
    """Their ids begin with the owner's, so that no two owners share one."""
    (one,) = properties("#a", {"n": {"value": 3}})
    assert (one["@id"], one["name"], one["value"]) == ("#a/n", "n", 3)
