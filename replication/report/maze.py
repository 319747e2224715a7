"""Pictures of mazes: demonstrations on the map, and learned values as surfaces.

One file because in the numbers of all, as on the page, x goes right and y goes up, in cells from
the lower left.
"""

from __future__ import annotations

from typing import Any

import matplotlib as mpl
import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Rectangle
from matplotlib.ticker import MaxNLocator
from numpy.typing import NDArray

from replication.demos.model import Demo, Demos
from replication.envs.environment import Environment
from replication.envs.maze import Maze, as_maze
from replication.irl import Trial
from replication.report.picture import Picture
from replication.report.style import (
    CORRECT_COLOUR,
    KIND_COLOURS,
    OTHER_KIND_COLOUR,
    WIDTH,
    canvas,
    legend_below,
    settled,
)
from replication.trials.measures import Report

TITLES = {
    "q_mid": "(a) Q after {} iterations",
    "q_end": "(b) Q at the end ({})",
    "reward_end": "(c) reward at the end",
}


# --- demonstrations (Figs. 4 and 8) ----------------------------------------------------------


def demonstrations(demos: Demos) -> Picture:
    """Show the map with the correct demonstrations, and with the incorrect ones, too."""
    maze = as_maze(demos.environment)
    parts = [map_numbers(maze)]
    for part in ("correct", "incorrect"):
        parts += [demo_numbers(maze, demo).assign(part=part) for demo in getattr(demos, part)]
    numbers = pd.concat(parts, ignore_index=True)[["part", "kind", "demo", "step", "x", "y"]]
    words = f"Map of {demos.task} with a correct demonstration of "
    words += f"{len(demos.correct[0].actions)} moves"
    counts = [f"{sum(d.kind == kind for d in demos.incorrect)} {kind}" for kind in demos.kinds]
    if counts:
        words += f"; incorrect ones: {', '.join(counts)}"
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
    figure, axes = canvas(1, 2, height=4.0)
    for panel, title in zip(axes, ("(a) correct", "(b) correct and incorrect"), strict=True):
        draw_map(panel, numbers[numbers["part"] == "map"])
        panel.set_title(title)
    correct, incorrect = (
        numbers[numbers["part"] == part].groupby(["kind", "demo"], sort=False)
        for part in ("correct", "incorrect")
    )
    on_path = {place for _, demo in correct for place in zip(demo["x"], demo["y"], strict=True)}
    for (kind, _), demo in incorrect:
        _draw_departure(axes[1], demo, on_path, KIND_COLOURS.get(kind, OTHER_KIND_COLOUR))
    for panel in axes:
        for _, demo in correct:
            draw_arrows(panel, demo)
    handles = [Line2D([], [], color=CORRECT_COLOUR, marker=">", ms=4, label="correct")]
    kinds = pd.Series([kind for (kind, _), _ in incorrect], dtype=object)
    for kind, number in kinds.groupby(kinds, sort=False).size().items():
        colour = KIND_COLOURS.get(str(kind), OTHER_KIND_COLOUR)
        mark = "x" if kind == "hit" else ""
        handles.append(Line2D([], [], color=colour, marker=mark, label=f"{kind} ({number})"))
    legend_below(figure, handles)
    return figure


def draw_map(panel: Axes, numbers: pd.DataFrame, *, grid: bool = True) -> None:
    """Draw a map from the rows of :func:`map_numbers`, and set up the axes."""
    cells = {kind: rows[["x", "y"]].to_numpy() for kind, rows in numbers.groupby("kind")}
    n_columns, n_rows = cells["corner"][0] + 1
    for left, bottom in cells.get("obstacle", ()):
        panel.add_patch(Rectangle((left - 0.5, bottom - 0.5), 1, 1, color="#8C8C8C", lw=0))
    for kind, colour, side in (("start", "#E24A33", -1), ("goal", "#2CA02C", 1)):
        left, bottom = cells[kind][0]
        panel.add_patch(Rectangle((left - 0.5, bottom - 0.5), 1, 1, color=colour, alpha=0.55, lw=0))
        # Paths run through the middles of cells: at a corner, inside the map, none covers it.
        across = side if 0 <= left + side < n_columns else -side
        upwards = side if 0 <= bottom + side < n_rows else -side
        corner = (left + across / 2, bottom + upwards / 2)
        letter = kind[0].upper()
        panel.text(*corner, letter, size=7.5, ha="center", va="center_baseline", zorder=6)
    if grid:
        for draw, count in ((panel.axvline, n_columns), (panel.axhline, n_rows)):
            for line in range(count + 1):
                draw(line - 0.5, color="0.9", lw=0.4, zorder=0)
    panel.set(xlim=(-0.5, n_columns - 0.5), ylim=(-0.5, n_rows - 0.5), aspect="equal")
    panel.set(xticks=range(0, n_columns, 5), yticks=range(0, n_rows, 5))
    panel.set(xlabel="x (cells)", ylabel="y (cells)")
    panel.spines[:].set(visible=True, linewidth=2, color="0.25")
    panel.tick_params(length=2)


def draw_arrows(panel: Axes, demo: pd.DataFrame) -> None:
    """Draw a correct demonstration as arrows."""
    x, y = demo["x"].to_numpy(), demo["y"].to_numpy()
    style: dict[str, Any] = {"angles": "xy", "scale_units": "xy", "scale": 1, "width": 0.007}
    style |= {"headwidth": 4.5, "headlength": 5, "headaxislength": 4.5}
    style |= {"color": CORRECT_COLOUR, "zorder": 5}
    panel.quiver(x[:-1], y[:-1], np.diff(x), np.diff(y), **style)


def _draw_departure(
    panel: Axes, demo: pd.DataFrame, on_path: set[tuple[int, int]], colour: str
) -> None:
    """Draw a demonstration where it is off the correct path, with a cross where it bumps."""
    x, y = demo["x"].to_numpy(float), demo["y"].to_numpy(float)
    off = np.array([place not in on_path for place in zip(x, y, strict=True)])
    bumps = (np.diff(x) == 0) & (np.diff(y) == 0)
    moves = off[:-1] | off[1:] | bumps
    if not moves.any():  # it goes back along the path: draw it beside
        moves[:] = True
        x, y = x + 0.25, y - 0.25
    for t in np.flatnonzero(moves):
        panel.plot(x[t : t + 2], y[t : t + 2], color=colour, lw=1.3, solid_capstyle="round")
        if bumps[t]:
            panel.plot(x[t], y[t], "x", color=colour, ms=5, mew=1.5, zorder=4)


# --- surfaces (Fig. 7) -----------------------------------------------------------------------


def surfaces(trial: Trial, environment: Environment, report: Report) -> Picture:
    """Show Q in the mid-term, Q at the end and the reward at the end, as surfaces over the maze.

    The trial needs its snapshots. `report` says what stands for a state's actions (FIG7-SURFACE),
    and when mid-term is (FIG7-MIDTERM). Obstacles are left out.
    """
    assert trial.snapshots is not None, "surfaces need a trial that kept its snapshots"
    maze = as_maze(environment)
    reduce = np.max if report.surface == "max" else np.mean
    middle = round(report.mid_term * trial.iterations)
    tables = {
        ("q_mid", middle): trial.snapshots.q[middle],
        ("q_end", trial.iterations): trial.q,
        ("reward_end", trial.iterations): trial.weights,
    }
    x, y = places(maze, np.arange(maze.n_states))
    parts = []
    for (surface, iteration), table in tables.items():
        value = np.where(maze.free, reduce(table, axis=1), np.nan)
        columns = {"surface": surface, "iteration": iteration, "x": x, "y": y, "value": value}
        parts.append(pd.DataFrame(columns))
    numbers = pd.concat(parts, ignore_index=True)
    words = [
        f"{title}: {rows['value'].min():.3g} to {rows['value'].max():.3g}"
        for title, rows in _surfaces(numbers)
    ]
    return Picture(numbers, draw_surfaces, f"Surfaces over the maze. {'; '.join(words)}.")


def _surfaces(numbers: pd.DataFrame) -> list[tuple[str, pd.DataFrame]]:
    """Return each surface's title and rows."""
    return [
        (TITLES[surface].format(iteration), rows)
        for (surface, iteration), rows in numbers.groupby(["surface", "iteration"], sort=False)
    ]


@settled
def draw_surfaces(numbers: pd.DataFrame) -> Figure:
    """Draw the surfaces side by side; what has no value is left out."""
    figure = Figure(figsize=(WIDTH, 2.5))
    FigureCanvasAgg(figure)
    shown = _surfaces(numbers)
    share = 1 / len(shown)
    facets: dict[str, Any] = {"rstride": 1, "cstride": 1, "lw": 0.1, "ec": "0.35", "shade": False}
    for position, (title, rows) in enumerate(shown):
        grid = rows.pivot(index="y", columns="x", values="value").sort_index(ascending=False)
        x, y = np.meshgrid(grid.columns, grid.index)
        height = grid.to_numpy(float)
        box = (position * share + 0.015, 0.04, share - 0.03, 0.88)
        panel: Any = figure.add_axes(box, projection="3d")
        panel.plot_surface(x, y, height, facecolors=_face_colours(height), **facets)
        panel.set_title(title, y=0.99)
        panel.set_xlabel("x (cells)", labelpad=-8)
        panel.set_ylabel("y (cells)", labelpad=-8)
        panel.tick_params(labelsize=6.5, pad=-3)
        panel.xaxis.set_major_locator(MaxNLocator(4, integer=True))
        panel.yaxis.set_major_locator(MaxNLocator(4, integer=True))
        panel.zaxis.set_major_locator(MaxNLocator(4))
        panel.set_box_aspect((1, 1, 0.75), zoom=1.0)
        panel.view_init(elev=28, azim=-125)
    return figure


def _face_colours(height: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the colour of each facet by its highest corner, so that peaks of one cell show."""
    corners = np.stack([height[:-1, :-1], height[1:, :-1], height[:-1, 1:], height[1:, 1:]])
    top = np.where(np.isnan(corners).any(axis=0), np.nan, corners.max(axis=0))
    scaled = (top - np.nanmin(height)) / max(np.nanmax(height) - np.nanmin(height), 1e-300)
    colours: NDArray[np.float64] = mpl.colormaps["viridis"](scaled)
    return colours
