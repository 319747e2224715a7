"""Soft planning and visits in plain NumPy: slow and obvious."""

from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.special import softmax

from replication.envs.tasks.moves import Moves

Array = NDArray[Any]


def transitions(moves: Moves) -> Array:
    """Return the probabilities [state, action, successor]; an end leads nowhere."""
    return np.stack([moves.ahead(place) for place in np.eye(moves.shape[0])], axis=2)


def plan_softly(moves: Moves, weights: Array, *, gamma: float) -> Array:
    """Iterate Q = R + gamma P log sum exp Q until nothing changes visibly."""
    q = weights
    for _ in range(int(-40 / np.log(max(gamma, 0.1)))):
        q = weights + gamma * moves.ahead(np.logaddexp.reduce(q, axis=1))
    return q


def visits(moves: Moves, policy: Array, *, gamma: float) -> Array:
    """Solve d = starts + gamma d P for the discounted visits of states that are no ends."""
    n = moves.shape[0]
    begin = np.bincount(moves.starts, moves.probabilities[moves.first[-2] :], n) * ~moves.ends
    chain = np.einsum("sa,sat->st", policy, transitions(moves)) * ~moves.ends[:, None]
    return np.linalg.solve(np.eye(n) - gamma * chain.T, begin)[:, None] * policy


def soft_visits(moves: Moves, weights: Array, *, gamma: float) -> Array:
    """Return the visits of the soft-optimal policy of `weights`."""
    return visits(moves, softmax(plan_softly(moves, weights, gamma=gamma), axis=1), gamma=gamma)
