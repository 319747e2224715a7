"""What each set of incorrect demonstrations saves."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from replication.irl import METHODS
from replication.paper.published import Published
from replication.report.drawing import SMALL
from replication.report.picture import Picture
from replication.report.readable import F_LABELS, SET_LABELS, interval
from replication.report.style import canvas, settled

KINDS = {
    "hit": "hits",
    "detour": "detours",
    "near-detour": "near detours",
    "far-detour": "far detours",
    "opposite": "opposite direction",
}
"""How kinds are called; others have their own name."""


def savings(table: pd.DataFrame, published: Mapping[str, Published]) -> Picture:
    """Show what each set of incorrect demonstrations saves, a panel for each reading of Eq. 9.

    `table` is that of :func:`replication.evidence.tables.sets_table`; `published` has the paper's
    mean by method.
    """
    method = METHODS["unified-incorrect"]
    paper = np.nan
    if {method.name, method.baseline} <= published.keys():
        paper = published[method.baseline].mean - published[method.name].mean
    numbers = table.assign(paper=paper)
    readings = "; ".join(F_LABELS[reading] for reading in table["reading"].unique())
    intro = (
        "Iterations saved by each set of incorrect demonstrations, with 95 % intervals; beside its "
        "name stands how many of its pairs leave the path. Named kinds are hits and detours, the "
        f"general list has the opposite direction as well. Under {readings}"
    )
    rows = (
        f"{' or '.join(name.splitlines())}: "
        + ", ".join(interval(row.saved, row.low, row.high) for row in own.itertuples())
        for name, own in _alike(numbers)
    )
    return Picture(numbers, draw, f"{intro}: {'; '.join(rows)}.")


def _alike(numbers: pd.DataFrame) -> Iterator[tuple[str, pd.DataFrame]]:
    """Yield the name and the rows of each set; of sets that save just the same, those of one."""
    groups: dict[Any, list[pd.DataFrame]] = {}
    for name, own in numbers.sort_values("leaving", kind="stable").groupby("set", sort=False):
        effects = own[["saved", "low", "high"]].round(9)
        unknown = bool(effects["saved"].isna().any())
        groups.setdefault(name if unknown else effects.to_numpy().tobytes(), []).append(own)
    for alike in groups.values():
        yield "\n".join(_name(own.iloc[0]) for own in alike), alike[0]


def _name(row: pd.Series) -> str:
    """Return what a set shows, and how many of its pairs leave the path."""
    kinds = " + ".join(KINDS.get(kind, kind) for kind in row["set"].split("+"))
    return f"{SET_LABELS.get(row['set'], kinds)} ({row['leaving']})"


@settled
def draw(numbers: pd.DataFrame) -> Figure:
    """Draw a row for each set with what it saves and its interval, and the paper's saving."""
    rows = list(_alike(numbers))
    readings = list(dict.fromkeys(numbers["reading"]))
    lines = sum(name.count("\n") + 1 for name, _ in rows)
    height = max(1.3 + 0.26 * lines, 2.2)
    figure, axes = canvas(1, len(readings), height=height, sharex=True, sharey=True)
    for panel, reading in zip(axes, readings, strict=True):
        for y, (_, own) in enumerate(rows):
            _draw_effect(panel, y, own[own["reading"] == reading])
        panel.axvline(0, color="0.4", lw=0.8, zorder=0)
        _name_paper(panel, numbers["paper"].iloc[0])
        panel.set_title(F_LABELS[reading], pad=16)
        panel.set_xlabel("iterations saved")
        panel.xaxis.set_major_locator(MaxNLocator(5, integer=True, steps=[1, 2, 5, 10]))
    axes[0].set_yticks(range(len(rows)), [name for name, _ in rows])
    axes[0].set_ylim(len(rows) - 0.5, -0.5)
    style: dict[str, Any] = {"xycoords": "axes fraction", "textcoords": "offset points"}
    axes[0].annotate(HEAD, (0, 1), (-5, 4), ha="right", color="0.3", size=SMALL, **style)
    return figure


HEAD = "set (its pairs that\nleave the path)"
COLOUR = METHODS["unified-incorrect"].colour


def _draw_effect(panel: Axes, y: float, own: pd.DataFrame) -> None:
    panel.hlines([y] * len(own), own["low"], own["high"], color=COLOUR, lw=1.6)
    panel.plot(own["saved"], [y] * len(own), "o", ms=4.5, color=COLOUR)


def _name_paper(panel: Axes, paper: float) -> None:
    """Mark what incorrect demonstrations save in the paper."""
    if np.isnan(paper):
        return
    panel.axvline(paper, color="0.3", lw=0.9, ls=(0, (2, 2)), zorder=0)
    at = (paper, 1), (0, 3)
    style: dict[str, Any] = {"textcoords": "offset points", "ha": "center", "size": SMALL}
    panel.annotate(f"paper: {paper:.2f}", *at, xycoords=panel.get_xaxis_transform(), **style)
