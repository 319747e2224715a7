"""A baseline: a method of the paper's loop, or one that finds its reward beforehand."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from replication.baselines.problem import Problem
from replication.irl import Method
from replication.paper.params import Update

Array = NDArray[np.float64]


def _forget(shape: tuple[int, int], params: Update) -> Array:
    """Return a memory that holds nothing."""
    return np.zeros(shape)


def _keep(
    w: Array, memory: Array, mu_e: Array, mu_i: Array, mu_b: NDArray[np.bool_], params: Update
) -> tuple[Array, Array]:
    """Leave the weights as they are."""
    return w, memory


@dataclass(frozen=True, kw_only=True)
class Baseline(Method):
    """A method beside those of the paper; by default it has no trace, no memory and no update.

    Attributes
    ----------
    find
        For a method without a loop: returns its weights [state, action].
    needs_incorrect
        Whether there is nothing to learn without incorrect demonstrations.
    """

    readings: tuple[str, ...] = ("",)
    use: str = "nothing"
    baseline: str = ""
    start: Callable[[tuple[int, int], Update], Array] = _forget
    update: Callable[
        [Array, Array, Array, Array, NDArray[np.bool_], Update], tuple[Array, Array]
    ] = _keep
    find: Callable[[Problem], Array] | None = None
    needs_incorrect: bool = False
