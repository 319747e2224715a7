"""How each method looks in the figures of many trials, and which of them each panel shows."""

from __future__ import annotations

from typing import Any, NamedTuple

import pandas as pd
from matplotlib.lines import Line2D

from replication.evidence.experiments import GENERAL, under
from replication.irl import METHODS, READINGS
from replication.irl.methods import Method
from replication.report.readable import F_LABELS, SET_LABELS

KEY = ["method", "reading", "set"]
"""What tells the conditions of a table of trials apart."""

LISTED = "#009E73"
"""The colour of a method that is given the general list."""


class Look(NamedTuple):
    """How the trials of a method with a set of incorrect demonstrations are drawn."""

    label: str
    colour: str
    dashes: Any

    @property
    def line(self) -> dict[str, Any]:
        """The style of its lines."""
        return {"color": self.colour, "ls": self.dashes}


Panels = dict[str, list[tuple[Look, pd.DataFrame]]]


def panels(numbers: pd.DataFrame) -> Panels:
    """Return each panel's title, and in it the rows of each method and set.

    A method without a trace is in the panel of every reading of Eq. 9.
    """
    readings = [name for name in READINGS if name in set(numbers["reading"])] or [""]
    return {
        F_LABELS[reading]: [
            (_look(method, name), rows)
            for method in METHODS.values()
            for name, rows in under(numbers[numbers["method"] == method.name], reading).groupby(
                "set", sort=False
            )
        ]
        for reading in readings
    }


def _look(method: Method, set: str) -> Look:
    if not method.uses_incorrect:
        return Look(method.label, method.colour, "-")
    # Dashes let the curve below be seen where two are the same.
    dashes = (0, (1, 1)) if set == GENERAL else (0, (4, 1.5))
    label = f"{method.label} ({SET_LABELS.get(set, set)})"
    return Look(label, LISTED if set == GENERAL else method.colour, dashes)


def line_handles(shown: Panels) -> list[Line2D]:
    """Return the legend's entries for the lines of all panels."""
    looks = {look.label: look for rows in shown.values() for look, _ in rows}
    return [Line2D([], [], label=label, lw=1.4, **look.line) for label, look in looks.items()]
