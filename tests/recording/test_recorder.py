from __future__ import annotations

import re

import gymnasium
import pytest
from hypothesis import given
from hypothesis import strategies as st

from replication import Demos, Maze
from replication.errors import UserError
from replication.recording.recorder import Recorder
from replication.recording.worlds import as_world
from tests.recording.test_worlds import MAZE, Drifting

CORRECT = ["right"] * 4 + ["up"] * 2 + ["enter", "enter"]
HIT = ["down", "right", "enter", *"hit", "enter"]
KEYS = ["up", "down", "left", "right", "enter", "back", "escape", "unknown", *"0123urpqw\ufffdhit-"]


def recorder(*keys: str, demos: Demos | None = None) -> Recorder:
    """Record in a small maze."""
    new = Recorder(as_world(MAZE), "mine", demos)
    for key in keys:
        new.press(key)
    return new


def shown(recorder: Recorder, columns: int = 80, lines: int = 24) -> str:
    """Return the screen without colours."""
    return re.sub(r"\x1b\[[0-9;]*m", "", recorder.screen(columns, lines))


def finished(recorder: Recorder) -> list[tuple[str, str, int]]:
    """Return name, kind and length of each demonstration."""
    demos = recorder.demos
    all_demos = (*demos.correct, *demos.incorrect) if demos else ()
    return [(demo.name, demo.kind, len(demo.actions)) for demo in all_demos]


def test_the_screen_says_all() -> None:
    """It has the task, the map with the way, the step, the state, what happened, and the keys."""
    assert shown(recorder("right", "down")).splitlines() == [
        "mine: nothing yet",
        "",
        ". . . . G",
        ". # # . .",
        "S @ . . .",
        "",
        "step 2, state 11 [2,1]",
        "down: hits a wall and stays",
        "",
        "arrow keys   0 up   1 down   2 right   3 left",
        "u undo   r start again   p replay   Enter finish   q save and quit",
    ]


def test_two_kinds_are_recorded() -> None:
    """Names are unique, and kinds that were used are offered."""
    end = recorder(*CORRECT, *HIT, *"20", "enter", "enter", *CORRECT)
    assert finished(end) == [
        ("correct-1", "correct", 6),
        ("correct-2", "correct", 6),
        ("hit-1", "hit", 2),
        ("hit-2", "hit", 2),
    ]
    assert shown(end).startswith("mine: 2 correct, 2 hit\n")


def test_what_was_there_is_kept() -> None:
    """Recording goes on from given demonstrations; their names are not taken again."""
    demos = recorder(*CORRECT, *HIT).demos
    assert demos is not None
    more = recorder(*HIT, demos=demos).demos
    assert more is not None
    assert more.correct == demos.correct
    assert [demo.name for demo in more.incorrect] == ["hit-1", "hit-2"]


def test_steps_are_taken_back() -> None:
    """Undo goes back as far as the start, from the goal, too."""
    assert "step 1, state 11" in shown(recorder("right", "right", "u"))
    assert "there is nothing to undo" in shown(recorder("right", "back", "back"))
    assert finished(recorder(*CORRECT[:6], "u", "right", "up", "enter", "enter")) == [
        ("correct-1", "correct", 7)
    ]


def test_starting_again_forgets_the_way() -> None:
    """The next demonstration has nothing of what was dropped."""
    assert finished(recorder("down", "r", *CORRECT)) == [("correct-1", "correct", 6)]


def test_nothing_follows_the_goal() -> None:
    """A step behind the goal is refused, with what can be done."""
    assert "it is over here: Enter finishes" in shown(recorder(*CORRECT[:6], "up"))


def test_the_first_demonstration_is_correct() -> None:
    """A mistake is not accepted before there is a correct demonstration, as no file could hold it.

    It is not lost either: the way is still there.
    """
    early = recorder("right", "enter")
    assert "the first demonstration must be correct" in shown(early)
    assert "step 1" in shown(early)
    assert "there is no correct demo" in shown(recorder(*CORRECT[:7], *"hit", "enter"))
    assert "take a step first" in shown(recorder("enter"))


@pytest.mark.parametrize("kind", ["Hit", "all", "none", "1st", "a_b"])
def test_a_kind_that_does_not_fit_is_asked_for_again(kind: str) -> None:
    """The rule is told, and the recording goes on from there."""
    asked = recorder(*CORRECT, "right", "enter", *kind, "enter")
    assert "use small letters, digits and '-', a letter first" in shown(asked, 200)
    for key in (*["back"] * len(kind), *"hit", "enter"):
        asked.press(key)
    assert finished(asked)[-1] == ("hit-1", "hit", 1)


def test_a_way_that_misses_the_goal_is_not_correct() -> None:
    """Correct is not offered, and refused if it is typed."""
    asked = recorder(*CORRECT, "right", "enter")
    assert "What kind of mistake is this?" in shown(asked)
    assert "type what kind" in shown(recorder(*CORRECT, "right", "enter", "enter"))
    typed = recorder(*CORRECT, "right", "enter", *"correct", "enter")
    assert "misses the goal" in shown(typed, 200)


def test_escape_goes_back_to_the_way() -> None:
    """A demonstration can be continued after it was almost finished."""
    assert "step 2" in shown(recorder(*CORRECT, "right", "enter", "escape", "right"))


def test_nothing_is_lost_if_saving_fails() -> None:
    """The reason is told; once it is gone, the same demonstration is saved."""
    saved: list[Demos] = []
    full = True

    def save(demos: Demos) -> None:
        if full:
            raise UserError("the disk is full")
        saved.append(demos)

    new = Recorder(as_world(MAZE), "mine", save=save)
    for key in CORRECT:
        new.press(key)
    assert "the disk is full" in shown(new)
    assert new.demos is None
    full = False
    new.press("enter")
    assert saved == [new.demos]
    assert finished(new) == [("correct-1", "correct", 6)]


def test_a_replay_shows_each_step() -> None:
    """It begins at the start and ends where the recording is, or was finished last."""
    watched = recorder("right", "right", "p")
    seen = [shown(watched)]
    while watched.pause is not None:
        watched.tick()
        seen.append(shown(watched))
    steps = [re.findall(r"step \d", screen)[0] for screen in seen]
    assert steps == ["step 0", "step 1", "step 2", "step 2"]
    assert "replay: step 1 of 2" in seen[1]
    last = recorder(*CORRECT, "p")
    assert "replay: step 0 of 6" in shown(last)
    assert "there is nothing to replay" in shown(recorder("p"))


def test_any_key_ends_a_replay() -> None:
    """The key does nothing else."""
    ended = recorder("right", "p", "u")
    assert ended.pause is None
    assert "step 1, state 11" in shown(ended)


def test_unfinished_steps_are_dropped_only_if_one_insists() -> None:
    """Quitting asks once; another key between the two withdraws it."""
    assert recorder("q").done
    assert not recorder("right", "q").done
    assert "1 step is not finished: Enter finishes it, q drops it" in shown(recorder("right", "q"))
    assert recorder("right", "q", "q").done
    assert not recorder("right", "q", "u", "down", "q").done


@given(st.lists(st.sampled_from(KEYS), max_size=60))
def test_no_keys_are_too_much(keys: list[str]) -> None:
    """Whatever is pressed, there is a screen, and what is finished is valid."""
    end = recorder()
    for key in keys:
        end.press(key)
        end.tick()
        assert shown(end).startswith("mine: ")


@given(st.integers(1, 100), st.integers(1, 40), st.sampled_from([[], CORRECT, [*CORRECT[:7]]]))
def test_every_terminal_is_large_enough(columns: int, lines: int, keys: list[str]) -> None:
    """The screen never has more lines than the terminal; some lines show the agent."""
    screen = shown(recorder(*keys), columns, lines)
    assert len(screen.splitlines()) <= lines
    if keys and keys[-1] == "enter" and len(keys) < len(CORRECT):
        assert lines < 7 or "> correct" in screen
    else:
        assert lines < 3 or "@" in screen


def test_a_large_maze_leaves_room_for_the_keys() -> None:
    """In a usual terminal a part of the maze is shown rather than none of the keys."""
    tall = Recorder(as_world(Maze(("S", *"." * 40, "G"))), "tall")
    assert "Enter finish" in shown(tall, 80, 24)
    assert "Enter finish" not in shown(tall, 80, 14)


def test_gymnasium_is_recorded() -> None:
    """A way to the goal and one into a hole are kept as they were."""
    new = Recorder(as_world(gymnasium.make("FrozenLake-v1", is_slippery=False)), "ice")
    for key in [*"112122", "enter", "enter", "right", "down", "enter", *"hole", "enter"]:
        new.press(key)
    assert finished(new) == [("correct-1", "correct", 6), ("hole-1", "hole", 2)]
    assert new.demos is not None
    assert new.demos.incorrect[0].states.tolist() == [0, 1, 5]


def test_where_no_step_can_be_undone_it_begins_anew() -> None:
    """The reason is told, and nothing of the old way remains."""
    new = Recorder(as_world(Drifting()), "drift")
    for key in "00u":
        new.press(key)
    assert "does not repeat itself" in shown(new)
    assert "step 0" in shown(new)


def test_an_only_way_is_drawn_in_colour() -> None:
    """The agent stands out where a terminal has colours."""
    assert "\x1b[1;31m@\x1b[0m" in Recorder(as_world(Maze(("S.G",))), "m").screen(80, 24)
