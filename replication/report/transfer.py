"""A picture of the value that is lost where a learned reward is used elsewhere."""

from __future__ import annotations

from typing import Any

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MultipleLocator

from replication.baselines import find_method
from replication.evidence.elsewhere import CHANGES
from replication.evidence.transfer import FEATURES, LIMIT, verdict_table
from replication.report.drawing import DASHES, PURPLE, handle
from replication.report.picture import Picture
from replication.report.readable import interval, readable
from replication.report.style import canvas, legend_below, settled

SPREAD = 0.7
"""How much of the place of a change its methods take, side by side."""

MARKS = "osD^vP"

SHORT = {"none": "task\nitself", "mirrored map": "mirror\nimage", "another map": "other\nmap"}
"""How changes are called where the name itself has no room."""


def label(method: str) -> str:
    """Return what a method is called."""
    return "Perceptron, five features" if method == FEATURES else find_method(method).label


def colour(method: str) -> str:
    """Return the colour of a method."""
    return PURPLE if method == FEATURES else find_method(method).colour


def transfer(table: pd.DataFrame) -> Picture:
    """Show the value lost by change.

    `table` is a :func:`~replication.evidence.transfer.transfer_table`.
    """
    parts = []
    for method, own in verdict_table(table).groupby("method", sort=False):
        holds = [_world(change) for change in own["change"][own["transfers"]]]
        parts.append(f"{label(str(method))}: {', '.join(holds) or 'nowhere'}")
    words = f"Value lost by change, and where at most {LIMIT} of it is lost in every task"
    return Picture(table, draw_transfer, f"{words}. {'; '.join(parts)}.")


def _world(change: str) -> str:
    """Return where a reward is used: what did not change is the task itself."""
    return "the task itself" if change == "none" else change


@settled
def draw_transfer(numbers: pd.DataFrame) -> Figure:
    """Draw a panel for each task, and one for the worst task of each method and change."""
    methods = list(dict.fromkeys(numbers["method"]))
    panels = dict(list(numbers.groupby("task", sort=False)))
    panels["worst of these"] = verdict_table(numbers)
    figure, axes = canvas(-(-len(panels) // 2), 2, height=6.6, sharey=True)
    for letter, panel, (task, rows) in zip("abcdefgh", axes.flat, panels.items(), strict=False):
        _draw_panel(panel, rows, methods)
        panel.set_title(f"({letter}) {task.replace('-', ' ')}", size=8, loc="left")
    for panel in axes.flat[len(panels) :]:
        panel.set_axis_off()
    for panel in axes[:, 0]:
        panel.set_ylabel("value lost", size=8)
        panel.yaxis.set_major_locator(MultipleLocator(0.5))
    handles = [
        handle(label(method), mark, colour(method), lw=0)
        for method, mark in zip(methods, MARKS, strict=False)
    ]
    n = numbers["n"].max()
    handles.append(handle(f"95 % interval, {n} trials with chance", "|", "0.4", lw=0, ms=9))
    handles.append(handle(f"limit of transfer, {LIMIT}", "", "0.25", lw=1, ls=DASHES))
    legend_below(figure, handles)
    return figure


def _draw_panel(panel: Axes, rows: pd.DataFrame, methods: list[str]) -> None:
    """Draw the values lost at each change, one mark and colour a method."""
    changes = [change for change in CHANGES if change in set(rows["change"])]
    for place in range(0, len(changes), 2):
        panel.axvspan(place - 0.5, place + 0.5, color="0.96", lw=0, zorder=-1)
    panel.axhline(LIMIT, color="0.25", lw=1, ls=DASHES, zorder=0)
    shifts = (np.arange(len(methods)) - (len(methods) - 1) / 2) * SPREAD / len(methods)
    for method, mark, shift in zip(methods, MARKS, shifts, strict=False):
        own = rows[rows["method"] == method].set_index("change").loc[changes]
        x = np.arange(len(changes)) + shift
        style: dict[str, Any] = {"color": colour(method), "lw": 1.1}
        panel.vlines(x, own["low"], own["high"], **style)
        panel.plot(x, own["lost"], mark, ms=3.2, color=colour(method))
    names = [SHORT.get(name, name.replace(" ", "\n")) for name in changes]
    panel.set_xticks(range(len(changes)), names, size=7)
    panel.set_xlim(-0.5, len(changes) - 0.5)


def readable_transfer(table: pd.DataFrame) -> pd.DataFrame:
    """Return where each method's reward transfers, a row for each method and change.

    `table` is a :func:`~replication.evidence.transfer.verdict_table`.
    """
    said = {True: "transfers", False: "does not transfer"}
    return readable(
        table,
        {
            "Method": lambda row: label(row.method),
            "Used in": lambda row: _world(row.change),
            "Verdict": lambda row: said[row.transfers],
            "Predicted": lambda row: said[row.predicted],
            "Worst task": lambda row: row.worst.replace("-", " "),
            "Value lost there [95 %]": lambda row: interval(row.lost, row.low, row.high),
        },
    )
