"""Why some 40 iterations: measured against the bound, and against the length of the path."""

from __future__ import annotations

from typing import Any

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import FixedLocator, NullLocator

from replication.evidence.experiments import NONE
from replication.report.comparison import short_label
from replication.report.drawing import BLUE, DASHES, GREEN, INK, VERMILION, handle
from replication.report.picture import Picture
from replication.report.readable import interval, readable
from replication.report.style import canvas, legend_below, settled

LOOKS = {
    ("perceptron", "", "planning"): ("o", GREEN),
    ("unified", "printed", "planning"): ("s", BLUE),
    ("unified", "updated", "planning"): ("^", VERMILION),
    ("unified", "printed", "q-learning"): ("D", INK),
}
"""Mark and colour of a method, a reading of Eq. 9 and an inner solver."""

RUN = ["method", "reading", "solver"]
SOLVERS = {"planning": "planning", "q-learning": "Q-learning"}


def run_label(method: str, reading: str, solver: str) -> str:
    """Return what a method with an inner solver is called."""
    return f"{short_label(method, reading, NONE)}, {SOLVERS[solver]}"


def bounds(table: pd.DataFrame) -> Picture:
    """Show the iterations against the bound, and against the length of the path.

    `table` is a :func:`~replication.evidence.bound.bound_table`.
    """
    proved = table[(table["method"] == "perceptron") & (table["solver"] == "planning")]
    looseness = proved["bound"] / proved["most"]
    parts = []
    for key, own in table.groupby(RUN, sort=False):
        per_step = own["mean"] / own["length"]
        parts.append(
            f"{run_label(*key)}: {own['mean'].min():.1f} to {own['mean'].max():.1f} iterations, "
            f"{per_step.min():.2f} to {per_step.max():.2f} for each step of the path"
        )
    words = (
        f"Mean iterations over {len(proved)} demonstrations, with bounds from "
        f"{table['bound'].min():.0f} to {table['bound'].max():.0f}. The perceptron stays below its "
        f"bound by a factor of {looseness.min():.0f} to {looseness.max():.0f}"
    )
    return Picture(table, draw_bounds, f"{words}. {'; '.join(parts)}.")


@settled
def draw_bounds(numbers: pd.DataFrame) -> Figure:
    """Draw mean iterations with intervals against bound and length; methods stand side by side."""
    numbers = numbers.fillna({"reading": ""})
    figure, axes = canvas(1, 2, height=3.3, sharey=True)
    for panel, name, width in zip(axes, ("bound", "length"), (1.12, 1.04), strict=True):
        places = np.linspace(-1, 1, len(LOOKS))
        for place, (key, (mark, colour)) in zip(places, LOOKS.items(), strict=True):
            own = numbers[(numbers[RUN] == list(key)).all(axis=1)]
            x = own[name] * width**place
            panel.vlines(x, own["low"].clip(lower=1), own["high"], color=colour, lw=0.7, alpha=0.45)
            panel.plot(x, own["mean"], mark, ms=3.2, color=colour, mew=0, alpha=0.8)
        panel.set_xscale("log")
        panel.set_xlim(numbers[name].min() / 1.6, numbers[name].max() * 1.6)
    ends = np.array(axes[1].get_xlim())
    axes[1].plot(ends, ends, color="0.5", lw=1, ls=DASHES, scalex=False, scaley=False)
    _scale(axes[0], "x", [1e3, 1e4, 1e5, 1e6], power=True)
    _scale(axes[1], "x", [4, 8, 16, 32])
    axes[0].set_yscale("log")
    axes[0].set_ylim(2, 100)
    for panel in axes:
        _scale(panel, "y", [2, 5, 10, 20, 50, 100])
    axes[0].set_ylabel("mean iterations (log axis)")
    axes[0].set_xlabel("bound $(R/\\delta)^2$ (log axis)")
    axes[1].set_xlabel("moves of the demonstrated path (log axis)")
    axes[0].set_title("(a) against the bound", size=8.5, loc="left")
    axes[1].set_title("(b) against the length of the path", size=8.5, loc="left")
    handles = [handle(run_label(*key), mark, colour, lw=0) for key, (mark, colour) in LOOKS.items()]
    handles.append(handle("one iteration for each move", "", "0.5", ls=DASHES))
    legend_below(figure, handles)
    return figure


def _scale(panel: Axes, name: str, ticks: list[float], *, power: bool = False) -> None:
    """Give a logarithmic axis these ticks and no others."""
    axis: Any = getattr(panel, f"{name}axis")
    axis.set_major_locator(FixedLocator(ticks))
    axis.set_minor_locator(NullLocator())
    axis.set_major_formatter(
        lambda value, _: f"$10^{{{np.log10(value):.0f}}}$" if power else f"{value:g}"
    )


CAUSES = {"margin": "1/δ²", "length": "length of the path"}
AMONG = {"shapes": "shapes (31 or 33 moves)", "all": "shapes and shorter paths"}


def readable_shares(table: pd.DataFrame) -> pd.DataFrame:
    """Return what margin and length explain, a row each.

    `table` is a :func:`~replication.evidence.explained.share_table`.
    """
    return readable(
        table,
        {
            "Method": lambda row: run_label(row.method, row.reading, row.solver),
            "Among": lambda row: f"{row.cases} {AMONG[row.among]}",
            "Cause": lambda row: CAUSES[row.cause],
            "Correlation": lambda row: f"{row.correlation:.2f}".replace("-", "\N{MINUS SIGN}"),
            "Variance explained [95 %]": lambda row: interval(row.share, row.low, row.high),
            "Right of pairs": lambda row: f"{row.right:.0%} of {row.pairs}",
        },
    )


def readable_bounds(table: pd.DataFrame) -> pd.DataFrame:
    """Return each demonstration's bound, and beside it the mean iterations of each method."""
    cases = ["world", "shape", "length"]
    means = {key: own.set_index(cases) for key, own in table.groupby(RUN, sort=False)}

    def mean(key: Any) -> Any:
        def cell(row: Any) -> str:
            own = means[key].loc[(row.world, row.shape, row.length)]
            return interval(own["mean"], own["low"], own["high"])

        return cell

    first = table[(table[RUN] == list(next(iter(means)))).all(axis=1)]
    return readable(
        first,
        {
            "Maze": lambda row: row.world,
            "Path": lambda row: row.shape,
            "Moves": lambda row: str(row.length),
            "R": lambda row: f"{row.radius:.2f}",
            "δ": lambda row: f"{row.delta:.4f}",
            "Bound": lambda row: f"{row.bound:,.0f}",
            **{run_label(*key): mean(key) for key in means},
        },
    )
