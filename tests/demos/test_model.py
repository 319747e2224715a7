from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from replication.demos.checks import DemoError
from replication.demos.model import Demo, Demos, content_hash, state_action_pairs
from replication.envs.maze import Maze
from tests.demos.example import MAZE, demo


@pytest.fixture
def demos() -> Demos:
    """Return one correct and three incorrect demonstrations of two kinds."""
    return Demos(
        "tiny",
        MAZE,
        (demo("c", "correct", "right", "down", "right"),),
        (
            demo("h", "hit", "up", "down"),
            demo("d", "detour", "down", "right", "right"),
            demo("h2", "hit", "left"),
        ),
    )


def test_select(demos: Demos) -> None:
    """Kinds are listed in their order; a selection keeps them and refuses absent ones."""
    assert demos.kinds == ("hit", "detour")
    assert demos.select("all") == demos == demos.select("detour+hit")
    assert demos.select("none").incorrect == ()
    assert [d.name for d in demos.select("hit").incorrect] == ["h", "h2"]
    assert demos.select("hit").correct == demos.correct
    for wrong in ("hits", "", "hit+", "all+hit", "hit, detour"):
        with pytest.raises(DemoError, match=r"no incorrect demo .*; use all, none, hit, detour$"):
            demos.select(wrong)


def test_demos_validate_themselves() -> None:
    """Demos that a program makes are checked as those of a file are."""
    maze = Maze(("S.G",))
    right = demo("a", "correct", "right", "right", maze=maze)
    bad = demo("b", "hit", "up", maze=maze)
    stray = Demo("a", "correct", np.array([0, 1]), np.array([4]))
    jump = Demo("a", "correct", np.array([0, 2]), np.array([2]))
    Demos("t", maze, (right,), (bad,))
    for task, correct, incorrect, message in (
        ("t", (right, right), (), "two demos are named 'a'"),
        ("t", (bad,), (), "'b' is correct; its kind must be 'correct'"),
        ("t", (demo("a", "correct", "right", maze=maze),), (), r"misses the goal \[0,2\]"),
        ("t", (right,), (replace(bad, kind="correct"),), "'b' is incorrect, of kind 'correct'"),
        ("t", (), (), "no correct demo"),
        ("../t", (right,), (), "letters, digits"),
        ("t", (stray,), (), r"actions must be 0\.\.3"),
        ("t", (jump,), (), r"step 1 .* leads to \[0,1\], but the file claims \[0,2\]"),
    ):
        with pytest.raises(DemoError, match=message):
            Demos(task, maze, correct, incorrect)
    with pytest.raises(DemoError, match="one-dimensional array of integers"):
        Demo("a", "correct", np.array([0.0, 1.0]), np.array([2]))


def test_content_hash_sees_what_the_learner_sees(demos: Demos) -> None:
    """Names, task and description leave the hash alone; map, moves, kinds, order change it."""
    first, detour, last = demos.incorrect
    renamed = replace(demos, incorrect=(replace(first, name="x"), detour, last))
    same = {content_hash(each) for each in (demos, renamed)}
    same |= {content_hash(replace(demos, task="x", description="x"))}
    assert len(same) == 1
    others = [
        replace(demos, environment=Maze(("S..", "..G"))),
        replace(demos, incorrect=(replace(first, kind="bump"), detour, last)),
        replace(demos, incorrect=(detour, first, last)),
        replace(demos, incorrect=()),
        replace(demos, incorrect=(first, detour, demo("h2", "hit", "up"))),
        replace(demos, correct=(demo("c", "correct", "down", "right", "right"),)),
    ]
    assert len({content_hash(each) for each in others} | same) == len(others) + 1


def test_conflicts_are_states_with_two_actions(demos: Demos) -> None:
    """A state in which correct demos take two actions is a conflict, in one demo or in two."""
    assert demos.conflicts() == ()
    other = demo("c2", "correct", "down", "right", "right")
    assert replace(demos, correct=(*demos.correct, other), incorrect=()).conflicts() == (0,)
    hesitant = demo("c", "correct", "up", "right", "down", "right")
    assert replace(demos, correct=(hesitant,)).conflicts() == (0,)
    assert state_action_pairs(*demos.correct) == {(0, 2), (1, 1), (4, 2)}
