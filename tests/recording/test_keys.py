from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from replication.errors import UserError
from replication.recording.keys import PLAIN_KEYS, action_keys, legend, split_keys


@given(st.text(max_size=30))
def test_whatever_is_sent_becomes_keys(text: str) -> None:
    """Any text is split without loss of what may still become a key."""
    keys, rest = split_keys(text)
    assert text.endswith(rest)
    assert all(keys)
    assert rest == "" or rest.startswith("\x1b")


@given(st.lists(st.sampled_from(["\x1b[A", "\x1bOB", "x", "\r", "\x1b[1;5D", "é"])), st.data())
def test_keys_that_come_in_pieces_are_the_same_keys(sent: list[str], data: st.DataObject) -> None:
    """It does not matter where a read ends."""
    text = "".join(sent)
    cut = data.draw(st.integers(0, len(text)))
    first, rest = split_keys(text[:cut])
    second, _ = split_keys(rest + text[cut:])
    assert first + second == split_keys(text)[0]


def test_arrows_and_letters_are_not_confused() -> None:
    """The letters with which the sequences of arrow keys end are keys of their own."""
    assert split_keys("ABCD\x1b[A\x7f\x1b[3~") == (
        ["A", "B", "C", "D", "up", "back", "unknown"],
        "",
    )


def test_each_action_has_a_key() -> None:
    """Actions are taken by number, and those named like an arrow, by the arrow, too."""
    assert action_keys(["Left", "wait", "north"]) == {"0": 0, "1": 1, "2": 2, "left": 0, "up": 2}


def test_commands_are_no_actions() -> None:
    """However many actions there are, the commands keep their keys; too many are refused."""
    most = [str(number) for number in range(len(PLAIN_KEYS))]
    assert set(action_keys(most)) & set("urpqw") == set()
    with pytest.raises(UserError, match=r"^there are 58 actions, but keys for 57 only; .*CSV"):
        action_keys([*most, "more"])


def test_the_legend_keeps_keys_and_meanings_together() -> None:
    """In a narrow terminal no line breaks between a key and what it does."""
    lines = legend(["up", "turn round"], 24)
    assert lines[:2] == ["arrow keys   0 up", "1 turn round"]
    assert "Enter finish" in " ".join(lines)
    assert max(map(len, lines)) <= 24
