"""The registry of methods: each is a start and an update for one loop."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from replication.choices import unknown_name
from replication.irl import adaboost, unified
from replication.params import Update

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Method:
    """An IRL method: all that tells it from the others.

    Attributes
    ----------
    name, label
        For parameters and data; for tables and figures.
    uses_incorrect
        Whether mu_B is given to the update; otherwise it sees no incorrect pair.
    start
        Returns what the update remembers before the first iteration, `[state, action]`.
    update
        Returns the next reward weights and memory from the present ones, mu_E, mu_i and mu_B.
    """

    name: str
    label: str
    uses_incorrect: bool
    start: Callable[[tuple[int, int], Update], Array]
    update: Callable[
        [Array, Array, Array, Array, NDArray[np.bool_], Update],
        tuple[Array, Array],
    ]


METHODS: dict[str, Method] = {
    method.name: method
    for method in (
        Method("adaboost", "AdaBoost-IRL (R1)", False, adaboost.start, adaboost.update),
        Method("unified", "Unified, without incorrect", False, unified.start, unified.update),
        Method("unified-incorrect", "Unified, with incorrect", True, unified.start, unified.update),
    )
}


def get_method(name: str) -> Method:
    """Return the method of that name.

    Raises
    ------
    ChoiceError
        If there is none; the error lists those that exist.

    Examples
    --------
    >>> get_method("unified").label
    'Unified, without incorrect'
    """
    if name not in METHODS:
        raise unknown_name(name, list(METHODS), "method")
    return METHODS[name]
