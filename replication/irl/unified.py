"""The unified method's weight update: Eqs. 8-10, Algorithm 1 and, with mu_B, Algorithm 2."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from replication.paper.params import Update

Array = NDArray[np.float64]


def start(shape: tuple[int, int], params: Update) -> Array:
    """Return F_0 [state, action], the same for all pairs (line 3 of both listings)."""
    return np.full(shape, params.f_start)


def update(
    w: Array, f: Array, mu_e: Array, mu_i: Array, mu_b: NDArray[np.bool_], params: Update
) -> tuple[Array, Array]:
    """Return the next reward weights and the next trace.

    Parameters
    ----------
    w, f
        Reward weights w_i and eligibility trace F_i.
    mu_e, mu_i
        Feature expectations of the expert and of the agent.
    mu_b
        Pairs that an incorrect demonstration visits; all false gives Algorithm 1.
    params
        alpha, and the trace by which the weights move (choice F-INDEX): F_i as printed, F_(i+1),
        or F_i but for the pairs of line 12, which move by their maximum at once.

    Returns
    -------
    w, f
        w_(i+1) (Eq. 9) and F_(i+1) (Eq. 10). All arrays are `[state, action]`.

    Notes
    -----
    Eq. 8 prints mu_a for the expert's mu_E. Line 13 of Algorithm 2 stands without an `else`, which
    would overwrite line 12 at once; it is read as the `else` of line 11 (choice LINE-13).
    """
    residual = mu_e - mu_i  # Eq. 8
    wrong = (mu_e == 0) & (mu_i > 0) & mu_b  # Algorithm 2, line 11
    f_next = np.where(wrong, 1.0, f + params.alpha * ((residual != 0) - f))  # line 12, Eq. 10
    used = {"printed": f, "updated": f_next, "at-once": np.where(wrong, 1.0, f)}[params.f_index]
    return w + used * residual, f_next  # Eq. 9
