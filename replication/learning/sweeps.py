"""Compiled planning on a table of moves: optimal and soft values, and discounted visits.

:func:`replication.learning.planning.plan` says what the optimal values are, in plain NumPy; here
they are found from a start that is nearly right, as methods that plan some hundred times need it.
"""

# Numba infers the types of compiled functions.
# mypy: disable-error-code="no-untyped-def, no-untyped-call"

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from replication.envs.tasks.moves import Moves
from replication.learning.compiled import cached

Array = NDArray[np.float64]

PRECISION = 1e-13
"""Sweeps end when no value moves by more than this, relative to the largest one."""


def optimal(moves: Moves, weights: Array, *, gamma: float, q: Array | None = None) -> Array:
    """Return the optimal Q [state, action] of the reward `weights`.

    Parameters
    ----------
    moves
        Where actions lead; what lies behind an end is worth nothing.
    weights
        Rewards R(s, a), float64 [state, action].
    gamma
        Discount factor, below 1.
    q
        Where to begin, [state, action]; the nearer, the sooner it is done.

    Examples
    --------
    A corridor of three states: action 0 stays, action 1 moves on, and moving on is worth 1.

    >>> outcomes = ([0, 0, 1, 1, 2, 2], [0, 1] * 3, [0, 1, 1, 2, 2, 2], [1] * 6)
    >>> ends = np.array([False, False, True])
    >>> moves = Moves.of(outcomes, shape=(3, 2), starts=[1, 0, 0], ends=ends)
    >>> optimal(moves, np.array([[0.0, 1.0]] * 3), gamma=0.5)
    array([[0.75, 1.5 ],
           [0.5 , 1.  ],
           [0.  , 1.  ]])
    """
    _check(gamma)
    found = np.array(weights if q is None else q, np.float64)
    _improve(*_table(moves), np.asarray(weights, np.float64), found, gamma, False)
    return found


def soft(moves: Moves, weights: Array, *, gamma: float, q: Array | None = None) -> Array:
    """Return the soft-optimal Q [state, action]: the maximum of Q is replaced by log sum exp.

    The policy exp(Q - V), with V = log sum exp Q, has the greatest sum of reward and entropy. The
    parameters are those of `optimal`.
    """
    _check(gamma)
    found = np.array(weights if q is None else q, np.float64)
    _improve(*_table(moves), np.asarray(weights, np.float64), found, gamma, True)
    return found


def visits(moves: Moves, policy: Array, *, gamma: float) -> Array:
    """Return the expected discounted visits mu(s, a) (Eq. 7) of a stochastic policy.

    Parameters
    ----------
    policy
        The probability of each action, [state, action].
    """
    _check(gamma)
    begin = np.zeros(moves.shape[0])
    begin[moves.starts] = moves.probabilities[moves.first[-2] :]
    mu = np.zeros(moves.shape)
    _visit(*_table(moves), begin, np.asarray(policy, np.float64), mu, gamma)
    return mu


def _check(gamma: float) -> None:
    if not 0 <= gamma < 1:
        raise ValueError(f"planning needs a discount factor from 0 to below 1, not {gamma}")


def _table(moves: Moves) -> tuple[NDArray[np.int64], NDArray[np.int64], Array, NDArray[np.bool_]]:
    return moves.first, moves.successors, moves.probabilities, moves.ends


@cached
def _value(row, softly):
    """Return the maximum of a row of Q, or its log sum exp."""
    best = row.max()
    return best + np.log(np.exp(row - best).sum()) if softly else best


@cached
def _improve(first, successors, probabilities, ends, weights, q, gamma, softly):
    """Sweep over all states, each of which sees what those before it have just become."""
    n_states, n_actions = q.shape
    values = np.zeros(n_states)
    for s in range(n_states):
        values[s] = 0.0 if ends[s] else _value(q[s], softly)
    while True:
        moved = largest = 0.0
        for s in range(n_states):
            for a in range(n_actions):
                pair = s * n_actions + a
                ahead = 0.0
                for k in range(first[pair], first[pair + 1]):
                    ahead += probabilities[k] * values[successors[k]]
                new = weights[s, a] + gamma * ahead
                moved = max(moved, abs(new - q[s, a]))
                largest = max(largest, abs(new))
                q[s, a] = new
            if not ends[s]:
                values[s] = _value(q[s], softly)
        if not moved > PRECISION * (1.0 - gamma) * largest:
            break


@cached
def _visit(first, successors, probabilities, ends, begin, policy, mu, gamma):
    """Follow the mass of all episodes until nothing of it is left."""
    n_states, n_actions = policy.shape
    mass = begin.copy()
    while mass.sum() > PRECISION:
        after = np.zeros(n_states)
        for s in range(n_states):
            if mass[s] == 0.0 or ends[s]:
                continue
            for a in range(n_actions):
                here = mass[s] * policy[s, a]
                mu[s, a] += here
                pair = s * n_actions + a
                for k in range(first[pair], first[pair + 1]):
                    after[successors[k]] += gamma * here * probabilities[k]
        mass = after
