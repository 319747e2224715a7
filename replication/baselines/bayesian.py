"""Bayesian IRL (Ramachandran and Amir 2007), with incorrect demonstrations (Brown and Niekum 2018).

What is known of the weights is a distribution. Before any demonstration each is standard normal. An
expert with the optimal Q of some weights takes an action with the probability

    pi(a|s) = exp(alpha Q(s, a)) / sum_b exp(alpha Q(s, b)),

so the demonstrations have the likelihood

    prod pi(a|s)  over the steps of correct ones  x  prod (1 - pi(a|s))  over marked pairs.

Marked are the pairs of incorrect demonstrations that no correct one visits, each once: an incorrect
one is right most of the way, and a pair of both kinds would count against itself. (The code of
Brown and Niekum takes every pair.) The posterior is sampled by PolicyWalk, a Metropolis chain that
moves the reward of one pair at a time and plans again from the last Q; what is returned is the mean
of its second half. A rejected move counts its old weights once more.
"""

# Numba infers the types of compiled functions.
# mypy: disable-error-code="no-untyped-def, no-untyped-call"

from __future__ import annotations

from collections.abc import Callable, Iterator
from itertools import islice
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from replication.baselines.problem import Problem
from replication.learning.compiled import cached

Array = NDArray[np.float64]

ALPHA = 10.0
"""The expert's confidence: of an action that is worse by half of what a reward varies by, fewer
than one in a hundred are taken, exp(-10 / 2)."""

STEP = 1.0
"""The standard deviation of a move: that of a reward before any demonstration."""

LENGTH = 20_000
"""Number of moves. On 20 x 20 cells the half that goes anywhere tries each pair some 6 times, and
the other half those in the states of demonstrations several times as often. That is what a second
allows, and too little for the mean of each weight: even between chains of five times that length,
with other roots, weights off the expert's way differ by some 0.45."""

ROOT = 2007
"""Root seed of the chain."""


class Proposals(NamedTuple):
    """What the chain draws beforehand: the pair to move, by how much, and log of a uniform, [n]."""

    pairs: NDArray[np.int64]
    steps: Array
    levels: Array


def find(problem: Problem) -> Array:
    """Return the posterior mean of the weights, [state, action]."""
    likelihood = Likelihood.of(problem)
    drawn = draw_proposals(likelihood.rows, problem.moves.shape, LENGTH, seed=ROOT)
    total = np.zeros(problem.moves.shape)
    for w in islice(walk(problem, likelihood, drawn), LENGTH // 2, None):
        total += w
    return total / (LENGTH - LENGTH // 2)


class Likelihood(NamedTuple):
    """What the likelihood needs to know of the demonstrations.

    Attributes
    ----------
    rows
        The states of correct steps and marked pairs, in ascending order, int64 [row].
    counts
        How often correct demonstrations take each action there, [row, action].
    marked
        Whether a pair is marked, bool [row, action].
    """

    rows: NDArray[np.int64]
    counts: Array
    marked: NDArray[np.bool_]

    @classmethod
    def of(cls, problem: Problem) -> Likelihood:
        """Count steps and marked pairs."""
        counts = np.zeros(problem.moves.shape)
        for demo in problem.correct:
            np.add.at(counts, (demo.states[:-1], demo.actions), 1.0)
        rows = np.flatnonzero(((counts > 0) | problem.marked).any(axis=1))
        return cls(rows, counts[rows], problem.marked[rows])

    def log(self, q: Array) -> float:
        """Return the log likelihood of an optimal Q [state, action]."""
        return _log_likelihood(*self, q, ALPHA)


def draw_proposals(
    rows: NDArray[np.int64], shape: tuple[int, int], n: int, *, seed: int
) -> Proposals:
    """Draw n moves of the chain.

    Half of them go to the states of demonstrations, `rows`, whose Q the likelihood sees at once,
    half to any pair. A move is as likely as its reverse, since which pair it goes to depends on no
    weights.
    """
    rng = np.random.default_rng(np.random.SeedSequence(seed))
    near = rows[rng.integers(len(rows), size=n)] * shape[1] + rng.integers(shape[1], size=n)
    anywhere = rng.integers(shape[0] * shape[1], size=n)
    pairs = np.where(rng.random(n) < 0.5, near, anywhere)
    return Proposals(pairs, STEP * rng.standard_normal(n), -rng.standard_exponential(n))


def walk(problem: Problem, likelihood: Likelihood, proposals: Proposals) -> Iterator[Array]:
    """Yield the weights after each move, [state, action]; they are written over by the next."""
    w = np.zeros(problem.moves.shape)
    q = problem.plan(w)
    score = likelihood.log(q)
    for pair, step, level in zip(*(drawn.tolist() for drawn in proposals), strict=True):
        old = w.item(pair)
        w.flat[pair] = new = old + step
        ahead = plan_again(problem.plan, w, q, pair, step)
        found = likelihood.log(ahead)
        if level < found - score + (old * old - new * new) / 2:
            q, score = ahead, found
        else:
            w.flat[pair] = old
        yield w


def plan_again(
    plan: Callable[[Array, Array], Array], w: Array, q: Array, pair: int, step: float
) -> Array:
    """Return the optimal Q after the reward of one pair has changed by `step`.

    If its action was not the best one and is not now, its state is worth what it was, and so is all
    else.
    """
    state, action = divmod(pair, q.shape[1])
    best, now = q[state].max(), q[state, action] + step
    if max(q[state, action], now) >= best:
        return plan(w, q)
    q = q.copy()
    q[state, action] = now
    return q


@cached
def _log_likelihood(rows, counts, marked, q, alpha):
    """Sum over rows; 1 - pi is the share of the others, so nothing cancels where pi is near 1."""
    total = 0.0
    for i in range(len(rows)):
        values = alpha * q[rows[i]]
        whole = _log_sum_exp(values, -1)
        for a in range(len(values)):
            if counts[i, a] > 0:
                total += counts[i, a] * (values[a] - whole)
            if marked[i, a]:
                total += _log_sum_exp(values, a) - whole
    return total


@cached
def _log_sum_exp(values, but):
    """Return log sum exp of all values but one."""
    top = -np.inf
    for a in range(len(values)):
        if a != but and values[a] > top:
            top = values[a]
    total = 0.0
    for a in range(len(values)):
        if a != but:
            total += np.exp(values[a] - top)
    return top + np.log(total)
