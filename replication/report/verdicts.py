"""The picture of the verdicts on the comparative claims."""

from __future__ import annotations

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Patch
from numpy.typing import NDArray

from replication.evidence.claims import label, load_claims
from replication.evidence.experiments import NONE
from replication.evidence.verdicts import (
    ABSENT,
    INCONCLUSIVE,
    NOT_TESTABLE,
    REVERSED,
    SHOWN,
    by_claim,
)
from replication.irl import READINGS
from replication.report import drawing
from replication.report.drawing import READING_MARKS, SMALL, UNITS, handle
from replication.report.picture import Picture
from replication.report.readable import F_LABELS, SET_LABELS, sentence
from replication.report.style import canvas, legend_below, settled

COLOURS = {
    SHOWN: "#0072B2",
    ABSENT: "#B04A00",
    REVERSED: "#AA3377",
    INCONCLUSIVE: "#777777",
    NOT_TESTABLE: "#777777",
}
"""A colour for each verdict; its word stands beside it."""

APART, CELL = 0.5, 0.103
"""Space between two rows, in cells, and the height of a cell in inches."""


def verdicts(table: pd.DataFrame) -> Picture:
    """Show the verdicts on the comparative claims, a panel for each unit.

    `table` is that of :func:`~replication.evidence.verdicts.judge_claims`; claims about published
    numbers are not drawn.
    """
    parts = [f"{label(id)}: {sentence(rows)}" for id, rows in by_claim(_comparative(table))]
    return Picture(table, draw_verdicts, f"{'. '.join(parts)}.")


@settled
def draw_verdicts(numbers: pd.DataFrame) -> Figure:
    """Draw the comparative claims of a table of verdicts: a line for each cell, with its verdict.

    Where the margin is a share of what the second method needs, effects are drawn as shares of it,
    so that tasks fit on one axis.
    """
    table = _comparative(numbers)
    units = [unit for unit in dict.fromkeys(UNITS.values()) if unit in set(table["unit"])]
    parts = [table[table["unit"] == unit] for unit in units]
    sizes = [_places(part)[-1] + 1 + APART for part in parts]
    height = 0.55 + 0.38 * len(units) + CELL * sum(sizes)
    figure, axes = canvas(len(units), 1, height=height, height_ratios=sizes)
    for panel, unit, part in zip(axes, units, parts, strict=True):
        relative = bool(part["fraction"].notna().all())
        _draw_unit(panel, _relative(part) if relative else part)
        symmetric = ", symmetric log axis" if panel.get_xscale() == "symlog" else ""
        name = f"{unit} (%)" if relative else unit
        panel.set_xlabel(f"{name}{symmetric}", size=7.5, labelpad=1)
        panel.tick_params(axis="x", labelsize=7.5)
    readings = [name for name in READINGS if name in set(table["reading"])]
    handles = [handle(F_LABELS[name], READING_MARKS[name][0], "0.3", lw=1.3) for name in readings]
    handles += [
        handle("the paper's effect", "|", "0.1", ms=9, mew=1.2, lw=0),
        Patch(color="0.9", lw=0, label="within the margin"),
    ]
    legend_below(figure, handles)
    return figure


def _comparative(table: pd.DataFrame) -> pd.DataFrame:
    units = [UNITS.get(key) for key in zip(table["statistic"], table["measure"], strict=True)]
    fractions = {claim.id: claim.fraction for claim in load_claims().claim}
    fraction = table["id"].map(fractions).astype(float)
    return table.assign(unit=units, fraction=fraction).dropna(subset="unit")


def _relative(part: pd.DataFrame) -> pd.DataFrame:
    """Return effects in per cent of what the second method needs, of which the margin is a share.

    A cell without numbers gets the margin of the others.
    """
    scaled = part[["effect", "low", "high", "paper"]].mul(100 * part["fraction"], axis=0)
    scaled = scaled.div(part["margin"], axis=0)
    return part.assign(**scaled, margin=100 * part["fraction"])


def _places(part: pd.DataFrame) -> NDArray[np.float64]:
    """Return where the cells lie, with space between rows: claims, each with a set."""
    rows = part[["id", "set"]].ne(part[["id", "set"]].shift()).any(axis=1).to_numpy()
    return np.arange(len(part)) + APART * (np.cumsum(rows) - 1)


def _draw_unit(panel: Axes, part: pd.DataFrame) -> None:
    ratio, share = (part["statistic"].iloc[0] == name for name in ("sd-ratio", "share"))
    part = part.assign(y=_places(part))
    rows = [cells for _, cells in part.groupby(["id", "set"], sort=False)]
    drawing.scale(panel, "x", part["statistic"].iloc[0], part["effect"])
    margins = part["margin"].to_numpy(float)
    known = part[["low", "high", "effect", "paper"]].to_numpy(float).ravel()
    neutral = [] if share else [[float(ratio)], 1 / margins if ratio else -margins]
    _limit(panel, np.concatenate([known, margins, *neutral]))
    if not share:
        panel.axvline(float(ratio), color="0.25", lw=1, zorder=1)
    for cells in rows:
        top, bottom = cells["y"].iloc[0] - 0.5 - APART / 4, cells["y"].iloc[-1] + 0.5 + APART / 4
        margin = cells["margin"].max()
        if not np.isnan(margin):
            span = (margin, 1 / margin) if ratio else (-margin, margin)
            span = (panel.get_xlim()[0], margin) if share else span
            panel.fill_betweenx([top, bottom], *span, color="0.9", lw=0, zorder=0)
        panel.vlines(cells["paper"].iloc[0], top, bottom, color="0.1", lw=1.2, zorder=2)
        for row in cells.itertuples():
            mark, colour = READING_MARKS[row.reading][0], COLOURS[row.verdict]
            panel.hlines(row.y, row.low, row.high, color=colour, lw=1.6)
            panel.plot(row.effect, row.y, mark, ms=3.8, color=colour, zorder=3)
            if cells["verdict"].nunique() > 1:
                drawing.beside(panel, row.verdict, 1, row.y, 6, color=colour)
        if cells["verdict"].nunique() == 1:
            verdict = cells["verdict"].iloc[0]
            drawing.beside(panel, verdict, 1, cells["y"].mean(), 6, color=COLOURS[verdict])
    panel.set_ylim(part["y"].iloc[-1] + 0.5 + APART / 2, -0.5 - APART / 2)
    panel.set_yticks([cells["y"].mean() for cells in rows], map(_name, rows), size=SMALL)
    panel.tick_params(axis="y", length=0)
    panel.spines["left"].set_visible(False)


def _name(cells: pd.DataFrame) -> str:
    text, set = label(cells["id"].iloc[0]), cells["set"].iloc[0]
    return text if set == NONE else f"{text}: {SET_LABELS[set]}"


def _limit(panel: Axes, values: NDArray[np.float64]) -> None:
    """Give the x axis room for all values, so that something can be drawn up to its ends."""
    log = panel.get_xscale() == "log"
    used = values[np.isfinite(values) & ((values > 0) | (not log))]
    used = np.log(used) if log else used
    room = 0.05 * (used.max() - used.min()) or 0.05
    ends = used.min() - room, used.max() + room
    panel.set_xlim(*(np.exp(ends) if log else ends))
