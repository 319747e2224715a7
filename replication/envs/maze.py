"""Mazes drawn as text: a map and its table of moves.

A map is a rectangle of the characters ``.`` free, ``#`` obstacle, ``S`` start and ``G`` goal. The
edge of the map is a wall (choice WALLS). A move into an obstacle or off the map stays in place
(choice BUMP). The table `Maze.next_state` holds the whole dynamics.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from replication.envs.environment import Environment
from replication.errors import UserError

ACTIONS = ("up", "down", "right", "left")
"""The names of the actions 0..3, in the paper's order."""

MAX_SIDE = 1_000
MAX_CELLS = 100_000

_MOVES = ((-1, 0), (1, 0), (0, 1), (0, -1))  # (row, column) of each action

_Array = TypeVar("_Array", bound=NDArray[Any])


class MazeError(UserError):
    """A map that is not a maze."""


@dataclass(frozen=True)
class Maze:
    """A maze, validated when it is made.

    Parameters
    ----------
    rows
        The lines of the map, the top one first.

    Raises
    ------
    MazeError
        If the map is empty, too large or not rectangular, has an unknown character, not exactly
        one start and one goal, or no way between them.

    Notes
    -----
    States number the cells: ``state = row * n_columns + column``, with row 0 at the top and column
    0 at the left. Obstacle cells have numbers too, but cannot be entered.

    Examples
    --------
    >>> maze = Maze.from_text('''
    ...     ..G
    ...     S#.
    ... ''')
    >>> maze.shape, maze.start, maze.goal
    ((2, 3), 3, 2)
    >>> maze.next_state[maze.start].tolist()  # up, down, right, left
    [0, 3, 3, 3]
    >>> maze.distances().tolist()
    [2, 1, 0, 3, -1, 1]
    """

    rows: tuple[str, ...]

    def __post_init__(self) -> None:
        object.__setattr__(self, "rows", _checked_rows(self.rows))
        if self.distances()[self.start] < 0:
            raise MazeError(
                f"the goal at {_place(*self.cell(self.goal))} cannot be reached from the start at "
                f"{_place(*self.cell(self.start))}; open a way through the obstacles"
            )

    def __reduce__(self) -> tuple[type[Maze], tuple[tuple[str, ...]]]:
        """Copy and pickle the map alone, so that a copy's tables are read-only too."""
        return Maze, (self.rows,)

    @classmethod
    def from_text(cls, text: str) -> Maze:
        """Read a maze from text, a row per line; margins are ignored."""
        return cls(tuple(line.strip() for line in text.strip().splitlines()))

    @property
    def kind(self) -> str:
        """Kind of environment: "maze"."""
        return "maze"

    @property
    def shape(self) -> tuple[int, int]:
        """Number of rows and columns."""
        return len(self.rows), len(self.rows[0])

    @property
    def n_states(self) -> int:
        """Number of states: all cells."""
        return len(self.rows) * len(self.rows[0])

    @property
    def n_actions(self) -> int:
        """Number of actions: 4."""
        return len(ACTIONS)

    @property
    def actions(self) -> tuple[str, ...]:
        """Names of actions."""
        return ACTIONS

    @cached_property
    def start(self) -> int:
        """State of the start."""
        return "".join(self.rows).index("S")

    @cached_property
    def goal(self) -> int:
        """State of the goal."""
        return "".join(self.rows).index("G")

    @cached_property
    def free(self) -> NDArray[np.bool_]:
        """Whether a state can be entered: bool [state], read-only."""
        return _read_only(np.array([character != "#" for character in "".join(self.rows)]))

    @cached_property
    def next_state(self) -> NDArray[np.int64]:
        """The state that an action leads to: int64 [state, action], read-only.

        Obstacle cells lead to themselves, and the goal is a cell like any other: environment and
        learner end an episode there.
        """
        n_rows, n_columns = self.shape
        states = np.arange(self.n_states)
        row, column = np.divmod(states, n_columns)
        table = np.empty((self.n_states, self.n_actions), dtype=np.int64)
        for action, (down, right) in enumerate(_MOVES):
            target = np.clip(row + down, 0, n_rows - 1) * n_columns
            target += np.clip(column + right, 0, n_columns - 1)
            table[:, action] = np.where(self.free & self.free[target], target, states)
        return _read_only(table)

    def cell(self, state: int) -> tuple[int, int]:
        """Return the row and column of a state."""
        if not 0 <= state < self.n_states:
            raise MazeError(f"there is no state {state}; states are 0..{self.n_states - 1}")
        row, column = divmod(int(state), self.shape[1])
        return row, column

    def cells(self, states: NDArray[np.int64]) -> NDArray[np.int64]:
        """Return rows and columns of states [n], int64 [n, 2]; the states are not checked."""
        return np.stack(np.divmod(states, self.shape[1]), axis=1)

    def state(self, row: int, column: int) -> int:
        """Return the state of a row and column."""
        n_rows, n_columns = self.shape
        if not (0 <= row < n_rows and 0 <= column < n_columns):
            raise MazeError(
                f"there is no cell [{row},{column}]; rows are 0..{n_rows - 1}, "
                f"columns 0..{n_columns - 1}"
            )
        return int(row) * n_columns + int(column)

    def distances(self, to: int | None = None) -> NDArray[np.int64]:
        """Return the least number of moves from each state to `to` (default: the goal).

        Returns
        -------
        int64 [state], read-only
            -1 where there is no way.
        """
        if to is None or to == self.goal:
            return self._goal_distances
        self.cell(to)
        return self._breadth_first(to)

    def replay(self, actions: Iterable[int]) -> NDArray[np.int64]:
        """Return the states that T actions visit from the start on, int64 [T + 1]."""
        states = [self.start]
        for action in actions:
            states.append(self.next_state.item(states[-1], action))
        return np.array(states, dtype=np.int64)

    def goal_step(self, actions: Iterable[int]) -> int | None:
        """Return how many of the actions it takes to reach the goal; None if they do not."""
        at_goal = np.flatnonzero(self.replay(actions) == self.goal)
        return int(at_goal[0]) if at_goal.size else None

    def describe(self) -> dict[str, Any]:
        """Return plain JSON values."""
        return {
            "kind": self.kind,
            "map": list(self.rows),
            "actions": list(self.actions),
            "start": list(self.cell(self.start)),
            "goal": list(self.cell(self.goal)),
        }

    @cached_property
    def _goal_distances(self) -> NDArray[np.int64]:
        return self._breadth_first(self.goal)

    def _breadth_first(self, origin: int) -> NDArray[np.int64]:
        neighbours = self.next_state.tolist()  # each move can be reversed: predecessors as well
        distance = [-1] * self.n_states
        distance[origin] = 0
        queue = deque([origin])
        while queue:
            state = queue.popleft()
            for neighbour in neighbours[state]:
                if distance[neighbour] < 0:
                    distance[neighbour] = distance[state] + 1
                    queue.append(neighbour)
        return _read_only(np.array(distance, dtype=np.int64))


def as_maze(environment: Environment) -> Maze:
    """Return the environment if it is a maze; raises `MazeError` if it is not."""
    if not isinstance(environment, Maze):
        raise MazeError(
            f"a maze is needed here, but this environment is of kind {environment.kind!r}"
        )
    return environment


def _checked_rows(rows: Sequence[str]) -> tuple[str, ...]:
    if isinstance(rows, str) or not all(isinstance(row, str) for row in rows):
        raise MazeError("rows must be a sequence of lines; use Maze.from_text for a single text")
    rows = tuple(rows)
    if not rows or not rows[0]:
        raise MazeError("the map is empty; draw at least a start 'S' and a goal 'G'")
    if max(len(rows), *map(len, rows)) > MAX_SIDE or len(rows) * len(rows[0]) > MAX_CELLS:
        raise MazeError(
            f"the map has {len(rows)} lines of up to {max(map(len, rows))} characters; "
            f"keep it within {MAX_SIDE} a side and {MAX_CELLS} cells"
        )
    for index, row in enumerate(rows):
        if len(row) != len(rows[0]):
            raise MazeError(
                f"map line {index + 1} has {len(row)} characters, but line 1 has {len(rows[0])}; "
                "make all lines equally long"
            )
        for column, character in enumerate(row):
            if character not in ".#SG":
                raise MazeError(
                    f"unknown character {character!r} at {_place(index, column)}; "
                    "use '.' free, '#' obstacle, 'S' start, 'G' goal"
                )
    for character, name in (("S", "start"), ("G", "goal")):
        places = [
            _place(index, column)
            for index, row in enumerate(rows)
            for column, drawn in enumerate(row)
            if drawn == character
        ]
        if not places:
            raise MazeError(f"the map has no {name}; mark one cell with {character!r}")
        if len(places) > 1:
            raise MazeError(
                f"the map has {len(places)} {name}s {character!r}, at {places[0]} and at "
                f"{places[1]}; keep one"
            )
    return rows


def _place(row: int, column: int) -> str:
    return f"map line {row + 1}, column {column + 1}"  # counted from 1, as editors do


def _read_only(array: _Array) -> _Array:
    array.setflags(write=False)
    return array
