"""The picture of the verdicts on the comparative claims."""

from __future__ import annotations

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Patch
from numpy.typing import NDArray

from replication.evidence.claims import label
from replication.evidence.sensitivity import HOLDS
from replication.evidence.sensitivity import REVERSED as TURNED
from replication.evidence.verdicts import REPRODUCED, REVERSED, by_claim, overall
from replication.report import drawing
from replication.report.drawing import OUTCOMES, SMALL, UNITS, handle
from replication.report.picture import Picture
from replication.report.style import canvas, legend_below, settled

COLOURS = {REPRODUCED: OUTCOMES[HOLDS], REVERSED: OUTCOMES[TURNED]}


def verdicts(table: pd.DataFrame) -> Picture:
    """Show the verdicts on the comparative claims, a panel for each unit.

    `table` is that of :func:`~replication.evidence.verdicts.judge_claims`; claims about published
    numbers are not drawn.
    """
    ids: dict[str, list[str]] = {}
    for id, rows in by_claim(_comparative(table)):
        ids.setdefault(overall(rows["verdict"].tolist()), []).append(id)
    parts = [f"{len(some)} {verdict} ({', '.join(some)})" for verdict, some in ids.items()]
    words = f"Of {sum(map(len, ids.values()))} comparative claims, {'; '.join(parts)}."
    return Picture(table, draw_verdicts, words)


@settled
def draw_verdicts(numbers: pd.DataFrame) -> Figure:
    """Draw the comparative claims of a table of verdicts."""
    table = _comparative(numbers)
    units = [unit for unit in dict.fromkeys(UNITS.values()) if unit in set(table["unit"])]
    parts = [table[table["unit"] == unit] for unit in units]
    sizes = [part["id"].nunique() for part in parts]
    height = 0.4 + 0.37 * len(units) + 0.29 * sum(sizes)
    figure, axes = canvas(len(units), 1, height=height, height_ratios=sizes)
    for panel, unit, part in zip(axes, units, parts, strict=True):
        _draw_unit(panel, part)
        panel.set_xlabel(unit, size=7.5, labelpad=1)
    handles = drawing.reading_handles(table)
    handles += [
        handle("the paper's effect", "v", "0.3", ms=6, mfc="white", lw=0),
        handle("margin", "", "0.25", lw=1),
        Patch(color="0.93", lw=0, label="claimed side"),
    ]
    legend_below(figure, handles)
    return figure


def _comparative(table: pd.DataFrame) -> pd.DataFrame:
    units = [UNITS.get(key) for key in zip(table["statistic"], table["measure"], strict=True)]
    return table.assign(unit=units).dropna(subset="unit")


def _draw_unit(panel: Axes, part: pd.DataFrame) -> None:
    ids = list(dict.fromkeys(part["id"]))
    drawing.scale(panel, "x", part["statistic"].iloc[0], part["effect"])
    _limit(panel, part[["low", "high", "effect", "paper", "margin"]].to_numpy(float))
    for at, (_, rows) in enumerate(by_claim(part)):
        claimed, margin = rows["direction"].iloc[0], rows["margin"].iloc[0]
        side = panel.get_xlim()[int(claimed == "greater")]
        panel.fill_betweenx([at - 0.48, at + 0.48], margin, side, color="0.93", lw=0, zorder=0)
        panel.vlines(margin, at - 0.48, at + 0.48, color="0.25", lw=1, zorder=1)
        for place, row in zip(np.linspace(-0.25, 0.25, len(rows)), rows.itertuples(), strict=True):
            mark, colour = drawing.READING_MARKS[row.reading]
            panel.hlines(at + place, row.low, row.high, color=colour, lw=1.4)
            panel.plot(row.effect, at + place, mark, color=colour, ms=4, zorder=4)
            weight = "bold" if row.verdict in COLOURS else "normal"
            ink = COLOURS.get(row.verdict, "0.35")
            drawing.beside(panel, row.verdict, 1, at + place, 5, color=ink, weight=weight)
        panel.plot(rows["paper"].iloc[0], at, "v", ms=6, mfc="none", mec="0.3", zorder=5)
    panel.set(yticks=range(len(ids)), ylim=(len(ids) - 0.5, -0.5))
    panel.set_yticklabels([f"{label(id)}\n{id}" for id in ids], size=SMALL)
    panel.tick_params(axis="x", labelsize=SMALL, pad=2)
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
