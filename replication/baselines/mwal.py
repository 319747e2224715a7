"""Multiplicative weights for apprenticeship learning, MWAL (Syed and Schapire 2008, figure 1).

A game: one player chooses a distribution W over features, the reward; the other one the agent's
policy. Where the agent visits a feature less than the expert, the feature gains weight.

Their algorithm returns a mixture of the policies of all rounds. Here, as with all methods of the
loop, the greedy policy of the last reward is held against the expert.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from replication.paper.params import Loop, Update
from replication.paper.register import load_choices

Array = NDArray[np.float64]


def rate(n_features: int, rounds: int, gamma: float) -> float:
    """Return by how much one discounted visit moves a log weight: ln(1 / beta) (1 - gamma) / 4.

    beta = 1 / (1 + sqrt(2 ln k / T)) for k features and T rounds is that of their theorem 2; visits
    are scaled to [-1, 1] by (1 - gamma), and what the agent lacks to [0, 1] by 4.
    """
    beta = 1 / (1 + np.sqrt(2 * np.log(n_features) / rounds))
    return float(-np.log(beta) * (1 - gamma) / 4)


def weights(logs: Array) -> Array:
    """Return the reward [state, action] of log weights.

    Features are one-hot over pairs, and their negatives, so that a reward may have any sign. The
    weights of a feature and of its negative are exp(c) and exp(-c), over the sum of all.
    """
    logs = np.clip(logs, -700, 700)  # what exp can hold
    return np.sinh(logs) / np.cosh(logs).sum()


def update(
    w: Array, logs: Array, mu_e: Array, mu_i: Array, mu_b: NDArray[np.bool_], params: Update
) -> tuple[Array, Array]:
    """Return the next reward and log weights c, [state, action].

    T is the registered cap of iterations, and gamma the registered one, whatever a user chose: both
    only set the rate.
    """
    gamma = float(load_choices()["GAMMA"].default)
    logs = logs + rate(2 * w.size, Loop().max_iterations, gamma) * (mu_e - mu_i)
    return weights(logs), logs
