"""A picture of the saving against the number of incorrect demonstrations."""

from __future__ import annotations

from typing import Any

import pandas as pd
from matplotlib.figure import Figure
from matplotlib.ticker import NullLocator
from matplotlib.transforms import ScaledTranslation

from replication.irl import READINGS
from replication.report import drawing
from replication.report.drawing import handle
from replication.report.picture import Picture
from replication.report.readable import F_LABELS
from replication.report.style import canvas, legend_below, settled

APART = 0.09
"""Between the marks of two readings, in inches: those that agree do not hide one another."""


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
    """Draw the saving of each number of demonstrations, and the published one.

    The numbers of demonstrations stand above, the pairs of state and action that they mark below.
    """
    figure, (panel,) = canvas(1, 1, height=3.5)
    pairs = numbers.drop_duplicates("pairs").sort_values("pairs")
    panel.axhline(0, color="0.25", lw=1)
    paper = numbers["paper"].iloc[0]
    panel.axhline(paper, color="0.3", lw=1, ls=drawing.DASHES)
    panel.annotate(f"the paper: {paper:.2f}", (0, paper), (0, 3), textcoords="offset points")
    above = panel.twiny()
    linear = float(pairs["pairs"][pairs["pairs"] > 0].min())
    for axes, name in ((panel, "pairs"), (above, "number")):
        axes.set_xscale("symlog", linthresh=linear, linscale=0.3)
        axes.set_xlim(-0.3 * linear, 1.15 * pairs["pairs"].max())
        axes.set_xticks(pairs["pairs"], pairs[name].astype(str), size=7.5)
        axes.xaxis.set_minor_locator(NullLocator())
    above.spines["top"].set_visible(True)
    above.set_xlabel("incorrect demonstrations")
    panel.set_xlabel(f"pairs of state and action that they mark (log axis from {linear:g} on)")
    panel.set_ylabel("iterations saved, same seeds")
    low, high = numbers["saved_low"].min(), max(numbers["saved_high"].max(), paper)
    panel.set_ylim(low - 0.04 * (high - low), high + 0.04 * (high - low))
    for reading, rows in numbers.groupby("reading", sort=False):
        mark, colour = drawing.READING_MARKS[str(reading)]
        rows, shift = rows.sort_values("pairs"), APART * (list(READINGS).index(str(reading)) - 1)
        beside = ScaledTranslation(shift, 0, figure.dpi_scale_trans)
        style: dict[str, Any] = {"color": colour, "transform": panel.transData + beside}
        panel.vlines(rows["pairs"], rows["saved_low"], rows["saved_high"], lw=1.4, **style)
        panel.plot(rows["pairs"], rows["saved"], lw=0.8, marker=mark, ms=4.5, **style)
    handles = drawing.reading_handles(numbers)
    handles.append(handle("95 % interval of the mean", "|", "0.4", lw=0, ms=9))
    legend_below(figure, handles)
    return figure
