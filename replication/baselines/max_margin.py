"""Maximum-margin planning (Ratliff, Bagnell and Zinkevich 2006).

Small weights under which the expert is better than every other trajectory by as much as that one
is worse to look at: by its loss, which counts 1 for each discounted visit off the expert's way, and
2 where an incorrect demonstration marks the pair. They minimise

    RIDGE / 2 |w|^2 + max over mu (w . mu + loss . mu) - w . mu_E.

The best mu is found by planning with the loss in the reward, and mu - mu_E + RIDGE w is then a
subgradient, which is followed with steps of 1 / (RIDGE k). The mean of all iterates is returned,
later ones counting more (weight k).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from replication.baselines.problem import Problem

Array = NDArray[np.float64]

RIDGE = 0.01
"""So small that matching the expert comes first, so large that the steps below suffice.

With steps of 1 / (RIDGE k), what is left is of the order R^2 / (RIDGE k), and R^2 is about 100.
"""

PLANS = 1000
"""Number of steps."""

MARKED = 2.0
"""The loss of a marked pair: twice that of a pair which nobody has marked."""


def find(problem: Problem) -> Array:
    """Return the weights, [state, action]."""
    loss = losses(problem)
    w, mean, q = np.zeros(loss.shape), np.zeros(loss.shape), np.zeros(loss.shape)
    for k in range(1, PLANS + 1):
        q = problem.plan(w + loss, q)
        w = (1 - 1 / k) * w + (problem.mu_e - problem.follow(q)) / (RIDGE * k)
        mean += 2 / (k + 1) * (w - mean)
    return mean


def losses(problem: Problem) -> Array:
    """Return the loss of each pair, [state, action]: 0 where the expert goes."""
    loss = np.where(problem.mu_e > 0, 0.0, 1.0)
    loss[problem.marked] = MARKED
    return loss
