from __future__ import annotations

import numpy as np
import pytest

from replication.demos.checks import DemoError, action_numbers, check_moves, replay
from replication.envs.maze import ACTIONS, Maze

MAZE = Maze(("S.#", "..G"))
WAY = np.array([2, 1, 2])  # right, down, right
CELLS = [[0, 0], [0, 1], [1, 1], [1, 2]]


def test_actions_are_numbered_in_the_order_of_the_environment() -> None:
    """Names become the numbers of the environment's actions; none give an empty array."""
    assert action_numbers(MAZE, "c", [*ACTIONS, "up"]).tolist() == [0, 1, 2, 3, 0]
    empty = action_numbers(MAZE, "c", [])
    assert empty.shape == (0,)
    assert empty.dtype == np.int64


def test_unknown_action() -> None:
    """An unknown action is refused with its step, the nearest known one and all known ones."""
    message = r"^step 2 of demo 'c': unknown action 'dwon' \(did you mean 'down'\?\); known: up, "
    with pytest.raises(DemoError, match=message):
        action_numbers(MAZE, "c", ["up", "dwon"])


def test_replay() -> None:
    """Actions lead through the states that a person finds; right claims change nothing."""
    assert replay(MAZE, "c", WAY, None).tolist() == [0, 1, 4, 5]
    assert replay(MAZE, "c", WAY, CELLS).tolist() == [0, 1, 4, 5]


@pytest.mark.parametrize(
    ("step", "claim", "message"),
    [
        (0, [1, 0], r"demo 'c' starts at \[1,0\], but the start is \[0,0\]; write \[0,0\]$"),
        (1, [1, 0], r"step 1 of demo 'c': 'right' from \[0,0\] leads to \[0,1\], but the file cl"),
        (3, [9, 9], r"step 3 .* leads to \[1,2\], but the file claims \[9,9\]; write \[1,2\] or"),
    ],
)
def test_wrong_claims(step: int, claim: list[int], message: str) -> None:
    """The first claim that differs is refused with its step and what is due."""
    claims = [*CELLS[:step], claim, *CELLS[step + 1 :]]
    with pytest.raises(DemoError, match=message):
        replay(MAZE, "c", WAY, claims)


def test_wrong_claims_at_a_wall() -> None:
    """Where a move changes nothing, the refusal says so."""
    with pytest.raises(DemoError, match=r"'up' from \[0,0\] hits a wall and stays, but the file"):
        replay(MAZE, "c", np.array([0]), [[0, 0], [0, 1]])


def test_wrong_number_of_claims() -> None:
    """There is one state more than there are actions."""
    for claims in (CELLS[:-1], [*CELLS, [1, 2]], []):
        with pytest.raises(DemoError, match=rf"3 actions and {len(claims)} states; give 4 states"):
            replay(MAZE, "c", WAY, claims)


@pytest.mark.parametrize(
    ("actions", "states", "message"),
    [
        ([], [0], "demo 'c' is empty; give it at least one action"),
        ([4], [0, 0], r"demo 'c': actions must be 0\.\.3"),
        ([-1], [0, 0], r"demo 'c': actions must be 0\.\.3"),
        ([2], [0, 99], r"leads to \[0,1\], but the file claims \[33,0\]"),
        ([2, 1, 2, 3], [0, 1, 4, 5, 4], "goes on after reaching the goal at step 3; drop the st"),
    ],
)
def test_wrong_moves(actions: list[int], states: list[int], message: str) -> None:
    """A demonstration that is empty, not one of moves, or goes beyond the goal is refused."""
    with pytest.raises(DemoError, match=message):
        check_moves(MAZE, "c", np.array(actions, dtype=np.int64), np.array(states))


def test_right_moves() -> None:
    """A demonstration that follows the moves passes, whether or not it ends at the goal."""
    check_moves(MAZE, "c", WAY, np.array([0, 1, 4, 5]))
    check_moves(MAZE, "h", np.array([0, 0]), np.array([0, 0, 0]))
