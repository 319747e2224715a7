"""Policy iteration (Howard 1960) where no move is random: exact planning in a fraction of a second.

A policy then leads from each state to one other, so its values follow from walking: to an end, or
around a loop, whose sum is a geometric series. :func:`replication.learning.planning.plan` says in
plain NumPy what is computed.
"""

# Numba infers the types of compiled functions.
# mypy: disable-error-code="no-untyped-def, no-untyped-call"

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from replication.learning.compiled import cached

Array = NDArray[np.float64]

PRECISION = 1e-14
"""An action replaces another if it is better by more than this share of the largest value.

Less could be rounding, by which two equal actions would replace each other for ever.
"""


def iterate(
    next_state: NDArray[np.int64],
    ends: NDArray[np.bool_],
    weights: Array,
    *,
    gamma: float,
    q: Array | None = None,
) -> Array:
    """Return the optimal Q [state, action] of the reward `weights`.

    Parameters
    ----------
    next_state
        The state that an action leads to, int64 [state, action].
    ends
        Whether a state ends an episode, bool [state]; it is worth nothing.
    weights
        Rewards R(s, a), float64 [state, action].
    gamma
        Discount factor, below 1.
    q
        Its greedy policy is the first one; the nearer, the sooner it is done.

    Examples
    --------
    A corridor of three states: action 0 stays, action 1 moves on, and moving on is worth 1.

    >>> moves = np.array([[0, 1], [1, 2], [2, 2]])
    >>> iterate(moves, np.array([False, False, True]), np.array([[0.0, 1.0]] * 3), gamma=0.5)
    array([[0.75, 1.5 ],
           [0.5 , 1.  ],
           [0.  , 1.  ]])
    """
    if not 0 <= gamma < 1:
        raise ValueError(f"planning needs a discount factor from 0 to below 1, not {gamma}")
    first = weights if q is None else q
    policy = first.argmax(axis=1)
    values = np.zeros(len(policy))
    found = np.empty(weights.shape)
    _iterate(next_state, ends, np.asarray(weights, np.float64), gamma, policy, values, found)
    return found


def visits(
    next_state: NDArray[np.int64],
    ends: NDArray[np.bool_],
    policy: NDArray[np.int64],
    start: int,
    *,
    gamma: float,
) -> Array:
    """Return the discounted visits mu(s, a) (Eq. 7) of a policy that takes `policy` [state]."""
    mu = np.zeros(next_state.shape)
    _visit(next_state, ends, policy, start, gamma, mu)
    return mu


@cached
def _visit(next_state, ends, policy, start, gamma, mu):
    """Add up what is left of the discount, until it is too small to be added to 1."""
    s, left = start, 1.0
    while not ends[s] and left > 1e-17:
        mu[s, policy[s]] += left
        left *= gamma
        s = next_state[s, policy[s]]


@cached
def _iterate(next_state, ends, weights, gamma, policy, values, q):
    """Improve `policy` until nothing is better; leave the values of its actions in `q`."""
    n_states, n_actions = q.shape
    better = True
    while better:
        _evaluate(next_state, ends, weights, gamma, policy, values)
        for s in range(n_states):
            for a in range(n_actions):
                q[s, a] = weights[s, a] + gamma * values[next_state[s, a]]
        margin = PRECISION * np.abs(q).max()
        better = False
        for s in range(n_states):
            best = q[s].argmax()
            if q[s, best] > q[s, policy[s]] + margin:
                policy[s] = best
                better = True


@cached
def _evaluate(next_state, ends, weights, gamma, policy, values):
    """Fill in the value of each state under a policy."""
    n_states = len(policy)
    known = ends.copy()
    values[:] = 0.0
    walked = np.full(n_states, -1)  # by which walk
    way = np.empty(n_states, np.int64)
    for begin in range(n_states):
        length = 0
        s = begin
        while not known[s] and walked[s] != begin:
            walked[s] = begin
            way[length] = s
            length += 1
            s = next_state[s, policy[s]]
        if not known[s]:  # a loop, which begins here
            total, factor, at = 0.0, 1.0, s
            while True:
                total += factor * weights[at, policy[at]]
                factor *= gamma
                at = next_state[at, policy[at]]
                if at == s:
                    break
            values[s] = total / (1.0 - factor)
            known[s] = True
        for k in range(length - 1, -1, -1):
            at = way[k]
            if not known[at]:
                values[at] = weights[at, policy[at]] + gamma * values[next_state[at, policy[at]]]
                known[at] = True
