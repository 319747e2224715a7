"""The perceptron: Algorithm 1 without its trace, F = 1 throughout.

It is the structured perceptron (Collins 2002), whose arg max is the planner: the trajectory that is
best under the weights is the agent's, and each mistake moves them by what it differs from the
expert's. The number of its mistakes is bounded, see :mod:`replication.evidence.bound`.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from replication.paper.params import Update

Array = NDArray[np.float64]


def update(
    w: Array, memory: Array, mu_e: Array, mu_i: Array, mu_b: NDArray[np.bool_], params: Update
) -> tuple[Array, Array]:
    """Return w + mu_E - mu_i (Eqs. 8 and 9 with F = 1)."""
    return w + (mu_e - mu_i), memory
