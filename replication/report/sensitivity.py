"""A picture of what the claims depend on: the effects with one choice changed."""

from __future__ import annotations

import textwrap
from collections.abc import Sequence

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from replication.evidence.claims import short_label
from replication.evidence.sensitivity import HOLDS, UNDEFINED, unchanged
from replication.evidence.specifications import DEFAULT
from replication.report import choices, drawing
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
    """Draw the effects with one choice changed.

    A cell is empty where the choice cannot act on the claim, and has a thin mark where it could but
    left every number as it was; rows without any other cell are named below instead.
    """
    parts = [_acting(part) for _, part in numbers.groupby("claim", sort=False)]
    names = list(dict.fromkeys(numbers["specification"]))
    moved = {name for part in parts for name in part.index[~part["same"]]}
    drawn = [name for name in names if name in moved]
    rows = [(name.partition("=")[0], name.partition("=")[2]) for name in drawn]
    y = drawing.blocks([id for id, _ in rows])
    figure, axes = canvas(1, len(parts), height=1.75 + 0.14 * (y[-1] + 1), sharey=True)
    drawing.pad(figure, wspace=0.02)
    for panel, part in zip(axes, parts, strict=True):
        _draw_claim(panel, part.assign(y=pd.Series(y, drawn)).dropna(subset="y"), len(parts))
        drawing.shade_blocks(panel, [id for id, _ in rows], y)
    drawing.label_blocks(axes[0], rows, y)
    capped = bool((numbers["capped"] > 0).any())
    handles = drawing.outcome_handles("", "no effect", capped=capped)
    handles.append(handle("default", "", "0.1", lw=1, ls=drawing.DASHES))
    if any(part["same"].any() for part in parts):
        handles.append(handle("as the default", "$=$", "0.1", lw=0, ms=6, mew=0))
    handles.append(handle(f"{numbers['n'].max()} trials each, 95 % intervals", "", "none"))
    legend_below(figure, handles)
    if len(drawn) < len(names):
        others = _listed([name for name in names if name not in moved])
        drawing.note(
            figure,
            "Where a panel is empty the choice cannot act on the claim. Not drawn, since no panel "
            f"would have other numbers than by default: {others}.",
        )
    return figure


def _listed(names: Sequence[str]) -> str:
    """Return specifications that change one choice in words, those of one choice together."""
    values: dict[str, list[str]] = {}
    for name in names:
        id, _, value = name.partition("=")
        values.setdefault(id, []).append(choices.value(id, value))
    return "; ".join(f"{choices.title(id)} ({' / '.join(each)})" for id, each in values.items())


def _acting(part: pd.DataFrame) -> pd.DataFrame:
    """Return a claim's rows whose choice can act on it, and which of them have the same numbers."""
    claim = part["claim"].iloc[0]
    acting = [choices.acts(name.partition("=")[0], claim) for name in part["specification"]]
    part = part.assign(same=unchanged(part))[acting]
    return part.set_index("specification")


def _draw_claim(panel: Axes, part: pd.DataFrame, panels: int) -> None:
    first = part.iloc[0]
    drawing.scale(panel, "x", first["statistic"], part["effect"])
    if panel.get_xscale() == "symlog":  # narrow: no room for a tick at each power of ten
        far = 10.0 ** np.floor(np.log10(part["effect"].abs().max()))
        panel.set_xticks([-far, 0, far])
    panel.axvline(first["neutral"], color="0.25", lw=1, zorder=1)
    if part.loc[DEFAULT, "effect"] != first["neutral"]:
        panel.axvline(part.loc[DEFAULT, "effect"], color="0.1", lw=1, ls=drawing.DASHES, zorder=1)
    for row in part[part["same"]].itertuples():
        panel.plot(row.effect, row.y, "s", ms=6, color="white")
        panel.plot(row.effect, row.y, marker="$=$", ms=5, color="0.1", mew=0)
    for row in part[~part["same"] & (part["outcome"] != UNDEFINED)].itertuples():
        colour = OUTCOMES[row.outcome]
        face = "white" if row.capped else colour
        panel.hlines(row.y, row.low, row.high, color=colour, lw=1.3)
        panel.plot(row.effect, row.y, drawing.MARKS[row.outcome], ms=3.4, mec=colour, mfc=face)
    for row in part[part["outcome"] == UNDEFINED].itertuples():
        drawing.beside(panel, UNDEFINED, 0, row.y, 2, color="0.35")
    width = 78 // panels
    panel.set_title(textwrap.fill(short_label(first["claim"]), width), size=8)
    label = drawing.unit(panel, "x", first["statistic"], first["measure"])
    panel.set_xlabel(textwrap.fill(label, width), size=7.5)
    panel.tick_params(axis="x", labelsize=SMALL)
    panel.tick_params(axis="y", left=False, labelleft=False)
    panel.spines["left"].set_visible(False)
