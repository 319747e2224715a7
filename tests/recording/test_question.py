from __future__ import annotations

from replication.recording.question import Question


def asked(offered: list[str], *keys: str) -> Question:
    """Ask, and press keys."""
    question = Question(offered)
    for key in keys:
        question.press(key)
    return question


def test_arrows_choose() -> None:
    """The arrow keys go through what is offered, and round at its ends."""
    offered = ["correct", "hit", "detour"]
    assert asked(offered).answer == "correct"
    assert asked(offered, "down").answer == "hit"
    assert asked(offered, "up").answer == "detour"
    assert asked(offered, "down", "down", "down").answer == "correct"


def test_what_is_typed_comes_first() -> None:
    """A typed kind is taken instead, until it is erased or an arrow chooses again."""
    assert asked(["correct"], *"hit").answer == "hit"
    assert asked(["correct"], *"hi", "back", "back").answer == "correct"
    assert asked(["correct", "hit"], *"x", "down").answer == "hit"
    assert asked(["correct"], *" ").answer == "correct"


def test_without_an_offer_one_must_type() -> None:
    """Nothing is the answer if nothing is offered or typed; keys that are no text do not matter."""
    assert asked([], "down", "up", "left", "\x00", "back").answer == ""
    assert asked([], *"hit").answer == "hit"


def test_the_mark_is_at_the_answer() -> None:
    """The line that Enter would take is marked."""
    for question in (asked(["correct", "hit"], "down"), asked(["hit"], *"new"), asked([], *"a")):
        (marked,) = [line for line in question.lines(80) if line.startswith(">")]
        assert marked.strip("> _") == question.answer
