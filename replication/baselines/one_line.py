"""The one-line reward: 0 where the expert acts, -1 elsewhere."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from replication.paper.params import Update

Array = NDArray[np.float64]


def update(
    w: Array, memory: Array, mu_e: Array, mu_i: Array, mu_b: NDArray[np.bool_], params: Update
) -> tuple[Array, Array]:
    """Return the reward, whatever the agent did."""
    return np.where(mu_e > 0, 0.0, -1.0), memory
