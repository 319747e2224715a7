"""Small mazes in which every policy can be tried: slow oracles for methods that plan."""

from __future__ import annotations

from itertools import product
from typing import Any

import numpy as np
from numpy.typing import NDArray

from replication.baselines import Problem, table_of
from replication.demos.maze_expert import demonstrate
from replication.demos.model import Demos
from replication.envs.maze import Maze

Array = NDArray[np.float64]

GAMMA = 0.9
TINY = ("...", ".S.", "..G")


def tiny_demos(rows: tuple[str, ...] = ("..", "SG")) -> Demos:
    """Return the demonstrations of a tiny maze."""
    return demonstrate("tiny", Maze(rows))


def problem_of(demos: Demos, *, incorrect: bool = False) -> Problem:
    """Return the problem of a maze's demonstrations."""
    moves = table_of(demos.environment)
    assert moves is not None
    return Problem(moves, demos.correct, demos.incorrect if incorrect else (), GAMMA)


def all_visits(demos: Demos) -> Array:
    """Return mu of every deterministic policy of a maze, [policy, state * action], each once."""
    maze: Any = demos.environment
    n_states, n_actions = maze.next_state.shape
    open_states = [s for s in range(n_states) if s != maze.goal]
    found = set()
    for choice in product(range(n_actions), repeat=len(open_states)):
        policy = dict(zip(open_states, choice, strict=True))
        mu = np.zeros((n_states, n_actions))
        state, left = maze.start, 1.0
        while state != maze.goal and left > 1e-17:
            mu[state, policy[state]] += left
            state, left = int(maze.next_state[state, policy[state]]), left * GAMMA
        found.add(tuple(mu.ravel().tolist()))
    return np.array(sorted(found))
