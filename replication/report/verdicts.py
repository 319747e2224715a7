"""The picture of the verdicts on the comparative claims."""

from __future__ import annotations

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Patch
from numpy.typing import NDArray

from replication.evidence.claims import label
from replication.evidence.experiments import NONE
from replication.evidence.verdicts import ABSENT, INCONCLUSIVE, REVERSED, SHOWN, by_claim
from replication.report import drawing
from replication.report.drawing import SMALL, UNITS, handle
from replication.report.picture import Picture
from replication.report.readable import F_LABELS, SET_LABELS, sentence
from replication.report.style import canvas, legend_below, settled

COLOURS = {SHOWN: "#0072B2", ABSENT: "#D55E00", REVERSED: "#CC79A7", INCONCLUSIVE: "#8A8A8A"}
"""A colour for each verdict that is drawn."""


def verdicts(table: pd.DataFrame) -> Picture:
    """Show the verdicts on the comparative claims, a panel for each unit.

    `table` is that of :func:`~replication.evidence.verdicts.judge_claims`; claims about published
    numbers are not drawn.
    """
    parts = [f"{label(id)}: {sentence(rows)}" for id, rows in by_claim(_comparative(table))]
    return Picture(table, draw_verdicts, f"{'. '.join(parts)}.")


@settled
def draw_verdicts(numbers: pd.DataFrame) -> Figure:
    """Draw the comparative claims of a table of verdicts: a line for each claim and set."""
    table = _comparative(numbers)
    units = [unit for unit in dict.fromkeys(UNITS.values()) if unit in set(table["unit"])]
    parts = [table[table["unit"] == unit] for unit in units]
    sizes = [len(part[["id", "set"]].drop_duplicates()) for part in parts]
    height = 0.4 + 0.4 * len(units) + 0.3 * sum(sizes)
    figure, axes = canvas(len(units), 1, height=height, height_ratios=sizes)
    for panel, unit, part in zip(axes, units, parts, strict=True):
        _draw_unit(panel, part)
        panel.set_xlabel(unit, size=7.5, labelpad=1)
    used = [name for name in COLOURS if name in set(table["verdict"])]
    handles = [handle(name, "", COLOURS[name], lw=2.2) for name in used]
    readings = [name for name in drawing.READING_MARKS if name in set(table["reading"]) - {""}]
    handles += [
        handle(F_LABELS[name], drawing.READING_MARKS[name][0], "0.3", lw=0) for name in readings
    ]
    handles += [
        handle("the paper's effect", "v", "0.3", ms=6, mfc="white", lw=0),
        Patch(color="0.9", lw=0, label="within the margin"),
    ]
    legend_below(figure, handles)
    return figure


def _comparative(table: pd.DataFrame) -> pd.DataFrame:
    units = [UNITS.get(key) for key in zip(table["statistic"], table["measure"], strict=True)]
    return table.assign(unit=units).dropna(subset="unit")


def _draw_unit(panel: Axes, part: pd.DataFrame) -> None:
    rows = [(id, set) for id, cells in by_claim(part) for set in cells["set"].unique()]
    ratio, share = (part["statistic"].iloc[0] == name for name in ("sd-ratio", "share"))
    drawing.scale(panel, "x", part["statistic"].iloc[0], part["effect"])
    _limit(panel, part[["low", "high", "effect", "paper", "margin"]].to_numpy(float))
    if not share:
        panel.axvline(float(ratio), color="0.25", lw=1, zorder=1)
    for at, (id, set) in enumerate(rows):
        cells = part[(part["id"] == id) & (part["set"] == set)]
        margin = cells["margin"].max()
        if not np.isnan(margin):
            ends = (margin, 1 / margin) if ratio else (-margin, margin)
            ends = (panel.get_xlim()[0], margin) if share else ends
            panel.fill_betweenx([at - 0.48, at + 0.48], *ends, color="0.9", lw=0, zorder=0)
        for place, row in zip(
            np.linspace(-0.28, 0.28, len(cells)), cells.itertuples(), strict=True
        ):
            mark, _ = drawing.READING_MARKS[row.reading]
            colour = COLOURS.get(row.verdict, "0.5")
            panel.hlines(at + place, row.low, row.high, color=colour, lw=1.6)
            panel.plot(row.effect, at + place, mark, ms=4, color=colour, zorder=3)
        paper = cells["paper"].iloc[0]
        if not np.isnan(paper):
            panel.plot(paper, at, "v", ms=6, mfc="white", mec="0.3", zorder=4)
    panel.set_ylim(len(rows) - 0.5, -0.5)
    names = [label(id) if set == NONE else f"{label(id)}: {SET_LABELS[set]}" for id, set in rows]
    panel.set_yticks(range(len(rows)), names, size=SMALL)
    panel.tick_params(axis="y", length=0)
    panel.spines["left"].set_visible(False)


def _limit(panel: Axes, values: NDArray[np.float64]) -> None:
    """Give the x axis room for all values, so that something can be drawn up to its ends."""
    log = panel.get_xscale() == "log"
    used = values[np.isfinite(values) & ((values > 0) | (not log))]
    used = np.log(used) if log else used
    room = 0.05 * (used.max() - used.min()) or 0.05
    ends = used.min() - room, used.max() + room
    panel.set_xlim(*(np.exp(ends) if log else ends))
