"""The perceptron with a margin: it goes on learning where the expert is best by too little.

As the perceptron it moves the weights by what the agent's trajectory lacks. But the trajectory is
the best one if each discounted visit off the expert's way were worth 1 more, so it is a mistake,
too, to prefer the expert by less than that. With d* as the margin of unit weights and R as the
largest |mu_E - mu|, it ends after at most (R^2 + 2 L) / d*^2 updates, where L = 1 / (1 - gamma) is
the largest such bonus: each update raises u . w by at least d*, and |w|^2 by at most R^2 + 2 L.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from replication.baselines.problem import Problem

Array = NDArray[np.float64]

PLANS = 10_000
"""Updates after which it is given up."""


def find(problem: Problem) -> Array:
    """Return the weights, [state, action]."""
    bonus = np.where(problem.mu_e > 0, 0.0, 1.0)
    w, q = np.zeros(bonus.shape), np.zeros(bonus.shape)
    while problem.plans < PLANS:
        q = problem.plan(w + bonus, q)
        mu = problem.follow(q)
        if not (bonus * mu).any():
            break
        w = w + (problem.mu_e - mu)
    return w
