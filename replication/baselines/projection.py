"""The projection method of apprenticeship learning (Abbeel and Ng 2004, section 3.1).

It keeps a mixture of the agent's trajectories so far whose feature expectations are as near to the
expert's as a step toward the last one brings them. What is still missing is the next reward.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from replication.paper.params import Update

Array = NDArray[np.float64]


def start(shape: tuple[int, int], params: Update) -> Array:
    """Return no mixture, [state, action]."""
    return np.full(shape, np.nan)


def update(
    w: Array, mixture: Array, mu_e: Array, mu_i: Array, mu_b: NDArray[np.bool_], params: Update
) -> tuple[Array, Array]:
    """Return w = mu_E - mixture, and the feature expectations of the mixture, [state, action].

    The mixture moves to the point of the line from it to mu_i that is nearest to mu_E. It stays
    between the two, which it does by itself where mu_i is optimal for w: with a learner inside the
    loop that is not certain.
    """
    if np.isnan(mixture).any():
        return mu_e - mu_i, mu_i
    step = mu_i - mixture
    length = (step * step).sum()
    share = ((mu_e - mixture) * step).sum() / length if length > 0 else 0.0
    mixture = mixture + min(max(share, 0.0), 1.0) * step
    return mu_e - mixture, mixture
