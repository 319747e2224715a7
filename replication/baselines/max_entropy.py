"""Maximum causal entropy: among the policies that match the expert's visits, the most random one.

Ziebart, Bagnell and Dey (2010), in the stationary discounted form. That policy is the soft-optimal
one, exp(Q - V) with Q = w + gamma P V and V = log sum exp Q, of the weights w that maximise the
likelihood of the demonstrations,

    L(w) = w . mu_E - V(start) - ridge / 2 |w|^2,    whose gradient is    mu_E - mu_pi - ridge w.

L is concave. Its last term is ours: where a demonstration never varies, weights would grow without
end.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize

from replication.baselines.problem import Problem

Array = NDArray[np.float64]

RIDGE = 1e-4
"""By how much visits differ from the expert's for each unit of weight.

Wandering for ever is worth an entropy of up to log 4 / (1 - gamma), 14 for gamma = 0.9, so weights
must be of that size. The difference that they cause is to be small beside the last of some 30
steps, whose visits are 0.9^30 = 0.04: 14 times 1e-4 is a thirtieth of it. Fixed before any run.
"""

TOLERANCE = 1e-8
"""Climbing ends when no entry of the gradient is larger; weights are then right to about 1e-4,
which is `TOLERANCE` / `RIDGE`."""


def find(problem: Problem) -> Array:
    """Return the weights that maximise L, [state, action]."""
    return climb(problem, problem.mu_e, ridge=RIDGE)


def climb(problem: Problem, target: Array, *, ridge: float) -> Array:
    """Return the weights that maximise L if `target` [state, action] stands in place of mu_E."""
    q = np.zeros(target.shape)

    def loss(flat: Array) -> tuple[float, Array]:
        nonlocal q
        w = flat.reshape(target.shape)
        q = problem.plan_softly(w, q)
        value, gradient = likelihood(problem, target, w, q, ridge=ridge)
        return -value, -gradient.ravel()

    limits = {"gtol": TOLERANCE, "ftol": 0.0, "maxiter": 10_000, "maxfun": 10_000}
    climbed = minimize(loss, np.zeros(target.size), jac=True, method="L-BFGS-B", options=limits)
    w: Array = climbed.x.reshape(target.shape)
    return w


def likelihood(
    problem: Problem, target: Array, w: Array, q: Array, *, ridge: float
) -> tuple[float, Array]:
    """Return L(w) and its gradient [state, action], given the soft-optimal Q of w."""
    moves, policy = problem.moves, soft_policy(q)
    best = q.max(axis=1)
    values = best + np.log(np.exp(q - best[:, None]).sum(axis=1))
    values[moves.ends] = 0.0
    start = moves.probabilities[moves.first[-2] :] @ values[moves.starts]
    value = (w * target).sum() - start - ridge / 2 * (w * w).sum()
    return float(value), target - problem.visits(policy) - ridge * w


def soft_policy(q: Array) -> Array:
    """Return exp(Q - V), the probability of each action, [state, action]."""
    odds = np.exp(q - q.max(axis=1, keepdims=True))
    return odds / odds.sum(axis=1, keepdims=True)
