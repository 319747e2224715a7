from __future__ import annotations

from typing import Any

import gymnasium
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from replication import TabularTask, TaskError

CORRIDOR = [[0, 1], [0, 2], [2, 2]]
"""Three states in a row: action 0 leads back, action 1 on."""


@st.composite
def tables(draw: st.DrawFn) -> list[list[int]]:
    """Draw a table of next states."""
    n_states, n_actions = draw(st.integers(1, 6)), draw(st.integers(1, 4))
    row = st.lists(st.integers(0, n_states - 1), min_size=n_actions, max_size=n_actions)
    return draw(st.lists(row, min_size=n_states, max_size=n_states))


@given(tables())
def test_next_states_and_their_probabilities_are_the_same_task(table: list[list[int]]) -> None:
    """A table of next states, of probabilities 0 and 1, and Gymnasium's form have equal moves."""
    n = len(table)
    chances = np.array([[[float(s == to) for s in range(n)] for to in row] for row in table])
    listed = {
        s: {a: [(1.0, to, 0.0, False)] for a, to in enumerate(row)} for s, row in enumerate(table)
    }
    tasks = [TabularTask(moves) for moves in (table, chances, listed)]
    assert len({task.describe()["digest"] for task in tasks}) == 1
    assert not any(task.is_random for task in tasks)


def test_actions_lead_where_the_table_says() -> None:
    """A replay follows the table, and an episode ends in the first terminal state."""
    task = TabularTask(CORRIDOR, terminal=[2], actions=("back", "on"))
    assert task.replay([1, 0, 1, 1]).tolist() == [0, 1, 0, 1, 2]
    assert task.walk([1, 0, 1, 1]).end == 4
    assert task.walk([1]).end is None
    assert (task.n_states, task.n_actions, task.actions) == (3, 2, ("back", "on"))


def test_outcomes_of_gymnasium_are_added_up() -> None:
    """Outcomes that lead to the same state are one; where one ends an episode, all do."""
    env = gymnasium.make("FrozenLake-v1", is_slippery=True)
    table = TabularTask(env.unwrapped.P).table  # type: ignore[attr-defined]
    assert table.after(0, 0).tolist() == [0, 4]
    assert table.probabilities[:2].tolist() == pytest.approx([2 / 3, 1 / 3])
    assert np.flatnonzero(table.ends).tolist() == [5, 7, 11, 12, 15]


@pytest.mark.parametrize(
    ("start", "starts"), [(1, [1]), ([0, 1], [0, 1]), ([0.25, 0.75, 0.0], [0, 1])]
)
def test_start_is_a_state_or_several(start: Any, starts: list[int]) -> None:
    """A start is one state, equally likely ones, or a probability for each."""
    task = TabularTask(CORRIDOR, start=start, terminal=[2])
    assert task.table.starts.tolist() == starts
    assert task.is_random == (len(starts) > 1)


@pytest.mark.parametrize(
    ("states", "actions", "fault"),
    [
        ([0, 1, 2], [1, 1], None),
        ([0, 1, 2, 2], [1, 1, 1], "it goes on after the episode has ended at step 2"),
        ([1, 2], [1], "it starts in state 1, but episodes start in 0"),
        ([0, 2], [1], "step 1: 'on' in state 0 leads to 1, never to 2"),
        ([0, 3], [1], "step 1 leads to state 3; states are 0..2"),
        ([0, 1], [2], "step 1 takes action 2; actions are 0..1"),
        ([0, 1], [1, 1], "there are 2 actions and 2 states; give 3 states"),
    ],
)
def test_what_cannot_have_been_is_told_with_its_step(
    states: list[int], actions: list[int], fault: str | None
) -> None:
    """An episode is checked against the table, step by step."""
    task = TabularTask(CORRIDOR, terminal=[2], actions=("back", "on"))
    found = task.fault(np.array(states), np.array(actions))
    assert found == fault or (found is not None and fault is not None and found.startswith(fault))


def test_random_moves_are_refused_only_where_impossible() -> None:
    """Where a move has several outcomes each of them may be; a replay needs the states."""
    task = TabularTask(np.array([[[0.5, 0.5]], [[0.0, 1.0]]]), terminal=[1])
    assert task.is_random
    assert task.fault(np.array([0, 0, 1]), np.array([0, 0])) is None
    assert "never to 0" in str(TabularTask([[1], [1]]).fault(np.array([0, 0]), np.array([0])))
    with pytest.raises(TaskError, match="give the states as well"):
        task.replay([0])


@pytest.mark.parametrize(
    ("moves", "options", "message"),
    [
        ([[0, 3]], {}, "moves: there is no state 3; states are 0..0"),
        ([[0.5, 1.0]], {}, r"moves must be integers .*not float64 \[1, 2\]"),
        ([], {}, "moves must be integers"),
        ({}, {}, "moves are no table"),
        ([[0, 1], [1]], {}, "moves are no table"),
        ({0: {0: [(1.0, 0, False)]}}, {}, "moves are no table"),
        ([[[0.5, 0.4]], [[0.0, 1.0]]], {}, r"state 0, action 0 must sum to 1, not 0\.9"),
        ([[[1.5, -0.5]], [[0.0, 1.0]]], {}, "probabilities must"),
        ([[[float("nan"), 1.0]], [[0.0, 1.0]]], {}, "probabilities must"),
        (CORRIDOR, {"terminal": [3]}, "terminal: there is no state 3"),
        (CORRIDOR, {"terminal": [0]}, "start: an episode would end in state 0 at once"),
        (CORRIDOR, {"start": [1, 0, 0]}, "start names a state twice; write probabilities as"),
        (CORRIDOR, {"start": 7}, "start: there is no state 7"),
        (CORRIDOR, {"start": "a"}, "start must be a state, several states, or 3 probabilities"),
        (CORRIDOR, {"start": [0.5, 0.2, 0.2]}, "the starts must sum to 1"),
        (CORRIDOR, {"actions": ["on"]}, "names 1 actions; the environment has 2"),
        (CORRIDOR, {"actions": ["on", "on"]}, "names 1 actions"),
    ],
)
def test_a_table_that_is_none_is_refused_in_one_line(
    moves: Any, options: dict[str, Any], message: str
) -> None:
    """What is wrong with a table is said with its place."""
    with pytest.raises(TaskError, match=message) as caught:
        TabularTask(moves, **options)
    assert "\n" not in str(caught.value)


def test_one_end_needs_no_list() -> None:
    """A single terminal state may stand for itself; a replay knows no other actions."""
    task = TabularTask(CORRIDOR, terminal=2)
    assert task.walk([1, 1]).end == 2
    with pytest.raises(TaskError, match=r"step 2 takes action 7; actions are 0\.\.1"):
        task.replay([1, 7])
    assert repr(task) == "<TabularTask of 3 states and 2 actions>"


def test_description_tells_tables_apart() -> None:
    """Another move, end or start has another digest; the same table has the same one."""
    described = [
        TabularTask(moves, **options).describe()["digest"]
        for moves, options in (
            (CORRIDOR, {"terminal": [2]}),
            (CORRIDOR, {}),
            ([[0, 1], [1, 2], [2, 2]], {"terminal": [2]}),
            (CORRIDOR, {"terminal": [2], "start": 1}),
        )
    ]
    assert len(set(described)) == 4
    assert described[0] == TabularTask(CORRIDOR, terminal=[2]).describe()["digest"]
