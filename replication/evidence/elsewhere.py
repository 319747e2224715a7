"""Worlds in which a reward is used that was learned in another one, and the value lost there.

The true reward of all of them is -1 a step until the goal. Every change keeps the cells, so that a
reward for pairs of state and action can be used as it is.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from replication.baselines.features import BESIDE, first_best
from replication.envs.maze import Maze
from replication.envs.tasks.moves import Moves
from replication.learning import sweeps
from replication.paper.params import Params

Array = NDArray[np.float64]

GAMMA = Params().learner.gamma

STEP = -1.0
"""The true reward of every move."""

SLIPS = (0.1, 0.2, 0.3)

CHANGES = (
    "none",
    "other starts",
    *(f"slip {chance}" for chance in SLIPS),
    "moved goal",
    "mirrored map",
    "another map",
)
"""What changes between learning and use."""


@dataclass(frozen=True, eq=False)
class World:
    """A maze, with starts and chances of its own in its table of moves."""

    maze: Maze
    moves: Moves

    @cached_property
    def best(self) -> float:
        """V*, the value of an optimal policy."""
        reward = np.full(self.moves.shape, STEP)
        return self.value(first_best(sweeps.optimal(self.moves, reward, gamma=GAMMA)))

    @cached_property
    def random(self) -> float:
        """The value of uniformly random moves."""
        return self.value(np.full(self.moves.shape, 1 / self.moves.shape[1]))

    def value(self, policy: Array) -> float:
        """Return the true value of a policy [state, action], the mean over the starts.

        It is the sum of true rewards over the policy's discounted visits.
        """
        return float(STEP * self.visits(policy).sum())

    def visits(self, policy: Array) -> Array:
        """Return the discounted visits mu [state, action] of a policy (Eq. 7)."""
        return sweeps.visits(self.moves, policy, gamma=GAMMA)

    def lost(self, policy: Array) -> float:
        """Return the value lost: (V* - V) / (V* - V_random), of means over the starts.

        It is 0 for an optimal policy, and 1 for one as bad as random moves; it may exceed 1.
        """
        return (self.best - self.value(policy)) / (self.best - self.random)

    def follow(self, weights: Array) -> Array:
        """Return the policy that is best here by a reward [state, action]: ties, the first."""
        return first_best(sweeps.optimal(self.moves, weights, gamma=GAMMA))


def worlds(maze: Maze, another: Maze) -> dict[str, World]:
    """Return the changed worlds of a maze, by the name of the change.

    ``other starts``
        Every cell from which there is a way to the goal, but for goal and start, is equally likely.
    ``slip 0.1``, ``slip 0.2``, ``slip 0.3``
        With this probability a move goes across, to either side alike.
    ``moved goal``
        See `moved_goal`.
    ``mirrored map``
        Left and right are exchanged, start and goal with them.
    ``another map``
        Another maze of the same size, start and goal.
    """
    others = (maze.distances() > 0) & (np.arange(maze.n_states) != maze.start)
    changed = {
        "none": World(maze, moves_of(maze)),
        "other starts": World(maze, moves_of(maze, starts=others / others.sum())),
        **{f"slip {chance}": World(maze, moves_of(maze, slip=chance)) for chance in SLIPS},
    }
    for name, other in {
        "moved goal": moved_goal(maze),
        "mirrored map": Maze(tuple(row[::-1] for row in maze.rows)),
        "another map": another,
    }.items():
        changed[name] = World(other, moves_of(other))
    return changed


def moved_goal(maze: Maze) -> Maze:
    """Return the maze with its goal in the cell that is farthest from both start and goal.

    That is the cell whose distance in moves to the nearer of the two is greatest; of equals the
    first.
    """
    nearer = np.minimum(maze.distances(), maze.distances(maze.start))
    cells = list("".join(maze.rows).replace("G", "."))
    cells[int(nearer.argmax())] = "G"
    width = maze.shape[1]
    return Maze(tuple("".join(cells[i : i + width]) for i in range(0, len(cells), width)))


def moves_of(maze: Maze, *, slip: float = 0.0, starts: Array | None = None) -> Moves:
    """Return a maze's table of moves.

    Parameters
    ----------
    maze
        The maze; the goal ends an episode.
    slip
        The probability that a move goes across, half of it to either side.
    starts
        The probability that an episode begins in a state, [state]; default: the maze's start.
    """
    places = np.arange(maze.n_states)
    intended = np.arange(maze.n_actions)[:, None]
    taken = np.hstack([intended, np.array(BESIDE)])  # [action, outcome]
    chance = np.array([1 - slip, slip / 2, slip / 2])
    after = maze.next_state[:, taken]
    state, action, outcome = np.indices(after.shape).reshape(3, -1)
    return Moves.of(
        (state, action, after.ravel(), chance[outcome]),
        shape=maze.next_state.shape,
        starts=(places == maze.start).astype(float) if starts is None else starts,
        ends=places == maze.goal,
    )
