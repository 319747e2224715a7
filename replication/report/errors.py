"""Figs. 5, 9 and 12: how many trials are on the expert's path, and how large the error d is."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator, NullLocator
from numpy.typing import NDArray

from replication.evidence.statistics import share_interval
from replication.report.drawing import SMALL, pad
from replication.report.looks import KEY, Look, line_handles, panels
from replication.report.picture import Picture
from replication.report.readable import full_label
from replication.report.style import canvas, legend_below, settled
from replication.trials.compute import TRACED_TRIAL
from replication.trials.measures import error_histories

LINEAR = 0.1
"""The error below which its axis is linear, so that zero can be seen on it."""


def falling(trials: pd.DataFrame, published: Mapping[str, int], *, median: bool = False) -> Picture:
    """Show by iteration which share of trials is at d = 0, and the errors of all.

    `trials` are those of some methods with their `errors`; `published` has the iteration at which
    the paper's own curve is zero, by method. The trial that is drawn is trial 0 (FIG5-TRIAL), or
    the median one (FIG12-TRIAL).
    """
    parts, words = [], []
    for (method, reading, name), rows in trials.groupby(KEY, sort=False):
        every = error_histories(rows)
        trial = median_trial(rows["iterations"].to_numpy()) if median else TRACED_TRIAL
        quartiles = np.quantile(every, [0.25, 0.5, 0.75], axis=0)
        ends = rows["iterations"].where(rows["converged"] == 1, np.inf).to_numpy(float)
        at_zero = (ends[:, None] <= np.arange(every.shape[1])).sum(axis=0)
        intervals = {k: share_interval(k, len(every)) for k in map(int, np.unique(at_zero))}
        paper = published.get(method, np.nan)
        part = pd.DataFrame(
            {
                "reading": reading,
                "method": method,
                "set": name,
                "iteration": np.arange(every.shape[1]),
                "at_zero": at_zero / len(every),
                "low": [intervals[k][0] for k in at_zero],
                "high": [intervals[k][1] for k in at_zero],
                "trial": trial,
                "error": every[trial],
                "quartile_1": quartiles[0],
                "median": quartiles[1],
                "quartile_3": quartiles[2],
                "paper": paper,
            }
        )
        parts.append(part)
        words.append(f"{full_label(method, reading, name)}: {_in_words(part, paper)}")
    n = trials["trial"].nunique()
    intro = (
        f"The share of {n} trials that have reached d = 0, by iteration, with pointwise 95 % "
        "Clopper-Pearson intervals; and their errors"
    )
    return Picture(pd.concat(parts, ignore_index=True), draw, f"{intro}. {'; '.join(words)}.")


def _in_words(part: pd.DataFrame, paper: float) -> str:
    """Say when half of the trials are at zero, and how many when the paper's curve is."""
    below = int((part["at_zero"] < 0.5).sum())
    text = f"half after {below} iterations" if below < len(part) else "less than half in the end"
    if np.isnan(paper):
        return text
    return f"{text}, {100 * _share_at(part, paper):.0f} % after the paper's {paper:g}"


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
def draw(numbers: pd.DataFrame) -> Figure:
    """Draw a column for each reading: above the shares at zero, below the errors."""
    shown = panels(numbers)
    layout = {"sharex": "row", "sharey": "row", "height_ratios": (1.5, 1)}
    figure, grid = canvas(2, len(shown), height=5.2, squeeze=False, **layout)
    for (upper, lower), (title, lines) in zip(grid.T, shown.items(), strict=True):
        upper.set_title(title)
        for look, rows in lines:
            _draw_shares(upper, look, rows)
            _draw_errors(lower, look, rows)
            _name_paper(upper, look, rows)
        _name_trials(lower, lines)
        for panel in (upper, lower):
            panel.set_xlabel("iteration")
            panel.xaxis.set_major_locator(MaxNLocator(5, integer=True, steps=[1, 2, 5, 10]))
    upper, lower = grid[:, 0]
    upper.set(ylabel="share of trials", ylim=(0, 1.02), xlim=(0, 1.02 * _last(numbers)))
    lower.set_yscale("symlog", linthresh=LINEAR, linscale=0.5)
    lower.set_ylabel(f"error d (linear\nbelow {LINEAR:g}, then log)")
    lower.set(
        xlim=(0, _last_error(numbers)), yticks=(0, 0.1, 1, 5), ylim=(0, 1.1 * _largest(numbers))
    )
    lower.yaxis.set_major_formatter(lambda value, _: f"{value:g}")
    lower.yaxis.set_minor_locator(NullLocator())
    for panel, height, text in zip((upper, lower), (20, 7), HEADS, strict=True):
        style: dict[str, Any] = {"textcoords": "offset points", "size": 9}
        # Heads are as long as a row of panels, and must not widen the first.
        head = panel.annotate(text, (0, 1), (0, height), xycoords="axes fraction", **style)
        head.set_in_layout(False)
    pad(figure, hspace=0.14, rect=(0, 0, 1, 0.96))
    legend_below(figure, line_handles(shown))
    return figure


HEADS = (
    "(a) trials that are on the expert's path, d = 0 (shaded: 95 % intervals)",
    "(b) median of all trials, their middle half (shaded), and one trial (thin)",
)


def _last(numbers: pd.DataFrame) -> float:
    """Return the iteration at which the last trial ends, or the paper's last curve."""
    return max(float(numbers[["iteration", "paper"]].max().max()), 1.0)


def _last_error(numbers: pd.DataFrame) -> float:
    """Return the iteration from which all that is drawn of the errors is zero."""
    above = numbers[["error", "quartile_3"]].max(axis=1) > 0
    return float(numbers.loc[above, "iteration"].max() + 1) if above.any() else 1.0


def _largest(numbers: pd.DataFrame) -> float:
    return float(numbers[["error", "quartile_3"]].max().max()) or 1.0


def _draw_shares(panel: Axes, look: Look, rows: pd.DataFrame) -> None:
    """Draw the shares at zero to the end of the axis: what is there stays there."""
    iterations = np.append(rows["iteration"], FAR)
    low, share, high = (
        np.append(rows[name], rows[name].iloc[-1]) for name in ("low", "at_zero", "high")
    )
    panel.fill_between(iterations, low, high, step="post", color=look.colour, alpha=0.15, lw=0)
    panel.step(iterations, share, where="post", lw=1.4, **look.line)


FAR = 10_000
"""An iteration beyond every axis."""


def _name_paper(panel: Axes, look: Look, rows: pd.DataFrame) -> None:
    """Mark where the paper's own curve reaches zero, with its number where our curve is not."""
    paper = rows["paper"].iloc[0]
    if np.isnan(paper):
        return
    panel.axvline(paper, color=look.colour, lw=0.9, ls=(0, (2, 2)))
    place = (0.98, "top") if _share_at(rows, paper) < 0.5 else (0.03, "bottom")
    style: dict[str, Any] = {
        "textcoords": "offset points",
        "rotation": 90,
        "ha": "right",
        "size": SMALL,
    }
    text = f"paper: {paper:g}"
    panel.annotate(text, (paper, place[0]), (-2, 0), va=place[1], color=look.colour, **style)


def _share_at(rows: pd.DataFrame, iteration: float) -> float:
    return float(rows.loc[rows["iteration"] <= iteration, "at_zero"].iloc[-1])


def _draw_errors(panel: Axes, look: Look, rows: pd.DataFrame) -> None:
    iterations = rows["iteration"].to_numpy()
    low, high = rows["quartile_1"].to_numpy(), rows["quartile_3"].to_numpy()
    panel.fill_between(iterations, low, high, color=look.colour, alpha=0.1, lw=0)
    median, trial = (_until_zero(rows[name].to_numpy()) for name in ("median", "error"))
    panel.plot(iterations[: len(median)], median, lw=1.4, **look.line)
    panel.plot(iterations[: len(trial)], trial, color=look.colour, lw=0.5)


def _until_zero(values: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return some errors up to the first that is zero."""
    return values[: np.argmax(values <= 0) + 1] if (values <= 0).any() else values


def _name_trials(panel: Axes, lines: list[tuple[Look, pd.DataFrame]]) -> None:
    """Say which trials the thin lines are."""
    trials = [(f"trial {rows['trial'].iloc[0]}", look.colour) for look, rows in lines]
    if len({name for name, _ in trials}) == 1:
        trials = [(trials[0][0], "0.3")]
    style: dict[str, Any] = {
        "xycoords": "axes fraction",
        "textcoords": "offset points",
        "size": SMALL,
    }
    for place, (name, colour) in enumerate([("thin:", "0.3"), *trials]):
        at = (0, -9 * place)
        panel.annotate(name, (0.99, 0.99), at, ha="right", va="top", color=colour, **style)
