"""Pictures of what the claims depend on: single choices, and shares of the variance."""

from __future__ import annotations

import textwrap
from collections.abc import Sequence

import numpy as np
import pandas as pd
from matplotlib.figure import Figure
from matplotlib.patches import Patch

from replication.evidence.claims import short_label
from replication.evidence.sensitivity import HOLDS, NOISE, OPEN, REST, UNDEFINED, unchanged
from replication.evidence.specifications import DEFAULT
from replication.report import drawing
from replication.report.drawing import OUTCOMES, SMALL, handle
from replication.report.picture import Picture
from replication.report.style import canvas, legend_below, settled


def single(effects: pd.DataFrame, claims: Sequence[str]) -> Picture:
    """Show the effects with one choice changed, a row for each value and a panel for each claim.

    `effects` is an :func:`~replication.evidence.sensitivity.effects_table`, of which the group
    "single" is drawn for two to four claims that have the same specifications.
    """
    rows = effects[effects["group"] == "single"]
    parts = [rows[rows["claim"] == claim] for claim in claims]
    texts = []
    for claim, part in zip(claims, parts, strict=True):
        default = part["specification"] == DEFAULT
        usual, others = part.loc[default, "outcome"].item(), part[~default]
        texts.append(
            f"{claim} {usual if usual == HOLDS else 'is ' + usual} by default; with one choice "
            f"changed it holds in {drawing.holding(others)}, is {drawing.counted(others)}; "
            f"{int(unchanged(part).sum())} of them have the numbers of the default"
        )
    return Picture(pd.concat(parts, ignore_index=True), draw_single, f"{'. '.join(texts)}.")


@settled
def draw_single(numbers: pd.DataFrame) -> Figure:
    """Draw the effects with one choice changed."""
    parts = [part for _, part in numbers.groupby("claim", sort=False)]
    names = parts[0]["specification"].tolist()
    rows = [(name.partition("=")[0], name.partition("=")[2]) for name in names]
    ids = [id for id, _ in rows]
    y = drawing.blocks(ids)
    figure, axes = canvas(1, len(parts), height=1.5 + 0.128 * (y[-1] + 1), sharey=True)
    for panel, part in zip(axes, parts, strict=True):
        first = part.iloc[0]
        part = part.set_index("specification").loc[names].assign(y=y)
        drawing.scale(panel, "x", first["statistic"], part["effect"])
        if panel.get_xscale() == "symlog":  # narrow: no room for a tick at each power of ten
            far = 10.0 ** np.floor(np.log10(part["effect"].abs().max()))
            panel.set_xticks([-far, 0, far])
        panel.axvline(first["neutral"], color="0.25", lw=1, zorder=1)
        panel.axvline(part.loc[DEFAULT, "effect"], color="0.1", lw=1, ls=(0, (4, 2)), zorder=1)
        for row in part[part["outcome"] != UNDEFINED].itertuples():
            colour = OUTCOMES[row.outcome]
            face = "white" if row.capped else colour
            panel.hlines(row.y, row.low, row.high, color=colour, lw=1.3)
            panel.plot(row.effect, row.y, drawing.MARKS[row.outcome], ms=3.4, mec=colour, mfc=face)
        for row in part[part["outcome"] == UNDEFINED].itertuples():
            drawing.beside(panel, UNDEFINED, 0, row.y, 2, color="0.35")
        width = 78 // len(parts)
        title = textwrap.fill(short_label(first["claim"]), width)
        panel.set_title(f"{title}\n{first['claim']}", size=7.5)
        label = "".join(drawing.unit(panel, "x", first["statistic"], first["measure"]))
        panel.set_xlabel(textwrap.fill(label, width), size=7.5)
        panel.tick_params(axis="x", labelsize=SMALL)
        panel.tick_params(axis="y", left=False, labelleft=False)
        panel.spines["left"].set_visible(False)
        drawing.shade_blocks(panel, ids, y)
    drawing.label_blocks(axes[0], rows, y)
    capped = bool((numbers["capped"] > 0).any())
    handles = drawing.outcome_handles("", "no effect", capped=capped)
    handles.append(handle("default", "", "0.1", lw=1, ls=(0, (4, 2))))
    legend_below(figure, handles)
    return figure


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


@settled
def draw_shares(numbers: pd.DataFrame) -> Figure:
    """Draw the shares of the variance as a heat map, beside bars of the outcomes."""
    known = list(dict.fromkeys(numbers["choice"]))
    others = [name for name in (NOISE, REST) if name in known]
    choices = [name for name in known if name not in (*others, *OUTCOMES)]
    claims = list(dict.fromkeys(numbers.loc[numbers["choice"].isin(OUTCOMES), "claim"]))
    grid = numbers.pivot(index="claim", columns="choice", values="share").reindex(claims)
    figure, axes = canvas(
        1, 3, height=1.7 + 0.32 * len(grid), sharey=True, width_ratios=(len(choices), 2.5, 5)
    )
    drawing.pad(figure, wspace=0.02, h_pad=0.08)
    for panel, columns, colours in zip(axes, (choices, others), ("Blues", "Greys"), strict=False):
        values = grid[columns].to_numpy(float)
        panel.imshow(values, cmap=colours, vmin=0, vmax=1, aspect="auto")
        for (row, column), value in np.ndenumerate(values):
            text = "–" if np.isnan(value) else drawing.number(round(100 * value))
            text = "≥100" if columns[column] == NOISE and value >= 1 else text
            colour = "white" if value > 0.55 else "0.15" if abs(value) >= 0.005 else "0.65"
            panel.text(column, row, text, size=7, ha="center", va="center_baseline", color=colour)
        panel.set_xticks(range(len(columns)), columns, size=SMALL, rotation=90)
        panel.xaxis.tick_top()
        panel.set_xticks(np.arange(len(columns) - 1) + 0.5, minor=True)
        panel.set_yticks(np.arange(len(grid) - 1) + 0.5, minor=True)
        panel.grid(which="minor", color="white", lw=1.5)
        panel.tick_params(which="both", length=0)
        panel.spines[:].set_visible(False)
    labels = [f"{short_label(id)}\n{id}" for id in claims]
    axes[0].set_yticks(range(len(grid)), labels, size=SMALL)
    axes[0].set_xlabel("share of the effect's variance (%)", size=7.5)
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
    axes[1].tick_params(labelleft=False)
    legend_below(figure, [Patch(color=colour, label=name) for name, colour in OUTCOMES.items()])
    return figure
