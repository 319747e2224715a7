"""Pictures of where Algorithm 1 breaks: demonstrations that differ or are noisy, larger mazes."""

from __future__ import annotations

from typing import Any

import numpy as np
import pandas as pd
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import NullLocator, PercentFormatter

from replication.baselines import find_method
from replication.report.drawing import INK, VERMILION, handle
from replication.report.picture import Picture
from replication.report.readable import interval, readable
from replication.report.style import canvas, legend_below, settled

DESIGNS = ("paths", "noise", "sizes")

ROLLOUT_MARKS = {1: ("o", INK), 100: ("s", VERMILION)}
METHOD_MARKS = {"one-line": ("^", 1.0), "perceptron": ("s", 0.93), "unified": ("o", 1.07)}
"""Mark of a method, and how far it is moved from its number of cells."""

SHARE_MARKS = {"share": ("o", INK), "contradictory": ("D", VERMILION)}


def limits(paths: pd.DataFrame, noise: pd.DataFrame, sizes: pd.DataFrame) -> Picture:
    """Show the three designs, a panel each.

    The tables are those of :mod:`replication.evidence.limits`.
    """
    tables = zip(DESIGNS, (paths, noise, sizes), strict=True)
    numbers = pd.concat([table.assign(design=name) for name, table in tables], ignore_index=True)
    single, many = (paths[paths["rollouts"] == rollouts] for rollouts in ROLLOUT_MARKS)
    near = ", ".join(f"{row.d:.2f} with {row.number}" for row in single.itertuples())
    start = ", ".join(f"{row.untrained:.0%} with {row.number}" for row in many.itertuples())
    shares = ", ".join(f"{row.share:.0%} at {row.level:g}" for row in noise.itertuples())
    powers = ", ".join(
        f"{find_method(name).label}: {power:.2f}" for name, power in growth(sizes).items()
    )
    return Picture(
        numbers,
        draw_limits,
        f"Least d by the number of different correct demonstrations: {near}; with "
        f"{many['rollouts'].iloc[0]} trajectories it is that of the untrained agent in "
        f"{start}. Trials that end at zero by the probability of a slip: {shares}. "
        f"Steps grow with this power of the number of cells: {powers}.",
    )


@settled
def draw_limits(numbers: pd.DataFrame) -> Figure:
    """Draw least d by demonstrations, the share at zero by slips, and steps by cells."""
    paths, noise, sizes = (numbers[numbers["design"] == name] for name in DESIGNS)
    figure, (left, middle, right) = canvas(1, 3, height=3.1)
    single = paths[paths["rollouts"] == 1]
    left.plot(single["number"], single["shortest"], "_", color="0.45", ms=18, mew=1.5)
    for shift, (rollouts, look) in zip((-0.12, 0.12), ROLLOUT_MARKS.items(), strict=True):
        rows = paths[paths["rollouts"] == rollouts]
        _marks(left, rows["number"] + shift, rows, "d", look)
        later = rows[rows["untrained"] > 0]
        left.plot(later["number"] + shift, later["learned"], look[0], ms=4, color=look[1], mfc="w")
    left.set_xticks(single["number"], single["number"].astype(int))
    left.set_ylim(0, None)
    _name(left, "(a) demonstrations that differ", "correct demonstrations", "least d")

    for shift, (name, look) in zip((-0.002, 0.002), SHARE_MARKS.items(), strict=True):
        _marks(middle, noise["level"] + shift, noise, name, look, lw=0.8)
    middle.set_xticks(noise["level"], [f"{100 * level:g} %" for level in noise["level"]])
    middle.yaxis.set_major_formatter(PercentFormatter(1))
    middle.set_ylim(-0.03, 1.03)
    _name(middle, "(b) slips of the demonstrator", "probability a step", "share")

    right.set(xscale="log", yscale="log", ylim=(sizes["steps"].min() / 2, 3 * sizes["steps"].max()))
    for method, rows in sizes.groupby("method", sort=False):
        mark, shift = METHOD_MARKS[str(method)]
        look = mark, find_method(str(method)).colour
        _marks(right, shift * rows["cells"], rows, "steps", look, lw=0.8)
        short = rows[rows["zero"] < 1]
        right.plot(shift * short["cells"], short["steps"], mark, ms=4, color=look[1], mfc="w")
    ticks = [25, 100, 900, 10_000]
    right.set_xticks(ticks, [f"{tick:,}" for tick in ticks], size=7.5)
    right.xaxis.set_minor_locator(NullLocator())
    right.yaxis.set_minor_locator(NullLocator())
    _name(right, "(c) larger mazes", "cells (log axis)", "steps (log axis)")
    legend_below(figure, _handles(paths, noise, sizes))
    return figure


def _marks(
    panel: Axes, x: Any, rows: pd.DataFrame, name: str, look: tuple[str, str], lw: float = 0
) -> None:
    """Draw means or shares with their intervals."""
    mark, colour = look
    panel.vlines(x, rows[f"{name}_low"], rows[f"{name}_high"], color=colour, lw=1.1)
    panel.plot(x, rows[name], mark, ms=4, color=colour, ls="-" if lw else "", lw=lw)


def _name(panel: Axes, title: str, x: str, y: str) -> None:
    panel.set_title(title, size=8, loc="left")
    panel.set_xlabel(x, size=8)
    panel.set_ylabel(y, size=8)


def growth(table: pd.DataFrame) -> dict[str, float]:
    """Return by method the power of the number of cells with which the steps grow.

    It is the slope of a straight line through the logarithms of a sizes table.
    """
    return {
        str(method): float(np.polyfit(np.log(rows["cells"]), np.log(rows["steps"]), 1)[0])
        for method, rows in table.groupby("method", sort=False)
    }


def _handles(paths: pd.DataFrame, noise: pd.DataFrame, sizes: pd.DataFrame) -> list[Artist]:
    """Return the entries of the legend, panel by panel."""
    handles = [
        handle(f"(a) {rollouts} trajector{'y' if rollouts == 1 else 'ies'} an iteration", *look)
        for rollouts, look in ROLLOUT_MARKS.items()
    ]
    handles.append(handle("(a) the same, after an update", "s", VERMILION, mfc="white", lw=0))
    handles.append(handle("(a) the nearest shortest path", "_", "0.45", ms=12, mew=1.5, lw=0))
    handles.append(handle("(b) trials that end at d = 0", *SHARE_MARKS["share"]))
    text = "(b) demonstrations with two actions in a state"
    handles.append(handle(text, *SHARE_MARKS["contradictory"]))
    handles += [
        handle(
            f"(c) {find_method(name).label.partition(',')[0]}",
            METHOD_MARKS[name][0],
            find_method(name).colour,
        )
        for name in dict.fromkeys(sizes["method"])
    ]
    if (sizes["zero"] < 1).any():
        handles.append(handle("(c) not all at d = 0", "o", "0.4", mfc="white", lw=0))
    n = int(paths["n"].max()), int(noise["n"].max()), int(sizes["n"].max())
    text = f"95 % intervals; {n[0]} trials in (a), {n[1]} in (b), {n[2]} in (c)"
    handles.append(handle(text, "|", "0.4", lw=0, ms=9))
    return handles


def readable_paths(table: pd.DataFrame) -> pd.DataFrame:
    """Return how near the agent comes to demonstrations that differ."""
    return readable(
        table,
        {
            "Demonstrations": lambda row: row.number,
            "Trajectories": lambda row: row.rollouts,
            "Trials": lambda row: row.n,
            "Least d [95 %]": lambda row: interval(row.d, row.d_low, row.d_high),
            "In iteration (quartiles)": lambda row: (
                f"{row.at:g} ({row.at_low:g}\N{EN DASH}{row.at_high:g})"
            ),
            "Least d after learning": lambda row: interval(
                row.learned, row.learned_low, row.learned_high
            ),
            "Nearest demonstration": lambda row: f"{row.demo:.2f}",
            "Nearest shortest path": lambda row: f"{row.shortest:.2f}",
            "As near as that": lambda row: f"{row.reached:.0%}",
            "Nearer": lambda row: f"{row.nearer:.0%}",
            "Before learning": lambda row: f"{row.untrained:.0%}",
            "At d = 0": lambda row: f"{row.zero:.0%}",
        },
    )


def readable_noise(table: pd.DataFrame) -> pd.DataFrame:
    """Return how the method bears slips of the demonstrator."""
    return readable(
        table,
        {
            "Slips a step": lambda row: f"{row.level:.0%}",
            "Trials": lambda row: row.n,
            "At d = 0 [95 %]": lambda row: interval(row.share, row.share_low, row.share_high),
            "Iterations, median": lambda row: f"{row.iterations:g}",
            "Least d [95 %]": lambda row: interval(row.d, row.d_low, row.d_high),
            "At d = 0 of those with two actions in a state": lambda row: (
                f"{row.against_zero:.0f} of {row.against:.0f}"
            ),
            "Demonstrations with two actions in a state [95 %]": lambda row: interval(
                row.contradictory, row.contradictory_low, row.contradictory_high
            ),
        },
    )


def readable_sizes(table: pd.DataFrame) -> pd.DataFrame:
    """Return what larger mazes cost, a row for each side and method."""
    return readable(
        table,
        {
            "Cells": lambda row: f"{row.side} × {row.side}",
            "Moves": lambda row: row.moves,
            "Method": lambda row: find_method(row.method).label,
            "Trials": lambda row: row.n,
            "At d = 0": lambda row: f"{row.zero:.0%}",
            "Iterations [95 %]": lambda row: _wide(row, "iterations", 1),
            "Thousand steps [95 %]": lambda row: _wide(row, "steps", 1000),
            "Steps an episode": lambda row: f"{row.episode:.0f}",
        },
    )


def _wide(row: Any, name: str, unit: float) -> str:
    middle, low, high = (getattr(row, f"{name}{end}") / unit for end in ("", "_low", "_high"))
    return f"{middle:,.0f} [{low:,.0f}, {high:,.0f}]"
