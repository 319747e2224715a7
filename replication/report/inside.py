"""What is inside the loop: the learner's noise, and how a trial begins."""

from __future__ import annotations

import numpy as np
import pandas as pd
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from replication.baselines import find_method
from replication.report.comparison import short_label
from replication.report.drawing import INK, TASKS, VERMILION, handle
from replication.report.picture import Picture
from replication.report.readable import interval, readable
from replication.report.style import canvas, legend_below, settled
from replication.trials.measures import numbers_in


def noise(table: pd.DataFrame) -> Picture:
    """Show the iterations of each trial with Q-learning and with exact planning inside.

    `table` is a :func:`~replication.evidence.comparison.noise_table`.
    """
    parts = [
        f"{TASKS[row.task]}, {short_label(row.method, row.reading, row.set)}: "
        f"{row.learned:.1f} (SD {row.learned_sd:.1f}) learned, "
        f"{row.planned:.1f} (SD {row.planned_sd:.1f}) planned"
        for row in table.itertuples()
    ]
    return Picture(table, draw_noise, f"Iterations. {'; '.join(parts)}.")


@settled
def draw_noise(numbers: pd.DataFrame) -> Figure:
    """Draw a panel for each maze: each trial as a point, a row for each method and solver."""
    numbers = numbers.fillna({"reading": ""})
    tasks = list(dict.fromkeys(numbers["task"]))
    names = ["iterations_learned", "iterations_planned"]
    most = max(x.max() for name in names for x in numbers_in(numbers[name]))
    figure, axes = canvas(1, len(tasks), height=3.0, sharex=True, sharey=True)
    for letter, panel, task in zip("ab", axes, tasks, strict=True):
        own = numbers[numbers["task"] == task]
        for place, row in enumerate(own.itertuples()):
            for shift, name, colour in ((-0.19, "learned", INK), (0.19, "planned", VERMILION)):
                (x,) = numbers_in([getattr(row, f"iterations_{name}")])
                y = place + shift + 0.11 * np.sin(2.4 * np.arange(len(x)))  # side by side
                panel.plot(x, y, "o", ms=2, color=colour, alpha=0.4, mew=0)
                mean = getattr(row, name)
                panel.vlines(mean, place + shift - 0.17, place + shift + 0.17, color=colour, lw=1.6)
        panel.set_title(f"({letter}) {TASKS[task]}", size=8, loc="left")
        panel.set_xlabel("iterations", size=8)
        panel.xaxis.set_major_locator(MaxNLocator(6, integer=True))
        panel.set_xlim(0, most + 2)
    labels = [short_label(row.method, row.reading, row.set) for row in own.itertuples()]
    axes[0].set_yticks(range(len(labels)), labels, size=7.5)
    axes[0].set_ylim(len(labels) - 0.5, -0.5)
    handles = [
        handle("Q-learning inside: each trial", "o", INK, ms=3, lw=0),
        handle("exact planning inside", "o", VERMILION, ms=3, lw=0),
        handle("means", "|", "0.4", ms=9, lw=0),
    ]
    legend_below(figure, handles)
    return figure


def readable_noise(table: pd.DataFrame) -> pd.DataFrame:
    """Return how the iterations divide into method and learner, a row for each method."""
    return readable(
        table,
        {
            "Task": lambda row: TASKS[row.task],
            "Method": lambda row: short_label(row.method, row.reading, row.set),
            "Q-learning: mean (SD)": lambda row: f"{row.learned:.1f} ({row.learned_sd:.1f})",
            "Planning: mean (SD)": lambda row: f"{row.planned:.1f} ({row.planned_sd:.1f})",
            "Difference [95 %]": lambda row: interval(row.noise, row.noise_low, row.noise_high),
        },
    )


def beginning(table: pd.DataFrame) -> Picture:
    """Show how the error falls, and what goes wrong in the initial phase.

    `table` is a :func:`~replication.evidence.comparison.start_table`.
    """
    parts = [
        f"{TASKS[row.task]}, {short_label(row.method, row.reading, row.set)}: "
        f"{row.errors:.1f} erroneous motions and {row.collisions:.3g} collisions at first"
        for row in table.itertuples()
    ]
    return Picture(table, draw_beginning, f"{'; '.join(parts)}.")


@settled
def draw_beginning(numbers: pd.DataFrame) -> Figure:
    """Draw the median error by iteration, and the erroneous motions and collisions, by maze."""
    tasks = list(dict.fromkeys(numbers["task"]))
    figure, axes = canvas(2, 3, height=4.2, width_ratios=[1.5, 1, 1])
    for line, task in zip(axes, tasks, strict=True):
        own = numbers[numbers["task"] == task]
        for place, row in enumerate(own.itertuples()):
            colour = find_method(row.method).colour
            (d,) = numbers_in([row.d])
            line[0].plot(d, color=colour)
            for panel, name in zip(line[1:], ("errors", "collisions"), strict=True):
                x, low, high = (getattr(row, f"{name}{end}") for end in ("", "_low", "_high"))
                panel.hlines(place, low, high, color=colour)
                panel.plot(x, place, "o", ms=4, color=colour, clip_on=False)
        line[0].set_ylabel(f"{TASKS[task]}\nmedian error d", size=8)
        for panel in line[1:]:
            panel.set_yticks([])
            panel.set_ylim(len(own) - 0.5, -0.5)
            panel.set_xlim(0, None)
            panel.xaxis.set_major_locator(MaxNLocator(3))
            panel.xaxis.set_major_formatter(lambda x, _: f"{x:,.0f}")
    titles = ("(a) error", "(b) erroneous motions", "(c) collisions while learning")
    for panel, title in zip(axes[0], titles, strict=True):
        panel.set_title(title, size=8, loc="left")
    feet = ("iteration", "in the initial phase", "in the initial phase")
    for panel, foot in zip(axes[-1], feet, strict=True):
        panel.set_xlabel(foot, size=8)
    handles = [
        handle(short_label(row.method, "", row.set), "o", find_method(row.method).colour, lw=1.2)
        for row in own.itertuples()
    ]
    legend_below(figure, handles)
    return figure
