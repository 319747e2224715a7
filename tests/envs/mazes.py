"""Mazes for tests."""

from __future__ import annotations

from hypothesis import assume
from hypothesis import strategies as st

from replication.envs.maze import Maze, MazeError

ROWS = ("...#G", ".#...", "S..#.")  # not square
CORRIDOR = ("S...G",)


@st.composite
def mazes(draw: st.DrawFn, most: int = 7) -> Maze:
    """Any small maze, of any shape, with sides up to `most`."""
    n_columns = draw(st.integers(1, most))
    n_rows = draw(st.integers(1 if n_columns > 1 else 2, most))
    size = n_rows * n_columns
    cells = draw(st.lists(st.sampled_from("...#"), min_size=size, max_size=size))
    start, goal = draw(st.permutations(range(size)))[:2]
    cells[start], cells[goal] = "S", "G"
    try:
        return Maze(tuple("".join(cells[i : i + n_columns]) for i in range(0, size, n_columns)))
    except MazeError as error:
        assume("cannot be reached" not in str(error))
        raise
