"""Keys: which of them a terminal has sent, and which action each of them takes."""

from __future__ import annotations

import re
import string
from collections.abc import Sequence

from replication.errors import UserError, clip
from replication.recording.question import wrap

ARROWS = {
    "up": ("up", "north", "forward"),
    "down": ("down", "south", "backward"),
    "left": ("left", "west"),
    "right": ("right", "east"),
}
"""The actions that an arrow key takes, if the environment has one of these names."""

COMMANDS = {
    "u": "undo",
    "r": "start again",
    "p": "replay",
    "Enter": "finish",
    "q": "save and quit",
}
PLAIN_KEYS = string.digits + "".join(c for c in string.ascii_letters if c not in "urpqw")
"""The keys of the actions 0, 1, 2 ...; the other letters are commands."""

NAMES = {"\r": "enter", "\n": "enter", "\x7f": "back", "\x08": "back", "\x1b": "escape"}
CODES = dict(zip("ABCD", ("up", "down", "right", "left"), strict=True))
"""What control characters are called, and the ends of arrow keys' sequences."""

_KEY = re.compile(r"\x1b[\[O][0-9;]*([A-Za-z~])|(\x1b\x1b|.)", flags=re.DOTALL)
_BEGUN = re.compile(r"\x1b([\[O][0-9;]*)?")


def action_keys(actions: Sequence[str]) -> dict[str, int]:
    """Return the number of the action that each key takes.

    Raises
    ------
    UserError
        If there are more actions than keys.

    Examples
    --------
    >>> action_keys(["north", "wait"])
    {'0': 0, '1': 1, 'up': 0}
    """
    if len(actions) > len(PLAIN_KEYS):
        raise UserError(
            f"there are {len(actions)} actions, but keys for {len(PLAIN_KEYS)} only; write a CSV "
            "file for `read_csv`, or give their numbers to `make_demos`"
        )
    keys = dict(zip(PLAIN_KEYS, range(len(actions)), strict=False))
    lower = [action.lower() for action in actions]
    for key, names in ARROWS.items():
        for name in set(names) & set(lower):
            keys[key] = lower.index(name)
    return keys


def legend(actions: Sequence[str], columns: int) -> list[str]:
    """Return lines that say what each key does; no line breaks between a key and its meaning."""
    arrows = ["arrow keys"] if action_keys(actions).keys() & ARROWS.keys() else []
    moves = [f"{key} {clip(name, 20)}" for key, name in zip(PLAIN_KEYS, actions, strict=False)]
    commands = [f"{key} {what}" for key, what in COMMANDS.items()]
    blank = "\N{NO-BREAK SPACE}"
    rows = (
        "   ".join(item.replace(" ", blank) for item in items)
        for items in ([*arrows, *moves], commands)
    )
    return [line.replace(blank, " ") for row in rows for line in wrap(row, columns)]


def split_keys(text: str) -> tuple[list[str], str]:
    r"""Return the keys that a terminal has sent, and what may be the begin of another one.

    Examples
    --------
    >>> split_keys("a\x1b[A\x1bOB\r\x1b[1;5C\x1b[")
    (['a', 'up', 'down', 'enter', 'right'], '\x1b[')
    """
    keys, at = [], 0
    while at < len(text) and not _BEGUN.fullmatch(text, at):
        match = _KEY.match(text, at)
        assert match is not None
        keys.append(CODES.get(match[1], "unknown") if match[1] else NAMES.get(match[2], match[2]))
        at = match.end()
    return keys, text[at:]
