"""Ranking: a reward under which correct demonstrations are worth more than incorrect ones.

As in T-REX (Brown et al. 2019), whose network is a table here: of a correct and an incorrect
demonstration the correct one is preferred with a probability that grows with what it is worth more
(Bradley and Terry 1952). The weights maximise the concave

    sum over all such pairs  log sigmoid(w . (mu_correct - mu_incorrect))  -  ridge / 2 |w|^2.

Nothing is planned. We deviate from T-REX in that returns are discounted, whole demonstrations are
compared instead of pieces, and the last term is added: on one-hot features weights would grow for
ever without it.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize
from scipy.special import expit, log_expit

from replication.baselines.problem import Problem
from replication.irl.expectations import feature_expectations

Array = NDArray[np.float64]

RIDGE = 1.0
"""As if each weight were standard normal before any demonstration, as in Bayesian IRL."""

TOLERANCE = 1e-9
"""The search ends when no entry of the gradient is larger; no weight is then farther off than
40 times as much on 20 x 20 cells, which is the root of the number of pairs over `RIDGE`."""


def find(problem: Problem) -> Array:
    """Return the weights that rank the demonstrations, [state, action]."""
    differences = gains(problem)
    start = np.zeros(differences.shape[1])
    limits = {"gtol": TOLERANCE, "ftol": 0.0, "maxiter": 10_000, "maxfun": 10_000}
    found = minimize(loss, start, args=(differences,), jac=True, method="L-BFGS-B", options=limits)
    return np.reshape(found.x, problem.moves.shape)


def gains(problem: Problem) -> Array:
    """Return mu_correct - mu_incorrect of each pair of demonstrations, [pair, state * action]."""
    shape, gamma = problem.moves.shape, problem.gamma
    right = np.array(
        [
            feature_expectations(demo.states, demo.actions, gamma=gamma, shape=shape)
            for demo in problem.correct
        ]
    )
    return (right[:, None] - problem.mu_wrong).reshape(-1, shape[0] * shape[1])


def loss(w: Array, differences: Array) -> tuple[float, Array]:
    """Return what is minimised, and its gradient, for weights [state * action]."""
    ahead = differences @ w
    value = RIDGE / 2 * (w @ w) - log_expit(ahead).sum()
    return float(value), RIDGE * w - expit(-ahead) @ differences
