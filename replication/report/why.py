"""Why turning back counts: a loop on the map, what wrong trajectories take, and what it saves."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from numpy.typing import NDArray

from replication.demos.model import Demos
from replication.envs.maze import as_maze
from replication.evidence.experiments import GENERAL, NAMED, NONE, Key
from replication.irl import Trial
from replication.report.drawing import READING_MARKS, handle
from replication.report.maze import draw_map, map_numbers, places
from replication.report.picture import Picture
from replication.report.readable import F_LABELS, SET_LABELS
from replication.report.style import canvas, legend_below, settled

SHOWN = "unified", "printed", NONE
"""The trial whose trajectory is drawn."""


def why(
    kinds: pd.DataFrame, saved: pd.DataFrame, trials: Mapping[Key, Trial], demos: Demos
) -> Picture:
    """Show a wrong trajectory, what goes wrong by kind, and what sets save.

    Parameters
    ----------
    kinds, saved
        See :func:`replication.evidence.tables.kinds_table` and `sets_table`.
    trials
        Trial 0 of the methods; drawn is the trajectory of the unified method after its first
        update.
    demos
        The demonstrations, with the correct path.
    """
    maze = as_maze(demos.environment)
    episode = trials[SHOWN].episodes[1]
    x, y = places(maze, episode.states)
    path_x, path_y = places(maze, demos.correct[0].states)
    parts = [
        map_numbers(maze).assign(part="map"),
        pd.DataFrame({"part": "path", "x": path_x, "y": path_y}),
        pd.DataFrame({"part": "trajectory", "x": x, "y": y}),
        kinds.assign(part="kind"),
        saved[saved["set"].isin(ALONE)].assign(part="saved"),
    ]
    taken = "; ".join(
        f"{row.kind}, {F_LABELS[row.reading]}: {row.weight:.0%}" for row in kinds.itertuples()
    )
    words = (
        f"After its first update the agent walks {len(np.unique(episode.states))} cells of the map "
        f"in {len(episode.actions)} moves. Share of each kind in the discounted visits of wrong "
        f"pairs: {taken}."
    )
    return Picture(pd.concat(parts, ignore_index=True), draw_why, words)


ALONE = ("hit", "detour", "opposite", NAMED, GENERAL)
"""The sets whose savings are drawn."""


PATH: dict[str, Any] = {"color": "0.55", "lw": 4, "alpha": 0.5, "solid_capstyle": "round"}
WAY: dict[str, Any] = {"color": "#D55E00", "lw": 1.6}


@settled
def draw_why(numbers: pd.DataFrame) -> Figure:
    """Draw the three panels."""
    figure, (where, taken, saves) = canvas(1, 3, height=3.0, width_ratios=(1.1, 1, 1))
    cells = numbers[numbers["part"] == "map"].astype({"x": int, "y": int})
    draw_map(where, cells, grid=False)
    path = numbers[numbers["part"] == "path"]
    where.plot(path["x"], path["y"], **PATH)
    way = numbers[numbers["part"] == "trajectory"]
    where.plot(way["x"], way["y"], **WAY)
    where.plot(way["x"].iloc[-1], way["y"].iloc[-1], "o", color=WAY["color"], ms=4)
    where.set(xticks=[], yticks=[], xlabel="", ylabel="")

    kinds = numbers[numbers["part"] == "kind"]
    names = list(dict.fromkeys(kinds["kind"]))
    readings = list(dict.fromkeys(kinds["reading"]))
    for place, reading in zip(_places(readings), readings, strict=True):
        rows = kinds[kinds["reading"] == reading].set_index("kind").loc[names]
        _, colour = READING_MARKS[reading]
        y, share = np.arange(len(names)) + place, 100 * rows["weight"].to_numpy()
        bars = taken.barh(y, share, height=0.8 / len(readings), color=colour, alpha=0.75)
        taken.bar_label(bars, fmt="%.1f", padding=2, size=7)
    taken.margins(x=0.15)
    taken.set_yticks(range(len(names)), names)
    taken.set_xlabel("share of all wrong visits\n(discounted, %)")

    saved = numbers[numbers["part"] == "saved"]
    sets = [name for name in ALONE if name in set(saved["set"])]
    readings = list(dict.fromkeys(saved["reading"]))
    for place, reading in zip(_places(readings), readings, strict=True):
        rows = saved[saved["reading"] == reading].set_index("set").loc[sets]
        mark, colour = READING_MARKS[reading]
        y = np.arange(len(sets)) + place
        saves.hlines(y, rows["low"], rows["high"], color=colour, lw=1.3)
        saves.plot(rows["saved"], y, mark, color=colour, ms=4)
    saves.axvline(0, color="0.5", lw=0.8)
    saves.set_yticks(range(len(sets)), [SET_LABELS.get(name, name) for name in sets])
    saves.set_xlabel("iterations saved\nby such demonstrations")
    for panel in (taken, saves):
        panel.invert_yaxis()
    handles = [
        Line2D([], [], label="the expert's path", **PATH),
        Line2D([], [], label="the agent's after the first update", **WAY),
        *(handle(F_LABELS[name], *READING_MARKS[name], lw=1.3) for name in readings),
    ]
    legend_below(figure, handles)
    return figure


def _places(readings: list[str]) -> NDArray[np.float64]:
    n = max(len(readings), 1)
    return (np.arange(len(readings)) - (len(readings) - 1) / 2) * 0.8 / n
