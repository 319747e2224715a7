"""A picture of what the variance of the claims' effects is due to, and of how often they hold."""

from __future__ import annotations

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Patch

from replication.evidence.claims import short_label
from replication.evidence.sensitivity import HOLDS, NOISE, OPEN, REST
from replication.report import choices, drawing
from replication.report.drawing import OUTCOMES, SMALL
from replication.report.picture import Picture
from replication.report.style import canvas, legend_below, settled


def shares(table: pd.DataFrame) -> Picture:
    """Show what the variance of each claim's effect is due to, and how often each claim holds.

    `table` is a :func:`~replication.evidence.sensitivity.shares_table`.
    """
    choices = table[~table["choice"].isin([NOISE, REST, *OUTCOMES])].dropna(subset="share")
    largest = choices.loc[choices.groupby("claim", sort=False)["share"].idxmax()]
    named = [f"{row.choice} for {row.claim} ({row.share:.0%})" for row in largest.itertuples()]
    held = table[table["choice"] == HOLDS]
    holds = [f"{row.claim} in {row.share:.0%}" for row in held.itertuples()]
    words = (
        f"The choice with the largest share of the variance is {', '.join(named)}. Of all "
        f"specifications, claims hold as follows: {', '.join(holds)}."
    )
    return Picture(table, draw_shares, words)


BESIDE = {REST: "choices together", NOISE: "few trials"}
"""What the variance is due to beside single choices, in words."""

SHARES = (
    "Choices together: what no choice explains by itself. Few trials: the sampling error of the "
    "specifications. <1 may be negative by chance; with such shares a row adds up to 100. A dot: "
    "the choice cannot act on the claim."
)


@settled
def draw_shares(numbers: pd.DataFrame) -> Figure:
    """Draw the shares of the variance as a heat map, beside bars of the outcomes."""
    known = list(dict.fromkeys(numbers["choice"]))
    others = [name for name in (REST, NOISE) if name in known]
    varied = [name for name in known if name not in (*others, *OUTCOMES)]
    claims = list(dict.fromkeys(numbers.loc[numbers["choice"].isin(OUTCOMES), "claim"]))
    grid = numbers.pivot(index="claim", columns="choice", values="share").reindex(claims)
    figure, axes = canvas(
        1, 3, height=2.5 + 0.27 * len(grid), sharey=True, width_ratios=(len(varied), 2.4, 5)
    )
    drawing.pad(figure, wspace=0.02, h_pad=0.08)
    for panel, columns, colours in zip(axes, (varied, others), ("Blues", "Greys"), strict=False):
        _draw_cells(panel, grid[columns], colours)
    axes[0].set_yticks(range(len(grid)), [short_label(id) for id in claims], size=7.5)
    axes[0].set_xlabel("share of the variance of the effect (%)", size=7.5)
    axes[1].set_xticklabels([BESIDE[name] for name in others])
    axes[1].tick_params(labelleft=False)
    start = np.zeros(len(grid))
    for outcome, colour in OUTCOMES.items():
        part = grid[outcome].to_numpy(float)
        axes[2].barh(range(len(grid)), part, left=start, height=0.7, color=colour, ec="white")
        for row in np.flatnonzero(part >= 0.1):
            middle, text = start[row] + part[row] / 2, f"{100 * part[row]:.0f}"
            ink = "0.1" if outcome == OPEN else "white"
            axes[2].text(middle, row, text, size=7, ha="center", va="center_baseline", color=ink)
        start += part
    axes[2].set(xlim=(0, 1), xticks=[])
    axes[2].set_xlabel("specifications (%)", size=7.5)
    axes[2].spines[:].set_visible(False)
    axes[2].tick_params(which="both", length=0, labelleft=False)
    legend_below(figure, [Patch(color=colour, label=name) for name, colour in OUTCOMES.items()])
    drawing.note(figure, SHARES)
    return figure


def _draw_cells(panel: Axes, shares: pd.DataFrame, colours: str) -> None:
    """Draw shares of the variance as cells, each with its number in per cent."""
    panel.imshow(shares.clip(lower=0), cmap=colours, vmin=0, vmax=1, aspect="auto")
    for (row, column), value in np.ndenumerate(shares.to_numpy(float)):
        id = shares.columns[column]
        text = _per_cent(value, most=id == NOISE) if choices.acts(id, shares.index[row]) else "·"
        colour = "white" if value > 0.55 else "0.15" if value >= 0.01 else "0.5"
        panel.text(column, row, text, size=7, ha="center", va="center_baseline", color=colour)
    names = map(choices.title, shares.columns)
    panel.set_xticks(range(len(shares.columns)), names, size=SMALL, rotation=90)
    panel.xaxis.tick_top()
    panel.set_xticks(np.arange(len(shares.columns) - 1) + 0.5, minor=True)
    panel.set_yticks(np.arange(len(shares) - 1) + 0.5, minor=True)
    panel.grid(which="minor", color="white", lw=1.5)
    panel.tick_params(which="both", length=0)
    panel.spines[:].set_visible(False)


def _per_cent(share: float, *, most: bool) -> str:
    """Return a share in per cent; a small or negative one is less than one, and noise cut off."""
    if np.isnan(share):
        return "–"
    if most and share >= 1:
        return "≥100"
    return f"{100 * share:.0f}" if share >= 0.01 else "<1"
