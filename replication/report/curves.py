"""Pictures of many trials: errors (Figs. 5, 9, 12), iterations (Figs. 6, 9), what sets save.

One file because all have a panel for each reading of Eq. 9, in which a method without a trace is
shown as well, and the same lines and marks.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np
import pandas as pd
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from matplotlib.ticker import MaxNLocator
from numpy.typing import NDArray

from replication.evidence.experiments import GENERAL, under
from replication.irl import METHODS, READINGS
from replication.irl.methods import Method
from replication.paper.published import Published
from replication.report.picture import Picture
from replication.report.readable import F_LABELS, SET_LABELS, full_label
from replication.report.style import canvas, legend_below, settled
from replication.trials.compute import TRACED_TRIAL
from replication.trials.measures import error_histories

Panels = dict[str, list[tuple["Line", pd.DataFrame]]]


class Line(NamedTuple):
    """How the trials of a method with a set of incorrect demonstrations are drawn."""

    label: str
    colour: str
    dashes: Any


KEY = ["method", "reading", "set"]
"""What tells the conditions of a table of trials apart."""

LISTED = "#009E73"
"""The colour of a method that is given the general list."""


def _line_of(method: Method, set: str) -> Line:
    if not method.uses_incorrect:
        return Line(method.label, method.colour, "-")
    # Dashes let the curve below be seen where two are the same.
    dashes = (0, (1, 1)) if set == GENERAL else (0, (4, 1.5))
    label = f"{method.label} ({SET_LABELS.get(set, set)})"
    return Line(label, LISTED if set == GENERAL else method.colour, dashes)


def _panels(numbers: pd.DataFrame) -> Panels:
    """Return each panel's title, and in it the rows of each method and set."""
    readings = [name for name in READINGS if name in set(numbers["reading"])] or [""]
    return {
        F_LABELS[reading]: [
            (_line_of(method, name), rows)
            for method in METHODS.values()
            for name, rows in under(numbers[numbers["method"] == method.name], reading).groupby(
                "set", sort=False
            )
        ]
        for reading in readings
    }


# --- errors ----------------------------------------------------------------------------------


def errors(trials: pd.DataFrame, published: Mapping[str, int], *, median: bool = False) -> Picture:
    """Show the error d against the iteration, given the trials of some methods with their `errors`.

    `published` has the iteration at which the paper's own curve is zero, by method. The trial that
    is drawn is trial 0 (FIG5-TRIAL), or the median one (FIG12-TRIAL).
    """
    parts, words = [], []
    for (method, reading, name), rows in trials.groupby(KEY, sort=False):
        every = error_histories(rows)
        trial = median_trial(rows["iterations"].to_numpy()) if median else TRACED_TRIAL
        low, middle, high = np.quantile(every, [0.25, 0.5, 0.75], axis=0)
        columns = {
            "reading": reading,
            "method": method,
            "set": name,
            "iteration": np.arange(len(low)),
            "trial": trial,
            "error": every[trial],
            "quartile_1": low,
            "median": middle,
            "quartile_3": high,
            "paper": published.get(method, np.nan),
        }
        parts.append(pd.DataFrame(columns))
        after = f"half of the trials are at zero after {(middle > 0).sum()} iterations"
        words.append(f"{full_label(method, reading, name)}: {after}")
    numbers = pd.concat(parts, ignore_index=True)
    return Picture(numbers, draw_errors, f"Error d against iteration. {'; '.join(words)}.")


def median_trial(iterations: NDArray[np.int64]) -> int:
    """Return the first trial with the (lower) median number of iterations.

    Examples
    --------
    >>> median_trial(np.array([9, 3, 5, 5]))
    2
    """
    middle = np.sort(iterations)[(len(iterations) - 1) // 2]
    return int(np.flatnonzero(iterations == middle)[0])


@settled
def draw_errors(numbers: pd.DataFrame) -> Figure:
    """Draw one trial, declared before the run, as a line, and the middle half of all as a band.

    Triangles on the axis mark where the paper's own curves reach zero.
    """
    panels = _panels(numbers)
    figure, axes = canvas(1, len(panels), height=3.2, sharex=True, sharey=True)
    for panel, (title, shown) in zip(axes, panels.items(), strict=True):
        for place, (line, rows) in enumerate(shown):
            _draw_curve(panel, line, rows, place)
        panel.set(title=title, xlabel="iteration")
    axes[0].set(ylabel="error d", xlim=(0, None), ylim=(0, None))
    handles: list[Artist] = [
        *_handles(panels),
        Patch(color="0.4", alpha=0.25, lw=0, label="middle half of all trials"),
        Line2D([], [], color="0.4", marker="o", ms=4, lw=0, label="the drawn trial is at zero"),
    ]
    if numbers["paper"].notna().any():
        handles.append(Line2D([], [], mec="0.4", lw=0, label="the paper's curve", **PAPER))
    legend_below(figure, handles)
    return figure


PAPER: dict[str, Any] = {"marker": "v", "ms": 6, "mfc": "white"}
TIPPED = PAPER | {"marker": ((-1, 1.8), (1, 1.8), (0, 0), (-1, 1.8)), "ms": 12}
"""The paper's mark: centred at its place, and with its tip there, above what else is there."""


def _draw_curve(panel: Axes, line: Line, rows: pd.DataFrame, place: int) -> None:
    colour, iterations = line.colour, rows["iteration"].to_numpy()
    low, high = rows["quartile_1"].to_numpy(), rows["quartile_3"].to_numpy()
    panel.fill_between(iterations, low, high, color=colour, alpha=0.18, lw=0)
    for edge in (low, high):
        panel.plot(iterations, edge, color=colour, alpha=0.5, lw=0.5)
    drawn = rows["error"].to_numpy()
    end = int(np.argmax(drawn <= 0)) if (drawn <= 0).any() else len(drawn) - 1
    panel.plot(iterations[: end + 1], drawn[: end + 1], **_style(line))
    # The first dots are the largest, so that none is hidden where curves end together.
    panel.plot(end, drawn[end], "o", color=colour, ms=6 - 1.3 * place, clip_on=False, zorder=4)
    paper = rows["paper"].iloc[0]
    if not np.isnan(paper):
        panel.plot(paper, 0, ls="none", mec=colour, clip_on=False, zorder=5, **TIPPED)


def _style(line: Line) -> dict[str, Any]:
    return {"color": line.colour, "lw": 1.1, "ls": line.dashes}


def _handles(panels: Panels) -> list[Line2D]:
    first = next(iter(panels.values()))
    return [Line2D([], [], label=line.label, **_style(line)) for line, _ in first]


# --- iterations ------------------------------------------------------------------------------


FIRST = 100
"""How many trials the paper's Fig. 6 shows, and with it ours."""


def iterations(trials: pd.DataFrame, published: Mapping[str, Published]) -> Picture:
    """Show the iterations of every trial of some methods, with their distribution.

    That Fig. 9 shows this, and not errors, is the choice FIG9-AXES.
    """
    parts, words = [], []
    for (method, reading, name), rows in trials.groupby(KEY, sort=False):
        counts = rows["iterations"]
        columns = {
            "reading": reading,
            "method": method,
            "set": name,
            "trial": rows["trial"],
            "iterations": counts,
            "trials_alike": counts.groupby(counts).transform("size"),
            "mean": counts.mean(),
            "paper": published[method].mean if method in published else np.nan,
        }
        parts.append(pd.DataFrame(columns))
        words.append(f"{full_label(method, reading, name)}: {counts.mean():.1f} on average")
    numbers = pd.concat(parts, ignore_index=True)
    return Picture(numbers, draw_iterations, f"Iterations of each trial. {'; '.join(words)}.")


@settled
def draw_iterations(numbers: pd.DataFrame) -> Figure:
    """Draw a row for each reading: as many trials as the paper has, and the distributions of all.

    A dot marks our mean, an open triangle the paper's.
    """
    panels = _panels(numbers)
    height = 0.7 + 2.0 * len(panels)
    figure, grid = canvas(len(panels), 2, height=height, width_ratios=(4, 1), sharey=True)
    grid = np.atleast_2d(grid)
    for (left, right), (title, shown) in zip(grid, panels.items(), strict=True):
        for position, (line, rows) in enumerate(shown):
            first = rows[rows["trial"] < FIRST]
            left.plot(first["trial"].to_numpy(), first["iterations"].to_numpy(), **_style(line))
            _draw_distribution(right, position, line.colour, rows)
        left.set_title(title, loc="left")
        left.set(ylabel="iterations", xlim=(-0.5, min(len(shown[0][1]), FIRST) - 0.5))
        left.xaxis.set_major_locator(MaxNLocator(6, integer=True))
        right.set(xticks=[], xlim=(-0.7, len(shown) - 0.3))
        right.spines["bottom"].set_visible(False)
        right.tick_params(labelleft=False)
    grid[-1, 0].set(xlabel="trial", ylim=(0, None))
    handles = _handles(panels)
    handles.append(Line2D([], [], color="0.3", marker="o", ms=5, lw=0, label="our mean"))
    if numbers["paper"].notna().any():
        handles.append(Line2D([], [], mec="0.3", lw=0, label="the paper's mean", **PAPER))
    legend_below(figure, handles)
    return figure


def _draw_distribution(panel: Axes, position: int, colour: str, rows: pd.DataFrame) -> None:
    bars = rows.drop_duplicates("iterations").sort_values("iterations")
    half = 0.42 * bars["trials_alike"].to_numpy() / bars["trials_alike"].max()
    style: dict[str, Any] = {"height": 0.9, "color": colour, "alpha": 0.35}
    panel.barh(bars["iterations"].to_numpy(), 2 * half, left=position - half, **style)
    panel.plot(position, rows["mean"].iloc[0], "o", color=colour, ms=5, zorder=4)
    paper = rows["paper"].iloc[0]
    if not np.isnan(paper):
        style = {"ls": "none", "mec": colour, "clip_on": False, "zorder": 5, **PAPER}
        panel.plot(position + 0.3, paper, **style)


# --- sets of incorrect demonstrations --------------------------------------------------------


def sets(table: pd.DataFrame) -> Picture:
    """Show what each set of incorrect demonstrations saves, a panel for each reading of Eq. 9.

    `table` is that of :func:`replication.evidence.tables.sets_table`.
    """
    parts = [
        f"{row.set}, {F_LABELS[row.reading]}: {row.saved:.1f} ({row.low:.1f} to {row.high:.1f})"
        for row in table.itertuples()
    ]
    words = "Iterations saved by incorrect demonstrations, with 95 % intervals"
    return Picture(table, draw_sets, f"{words}. {'; '.join(parts)}.")


@settled
def draw_sets(numbers: pd.DataFrame) -> Figure:
    """Draw what each set saves with its interval; beside its name stand the pairs that leave."""
    panels = [rows for _, rows in numbers.groupby("reading", sort=False)]
    n_sets = max(map(len, panels))
    height = max(1.1 + 0.26 * n_sets, 2.0)
    figure, axes = canvas(1, len(panels), height=height, sharex=True, sharey=True)
    colour = METHODS["unified-incorrect"].colour
    for panel, rows in zip(axes, panels, strict=True):
        y = np.arange(len(rows))
        panel.axvline(0, color="0.5", lw=0.8)
        panel.hlines(y, rows["low"], rows["high"], color=colour, lw=1.4)
        panel.plot(rows["saved"], y, "o", ms=4.5, color=colour)
        panel.set(title=F_LABELS[rows["reading"].iloc[0]], yticks=y)
        panel.set_yticklabels(f"{row.set}  ({row.leaving})" for row in rows.itertuples())
    for panel in axes:
        panel.set_xlabel("iterations saved")
    axes[0].invert_yaxis()
    axes[0].set_ylabel("set (leaving pairs)")
    return figure
