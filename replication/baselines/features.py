"""A perceptron with a few features that mean the same in any maze.

One-hot features learn a number for each pair of cell and move, which says nothing of a cell that
was never visited. Here the reward is w(s, a) = theta . phi(s, a): five numbers are learned, and phi
is computed anew wherever the reward is used.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from replication.baselines.problem import Problem
from replication.envs.maze import Maze
from replication.irl.expectations import norm

Array = NDArray[np.float64]

NAMES = ("row", "column", "distance", "bump", "walls beside")

ITERATIONS = 300
"""Updates before giving up, as in the paper's loop (choice ITERATION-CAP)."""

TIE = 1e-9
"""Values of actions tie if they differ by at most this share of the largest one.

Planning ends with an error of at most 1e-13 of the largest value; so ties are not left to rounding.
"""

BESIDE = ((2, 3), (2, 3), (0, 1), (0, 1))
"""The two directions across each of up, down, right, left."""


class Found(NamedTuple):
    """The weights of the features, their error d (Eq. 6 with these features) and all updates."""

    theta: Array
    error: float
    iterations: int


def features(maze: Maze) -> Array:
    """Return phi, float64 [state, action, feature], each from 0 to 1.

    ``row``, ``column``
        Of the cell that the move leads to, as shares of the map.
    ``distance``
        Manhattan distance from there to the goal, as a share of the largest one on the map. The
        number of moves to the goal would be the answer itself, not a feature.
    ``bump``
        Whether the move ends where it began, at a wall or an obstacle.
    ``walls beside``
        The share of the two cells beside, across the move, that are walls or obstacles.

    There is no constant: a reward of -1 a step is not among those that can be learned.
    """
    there = maze.cells(maze.next_state.ravel()).reshape(*maze.next_state.shape, 2)
    most = np.maximum(np.array(maze.shape) - 1, 1)
    away = np.abs(there - np.array(maze.cell(maze.goal))).sum(axis=2) / (sum(maze.shape) - 2)
    bump = maze.next_state == np.arange(maze.n_states)[:, None]
    beside = bump[:, BESIDE].mean(axis=2)
    return np.dstack([there / most, away, bump, beside])


def first_best(q: Array) -> Array:
    """Return the greedy policy as probabilities [state, action]: of actions that tie, the first."""
    best = q.max(axis=1, keepdims=True)
    ties = q >= best - TIE * np.abs(best)
    return np.eye(q.shape[1])[ties.argmax(axis=1)]


def perceptron(problem: Problem, phi: Array) -> Found:
    """Return the weights with the least error among all iterations, the first of equals.

    Each update is theta += Phi^T (mu_E - mu_i), the structured perceptron (Collins 2002), where
    mu_i is the optimal policy's under theta, by exact planning. Where no theta has the error 0 its
    updates never end; it is the least error, not the last one, that is then returned.
    """
    theta, q = np.zeros(phi.shape[2]), np.zeros(problem.moves.shape)
    found = Found(theta, np.inf, 0)
    for iteration in range(ITERATIONS + 1):
        residual = np.tensordot(problem.mu_e - problem.visits(first_best(q)), phi, 2)
        error = norm(residual)
        if error < found.error:
            found = found._replace(theta=theta, error=error)
        found = found._replace(iterations=iteration)
        if error <= TIE:
            break
        theta = theta + residual
        q = problem.plan(phi @ theta, q)
    return found
