"""The picture of the verdicts on the comparative claims."""

from __future__ import annotations

import re
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Patch

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
from replication.report.drawing import BLUE, INK, READING_MARKS, TASKS, UNITS, VERMILION, handle
from replication.report.picture import Picture
from replication.report.readable import F_LABELS, SET_LABELS, sentence
from replication.report.style import canvas, legend_below, settled

LOOKS: dict[str, dict[str, Any]] = {
    SHOWN: {"ec": BLUE, "fc": BLUE, "ls": "-"},
    ABSENT: {"ec": INK, "fc": "white", "ls": "-"},
    REVERSED: {"ec": VERMILION, "fc": VERMILION, "ls": "-"},
    INCONCLUSIVE: {"ec": "#777777", "fc": "white", "ls": (0, (2, 1.2))},
    NOT_TESTABLE: {"ec": "#777777", "fc": "#E4E4E4", "ls": "-"},
}
"""Edge and face of a verdict's marks; its word stands beside them."""

SHARE, SPARED, GROWTH = (
    "trials that reach zero (%)",
    "spared, in % of those without incorrect demonstrations",
    "growth from mid-term to end, of Q and of the reward",
)
"""What the axes of claims show whose effects are not drawn in the unit of their statistic."""

TYPE = 8.5
ROW, HEADING, HEAD, AXIS = 0.25, 1.05, 1.3, 0.33
"""Height of a row in inches, of a heading and the columns' head in rows, of an axis in inches."""

APART = 0.29
"""Between two readings, in rows."""

NAMES, NUMBERS, COLUMN, WORDS = -116, 26, 37, 124
"""Where texts stand, in points from the left or right end of a panel."""


def verdicts(table: pd.DataFrame) -> Picture:
    """Show the verdicts on the comparative claims, a panel for each unit.

    `table` is that of :func:`~replication.evidence.verdicts.judge_claims`; claims about published
    numbers are not drawn.
    """
    parts = [f"{label(id)}: {sentence(rows)}" for id, rows in by_claim(_comparative(table))]
    return Picture(table, draw_verdicts, f"{'. '.join(parts)}.")


@settled
def draw_verdicts(numbers: pd.DataFrame) -> Figure:
    """Draw the comparative claims of a table of verdicts: a row for each claim, task and set.

    A row has a mark for each reading of Eq. 9 and, at the right, its effect and the verdict.
    """
    table = _scaled(_comparative(numbers))
    parts = [part for _, part in table.groupby("axis", sort=False)]
    tops = [0.6 + HEAD * (place == 0) for place in range(len(parts))]
    heights = [ROW * (part["row"].max() + 0.6 + top) for part, top in zip(parts, tops, strict=True)]
    whole = sum(heights) + AXIS * len(parts) + 0.62
    figure, axes = canvas(len(parts), 1, height=whole, height_ratios=heights)
    drawing.pad(figure, h_pad=0.03)
    for panel, part, top in zip(axes, parts, tops, strict=True):
        _draw(panel, part)
        panel.set_ylim(part["row"].max() + 0.6, -top)
    _head(axes[0], -tops[0])
    used = [name for name in LOOKS if name in set(table["verdict"])]
    handles: list[Artist] = [Patch(label=name, **LOOKS[name]) for name in used]
    handles += [
        handle("95 % interval", "", INK, lw=1.5),
        handle("the paper's effect", "|", INK, ms=9, mew=1.6, lw=0),
        Patch(color="0.9", lw=0, label="within the margin"),
        handle(_trials(table), "", "none"),
    ]
    legend_below(figure, handles)
    return figure


def _trials(table: pd.DataFrame) -> str:
    """Say how many trials stand behind a cell."""
    counts = table.groupby("n", sort=False)["task"].unique()
    parts = (f"{n} ({', '.join(TASKS[task] for task in tasks)})" for n, tasks in counts.items())
    return f"trials: {', '.join(parts)}"


def _comparative(table: pd.DataFrame) -> pd.DataFrame:
    known = [key in UNITS for key in zip(table["statistic"], table["measure"], strict=True)]
    return table[known]


def _scaled(table: pd.DataFrame) -> pd.DataFrame:
    """Return the cells in the order of the units, with their axis, heading and height on it.

    Effects whose margin is a share of what the second method needs become per cents of that, so
    that tasks and measures fit on one axis; a cell without numbers gets the margin of the others.
    """
    fractions = {claim.id: claim.fraction for claim in load_claims().claim}
    fraction = table["id"].map(fractions).astype(float)
    share = table["statistic"] == "share"
    by = pd.Series(np.where(share, 100.0, 100 * fraction / table["margin"]), table.index)
    by = by.where(share | fraction.notna(), 1.0)
    columns = ["effect", "low", "high", "paper", "margin"]
    table = table.assign(**table[columns].mul(by, axis=0))
    table["margin"] = table["margin"].where(fraction.isna(), 100 * fraction)
    units = [UNITS[key] for key in zip(table["statistic"], table["measure"], strict=True)]
    axis = pd.Series(units, table.index).where(~share, SHARE).where(fraction.isna(), SPARED)
    table["axis"] = axis.where(table["statistic"] != "mean", GROWTH)
    table["heading"] = [drawing.statement(claim) for claim in table["claim"]]
    order = {unit: place for place, unit in enumerate(UNITS.values())}
    table = table.iloc[np.argsort([order[unit] for unit in units], kind="stable")]
    table["heading"] = table["heading"].mask(table["heading"].duplicated(), "")
    return pd.concat([_placed(part) for _, part in table.groupby("axis", sort=False)])


def _placed(part: pd.DataFrame) -> pd.DataFrame:
    """Add the height `row` of each row on an axis, and `y` of each cell."""
    row, y, rows = -1.0, [], []
    for _, cells in part.groupby(["id", "set"], sort=False):
        row += 1 + HEADING * bool(cells["heading"].iloc[0])
        y += [row + APART * (place - (len(cells) - 1) / 2) for place in range(len(cells))]
        rows += [row] * len(cells)
    return part.assign(row=rows, y=y)


def _draw(panel: Axes, part: pd.DataFrame) -> None:
    ratio, share = (part["statistic"].iloc[0] == name for name in ("sd-ratio", "share"))
    drawing.scale(panel, "x", part["statistic"].iloc[0], part["effect"].iloc[:1])
    neutral = None if share else float(ratio)
    margins = part["margin"].to_numpy(float)
    known = part[["low", "high", "effect", "paper"]].to_numpy(float).ravel()
    others = [] if share else [[neutral], 1 / margins if ratio else -margins]
    drawing.limit(panel, np.concatenate([known, margins, *others]))
    for _, cells in part.groupby(["id", "set"], sort=False):
        _draw_row(panel, cells, neutral)
    panel.set_yticks([])
    panel.spines["left"].set_visible(False)
    name = part["axis"].iloc[0] + (", log axis" if ratio else "")
    panel.set_xlabel(name, size=TYPE - 0.5, labelpad=1)
    panel.tick_params(axis="x", labelsize=TYPE - 0.5, pad=2)


def _draw_row(panel: Axes, cells: pd.DataFrame, neutral: float | None) -> None:
    first, margin = cells.iloc[0], cells["margin"].max()
    row, top, bottom = first["row"], first["row"] - 0.46, first["row"] + 0.46
    if first["heading"]:
        drawing.beside(panel, first["heading"], 0, row - HEADING, NAMES, size=TYPE, weight="bold")
    drawing.beside(panel, _name(first), 0, row, NAMES + 8, size=TYPE)
    if not np.isnan(margin):
        ratio = first["statistic"] == "sd-ratio"
        span = (
            panel.get_xlim()[0] if neutral is None else 1 / margin if ratio else -margin,
            margin,
        )
        panel.fill_betweenx([top, bottom], *sorted(span), color="0.9", lw=0, zorder=0)
    if neutral is not None:
        panel.plot([neutral, neutral], [row - 0.5, row + 0.5], color="0.25", lw=1, zorder=1)
    panel.vlines(first["paper"], top, bottom, color=INK, lw=1.6, zorder=2)
    for cell in cells.itertuples():
        look = LOOKS[cell.verdict]
        panel.hlines(cell.y, cell.low, cell.high, color=look["ec"], lw=1.5)
        mark, style = READING_MARKS[cell.reading][0], {"mec": look["ec"], "mfc": look["fc"]}
        panel.plot(cell.effect, cell.y, mark, ms=3.9, mew=1, zorder=3, **style)
        at = NUMBERS + COLUMN * READINGS.index(cell.reading or READINGS[0])
        ink = look["ec"] if look["fc"] != look["ec"] else "white"
        box = {"boxstyle": "round,pad=0.22,rounding_size=0.5", "lw": 0.9, **look}
        drawing.beside(panel, _number(cell), 1, row, at, size=7.5, color=ink, bbox=box, ha="center")
    words = list(dict.fromkeys(cells["verdict"]))
    size: dict[str, Any] = {"size": TYPE} if len(words) == 1 else {"size": 7, "linespacing": 1.05}
    drawing.beside(panel, ", ".join(words).replace(", ", ",\n", 1), 1, row, WORDS, **size)


def _head(panel: Axes, top: float) -> None:
    """Name the columns at the right, above the first panel."""
    style: dict[str, Any] = {"size": 7.5, "va": "top", "linespacing": 1.3}
    for place, (name, sign) in enumerate(zip(READINGS, "●■◆", strict=True)):
        text = f"{sign}\n" + re.sub(r" \(|, maximum ", "\n", F_LABELS[name]).rstrip(")")
        drawing.beside(panel, text, 1, top, NUMBERS + COLUMN * place, ha="center", **style)
    drawing.beside(panel, "\n\nverdict", 1, top, WORDS, **style)


def _name(cell: pd.Series) -> str:
    task, set = TASKS[cell["task"]], cell["set"]
    return task if set == NONE else f"{task}, {SET_LABELS[set]}"


def _number(cell: Any) -> str:
    """Return an effect with as many decimals as are of use."""
    if np.isnan(cell.effect):
        return "–"
    decimals = {"mean": 3, "sd-ratio": 2, "share": 0}.get(cell.statistic, 1)
    return f"{cell.effect:z.{decimals}f}".replace("-", "\N{MINUS SIGN}")
