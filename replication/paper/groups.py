"""The choices by what they are about: the sections of the register's file."""

from __future__ import annotations

import re
from pathlib import Path

from replication.files import read_text
from replication.paper.register import Choice, load_choices


def choice_groups() -> dict[str, list[Choice]]:
    """Return the register's choices under the headings of their sections, in the file's order.

    Examples
    --------
    >>> [choice.id for choice in choice_groups()["the weight update"]][:2]
    ['F-INDEX', 'F-SIZE']
    """
    text = read_text(Path(__file__).with_name("choices.toml"))
    entries, groups = load_choices(), dict[str, list[Choice]]()
    for heading, id in re.findall(r'^# -{10,} (.+)|^id = "(.+)"', text, re.MULTILINE):
        if heading:
            groups[heading] = members = []
        else:
            members.append(entries[id])
    return groups
