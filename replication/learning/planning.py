"""Exact planning: what Q-learning (Eq. 1) would find without noise and without end."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


def plan(weights: Array, ahead: Callable[[Array], Array], *, gamma: float) -> Array:
    """Return the optimal Q of the reward `weights`, by value iteration.

    Parameters
    ----------
    weights
        Rewards R(s, a), float64 [state, action].
    ahead
        Returns the expected value of the next state, [state, action], given the value of each
        state [state]; it is 0 where a move ends the episode.
    gamma
        Discount factor, below 1.

    Returns
    -------
    float64 [state, action]
        The fixed point of Q = R + gamma ahead(max Q), or what is left of the distance to it after
        so many sweeps that none of the 53 bits of a number can show it.

    Raises
    ------
    ValueError
        If gamma is 1, since sums without end need not have a value.

    Examples
    --------
    A corridor of three states: action 0 stays, action 1 moves on, and moving on is worth 1.

    >>> moves = np.array([[0, 1], [1, 2], [2, 2]])
    >>> goal = moves == 2
    >>> plan(np.array([[0.0, 1.0]] * 3), lambda v: np.where(goal, 0.0, v[moves]), gamma=0.5)
    array([[0.75, 1.5 ],
           [0.5 , 1.  ],
           [0.  , 1.  ]])
    """
    if not 0 <= gamma < 1:
        raise ValueError(f"planning needs a discount factor from 0 to below 1, not {gamma}")
    sweeps = 1 if gamma == 0 else math.ceil(60 / -math.log2(gamma))
    q = weights
    for _ in range(sweeps):
        better = weights + gamma * ahead(q.max(axis=1))
        if np.array_equal(better, q):
            break
        q = better
    return q
