"""Pictures of rounding: iterations by the tolerance of ties, and where it decides."""

from __future__ import annotations

from typing import Any

import numpy as np
import pandas as pd
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from replication.irl import get_method
from replication.report.choices import power
from replication.report.drawing import BLUE, INK, TASKS, VERMILION, handle
from replication.report.picture import Picture
from replication.report.readable import F_LABELS, full_label, interval, p_value, readable
from replication.report.style import canvas, legend_below, settled

MARKS: dict[str, tuple[str, str]] = {
    "double": ("o", INK),
    "fused": ("s", BLUE),
    "single": ("D", VERMILION),
}


def tolerances(table: pd.DataFrame) -> Picture:
    """Show the mean iterations under each tolerance of ties and each arithmetic.

    `table` is a :func:`~replication.evidence.rounding.rounding_table`.
    """
    parts = []
    for (task, method, reading), rows in table.groupby(["task", "method", "reading"], sort=False):
        double = rows[rows["arithmetic"] == "double"]
        means = ", ".join(f"{row.mean:.1f} at {row.tolerance:g}" for row in double.itertuples())
        parts.append(f"{TASKS[task]}, {full_label(method, reading)}: {means}")
    words = "Mean iterations by the tolerance of ties, in double precision"
    return Picture(table, draw_tolerances, f"{words}. {'; '.join(parts)}.")


@settled
def draw_tolerances(numbers: pd.DataFrame) -> Figure:
    """Draw a panel for each setting: means with intervals, by tolerance, one mark an arithmetic."""
    keys = list(numbers.groupby(["method", "reading"], sort=False).groups)
    tasks = list(dict.fromkeys(numbers["task"]))
    figure, axes = canvas(len(tasks), len(keys), height=4.2, sharex=True, sharey=True)
    steps = sorted(numbers["tolerance"].unique())
    letters = iter("abcdefghij")
    for line, task in zip(axes, tasks, strict=True):
        for panel, (method, reading) in zip(line, keys, strict=True):
            own = numbers[
                (numbers["task"] == task)
                & (numbers["method"] == method)
                & (numbers["reading"] == reading)
            ]
            for shift, (arithmetic, (mark, colour)) in zip(
                (-0.2, 0, 0.2), MARKS.items(), strict=True
            ):
                rows = own[own["arithmetic"] == arithmetic].sort_values("tolerance")
                x = np.arange(len(steps)) + shift
                half = 1.96 * rows["sd"] / np.sqrt(rows["n"])
                style: dict[str, Any] = {"color": colour, "lw": 1.1}
                panel.vlines(x, rows["mean"] - half, rows["mean"] + half, **style)
                panel.plot(x, rows["mean"], mark, ms=4, color=colour)
            title = f"({next(letters)}) {TASKS[task]}\n{_short_label(method, reading)}"
            panel.set_title(title, size=8, loc="left")
            panel.set_xticks(range(len(steps)), [power(step) for step in steps])
    for line in axes:
        line[0].yaxis.set_major_locator(MaxNLocator(5, steps=[1, 2, 5, 10]))
        line[0].set_ylabel("mean number of iterations", size=8)
    for panel in axes[-1]:
        panel.set_xlabel("relative tolerance of ties", size=8)
    handles = [handle(f"{name} arithmetic", *mark) for name, mark in MARKS.items()]
    handles.append(handle(f"95 % interval, {numbers['n'].max()} trials", "|", "0.4", lw=0, ms=9))
    legend_below(figure, handles)
    return figure


def _short_label(method: str, reading: str) -> str:
    """Return a method's label for a narrow panel; all are without incorrect demonstrations."""
    label = get_method(method).label.partition(" (")[0].partition(",")[0]
    return f"{label}, {F_LABELS[reading]}" if reading else label


def profile(table: pd.DataFrame) -> Picture:
    """Show where along the path the greedy choice is left to a tie or to rounding.

    `table` is a :func:`~replication.evidence.rounding.profile_table`.
    """
    parts = [
        f"{full_label(method, reading)}: rounding decides in {rows['rounded'].mean():.1%} and an "
        f"exact tie in {rows['tied'].mean():.1%} of the choices along the path"
        for (method, reading), rows in table.groupby(["method", "reading"], sort=False)
    ]
    return Picture(table, draw_profile, f"{'; '.join(parts)}.")


@settled
def draw_profile(numbers: pd.DataFrame) -> Figure:
    """Draw the shares of Q-tables against the step of the path, a panel for each method."""
    keys = list(numbers.groupby(["method", "reading"], sort=False))
    figure, axes = canvas(1, len(keys), height=2.5, sharex=True, sharey=True)
    for letter, panel, ((method, reading), rows) in zip("abc", axes, keys, strict=False):
        x, tied, rounded = (rows[name].to_numpy() for name in ("step", "tied", "rounded"))
        panel.bar(x, 100 * rounded, width=0.9, color=VERMILION)
        panel.bar(x, 100 * tied, width=0.9, bottom=100 * rounded, color="0.75")
        panel.set_title(f"({letter}) {_short_label(method, reading)}", size=8, loc="left")
        panel.annotate(
            f"{rows['tables'].iloc[0]} Q-tables", (0.03, 0.9), xycoords="axes fraction", size=7.5
        )
        panel.set_xlabel("step of the expert's path", size=8)
        panel.set_xlim(-0.6, x[-1] + 0.6)
    axes[0].set_ylabel("share of Q-tables (%)", size=8)
    axes[0].yaxis.set_major_locator(MaxNLocator(5, steps=[1, 2, 5, 10]))
    handles = [
        handle("best two values differ by rounding alone", "s", VERMILION, ms=6, lw=0),
        handle("best two values are equal", "s", "0.75", ms=6, lw=0),
    ]
    legend_below(figure, handles)
    return figure


def readable_rounding(table: pd.DataFrame) -> pd.DataFrame:
    """Return how the iterations depend on arithmetic, a row for each setting and tolerance."""
    others = table[table["arithmetic"] != "double"]
    double = table[table["arithmetic"] == "double"].set_index(
        ["task", "method", "reading", "tolerance"]
    )

    def mean(row: Any) -> str:
        own = double.loc[(row.task, row.method, row.reading, row.tolerance)]
        return f"{own['mean']:.2f} ({own['sd']:.2f})"

    return readable(
        others,
        {
            "Task": lambda row: TASKS[row.task],
            "Method": lambda row: full_label(row.method, row.reading),
            "Tolerance": lambda row: f"{row.tolerance:g}",
            "Double: mean (SD)": mean,
            "Arithmetic": lambda row: row.arithmetic,
            "More than double [95 %]": lambda row: interval(row.difference, row.low, row.high),
            "Equal trials": lambda row: f"{row.equal:.0%}",
            "p, Holm": lambda row: p_value(row.p_holm),
            "Wrong pairs": lambda row: f"{row.wrong:.1f}",
        },
    )
