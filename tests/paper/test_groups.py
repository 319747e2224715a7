from __future__ import annotations

from replication.paper.groups import choice_groups
from replication.paper.register import load_choices


def test_every_choice_is_in_one_group() -> None:
    """The groups hold the register, in its order, and none is empty."""
    groups = choice_groups()
    assert [one for members in groups.values() for one in members] == [*load_choices().values()]
    assert all(groups.values())
