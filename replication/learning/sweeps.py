"""Compiled planning on a table of moves: optimal and soft values, and discounted visits.

:func:`replication.learning.planning.plan` says what the optimal values are, in plain NumPy; here
they are found from a start that is nearly right, as methods that plan some hundred times need it,
by modified policy iteration (Puterman and Shin 1978) with Gauss-Seidel sweeps. Soft values are
found in the same way, as the entropy of a policy is part of its reward.
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
"""Values are this near to their fixed point, relative to the largest one."""

ROUNDING = 2.0**-48
"""What moves less, relative to the largest value, may be rounding: that is where planning ends if
gamma is so near to 1 that `PRECISION` cannot be had."""

TINY = 1e-290
"""What is smaller counts as nothing: numbers that have lost digits may move for ever."""


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
def _ahead(first, successors, probabilities, values, pair, but):
    """Return the expected value of the next state, as if state `but` were worth nothing."""
    ahead = 0.0
    for k in range(first[pair], first[pair + 1]):
        if successors[k] != but:
            ahead += probabilities[k] * values[successors[k]]
    return ahead


@cached
def _stays(first, successors, probabilities, policy):
    """Return the probability that a state is its own successor under a policy, [state]."""
    n_states, n_actions = policy.shape
    stays = np.zeros(n_states)
    for s in range(n_states):
        for a in range(n_actions):
            pair = s * n_actions + a
            for k in range(first[pair], first[pair + 1]):
                if successors[k] == s:
                    stays[s] += policy[s, a] * probabilities[k]
    return stays


@cached
def _choose(q, s, policy, softly):
    """Return the maximum of a row of Q, or its log sum exp; the policy that attains it is set."""
    best = q[s].argmax()
    policy[s] = 0.0
    if not softly:
        policy[s, best] = 1.0
        return q[s, best]
    total = 0.0
    for a in range(q.shape[1]):
        policy[s, a] = np.exp(q[s, a] - q[s, best])
        total += policy[s, a]
    policy[s] /= total
    return q[s, best] + np.log(total)


@cached
def _improve(first, successors, probabilities, ends, weights, q, gamma, softly):
    """Bring Q to its fixed point: improve the policy, evaluate it, and so on."""
    n_states, n_actions = q.shape
    values, rewards, policy = np.zeros(n_states), np.zeros(n_states), np.zeros(q.shape)
    for s in range(n_states):
        values[s] = 0.0 if ends[s] else _choose(q, s, policy, softly)
    while True:
        moved, largest = 0.0, TINY
        for s in range(n_states):
            for a in range(n_actions):
                pair = s * n_actions + a
                ahead = _ahead(first, successors, probabilities, values, pair, -1)
                q[s, a] = weights[s, a] + gamma * ahead
                largest = max(largest, abs(q[s, a]))
            if ends[s]:
                continue
            new = _choose(q, s, policy, softly)
            moved, largest = max(moved, abs(new - values[s])), max(largest, abs(new))
            values[s] = new
            rewards[s] = 0.0
            for a in range(n_actions):  # V - Q is -log policy: what its entropy adds
                rewards[s] += policy[s, a] * (weights[s, a] + new - q[s, a])
        enough = max(PRECISION * (1.0 - gamma), ROUNDING) * largest
        if not moved > enough:
            break
        until = max(moved / 10, enough)  # to evaluate better than that pays only in the end
        stays = _stays(first, successors, probabilities, policy)
        _evaluate(
            (first, successors, probabilities, ends), policy, rewards, stays, values, gamma, until
        )


@cached
def _evaluate(table, policy, rewards, stays, values, gamma, until):
    """Sweep there and back until the values of a policy move by no more than `until`.

    Each state sees what those before it have just become, and what it adds to itself is summed at
    once: else cells from which no move leads on would take as many sweeps as gamma has them.
    """
    first, successors, probabilities, ends = table
    n_states, n_actions = policy.shape
    before, moved = np.inf, 1e300
    while until < moved < before:  # it shrinks with each sweep until all of it is rounding
        before, moved = moved, 0.0
        for i in range(2 * n_states):
            s = min(i, 2 * n_states - 1 - i)
            if ends[s]:
                continue
            ahead = 0.0
            for a in range(n_actions):
                if policy[s, a] != 0.0:
                    pair = s * n_actions + a
                    ahead += policy[s, a] * _ahead(
                        first, successors, probabilities, values, pair, s
                    )
            new = (rewards[s] + gamma * ahead) / (1.0 - gamma * stays[s])
            moved = max(moved, abs(new - values[s]))
            values[s] = new


@cached
def _visit(first, successors, probabilities, ends, mass, policy, mu, gamma):
    """Push the mass of all episodes on, there and back over the states, until nothing is left."""
    n_states, n_actions = policy.shape
    stays = _stays(first, successors, probabilities, policy)
    enough = PRECISION * (1.0 - gamma)
    while mass.sum() > enough:
        for i in range(2 * n_states):
            s = min(i, 2 * n_states - 1 - i)
            if ends[s]:
                mass[s] = 0.0
            if mass[s] <= enough / n_states:  # waits for more to come: tiny numbers take time
                continue
            here, mass[s] = mass[s] / (1.0 - gamma * stays[s]), 0.0
            for a in range(n_actions):
                mu[s, a] += here * policy[s, a]
                pair = s * n_actions + a
                for k in range(first[pair], first[pair + 1]):
                    if successors[k] != s:
                        mass[successors[k]] += gamma * here * policy[s, a] * probabilities[k]
