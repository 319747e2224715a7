"""The methods of the paper beside all baselines, as a table and as a figure."""

from __future__ import annotations

from typing import Any

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import FixedLocator, NullLocator

from replication.baselines import find_method
from replication.evidence.experiments import GENERAL, NONE
from replication.report.drawing import BLUE, GREEN, INK, VERMILION, handle
from replication.report.picture import Picture
from replication.report.readable import F_LABELS, Form, readable
from replication.report.style import canvas, legend_below, settled

MARKS = {
    "open-maze": ("o", BLUE, "open maze"),
    "obstacle-maze": ("s", VERMILION, "obstacles"),
    "random": ("^", INK, "three random mazes, mean"),
    "soccer": ("D", GREEN, "robot soccer"),
}
"""Mark, colour and label of each group of tasks."""

KEY = ["method", "reading", "set"]
"""What a row shows."""


def short_label(method: str, reading: str, set: str) -> str:
    """Return what a row of the figure and of the table is called."""
    label = find_method(method).label.partition(",")[0]
    label = f"{label}, wary" if method == "wary" else label
    label = label if set == NONE else f"{label} + incorrect"
    return f"{label}, {F_LABELS[reading].partition(' ')[0]}" if reading else label


def grouped(table: pd.DataFrame) -> pd.DataFrame:
    """Return the table with the random mazes as one task: means, with the interval of the mean.

    `table` is a :func:`~replication.evidence.comparison.comparison_table`.
    """
    table = table.assign(
        task=table["task"].str.replace(r"^random-.*", "random", regex=True),
        set=table["set"].replace("all", GENERAL),
    )
    rows = []
    for key, own in table.groupby([*KEY, "solver", "task"], sort=False):
        row = dict(zip([*KEY, "solver", "task"], key, strict=True))
        for name in ("d", "iterations", "steps"):
            half = (own[f"{name}_high"] - own[f"{name}_low"]) / 2
            row |= {name: own[name].mean(), f"{name}_half": np.sqrt((half**2).sum()) / len(own)}
        rows.append(row | {"reached": own["reached"].mean(), "plans": own["plans"].mean()})
    return pd.DataFrame(rows)


def comparison(table: pd.DataFrame) -> Picture:
    """Show what each method reaches and what it costs."""
    numbers = grouped(table)
    parts = []
    for (method, reading, set), own in numbers.groupby(KEY, sort=False):
        rows = own[(own["task"] == "open-maze") & (own["solver"] == "q-learning")]
        for row in rows.itertuples():
            parts.append(
                f"{short_label(method, reading, set)}: {row.iterations:.1f} iterations, "
                f"d = {row.d:.2g} at the end"
            )
    words = "Each method on the open maze, with Q-learning inside"
    return Picture(numbers, draw_comparison, f"{words}. {'; '.join(parts)}.")


@settled
def draw_comparison(numbers: pd.DataFrame) -> Figure:
    """Draw a row for each method, in panels of d, of iterations and of steps."""
    numbers = numbers.fillna({"reading": ""})
    keys = list(numbers.groupby(KEY, sort=False).groups)
    figure, axes = canvas(1, 3, height=0.21 * len(keys) + 1.2, sharey=True)
    shifts = dict(zip(MARKS, np.linspace(-0.24, 0.24, len(MARKS)), strict=True))
    for place, key in enumerate(keys):
        own = numbers[(numbers[KEY] == list(key)).all(axis=1)]
        for row in own.itertuples():
            mark, colour, _ = MARKS[row.task]
            y = place + shifts[row.task]
            learned = row.solver == "q-learning"
            style: dict[str, Any] = {"color": colour, "lw": 1.0}
            fill = colour if learned else "white"
            for panel, name in zip(axes, ("d", "iterations", "steps"), strict=True):
                if name == "steps" and not learned:
                    continue
                x, half = getattr(row, name), getattr(row, f"{name}_half")
                panel.hlines(y, max(x - half, 0), x + half, **style)
                panel.plot(x, y, mark, ms=3.6, color=colour, mfc=fill, mew=0.8)
    axes[0].set_yticks(range(len(keys)), [short_label(*key) for key in keys], size=7.5)
    axes[0].set_ylim(len(keys) - 0.4, -0.6)
    _scale(axes[0], "(a) distance d at the end", 0.1, [0, 0.1, 1, 5])
    _scale(axes[1], "(b) iterations", 1, [0, 1, 10, 100])
    _scale(axes[2], "(c) steps in the environment", 1e4, [0, 1e4, 1e5, 1e6, 1e7, 1e8])
    for panel in axes:
        panel.grid(axis="y", color="0.92", lw=0.6)
        panel.set_axisbelow(True)
        panel.tick_params(axis="y", length=0)
    handles = [handle(label, mark, colour, ms=5, lw=0) for mark, colour, label in MARKS.values()]
    handles.append(handle("filled: Q-learning", "o", INK, ms=5, lw=0))
    handles.append(handle("hollow: exact planning", "o", INK, ms=5, lw=0, mfc="white"))
    legend_below(figure, handles)
    return figure


def _scale(panel: Axes, title: str, linear: float, ticks: list[float]) -> None:
    """Let a panel begin at zero and go on by powers."""
    panel.set_title(title, size=8, loc="left")
    names = {
        tick: f"{tick:g}" if tick < 1000 else f"$10^{{{np.log10(tick):.0f}}}$" for tick in ticks
    }
    panel.set_xlabel(f"log axis from {names[linear]} on", size=7)
    panel.set_xscale("symlog", linthresh=linear, linscale=0.5)
    panel.set_xlim(-0.1 * linear, None)
    panel.xaxis.set_major_locator(FixedLocator(ticks))
    panel.xaxis.set_minor_locator(NullLocator())
    panel.set_xticks(ticks, names.values())


def readable_comparison(table: pd.DataFrame) -> pd.DataFrame:
    """Return what each method came to, a row for each method, reading and set."""
    numbers = grouped(table)
    cells = numbers.set_index([*KEY, "solver", "task"])

    def cell(row: Any, name: str, solver: str, task: str, scale: float = 1.0) -> str:
        key = (row.method, row.reading, row.set, solver, task)
        if key not in cells.index:
            return "–"
        found = cells.loc[key]
        half = f" ± {found[f'{name}_half'] / scale:.1f}" if found[f"{name}_half"] else ""
        return f"{found[name] / scale:.1f}{half}"

    def distance(row: Any) -> str:
        own = numbers[(numbers[KEY] == [row.method, row.reading, row.set]).all(axis=1)]
        low, high = own["d"].min(), own["d"].max()
        return "0" if (own["reached"] == 1).all() else f"{low:.2g} to {high:.2g}"

    def iterations(solver: str, task: str) -> Form:
        return lambda row: cell(row, "iterations", solver, task)

    def plans(row: Any) -> str:
        key = (row.method, row.reading, row.set, "planning", "open-maze")
        return f"{cells.loc[key, 'plans']:.0f}"

    rows = table[(table["solver"] == "planning") & (table["task"] == "open-maze")]
    names = ("open maze", "obstacles", "random", "soccer")
    every = list(zip(names, MARKS, strict=True))
    return readable(
        rows,
        {
            "Method": lambda row: short_label(row.method, row.reading, row.set),
            "Uses of incorrect": lambda row: row.use,
            "d at the end": distance,
            **{f"Iterations, {name}": iterations("q-learning", task) for name, task in every},
            **{f"Planning, {name}": iterations("planning", task) for name, task in every[:3]},
            "Steps, open maze (M)": lambda row: cell(row, "steps", "q-learning", "open-maze", 1e6),
            "Plans, open maze": plans,
        },
    )
