"""Inverse reinforcement learning from failure: like the correct demonstrations, unlike the others.

Shiarlis, Messias and Whiteson (2016). The reward is w_S + w_F; w_S draws the agent to the visits of
the correct demonstrations as in maximum entropy, w_F drives it from those of the incorrect ones,
mu_F. For the visits mu of the soft-optimal policy of the sum,

    mu_E - mu = RIDGE w_S,    mu - mu_F = SCALE w_F.

Their Algorithm 1 steps along the gradient of w_S, sets w_F, and lowers the scale (their lambda) to
a floor, in turn. Here all pairs are features, and failures begin where successes do. So both
compare the same visits, and the two equations add up to a single one, of w = w_S + w_F,

    target - mu = ridge w,    ridge = RIDGE SCALE / (SCALE - RIDGE),
                              target = mu_E + ridge / SCALE (mu_E - mu_F),

which is maximum entropy with a target that lies a little beyond mu_E, as seen from mu_F. Its
likelihood is concave if RIDGE < SCALE, so there is one solution, and it is climbed to directly.
Where Algorithm 1 settles, it settles there; on a small maze, with gamma = 0.9 and a scale of 1, it
did not settle with steps of 0.01 either. The term in RIDGE is ours; without it, an expert that is
matched exactly leaves nothing to failures.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from replication.baselines import max_entropy
from replication.baselines.max_entropy import RIDGE
from replication.baselines.problem import Problem

Array = NDArray[np.float64]

SCALE = 1.0
"""The floor of the scale: one visit more than failures have earns 1, the unit in which entropy is
measured and with it all weights. Fixed before any run."""


def find(problem: Problem) -> Array:
    """Return w_S + w_F, [state, action]; without incorrect demonstrations, those of max entropy."""
    if not problem.incorrect:
        return max_entropy.find(problem)
    return balance(problem, ridge=RIDGE, scale=SCALE)


def balance(problem: Problem, *, ridge: float, scale: float) -> Array:
    """Return w_S + w_F, [state, action], of a `ridge` of w_S below the `scale` of w_F."""
    common = ridge * scale / (scale - ridge)
    beyond = problem.mu_e - problem.mu_wrong.mean(axis=0)
    return max_entropy.climb(problem, problem.mu_e + common / scale * beyond, ridge=common)
