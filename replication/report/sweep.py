"""A picture of the saving against the number of incorrect demonstrations."""

from __future__ import annotations

import pandas as pd
from matplotlib.figure import Figure
from matplotlib.patches import Patch
from matplotlib.ticker import NullLocator

from replication.report import drawing
from replication.report.drawing import handle
from replication.report.picture import Picture
from replication.report.readable import F_LABELS
from replication.report.style import canvas, legend_below, settled


def numbers(table: pd.DataFrame) -> Picture:
    """Show the iterations saved against the number of marked pairs.

    `table` is a :func:`~replication.evidence.sweep.numbers_table`.
    """
    parts = []
    for reading, rows in table.groupby("reading", sort=False):
        most = rows.loc[rows["pairs"].idxmax()]
        parts.append(
            f"{most['saved']:.1f} [{most['saved_low']:.1f}, {most['saved_high']:.1f}] iterations "
            f"under {F_LABELS[str(reading)]}"
        )
    pairs = table["pairs"].max()
    words = f"With the most marked pairs, {pairs}, incorrect demonstrations save"
    return Picture(table, draw_numbers, f"{words} {', '.join(parts)}.")


@settled
def draw_numbers(numbers: pd.DataFrame) -> Figure:
    """Draw the saving of each number of demonstrations, and the published one."""
    figure, (panel,) = canvas(1, 1, height=3.4)
    pairs = numbers.drop_duplicates("pairs").sort_values("pairs")
    linear = float(pairs["pairs"][pairs["pairs"] > 0].min())
    panel.set_xscale("symlog", linthresh=linear, linscale=0.3)
    panel.axhline(0, color="0.25", lw=1)
    panel.axhline(numbers["paper"].iloc[0], color="0.3", lw=1, ls=(0, (4, 2)))
    for reading, rows in numbers.groupby("reading", sort=False):
        mark, colour = drawing.READING_MARKS[str(reading)]
        rows = rows.sort_values("pairs")
        low, high = rows["saved_low"], rows["saved_high"]
        panel.fill_between(rows["pairs"], low, high, color=colour, alpha=0.15, lw=0)
        panel.plot(rows["pairs"], rows["saved"], color=colour, marker=mark, ms=4.5)
    ticks = [f"{row.pairs}\n({row.number})" for row in pairs.itertuples()]
    panel.set_xticks(pairs["pairs"], ticks)
    panel.xaxis.set_minor_locator(NullLocator())
    panel.tick_params(axis="x", labelsize=7.5)
    panel.set(xlabel="marked pairs of state and action (incorrect demonstrations), log axis")
    panel.set(ylabel="iterations saved, same seeds")
    handles = drawing.reading_handles(numbers)
    handles.append(Patch(color="0.4", alpha=0.25, lw=0, label="95 % interval of the mean"))
    handles.append(handle("the paper's saving", "", "0.3", lw=1, ls=(0, (4, 2))))
    legend_below(figure, handles)
    return figure
