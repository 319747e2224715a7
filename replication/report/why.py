"""Why turning back counts: a walk on the map, what wrong trajectories take, and what it saves."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from numpy.typing import NDArray

from replication.demos.model import Demos
from replication.envs.maze import Maze, as_maze
from replication.evidence.experiments import GENERAL, NAMED, NONE, Key
from replication.irl import Trial
from replication.irl.agent import Episode
from replication.irl.expectations import visited
from replication.report.drawing import READING_MARKS, handle
from replication.report.maze import draw_map, map_numbers, places, ticks
from replication.report.picture import Picture
from replication.report.readable import F_LABELS, SET_LABELS
from replication.report.style import canvas, legend_below, settled
from replication.report.ways import COLOURS
from replication.trials.measures import kind_pairs

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
    trial = trials[SHOWN]
    episode = trial.episodes[min(1, trial.iterations)]  # the first may be right by chance
    path_x, path_y = places(maze, demos.correct[0].states)
    moves = _moves(maze, episode, demos)
    parts = [
        map_numbers(maze).assign(part="map"),
        pd.DataFrame({"part": "path", "x": path_x, "y": path_y}),
        moves.assign(part="move"),
        kinds.assign(part="kind"),
        saved[saved["set"].isin(ALONE)].assign(part="saved"),
    ]
    taken = "; ".join(
        f"{row.kind}, {F_LABELS[row.reading]}: {row.weight:.0%}" for row in kinds.itertuples()
    )
    counts = moves.groupby("kind", sort=False)["count"].sum()
    listed = "; ".join(f"{counts[kind]} {text}" for kind, text in MARKED.items() if kind in counts)
    words = (
        f"After its first update the agent walks {len(np.unique(episode.states))} cells of the map "
        f"in {len(episode.actions)} moves: {listed}. Share of each kind in the "
        f"discounted visits of wrong pairs: {taken}."
    )
    return Picture(pd.concat(parts, ignore_index=True), draw_why, words)


def _moves(maze: Maze, episode: Episode, demos: Demos) -> pd.DataFrame:
    """Return each move of an episode once: how often it is made, and which kind marks it."""
    pairs = np.stack([episode.states[:-1], episode.actions], axis=1)
    (states, actions), counts = (part.T for part in np.unique(pairs, axis=0, return_counts=True))
    shape = maze.n_states, maze.n_actions
    known = {"correct": visited(demos.correct, shape=shape), **kind_pairs(demos)}
    known = {kind: marked for kind, marked in known.items() if kind in MARKED}
    kinds = [
        next((kind for kind, marked in known.items() if marked[pair]), "unmarked")
        for pair in zip(states, actions, strict=True)
    ]
    (x, y), (to_x, to_y) = places(maze, states), places(maze, maze.next_state[states, actions])
    return pd.DataFrame(
        {"kind": kinds, "x": x, "y": y, "to_x": to_x, "to_y": to_y, "count": counts}
    )


ALONE = ("hit", "detour", "opposite", NAMED, GENERAL)
"""The sets whose savings are drawn."""

AROUND = 7
"""Cells of the map at least, along each side."""


MARKED = {
    "correct": "as the expert",
    "hit": "wrong, as in hits",
    "detour": "wrong, as in detours",
    "opposite": "turning back (general list only)",
    "unmarked": "wrong otherwise",
}
"""What a move of the agent is, in words."""

PATH: dict[str, Any] = {"color": "0.55", "lw": 7, "alpha": 0.5, "solid_capstyle": "round"}
MOVE_COLOURS = COLOURS | {"correct": "0.3", "opposite": "#D55E00", "unmarked": "#CC79A7"}
SIDE = 0.17  # cells between a move and the middle of its cells, so that to and fro are two arrows


@settled
def draw_why(numbers: pd.DataFrame) -> Figure:
    """Draw the three panels."""
    figure, (where, taken, saves) = canvas(1, 3, height=3.4, width_ratios=(1.1, 1, 1))
    moves = numbers[numbers["part"] == "move"]
    _draw_moves(where, numbers, moves)
    where.set_anchor("N")
    where.set_title("(a) a walk after one update")
    taken.set_title("(b) what goes wrong")
    saves.set_title("(c) what is saved")

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
    saves.set_xlabel("iterations saved,\nwith 95 % interval")
    for panel in (taken, saves):
        panel.invert_yaxis()
    counts = moves.groupby("kind")["count"].sum()
    handles = [
        Line2D([], [], label="the expert's path", **PATH),
        *(
            Line2D(
                [],
                [],
                color=MOVE_COLOURS[kind],
                marker=">",
                ms=5,
                label=f"{text}: {counts[kind]:.0f} moves",
            )
            for kind, text in MARKED.items()
            if kind in counts
        ),
        *(handle(F_LABELS[name], *READING_MARKS[name], lw=1.3) for name in readings),
    ]
    legend_below(figure, handles)
    return figure


def _draw_moves(panel: Axes, numbers: pd.DataFrame, moves: pd.DataFrame) -> None:
    """Draw each move of a walk as an arrow, on that part of the map where it is."""
    cells = numbers[numbers["part"] == "map"].astype({"x": int, "y": int})
    path = numbers[numbers["part"] == "path"]
    walked = np.concatenate([moves[["x", "y"]], moves[["to_x", "to_y"]]])
    seen = {(x, y) for x, y in np.concatenate([walked, path[["x", "y"]]])}
    draw_map(panel, cells, avoid=seen)
    panel.plot(path["x"], path["y"], zorder=1, **PATH)
    for move in moves.itertuples():
        start, end = np.array([move.x, move.y]), np.array([move.to_x, move.to_y])
        colour, (ahead, up) = MOVE_COLOURS[move.kind], end - start
        if (start == end).all():
            panel.plot(*start, "x", color=colour, ms=6, mew=1.5, zorder=4)
            continue
        aside = SIDE * np.array([up, -ahead])
        arrow = {"arrowstyle": "-|>", "color": colour, "lw": 1.5, "shrinkA": 0, "shrinkB": 0}
        tip, tail = (tuple(place + aside) for place in (end, start))
        panel.annotate("", tip, tail, arrowprops=arrow, zorder=4)
    _zoom(panel, walked)


def _zoom(panel: Axes, walked: NDArray[np.float64]) -> None:
    """Show a square of the map, with at least :data:`AROUND` cells, about what is walked."""
    low, high = walked.min(axis=0), walked.max(axis=0)
    side = max(AROUND, (high - low).max() + 3)
    for middle, name in zip((low + high) / 2, "xy", strict=True):
        _, end = getattr(panel, f"get_{name}lim")()
        n = end + 0.5
        first = np.clip(np.round(middle - (side - 1) / 2), 0, max(n - side, 0))
        last = min(first + side, n)
        getattr(panel, f"set_{name}lim")(first - 0.5, last - 0.5)
        getattr(panel, f"set_{name}ticks")([first + tick for tick in ticks(int(last - first))])


def _places(readings: list[str]) -> NDArray[np.float64]:
    n = max(len(readings), 1)
    return (np.arange(len(readings)) - (len(readings) - 1) / 2) * 0.8 / n
