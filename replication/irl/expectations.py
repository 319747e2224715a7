"""Feature expectations of trajectories and their distance: Eqs. 3, 5, 6, 7 and 11.

Features are one-hot over state-action pairs (choice FEATURES), so feature expectations are arrays
`[state, action]` and the reward of a pair is its weight, R(s, a) = w(s, a) (Eq. 2).
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import Protocol

import numpy as np
from numpy.typing import NDArray


class Trajectory(Protocol):
    """Anything with `states` [T + 1] and `actions` [T]; the last state is where it ended."""

    @property
    def states(self) -> NDArray[np.int64]:
        """Visited states."""
        ...

    @property
    def actions(self) -> NDArray[np.int64]:
        """Actions taken there."""
        ...


def feature_expectations(
    states: NDArray[np.int64],
    actions: NDArray[np.int64],
    *,
    gamma: float,
    shape: tuple[int, int],
) -> NDArray[np.float64]:
    """Return mu(s, a), the discounted visits of one trajectory (Eq. 7).

    The discounts are a running product and the visits are added in their order, so that equal
    trajectories, and equal beginnings of unequal ones, have equal bits.

    Parameters
    ----------
    states, actions
        Visited states [T + 1] or [T] and the actions taken there [T].
    gamma
        Discount factor.
    shape
        Number of states and number of actions.

    Returns
    -------
    array [state, action]

    Examples
    --------
    >>> feature_expectations(np.array([0, 1]), np.array([1, 0]), gamma=0.9, shape=(2, 2))
    array([[0. , 1. ],
           [0.9, 0. ]])
    """
    factors = np.full(len(actions), gamma)
    factors[:1] = 1.0
    mu = np.zeros(shape)
    np.add.at(mu, (states[: len(actions)], actions), np.cumprod(factors))
    return mu


def mean_expectations(
    trajectories: Iterable[Trajectory], *, gamma: float, shape: tuple[int, int]
) -> NDArray[np.float64]:
    """Return the mean feature expectations [state, action] of some trajectories.

    That is mu_E of the demonstrations (Eq. 5), and mu_i of the agent's trajectories (Eq. 7). Equal
    ones are weighted, and all are taken in an order of their own: so equal shares have equal bits.
    Rounding alone would otherwise keep d from reaching zero.
    """
    counts: dict[tuple[bytes, bytes], int] = {}
    each: dict[tuple[bytes, bytes], NDArray[np.float64]] = {}
    for way in trajectories:
        key = way.states.tobytes(), way.actions.tobytes()
        counts[key] = counts.get(key, 0) + 1
        if key not in each:
            each[key] = feature_expectations(way.states, way.actions, gamma=gamma, shape=shape)
    total = sum(counts.values())
    return np.sum([counts[key] / total * each[key] for key in sorted(each)], axis=0)


def visited(demos: Iterable[Trajectory], *, shape: tuple[int, int]) -> NDArray[np.bool_]:
    """Return where mu_B of Eq. 11 is not zero: the pairs that any of the demonstrations visits.

    Eq. 11 counts visits without discount, and Algorithm 2 asks only whether there are any (choice
    INCORRECT-INDICATOR).

    Returns
    -------
    bool array [state, action]
    """
    mu_b = np.zeros(shape, dtype=bool)
    for demo in demos:
        mu_b[demo.states[: len(demo.actions)], demo.actions] = True
    return mu_b


def norm(values: NDArray[np.float64]) -> float:
    """Return the Euclidean norm of an array (Eqs. 4 and 6).

    The squares are summed exactly and rounded once. In NumPy's own norm a BLAS library chooses the
    order of the sum by the processor, and with it the last bit.

    Examples
    --------
    >>> norm(np.array([[3.0, 0.0], [0.0, 4.0]]))
    5.0
    """
    squares = values * values
    return math.sqrt(math.fsum(squares[squares != 0].tolist()))
