"""What the figures of claims share: colours, marks, units, scales, rows in blocks, legends."""

from __future__ import annotations

import re
import textwrap
from collections.abc import Hashable, Sequence
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.font_manager import FontProperties
from matplotlib.lines import Line2D
from matplotlib.ticker import Locator, MaxNLocator, NullFormatter, NullLocator
from numpy.typing import NDArray

from replication.evidence.sensitivity import HOLDS, OPEN, REVERSED
from replication.report import choices
from replication.report.readable import F_LABELS

INK, GREY = "#222222", "#8A8A8A"
BLUE, VERMILION, GREEN, PURPLE = "#0072B2", "#D55E00", "#009E73", "#CC79A7"
"""Of Okabe and Ito; blue speaks for a claim, vermilion against it."""

OUTCOMES = {HOLDS: BLUE, OPEN: GREY, REVERSED: VERMILION}
MARKS = {HOLDS: "o", OPEN: "s", REVERSED: "D"}
READING_MARKS = {
    "printed": ("o", INK),
    "updated": ("s", GREEN),
    "at-once": ("D", PURPLE),
    "": ("o", INK),
}
TASKS = {"open-maze": "open maze", "obstacle-maze": "obstacles", "soccer": "soccer"}
SMALL, LABELS = 7.0, -158
DASHES: Any = (0, (4, 2))

FAR = 8
"""How far beyond the upper quartile an effect has to lie for an axis that turns logarithmic.

Effects of exactly zero do not count.
"""

UNITS = {
    ("share", "converged"): "share of trials at zero",
    ("saved", "iterations"): "iterations saved",
    ("saved", "early_collisions"): "collisions spared",
    ("saved", "early_errors"): "erroneous motions spared",
    ("sd-ratio", "iterations"): "ratio of SDs",
    ("mean", "q_growth"): "growth of Q",
    ("mean", "reward_growth"): "growth of the reward",
}
"""The unit of a comparative claim's effect, by its statistic and its measure."""


def statement(claim: str) -> str:
    """Return what a claim says on any task.

    Examples
    --------
    >>> statement("Incorrect demonstrations save iterations on the open maze")
    'Incorrect demonstrations save iterations'
    """
    return re.sub(r",? (on the open maze|in the maze with obstacles|in robot soccer)$", "", claim)


def number(value: float) -> str:
    """Return a number with three digits and a proper minus."""
    return f"{value:.3g}".replace("-", "\N{MINUS SIGN}")


class Ratios(Locator):
    """Ticks of a logarithmic axis that are apart by at least a share of its length."""

    def __init__(self, apart: float) -> None:
        self.apart = apart

    def __call__(self) -> list[float]:
        """Return the ticks in view."""
        assert self.axis is not None
        low, high = sorted(self.axis.get_view_interval())
        decades = 10.0 ** np.arange(np.floor(np.log10(low)), np.ceil(np.log10(high)) + 1)
        for steps in ([1, 1.5, 2, 3, 5, 7], [1, 2, 5], [1, 3], [1]):
            ticks = [tick for tick in np.outer(decades, steps).ravel() if low <= tick <= high]
            gaps = np.diff(np.log(ticks)) / np.log(high / low)
            if (gaps >= self.apart).all():
                break
        return ticks


def scale(panel: Axes, name: str, statistic: str, effects: pd.Series) -> None:
    """Give an axis few ticks, ratios a logarithmic one, and far outliers one that they fit on."""
    size = effects[effects != 0].abs().dropna()
    axis: Any = getattr(panel, f"{name}axis")
    if statistic == "sd-ratio":
        getattr(panel, f"set_{name}scale")("log")
        axis.set_major_locator(Ratios(0.2 if name == "x" else 0.06))
        axis.set_major_formatter(lambda value, _: f"{value:g}")
        axis.set_minor_formatter(NullFormatter())
        axis.set_minor_locator(NullLocator())
    elif size.max() > FAR * size.quantile(0.75) > 0:
        linear = 10.0 ** np.ceil(np.log10(size.quantile(0.75)))
        getattr(panel, f"set_{name}scale")("symlog", linthresh=linear)
        axis.set_major_formatter(lambda value, _: f"{value:,g}".replace("-", "\N{MINUS SIGN}"))
        axis.set_minor_locator(NullLocator())
    else:
        axis.set_major_locator(MaxNLocator(4 if name == "x" else 6, steps=[1, 2, 2.5, 5, 10]))


def unit(panel: Axes, name: str, statistic: str, measure: str) -> str:
    """Return the unit of an axis, and where its scale is logarithmic."""
    kind = getattr(panel, f"get_{name}scale")()
    transform: Any = getattr(panel, f"{name}axis").get_transform()
    where = {
        "log": ", log axis",
        "symlog": f", log beyond ±{getattr(transform, 'linthresh', 0):,g}",
    }
    return UNITS[statistic, measure] + where.get(kind, "")


def limit(panel: Axes, values: NDArray[np.float64]) -> None:
    """Give the x axis room for all values, so that something can be drawn up to its ends."""
    log = panel.get_xscale() == "log"
    used = values[np.isfinite(values) & ((values > 0) | (not log))]
    used = np.log(used) if log else used
    room = 0.03 * (used.max() - used.min()) or 0.05
    ends = used.min() - room, used.max() + room
    panel.set_xlim(*(np.exp(ends) if log else ends))


def pad(figure: Figure, **pads: Any) -> None:
    """Set the paddings of a figure's layout."""
    engine: Any = figure.get_layout_engine()
    engine.set(**pads)


def blocks(ids: Sequence[Hashable]) -> NDArray[np.float64]:
    """Return where rows lie, with a gap wherever the id changes."""
    changes = [0.0, *(float(a != b) for a, b in zip(ids[1:], ids[:-1], strict=True))]
    return np.arange(len(ids)) + 0.45 * np.cumsum(changes)


def beside(panel: Axes, text: str, x: float, y: float, points: float, **style: Any) -> None:
    """Write beside a row: so many points right of an end of the panel, x = 0 or 1."""
    style = {"textcoords": "offset points", "va": "center_baseline", "size": SMALL, **style}
    panel.annotate(text, (x, y), (points, 0), xycoords=panel.get_yaxis_transform(), **style)


def shade_blocks(panel: Axes, ids: Sequence[str], y: NDArray[np.float64]) -> None:
    """Shade every other block of rows."""
    for id in list(dict.fromkeys(ids))[::2]:
        places = y[[other == id for other in ids]]
        panel.axhspan(places[0] - 0.72, places[-1] + 0.72, color="0.96", lw=0, zorder=-1)
    panel.set_ylim(y[-1] + 0.8, -0.8)


def label_blocks(
    panel: Axes, rows: Sequence[tuple[str, str]], y: NDArray[np.float64], bold: Sequence[Any] = ()
) -> None:
    """Name each block of rows and its values at the left, some pairs of them in bold."""
    named = set()
    for at, (id, value) in zip(y, rows, strict=True):
        if id not in named:
            beside(panel, choices.title(id), 0, at, LABELS)
        named.add(id)
        weight = "bold" if (id, value) in bold else "normal"
        beside(panel, choices.value(id, value), 0, at, -4, ha="right", weight=weight)


def note(figure: Figure, text: str) -> None:
    """Write a note in small type between the panels and the legend."""
    text = textwrap.fill(text, 130, break_long_words=False)
    figure.legends[0].set_title(text, prop=FontProperties(size=SMALL))


def handle(label: str, mark: str, colour: Any, **style: Any) -> Artist:
    """Return an entry of a legend: a mark on a line."""
    return Line2D([], [], label=label, marker=mark, color=colour, **{"ms": 4, **style})


def outcome_handles(mark: str, margin: str, *, capped: bool) -> list[Artist]:
    """Return the legend's entries for outcomes; without a mark each outcome has its own."""
    handles = [handle(name, mark or MARKS[name], colour) for name, colour in OUTCOMES.items()]
    if capped:
        handles.append(handle("hollow: trials at the cap", mark or "o", "0.4", mfc="white", lw=0))
    return [*handles, handle(margin, "", "0.25", lw=1)]


def reading_handles(numbers: pd.DataFrame) -> list[Artist]:
    """Return the legend's entries for the readings of Eq. 9 that a table has."""
    used = set(numbers["reading"])
    return [handle(F_LABELS[name], *READING_MARKS[name]) for name in READING_MARKS if name in used]


def holding(part: pd.DataFrame) -> str:
    """Say in how many specifications a claim holds."""
    holds = (part["outcome"] == HOLDS).sum()
    return f"{holds} of {len(part)} specifications ({100 * holds / len(part):.0f} %)"


def counted(part: pd.DataFrame) -> str:
    """Say in how many specifications a claim is open, and in how many reversed."""
    counts = (f"{name} in {(part['outcome'] == name).sum()}" for name in (OPEN, REVERSED))
    return ", ".join(counts)
