"""The picture of the calibration grid, and the table of its check."""

from __future__ import annotations

import numpy as np
import pandas as pd
from matplotlib import colormaps
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from replication.evidence.calibration import CALIBRATED
from replication.evidence.specifications import sort_key
from replication.report.drawing import handle
from replication.report.picture import Picture
from replication.report.readable import F_LABELS, interval, readable
from replication.report.style import canvas, legend_below, settled


def grid(table: pd.DataFrame) -> Picture:
    """Show the SD against the mean of each point of the calibration grid.

    `table` is a :func:`~replication.evidence.calibration.calibration_table`.
    """
    paper = table.iloc[0]
    words = (
        f"{len(table)} points, with means from {table['mean'].min():.1f} to "
        f"{table['mean'].max():.1f} and SDs from {table['sd'].min():.1f} to "
        f"{table['sd'].max():.1f}; published are {paper['paper_mean']:.2f} and "
        f"{paper['paper_sd']:.2f}."
    )
    for _, row in table[table["default"]].iterrows():
        nearer = int((table["kl_divergence"] < row["kl_divergence"]).sum())
        words += (
            f" The default ({', '.join(_point(row))}) has {row['mean']:.2f} and {row['sd']:.2f}; "
            f"{nearer or 'none'} of the points {'is' if nearer < 2 else 'are'} nearer."
        )
    return Picture(table, draw_grid, words)


@settled
def draw_grid(numbers: pd.DataFrame) -> Figure:
    """Draw the points of the grid, the default with its values, and the published pair."""
    figure, (panel,) = canvas(1, 1, height=4.3)
    shapes = sorted(set(numbers["DEMO-SHAPE"]), key=sort_key)
    shades = colormaps["viridis_r"](np.linspace(0.08, 1, len(shapes)))
    colours = dict(zip(shapes, shades, strict=True))
    marks = dict(zip(sorted(set(numbers["TIES"]), key=str, reverse=True), "o^sD", strict=False))
    columns = numbers[["DEMO-SHAPE", "TIES", "mean", "sd"]]
    for shape, ties, mean, sd in columns.itertuples(index=False, name=None):
        panel.plot(mean, sd, marks[ties], ms=5, mfc=colours[shape], mec="white", mew=0.5)
    mean, sd = numbers[["paper_mean", "paper_sd"]].iloc[0]
    panel.plot(mean, sd, "*", ms=15, mfc="white", mec="#D0021B", mew=1.4, zorder=5)
    panel.set(xlabel="mean of the iterations", ylabel="SD of the iterations")
    panel.margins(0.08)
    for _, row in numbers[numbers["default"]].iterrows():
        panel.plot(row["mean"], row["sd"], "o", ms=12, mfc="none", mec="0.1", mew=1.3, zorder=6)
        _label_in_free_corner(panel, numbers, row)
    handles = [handle(f"DEMO-SHAPE {shape}", "o", colours[shape], lw=0) for shape in shapes]
    handles += [handle(f"TIES {ties}", mark, "0.4", lw=0) for ties, mark in marks.items()]
    star = f"published ({mean:.2f}, {sd:.2f})"
    handles.append(handle(star, "*", "#D0021B", ms=11, mfc="white", lw=0))
    legend_below(figure, handles)
    return figure


def _point(row: pd.Series) -> list[str]:
    return [f"{id} {row[id]}" for id in CALIBRATED]


def _label_in_free_corner(panel: Axes, numbers: pd.DataFrame, row: pd.Series) -> None:
    """Label a point from the corner that has the fewest points around it."""
    x, y = (
        (values - values.min()) / (values.max() - values.min())
        for values in (numbers["mean"], numbers["sd"])
    )
    across, up = min(
        ((0, 1), (1, 1), (0, 0), (1, 0)),
        key=lambda at: int(((abs(x - at[0]) < 0.5) & (abs(y - at[1]) < 0.25)).sum()),
    )
    point = _point(row)
    panel.annotate(
        f"default: {', '.join(point[:2])},\n{', '.join(point[2:])}",
        (row["mean"], row["sd"]),
        (0.02 + 0.96 * across, 0.04 + 0.92 * up),
        textcoords="axes fraction",
        ha="right" if across else "left",
        va="top" if up else "bottom",
        size=7.5,
        arrowprops={"arrowstyle": "-", "color": "0.1", "lw": 0.8, "shrinkB": 6},
        zorder=7,
    )


def readable_check(check: pd.DataFrame) -> pd.DataFrame:
    """Return the check of the chosen point: means and SDs, and where they are expected."""
    sources = {"grid": "of the grid", "new": "new"}
    return readable(
        check,
        {
            "Trials": lambda row: f"{row.n}, {sources[row.trials]}",
            "Reading": lambda row: F_LABELS[row.reading],
            "Mean [95 %]": lambda row: interval(row.mean, row.low, row.high),
            "Expected": lambda row: f"{row.predicted_low:.2f} to {row.predicted_high:.2f}",
            "SD [95 %]": lambda row: interval(row.sd, row.sd_low, row.sd_high),
            "SD expected": lambda row: f"{row.sd_predicted_low:.2f} to {row.sd_predicted_high:.2f}",
        },
    )
