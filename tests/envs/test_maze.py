from __future__ import annotations

import copy
import pickle
import re

import numpy as np
import pytest
from hypothesis import given, settings

from replication.envs.maze import ACTIONS, Maze, MazeError
from tests.envs.mazes import CORRIDOR, ROWS, mazes


def moved(rows: tuple[str, ...], row: int, column: int, action: str) -> tuple[int, int]:
    """Apply the rule of a move in plain words: the oracle of the table."""
    if rows[row][column] == "#":
        return row, column
    down, right = {"up": (-1, 0), "down": (1, 0), "right": (0, 1), "left": (0, -1)}[action]
    there = row + down, column + right
    inside = 0 <= there[0] < len(rows) and 0 <= there[1] < len(rows[0])
    return there if inside and rows[there[0]][there[1]] != "#" else (row, column)


@settings(max_examples=50, deadline=None)
@given(mazes())
def test_table_is_the_rule(maze: Maze) -> None:
    """Each entry of the table is the plain rule of a move; obstacles lead to themselves."""
    assert maze.next_state.shape == (maze.n_states, maze.n_actions)
    for state in range(maze.n_states):
        assert maze.state(*maze.cell(state)) == state
        assert maze.cells(np.array([state])).tolist() == [list(maze.cell(state))]
        for number, action in enumerate(ACTIONS):
            there = moved(maze.rows, *maze.cell(state), action)
            assert maze.next_state[state, number] == maze.state(*there)


@settings(max_examples=50, deadline=None)
@given(mazes())
def test_distances_solve_the_shortest_path_equations(maze: Maze) -> None:
    """A distance is one more than the least among the neighbours; the way back is as long."""
    distances = maze.distances()
    assert distances[maze.goal] == 0
    assert distances[maze.start] == maze.distances(maze.start)[maze.goal] > 0
    assert (distances[~maze.free] == -1).all()
    for state in np.flatnonzero(maze.free):
        near = [d for d in distances[maze.next_state[state]] if d >= 0]
        if distances[state] > 0:
            assert distances[state] == min(near) + 1
        elif state != maze.goal:
            assert not near


def test_worked_example() -> None:
    """A map solved by hand: shape, places, moves and distances."""
    maze = Maze(ROWS)
    assert maze.shape == (3, 5)
    assert (maze.n_states, maze.n_actions) == (15, 4)
    assert maze.cell(maze.start) == (2, 0)
    assert maze.cell(maze.goal) == (0, 4)
    assert maze.distances().reshape(3, 5).tolist() == [
        [6, 5, 4, -1, 0],
        [7, -1, 3, 2, 1],
        [6, 5, 4, -1, 2],
    ]
    assert maze.replay([3, 2, 2]).tolist() == [10, 10, 11, 12]


def test_corridor() -> None:
    """In a corridor of one line, up and down stay in place."""
    maze = Maze(CORRIDOR)
    assert maze.next_state.tolist() == [
        [0, 0, 1, 0],
        [1, 1, 2, 0],
        [2, 2, 3, 1],
        [3, 3, 4, 2],
        [4, 4, 4, 3],
    ]
    standing = Maze(tuple(CORRIDOR[0]))
    assert standing.next_state[0].tolist() == [0, 1, 0, 0]


@pytest.mark.parametrize(
    ("rows", "message"),
    [
        ((), "the map is empty"),
        (("",), "the map is empty"),
        (("S.", "..G"), "map line 2 has 3 characters, but line 1 has 2"),
        (("S..", ".xG"), "unknown character 'x' at map line 2, column 2"),
        (("S..", ".\nG"), r"unknown character '\n' at map line 2, column 2"),
        (("...", "..G"), "no start; mark one cell with 'S'"),
        (("S..", "..."), "no goal; mark one cell with 'G'"),
        (("S..", "S.G"), "2 starts 'S', at map line 1, column 1 and at map line 2, column 1"),
        (("S.G", "..G"), "2 goals 'G', at map line 1, column 3 and at map line 2, column 3"),
        (
            ("S#G", ".#."),
            "the goal at map line 1, column 3 cannot be reached from the start at map",
        ),
        (("S" + "." * 999 + "G",), "keep it within 1000 a side and 100000 cells"),
        (("S" + "." * 498 + "G",) * 201, "keep it within 1000 a side and 100000 cells"),
        ("SG", "use Maze.from_text"),
        ((1, 2), "use Maze.from_text"),
    ],
)
def test_refusals(rows: tuple[str, ...], message: str) -> None:
    """What is not a maze is refused in one line that names the place and the fix."""
    with pytest.raises(MazeError, match=re.escape(message)) as caught:
        Maze(rows)
    assert "\n" not in str(caught.value)


def test_largest_maze() -> None:
    """A maze at the limit of the size is accepted and solved."""
    rows = ["." * 1000] * 100
    maze = Maze(("S" + rows[0][1:], *rows[1:-1], rows[-1][1:] + "G"))
    assert maze.distances()[maze.start] == 999 + 99


def test_from_text_ignores_margins() -> None:
    """Blank lines around a map and its indentation do not matter; equal maps are equal mazes."""
    maze = Maze.from_text("\n    ...#G\n    .#...\n    S..#.\n  ")
    assert maze == Maze(ROWS) == Maze(list(ROWS))  # type: ignore[arg-type]
    assert hash(maze) == hash(Maze(ROWS))


@pytest.mark.parametrize("duplicate", [copy.deepcopy, lambda x: pickle.loads(pickle.dumps(x))])
def test_tables_are_read_only(duplicate) -> None:  # type: ignore[no-untyped-def]
    """Nobody can change the tables of a maze, nor those of its copies."""
    maze = Maze(ROWS)
    assert maze.next_state is maze.next_state
    again = duplicate(maze)
    assert again == maze
    for table in (again.next_state, again.free, again.distances(), again.distances(0)):
        with pytest.raises(ValueError, match="read-only"):
            table[0] = 0


def test_unknown_places() -> None:
    """States and cells outside of the map are refused, negative ones too."""
    maze = Maze(ROWS)
    for state in (-1, 15):
        with pytest.raises(MazeError, match=r"states are 0\.\.14"):
            maze.cell(state)
        with pytest.raises(MazeError, match=r"states are 0\.\.14"):
            maze.distances(state)
    for row, column in ((-1, 0), (0, -1), (3, 0), (0, 5)):
        with pytest.raises(MazeError, match=r"rows are 0\.\.2, columns 0\.\.4"):
            maze.state(row, column)
