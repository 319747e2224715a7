"""The picture of the calibration's finalists, and its tables."""

from __future__ import annotations

from typing import Any

import pandas as pd
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from replication.evidence.calibration import JUDGED, TRACE, WORLD
from replication.irl.methods import TRACES
from replication.report.drawing import BLUE, INK, VERMILION, handle
from replication.report.picture import Picture
from replication.report.readable import F_LABELS, Form, interval, readable
from replication.report.style import canvas, legend_below, settled

RATES = {0.1: "#A6A6A6", 0.3: "#56B4E9", 0.5: BLUE, 0.9: "#111111"}
STARTS = {0.1: "o", 0.5: "s", 1.0: "D"}
"""The colour of each rate of the trace, and the mark of each start."""


def points(final: pd.DataFrame, judged: pd.DataFrame) -> Picture:
    """Show the SD against the mean of each finalist and of the judging run, with intervals.

    Both tables are those of :func:`~replication.evidence.calibration.calibration_table`; there is a
    panel for each trace.
    """
    parts = [
        f"{F_LABELS[trace]}: {len(rows)} finalists, {int(rows['fits'].sum())} of which fit; the "
        f"nearest has a mean of {rows['mean'].iloc[0]:.1f} (SD {rows['sd'].iloc[0]:.1f}), and the "
        f"judging run {_pair(judged[judged['F-INDEX'] == trace])}"
        for trace, rows in final.groupby("F-INDEX", sort=False)
    ]
    paper = final.iloc[0]
    words = f"Published are {paper['paper_mean']:.2f} ({paper['paper_sd']:.2f})"
    table = pd.concat([final.assign(run="final"), judged.assign(run=JUDGED)], ignore_index=True)
    return Picture(table, draw_points, f"{words}. {'; '.join(parts)}.")


def _pair(rows: pd.DataFrame) -> str:
    return "; ".join(f"{row.mean:.1f} (SD {row.sd:.1f})" for row in rows.itertuples(index=False))


@settled
def draw_points(numbers: pd.DataFrame) -> Figure:
    """Draw the finalists, those that fit filled, the judging run, and the published pair."""
    numbers = numbers.rename(columns={"F-INDEX": "trace", "ALPHA": "alpha", "F-START": "start"})
    traces = [trace for trace in TRACES if trace in set(numbers["trace"])]
    figure, axes = canvas(1, len(traces), height=3.9, sharex=True, sharey=True)
    judged = numbers["run"] == JUDGED
    for letter, panel, trace in zip("ab", axes, traces, strict=False):
        own = numbers["trace"] == trace
        for row in numbers[own & ~judged].itertuples():
            colour, mark = RATES[row.alpha], STARTS[row.start]
            _cross(panel, row, colour, lw=0.9, alpha=0.5)
            face = colour if row.fits else "w"
            panel.plot(row.mean, row.sd, mark, ms=4.5, mec=colour, mfc=face, mew=1.2)
        for row in numbers[own & judged].itertuples():
            _cross(panel, row, VERMILION, lw=1.8, zorder=4)
            face = VERMILION if row.fits else "w"
            style = {"color": VERMILION, "mfc": face, "mew": 1.4, "zorder": 5}
            panel.plot(row.mean, row.sd, STARTS[row.start], ms=5, **style)
        mean, sd = numbers[["paper_mean", "paper_sd"]].iloc[0]
        panel.plot(mean, sd, "*", ms=14, mfc="none", mec=INK, mew=1.3, zorder=6)
        panel.set_title(f"({letter}) {F_LABELS[trace]}", loc="left")
        panel.set_xlabel("mean of the iterations")
    axes[0].set_ylabel("SD of the iterations")
    legend_below(figure, _handles(numbers[~judged], numbers[judged], mean, sd))
    return figure


def _cross(panel: Axes, row: Any, colour: str, **style: Any) -> None:
    """Draw both intervals of a point."""
    panel.hlines(row.sd, row.low, row.high, color=colour, **style)
    panel.vlines(row.mean, row.sd_low, row.sd_high, color=colour, **style)


def _handles(final: pd.DataFrame, judged: pd.DataFrame, mean: float, sd: float) -> list[Artist]:
    rates = [handle(f"α = {rate:g}", "", colour, lw=3) for rate, colour in RATES.items()]
    starts = [handle(f"F₀ = {f:g}", mark, "0.3", mfc="w", lw=0) for f, mark in STARTS.items()]
    rest: list[Artist] = []
    if final["fits"].any():
        rest.append(handle("filled: fits", "o", "0.3", lw=0))
    for row in judged.head(1).itertuples():
        name = f"judging run, α = {row.alpha:g} ({row.n} trials)"
        rest.append(handle(name, STARTS[row.start], VERMILION, mfc="w", lw=1.8))
    star = f"published ({mean:.2f}, {sd:.2f})"
    rest.append(handle(star, "*", INK, ms=10, mfc="none", lw=0))
    rest.append(handle(f"95 % intervals, {final['n'].max()} trials", "+", "0.5", ms=9, lw=0))
    return [*rates, *starts, *rest]


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
