"""Pictures of a maze: the map, and demonstrations on it (Figs. 4 and 8).

In the numbers as on the page x goes right and y goes up, in cells from the lower left.
"""

from __future__ import annotations

from collections.abc import Collection
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle
from numpy.typing import NDArray

from replication.demos.model import Demo, Demos
from replication.envs.maze import Maze, as_maze
from replication.report.picture import Picture
from replication.report.style import canvas, legend_below, settled
from replication.report.ways import PANEL, Cell, draw_demos


def demonstrations(demos: Demos) -> Picture:
    """Show the map with the correct demonstrations, and with the incorrect ones, too."""
    maze = as_maze(demos.environment)
    parts = [map_numbers(maze)]
    for part in ("correct", "incorrect"):
        parts += [demo_numbers(maze, demo).assign(part=part) for demo in getattr(demos, part)]
    numbers = pd.concat(parts, ignore_index=True)[["part", "kind", "demo", "step", "x", "y"]]
    moves = " and ".join(dict.fromkeys(str(len(demo.actions)) for demo in demos.correct))
    plural = "s" * (len(demos.correct) > 1)
    words = f"Map of {demos.task} with {len(demos.correct)} correct demonstration{plural} of "
    words += f"{moves} moves"
    counts = [f"{sum(d.kind == kind for d in demos.incorrect)} {kind}" for kind in demos.kinds]
    if counts:
        words += f"; incorrect ones, drawn where they leave it: {', '.join(counts)}"
    return Picture(numbers, draw_demonstrations, f"{words}.")


def map_numbers(maze: Maze) -> pd.DataFrame:
    """Return a map as rows: its upper right corner, start, goal, and each obstacle."""
    corner = maze.shape[1] - 1
    states = np.array([corner, maze.start, maze.goal, *np.flatnonzero(~maze.free)])
    x, y = places(maze, states)
    kinds = ["corner", "start", "goal", *["obstacle"] * (len(states) - 3)]
    return pd.DataFrame({"part": "map", "kind": kinds, "demo": "", "step": 0, "x": x, "y": y})


def places(maze: Maze, states: NDArray[np.int64]) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Return x and y of states."""
    rows, columns = np.divmod(states, maze.shape[1])
    return columns, maze.shape[0] - 1 - rows


def demo_numbers(maze: Maze, demo: Demo) -> pd.DataFrame:
    """Return where a demonstration is after each of its moves."""
    x, y = places(maze, demo.states)
    steps = np.arange(len(demo.states))
    return pd.DataFrame({"kind": demo.kind, "demo": demo.name, "step": steps, "x": x, "y": y})


@settled
def draw_demonstrations(numbers: pd.DataFrame) -> Figure:
    """Draw correct demonstrations as arrows, incorrect ones where they leave them."""
    own, shown = numbers[numbers["part"] == "map"], numbers[numbers["part"] != "map"]
    columns, rows = own.loc[own["kind"] == "corner", ["x", "y"]].to_numpy()[0] + 1
    figure, axes = canvas(1, 2, height=1.2 + 2.9 * np.clip(rows / columns, 0.3, 1.3))
    for panel, title, part in zip(
        axes,
        ("(a) correct", "(b) correct and incorrect"),
        (shown[shown["part"] == "correct"], shown),
        strict=True,
    ):
        draw_map(panel, own, avoid=cells_of(shown))
        panel.set(title=title, anchor="N")  # else the layout, with its own idea of height, cuts it
        handles = draw_demos(panel, part)
    legend_below(figure, handles)
    return figure


def cells_of(numbers: pd.DataFrame) -> set[Cell]:
    """Return the cells of some rows."""
    return set(zip(numbers["x"], numbers["y"], strict=True))


def draw_map(
    panel: Axes, numbers: pd.DataFrame, *, grid: bool = True, avoid: Collection[Cell] = ()
) -> None:
    """Draw a map from the rows of :func:`map_numbers`, and set up the axes.

    The letters of start and goal stand beside their cells, if possible in none of `avoid`.
    """
    cells = {kind: rows[["x", "y"]].to_numpy() for kind, rows in numbers.groupby("kind")}
    n_columns, n_rows = cells["corner"][0] + 1
    obstacles = {(x, y) for x, y in cells.get("obstacle", ())}
    letter = 0.5 + min(0.5, 6 / PANEL * max(n_columns, n_rows))
    for left, bottom in obstacles:
        panel.add_patch(Rectangle((left - 0.5, bottom - 0.5), 1, 1, color="#8C8C8C", lw=0))
    for kind, colour, side in (("start", "#E24A33", -1), ("goal", "#2CA02C", 1)):
        x, y = cells[kind][0]
        panel.add_patch(Rectangle((x - 0.5, y - 0.5), 1, 1, color=colour, alpha=0.55, lw=0))
        steps = [(a, b) for b in (side, -side, 0) for a in (side, -side, 0) if (a, b) != (0, 0)]
        around = [(a, b) for a, b in steps if 0 <= x + a < n_columns and 0 <= y + b < n_rows]
        empty = [(a, b) for a, b in around if (x + a, y + b) not in obstacles]
        free = [(a, b) for a, b in empty if (x + a, y + b) not in avoid]
        a, b = [*free, *empty, *around][0]
        style: dict[str, Any] = {"size": 7.5, "ha": "center", "va": "center_baseline", "zorder": 6}
        style["clip_on"] = True  # where a part of the map is shown
        panel.text(x + letter * a, y + letter * b, kind[0].upper(), **style)
    if grid:
        for draw, count in ((panel.axvline, n_columns), (panel.axhline, n_rows)):
            for line in range(count + 1):
                draw(line - 0.5, color="0.9", lw=0.4, zorder=0)
    panel.set(xlim=(-0.5, n_columns - 0.5), ylim=(-0.5, n_rows - 0.5), aspect="equal")
    panel.set(xticks=ticks(n_columns), yticks=ticks(n_rows))
    panel.set(xlabel="x (cells)", ylabel="y (cells)")
    panel.spines[:].set(visible=True, linewidth=2, color="0.25")
    panel.tick_params(length=2)


def ticks(count: int) -> list[int]:
    """Return few ticks, the last one at the last cell."""
    step, last = next(n for n in (1, 2, 5, 10, 20, 50, 10**6) if n * 8 >= count), count - 1
    return [*(tick for tick in range(0, last, step) if last - tick > 0.4 * step), last]
