"""The picture of the calibration's finalists, and its tables."""

from __future__ import annotations

import pandas as pd
from matplotlib.figure import Figure

from replication.evidence.calibration import TRACE, WORLD
from replication.irl.methods import TRACES
from replication.report.drawing import handle
from replication.report.picture import Picture
from replication.report.readable import F_LABELS, Form, interval, readable
from replication.report.style import canvas, legend_below, settled


def points(table: pd.DataFrame) -> Picture:
    """Show the SD against the mean of each finalist, with intervals, a panel for each trace.

    `table` is a :func:`~replication.evidence.calibration.calibration_table`.
    """
    parts = [
        f"{F_LABELS[trace]}: {len(rows)} finalists, {int(rows['fits'].sum())} of which fit; the "
        f"nearest has a mean of {rows['mean'].iloc[0]:.1f} (SD {rows['sd'].iloc[0]:.1f})"
        for trace, rows in table.groupby("F-INDEX", sort=False)
    ]
    paper = table.iloc[0]
    words = f"Published are {paper['paper_mean']:.2f} ({paper['paper_sd']:.2f})"
    return Picture(table, draw_points, f"{words}. {'; '.join(parts)}.")


@settled
def draw_points(numbers: pd.DataFrame) -> Figure:
    """Draw the finalists, those that fit filled, the defaults ringed, and the published pair."""
    traces = [trace for trace in TRACES if trace in set(numbers["F-INDEX"])]
    figure, axes = canvas(1, len(traces), height=3.4, sharex=True, sharey=True)
    for panel, trace in zip(axes, traces, strict=True):
        for row in numbers[numbers["F-INDEX"] == trace].itertuples():
            colour = "#0072B2" if row.fits else "0.55"
            panel.hlines(row.sd, row.low, row.high, color=colour, lw=0.9, alpha=0.6)
            panel.vlines(row.mean, row.sd_low, row.sd_high, color=colour, lw=0.9, alpha=0.6)
            panel.plot(row.mean, row.sd, "o", ms=5, color=colour, mfc=colour if row.fits else "w")
            if row.default:
                panel.plot(row.mean, row.sd, "o", ms=11, mfc="none", mec="0.1", mew=1.2)
        mean, sd = numbers[["paper_mean", "paper_sd"]].iloc[0]
        panel.plot(mean, sd, "*", ms=14, mfc="none", mec="#D0021B", mew=1.3, zorder=5)
        panel.set(title=F_LABELS[trace], xlabel="mean of the iterations")
    axes[0].set_ylabel("SD of the iterations")
    handles = [handle("does not fit, with 95 % intervals", "o", "0.55", mfc="white", lw=0.9)]
    if numbers["fits"].any():
        handles.append(handle("fits", "o", "#0072B2", lw=0.9))
    if numbers["default"].any():
        handles.append(handle("default", "o", "0.1", ms=9, mfc="none", lw=0))
    star = f"published ({mean:.2f}, {sd:.2f})"
    handles.append(handle(star, "*", "#D0021B", ms=10, mfc="none", lw=0))
    legend_below(figure, handles)
    return figure


def _point_columns(table: pd.DataFrame) -> pd.DataFrame:
    columns = table[["F-INDEX", *WORLD, *TRACE]].copy()
    columns["F-INDEX"] = columns["F-INDEX"].map(F_LABELS)
    return columns.reset_index(drop=True)


def readable_final(table: pd.DataFrame) -> pd.DataFrame:
    """Return the finalists, the nearest first."""
    forms: dict[str, Form] = {
        "Mean [95 %]": lambda row: interval(row.mean, row.low, row.high),
        "SD [95 %]": lambda row: interval(row.sd, row.sd_low, row.sd_high),
        "Divergence": lambda row: f"{row.kl_divergence:.3f}",
        "Fits": lambda row: "yes" if row.fits else "no",
        "Default": lambda row: "yes" if row.default else "",
    }
    return pd.concat([_point_columns(table), readable(table, forms)], axis=1)
