"""The registry of methods: each is a start and an update for the one loop."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from replication.errors import unknown
from replication.irl import adaboost, unified
from replication.paper.params import Update
from replication.paper.register import ChoiceError

Array = NDArray[np.float64]


@dataclass(frozen=True, kw_only=True)
class Method:
    """An IRL method, and all that the rest of the package needs to know about it.

    Attributes
    ----------
    name, label, colour
        Its name in parameters and data, in tables and figures, and its colour in figures.
    readings
        The readings of Eq. 9 (choice F-INDEX) under which it is run; a single "" if it has no
        trace.
    use
        What it makes of incorrect demonstrations: "nothing", "marked pairs", whose mu_B the update
        is given, or "whole trajectories".
    baseline
        Name of the method that it is compared with, or "".
    start
        Returns the memory of the update before the first iteration, `[state, action]`.
    update
        Returns the next weights and memory, given the current ones, mu_E, mu_i and mu_B.
    """

    name: str
    label: str
    colour: str
    readings: tuple[str, ...]
    use: str
    baseline: str
    start: Callable[[tuple[int, int], Update], Array]
    update: Callable[
        [Array, Array, Array, Array, NDArray[np.bool_], Update],
        tuple[Array, Array],
    ]

    @property
    def uses_incorrect(self) -> bool:
        """Whether it is given incorrect demonstrations."""
        return self.use != "nothing"

    def under(self, reading: str) -> str:
        """Return the reading under which this method is run when others are run under `reading`.

        Without incorrect demonstrations nothing is set to the maximum at once, and what is left
        of that reading is the printed one.
        """
        if self.readings == ("",):
            return ""
        return reading if reading in self.readings else "printed"


TRACES = ("printed", "updated")
"""Readings of Eq. 9 (choice F-INDEX): the weights move by F_i as printed, or by F_(i+1)."""

READINGS = (*TRACES, "at-once")
"""All readings: also F_i, but for marked wrong pairs, which move by their maximum at once."""

METHODS: dict[str, Method] = {
    method.name: method
    for method in (
        Method(
            name="adaboost",
            label="AdaBoost-IRL (R1)",
            colour="#7A7A7A",
            readings=("",),
            use="nothing",
            baseline="",
            start=adaboost.start,
            update=adaboost.update,
        ),
        Method(
            name="unified",
            label="Unified, without incorrect",
            colour="#0072B2",
            readings=TRACES,
            use="nothing",
            baseline="adaboost",
            start=unified.start,
            update=unified.update,
        ),
        Method(
            name="unified-incorrect",
            label="Unified, with incorrect",
            colour="#D55E00",
            readings=READINGS,
            use="marked pairs",
            baseline="unified",
            start=unified.start,
            update=unified.update,
        ),
    )
}
"""In the order in which tables and figures show them. A new method is one more row."""


def get_method(name: str) -> Method:
    """Return the method of that name.

    Raises
    ------
    ChoiceError
        If there is none; the message lists those that exist.

    Examples
    --------
    >>> get_method("unified").label
    'Unified, without incorrect'
    """
    if name not in METHODS:
        raise ChoiceError(unknown(name, METHODS, "method"))
    return METHODS[name]
