"""Our variant of Algorithm 2: marked pairs begin with a negative weight.

The abstract promises that incorrect demonstrations avoid errors in the initial phase. In Algorithm
2 a marked pair changes nothing before the agent has taken it; here it costs from the start on.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from replication.irl import unified
from replication.paper.params import Update

Array = NDArray[np.float64]

COST = 1.0
"""What a marked pair costs at first: as much as it takes to outweigh the expert's first step."""


def start(shape: tuple[int, int], params: Update) -> Array:
    """Return F_0, and ones for the cost that is still to be paid, [2, state, action]."""
    return np.stack([unified.start(shape, params), np.ones(shape)])


def update(
    w: Array, memory: Array, mu_e: Array, mu_i: Array, mu_b: NDArray[np.bool_], params: Update
) -> tuple[Array, Array]:
    """Return what Algorithm 2 returns; before the first time, marked pairs get their weight.

    A marked pair that the expert takes, too, gets none.
    """
    f, due = memory
    cost = COST * due * (mu_b & (mu_e == 0))
    w, f = unified.update(w - cost, f, mu_e, mu_i, mu_b, params)
    return w, np.stack([f, np.zeros_like(f)])
