"""Asking what a finished demonstration shows: keys come in, and text for the screen goes out."""

from __future__ import annotations

import textwrap
from collections.abc import Sequence


class Question:
    """Asks for a kind, of which some are offered.

    Parameters
    ----------
    offered
        Kinds to choose from; the first one is chosen at first.
    """

    def __init__(self, offered: Sequence[str]) -> None:
        self._offered = offered
        self._chosen, self._typed = 0, ""

    @property
    def answer(self) -> str:
        """The kind that is typed, or else chosen; empty if there is none yet."""
        return self._typed.strip() or (self._offered[self._chosen] if self._offered else "")

    def press(self, key: str) -> None:
        """Take a key, see :meth:`replication.recording.recorder.Recorder.press`."""
        if key in ("up", "down") and self._offered:
            self._typed = ""
            self._chosen = (self._chosen + (1 if key == "down" else -1)) % len(self._offered)
        elif key == "back":
            self._typed = self._typed[:-1]
        elif len(key) == 1 and key.isprintable():
            self._typed += key

    def lines(self, columns: int) -> list[str]:
        """Return the question as text, with the answers that are offered."""
        typing = bool(self._typed) or not self._offered
        answers = [
            f"{'>' if number == self._chosen and not typing else ' '} {kind}"
            for number, kind in enumerate(self._offered)
        ]
        choose = "Up and down choose, or type another kind of mistake. " if self._offered else ""
        return [
            "What does this show?" if self._offered else "What kind of mistake is this?",
            *answers,
            f"{'>' if typing else ' '} {self._typed}_",
            *wrap(f"{choose}Enter keeps it, Esc goes back.", columns),
        ]


def wrap(text: str, columns: int) -> list[str]:
    """Return text as lines, at least one."""
    return textwrap.wrap(text, max(columns, 20)) or [""]
