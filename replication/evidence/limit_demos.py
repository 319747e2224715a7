"""Demonstrations with which Algorithm 1 may break: different ones, noisy ones, and long ones.

And how near a single trajectory can come to several that differ.
"""

from __future__ import annotations

from functools import cache

import numpy as np
from numpy.typing import NDArray

from replication.demos.files import load_demos
from replication.demos.maze_expert import Expert, random_actions
from replication.demos.model import Demo, Demos
from replication.envs.maze import Maze, as_maze
from replication.evidence.experiments import EXPERIMENTS
from replication.irl.expectations import feature_expectations, mean_expectations, norm
from replication.learning.seeds import child

Array = NDArray[np.float64]

DEMO_ROOT = 18
"""Root seed of the demonstrations, used nowhere else."""

LOOKED_AT = 1000
"""Noisy demonstrations of which those are counted that contradict themselves."""


def path_demos(number: int, draw: int) -> Demos:
    """Return different shortest paths of the open maze; the next number has one more."""
    maze, seed = as_maze(_stored().environment), _seed(0, draw)
    ways: dict[tuple[int, ...], None] = {}
    drawn = 0
    while len(ways) < number:
        ways[tuple(random_actions(maze, seed=child(seed, drawn)))] = None
        drawn += 1
    return _demos("open-maze", maze, *map(list, ways))


def noisy_demos(level: float, draw: int) -> Demos:
    """Return one demonstration of the open maze whose driver slips."""
    maze, path = as_maze(_stored().environment), _stored().correct[0]
    return _demos("open-maze", maze, noisy_actions(maze, path, level, seed=_seed(1, draw)))


def noisy_actions(
    maze: Maze, path: Demo, level: float, *, seed: np.random.SeedSequence
) -> list[int]:
    """Return the actions of a driver who slips now and then, up to the goal.

    Parameters
    ----------
    maze
        Where it drives.
    path
        A shortest path, which it follows wherever it is on it. Elsewhere it takes the first of the
        actions that lead nearer to the goal.
    level
        Probability of taking one of the other actions instead, each of them as likely.
    seed
        Of the draws: two for each step, whatever the level.
    """
    rng = np.random.default_rng(seed)
    distances = maze.distances()
    wanted = (distances[maze.next_state] == distances[:, None] - 1).argmax(axis=1)
    wanted[path.states[:-1]] = path.actions
    state, actions = maze.start, []
    while state != maze.goal:
        slips, other = rng.random() < level, int(rng.integers(1, maze.n_actions))
        action = (int(wanted[state]) + slips * other) % maze.n_actions
        actions.append(action)
        state = int(maze.next_state[state, action])
    return actions


def contradictory(level: float) -> int:
    """Return how many of LOOKED_AT noisy demonstrations show two actions in one state."""
    return sum(bool(noisy_demos(level, draw).conflicts()) for draw in range(LOOKED_AT))


def open_demos(side: int) -> Demos:
    """Return the demonstration of an open maze from corner to corner, in even legs.

    Legs differ from DEMO-SHAPE by as little as those of
    :func:`~replication.demos.maze_expert.correct_actions`, which takes seconds on the longest side.
    """
    cells = np.full((side, side), ".")
    cells[-1, 0], cells[0, -1] = "S", "G"
    moves = side - 1
    legs = np.array_split(np.arange(moves), max(round(moves / Expert().leg), 1))
    up, right = 0, 2
    actions = [action for leg in legs for action in [up] * len(leg) + [right] * len(leg)]
    return _demos(f"open-{side}", Maze(tuple("".join(row) for row in cells)), actions)


@cache
def _stored() -> Demos:
    return load_demos(EXPERIMENTS["open-maze"].demos)


def _seed(design: int, draw: int) -> np.random.SeedSequence:
    return child(child(np.random.SeedSequence(DEMO_ROOT), design), draw)


def _demos(task: str, maze: Maze, *ways: list[int]) -> Demos:
    """Return correct demonstrations, given their actions."""
    return Demos(
        task,
        maze,
        tuple(
            Demo(f"correct-{at}", "correct", maze.replay(way), np.array(way))
            for at, way in enumerate(ways, start=1)
        ),
    )


# --- how near one trajectory can come ------------------------------------------------------------


def nearest(demos: Demos, *, gamma: float) -> float:
    """Return the least d of any shortest path of a maze: a bound from above of what can be reached.

    All shortest paths have equally long feature expectations, for none takes a pair twice; so the
    nearest to mu_E is the one with the greatest inner product, which is found from the goal
    backwards. A longer trajectory may be nearer still. None is at zero where the demonstrations
    differ: it would have to share what they have in common, take one action where they part first,
    at step t, and so have gamma^t at a pair where mu_E has a part of that.
    """
    maze = as_maze(demos.environment)
    shape = maze.n_states, maze.n_actions
    mu_e = mean_expectations(demos.correct, gamma=gamma, shape=shape)
    distances, moves = maze.distances(), maze.distances()[maze.start]
    worth, best = np.zeros(maze.n_states), np.zeros(maze.n_states, np.int64)
    for left in range(1, moves + 1):
        states = np.flatnonzero(distances == left)
        there = maze.next_state[states]
        products = gamma ** (moves - left) * mu_e[states] + worth[there]
        products[distances[there] != left - 1] = -np.inf
        worth[states], best[states] = products.max(axis=1), products.argmax(axis=1)
    state, actions = maze.start, []
    while state != maze.goal:
        actions.append(int(best[state]))
        state = int(maze.next_state[state, best[state]])
    return _distance(mu_e, maze.replay(actions), np.array(actions), gamma)


def nearest_demo(demos: Demos, *, gamma: float) -> float:
    """Return the least d of the demonstrations themselves."""
    shape = demos.environment.n_states, demos.environment.n_actions
    mu_e = mean_expectations(demos.correct, gamma=gamma, shape=shape)
    return min(_distance(mu_e, demo.states, demo.actions, gamma) for demo in demos.correct)


def _distance(
    mu_e: Array, states: NDArray[np.int64], actions: NDArray[np.int64], gamma: float
) -> float:
    return norm(mu_e - feature_expectations(states, actions, gamma=gamma, shape=mu_e.shape))
