"""Figs. 6 and 9: the iterations of every trial, and what a method saves with the same seed.

That Fig. 9 shows this, and not errors, is the choice FIG9-AXES.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import MaxNLocator
from numpy.typing import NDArray

from replication.evidence.experiments import under
from replication.evidence.statistics import mean_interval, summarise
from replication.evidence.tables import FIRST
from replication.irl import get_method
from replication.paper.published import Published
from replication.report.drawing import SMALL, pad
from replication.report.looks import KEY, Look, panels
from replication.report.picture import Picture
from replication.report.raincloud import OURS, PAPER, Array, draw_cloud, draw_mean, draw_paper
from replication.report.readable import full_label, interval, number
from replication.report.style import canvas, legend_below, settled

ALIKE = 0.1
"""The share of trials without a difference above which it is written beside them."""


def per_trial(trials: pd.DataFrame, published: Mapping[str, Published]) -> Picture:
    """Show the iterations of every trial of some methods, and what each saves against its baseline.

    `published` has the paper's mean and SD by method.
    """
    parts, words = [], []
    for (method, reading, name), rows in trials.groupby(KEY, sort=False):
        baseline = get_method(str(method)).baseline
        part = rows[[*KEY, "trial", "iterations", "converged"]].assign(
            saved=_saved(rows, under(trials[trials["method"] == baseline], str(reading))),
            paper=published[method].mean if method in published else np.nan,
            paper_sd=published[method].sd if method in published else np.nan,
            paper_saved=published[baseline].mean - published[method].mean
            if {method, baseline} <= published.keys()
            else np.nan,
        )
        parts.append(part)
        words.append(f"{full_label(method, reading, name)}: {_in_words(part)}")
    intro = (
        f"Iterations of each trial: the first {FIRST}, as many as the paper has; all; and what is "
        "saved with the same seed"
    )
    return Picture(pd.concat(parts, ignore_index=True), draw, f"{intro}. {'; '.join(words)}.")


def _saved(rows: pd.DataFrame, baseline: pd.DataFrame) -> Array:
    """Return what each trial saves, [trial]; NaN if it or its baseline's has no count."""
    both = rows.merge(baseline, on="trial", how="left", suffixes=("", "_of_baseline"))
    known = (both["converged"] == 1) & (both["converged_of_baseline"] == 1)
    return (both["iterations_of_baseline"] - both["iterations"]).where(known).to_numpy(float)


def _in_words(part: pd.DataFrame) -> str:
    """Say the mean and SD of a condition's trials, and what they save."""
    own = summarise(part["iterations"], part["converged"])
    text = f"mean {own.mean:.1f} (SD {number(own.sd)})"
    if own.capped:
        text = f"{own.capped} of {own.n} trials at the cap"
    if part["saved"].isna().all():
        return text
    return f"{text}, saved {_effect(part['saved'].to_numpy())}"


def _effect(saved: Array) -> str:
    """Return the mean of what is saved with its interval."""
    low, high = mean_interval(saved)
    return interval(saved.mean(), float(low), float(high))


@settled
def draw(numbers: pd.DataFrame) -> Figure:
    """Draw a row for each reading: the first trials, all of them, and what each saves."""
    shown = panels(numbers)
    counts = [len(lines) for lines in shown.values()]
    layout = {"width_ratios": (1.3, 2, 2), "height_ratios": counts, "sharex": "col"}
    height = 1.1 + 0.3 * len(shown) + 0.6 * sum(counts)
    figure, grid = canvas(len(shown), 3, height=height, squeeze=False, **layout)
    for (left, middle, right), (title, lines) in zip(grid, shown.items(), strict=True):
        left.set_title(title, loc="left", weight="bold")
        left.set_ylabel("iterations")
        for place, (look, rows) in zip(range(len(lines))[::-1], lines, strict=True):
            _draw_first(left, look, rows)
            _draw_iterations(middle, place, look, rows)
            _draw_saved(right, place, look, rows)
        _name_rows(middle, [look for look, _ in lines])
        right.set(yticks=[], ylim=middle.get_ylim())
        right.axvline(0, color="0.4", lw=0.8, zorder=0)
        right.spines["left"].set_visible(False)
    _label_columns(grid, numbers)
    pad(figure, w_pad=0.07)
    legend_below(figure, _handles(numbers))
    return figure


def _draw_first(panel: Axes, look: Look, rows: pd.DataFrame) -> None:
    first = rows[rows["trial"] < FIRST]
    panel.plot(first["trial"].to_numpy(), first["iterations"].to_numpy(), lw=0.7, **look.line)


def _name_rows(panel: Axes, looks: list[Look]) -> None:
    """Name the methods on the axis, from above."""
    names = [_broken(look.label) for look in looks[::-1]]
    panel.set_yticks(range(len(looks)), names, size=7.5)
    panel.set_ylim(-0.55, len(looks) - 0.4)
    panel.tick_params(axis="y", length=0)
    panel.spines["left"].set_visible(False)
    for text, look in zip(panel.get_yticklabels(), looks[::-1], strict=True):
        text.set_color(look.colour)


def _broken(label: str) -> str:
    """Return a label in lines."""
    return label.replace(" incorrect", "\nincorrect").replace(" (", "\n(")


def _draw_iterations(panel: Axes, place: int, look: Look, rows: pd.DataFrame) -> None:
    """Draw the iterations of all trials, with our mean and SD and the paper's."""
    own = summarise(rows["iterations"], rows["converged"])
    draw_cloud(panel, place, look.colour, rows["iterations"].to_numpy(float))
    draw_mean(panel, place, look.colour, own.mean, (own.low, own.high), own.sd)
    draw_paper(panel, place, look.colour, rows["paper"].iloc[0], rows["paper_sd"].iloc[0])


def _draw_saved(panel: Axes, place: int, look: Look, rows: pd.DataFrame) -> None:
    """Draw what each trial saves, with the mean of all and the paper's difference of means."""
    saved = rows["saved"].to_numpy(float)
    if np.isnan(saved).all():
        return
    draw_cloud(panel, place, look.colour, saved[~np.isnan(saved)])
    low, high = mean_interval(saved)
    draw_mean(panel, place, look.colour, saved.mean(), (float(low), float(high)), np.nan)
    draw_paper(panel, place, look.colour, rows["paper_saved"].iloc[0], np.nan)
    alike = (saved == 0).mean()
    text = _effect(saved).replace(" ", "\n", 1).replace("-", "\N{MINUS SIGN}")
    text += f"\nequal in {100 * alike:.0f} %" if alike > ALIKE else ""
    style: dict[str, Any] = {"textcoords": "offset points", "va": "center", "size": SMALL}
    at = (1, place + 0.05)
    panel.annotate(text, at, (3, 0), xycoords=panel.get_yaxis_transform(), **style)


def _label_columns(grid: NDArray[Any], numbers: pd.DataFrame) -> None:
    """Say above and below each column what it shows."""
    n = numbers["trial"].nunique()
    first = min(n, FIRST)
    heads = f"(a) first {first} trials", f"(b) all {n} trials", "(c) differences, same seed"
    units = "trial", "iterations", f"iterations saved against\n{_baseline(numbers)}"
    style: dict[str, Any] = {"textcoords": "offset points", "size": 9}
    for column, head, unit in zip(grid.T, heads, units, strict=True):
        column[0].annotate(head, (0, 1), (0, 22), xycoords="axes fraction", **style)
        column[-1].set_xlabel(unit)
        column[-1].xaxis.set_major_locator(MaxNLocator(5, integer=True, steps=[1, 2, 5, 10]))
    grid[0, 0].set_xlim(-0.5, first - 0.5)
    for panel in grid[:, 0]:
        panel.set_ylim(0, 1.05 * numbers["iterations"].max())


def _baseline(numbers: pd.DataFrame) -> str:
    """Return against what is saved."""
    saving = numbers.loc[numbers["saved"].notna(), "method"].unique()
    names = {get_method(get_method(method).baseline).label for method in saving}
    return names.pop() if len(names) == 1 else "the method's baseline"


def _handles(numbers: pd.DataFrame) -> list[Artist]:
    ours = "our mean (width: 95 % interval) \N{PLUS-MINUS SIGN} SD"
    theirs = "the paper's mean \N{PLUS-MINUS SIGN} SD; in (c) its difference of means"
    style: dict[str, Any] = {"color": "0.3", "lw": 1}
    handles: list[Artist] = [Line2D([], [], label=ours, **style, **OURS | {"mew": 2.5})]
    if numbers["paper"].notna().any():
        handles.append(Line2D([], [], label=theirs, ls=(0, (2, 1)), **style, **PAPER))
    return handles
