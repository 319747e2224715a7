"""All drawing. Each function takes numbers that are already computed and returns a figure.

Figures do not go through pyplot and its global state. Files carry no time or version, and SVG ids
are derived from the content, so that equal numbers give equal bytes on one platform.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import matplotlib as mpl
import numpy as np
import pandas as pd
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch, Rectangle
from matplotlib.ticker import MaxNLocator
from numpy.typing import NDArray

from replication.demos.model import Demo, Demos
from replication.envs.maze import Maze, as_maze
from replication.fit import Fit
from replication.irl import METHODS
from replication.report.style import (
    CORRECT_COLOUR,
    GOAL_COLOUR,
    KIND_COLOURS,
    OBSTACLE_COLOUR,
    OTHER_KIND_COLOUR,
    START_COLOUR,
    WIDTH,
    canvas,
    legend_below,
    settled,
)

COLOURS = {method.name: method.colour for method in METHODS.values()}


@dataclass(frozen=True)
class Curves:
    """Errors of one condition over its trials.

    Attributes
    ----------
    label, colour
        How it is drawn.
    errors
        d, `[trial, iteration]`, zero once a trial has converged.
    traced
        The trial that is drawn as a line.
    published
        Iteration at which the paper's curve is zero, if it is published.
    dashed
        So that a curve below, which may be the same, stays visible.
    """

    label: str
    colour: str
    errors: NDArray[np.float64]
    traced: int = 0
    published: int | None = None
    dashed: bool = False


@dataclass(frozen=True)
class Counts:
    """Iterations of one condition, [trial], with the published mean; `dashed` as in Curves."""

    label: str
    colour: str
    iterations: NDArray[np.int64]
    published: float | None = None
    dashed: bool = False


@settled
def maze_figure(demos: Demos) -> Figure:
    """Draw the map with correct demonstrations, and with incorrect ones too (Figs. 4 and 8)."""
    figure, axes = canvas(1, 2, height=4.0)
    for panel, title in zip(axes, ("(a) correct", "(b) correct and incorrect"), strict=True):
        _draw_map(panel, as_maze(demos.environment))
        panel.set_title(title)
    on_path = {int(state) for demo in demos.correct for state in demo.states}
    for demo in demos.incorrect:
        _draw_departure(axes[1], as_maze(demos.environment), demo, on_path)
    for panel in axes:
        for demo in demos.correct:
            _draw_arrows(panel, as_maze(demos.environment), demo)
    handles = [Line2D([], [], color=CORRECT_COLOUR, marker=">", ms=4, label="correct")]
    for kind in demos.kinds:
        mark = "x" if kind == "hit" else ""
        number = sum(demo.kind == kind for demo in demos.incorrect)
        handles.append(
            Line2D([], [], color=_kind_colour(kind), marker=mark, label=f"{kind} ({number})")
        )
    legend_below(figure, handles)
    return figure


@settled
def error_figure(panels: Mapping[str, Sequence[Curves]]) -> Figure:
    """Draw the error against the iteration (Figs. 5 and 9), one panel for each title.

    The line is one trial, declared before the run; the band holds the middle half of all trials.
    Triangles on the axis mark where the paper's own curves reach zero.
    """
    figure, axes = canvas(1, len(panels), height=3.2, sharex=True, sharey=True)
    for panel, (title, curves) in zip(axes, panels.items(), strict=True):
        for one in curves:
            iterations = np.arange(one.errors.shape[1])
            low, high = np.quantile(one.errors, [0.25, 0.75], axis=0)
            panel.fill_between(iterations, low, high, color=one.colour, alpha=0.18, lw=0)
            for edge in (low, high):
                panel.plot(iterations, edge, color=one.colour, alpha=0.5, lw=0.5)
            traced = one.errors[one.traced]
            end = int(np.argmax(traced <= 0)) if (traced <= 0).any() else len(traced) - 1
            panel.plot(iterations[: end + 1], traced[: end + 1], **_line(one))
            panel.plot(end, traced[end], "o", color=one.colour, ms=4, clip_on=False, zorder=4)
            if one.published is not None:
                panel.plot(
                    one.published,
                    0,
                    "v",
                    ms=6,
                    mfc="white",
                    mec=one.colour,
                    clip_on=False,
                    zorder=5,
                )
        panel.set(title=title, xlabel="iteration")
    axes[0].set(ylabel="error d", xlim=(0, None), ylim=(0, None))
    first = next(iter(panels.values()))
    handles: list[Artist] = [Line2D([], [], label=one.label, **_line(one)) for one in first]
    handles.append(Patch(color="0.4", alpha=0.25, lw=0, label="middle half of all trials"))
    handles.append(
        Line2D([], [], color="0.4", marker="o", ms=4, lw=0, label="the drawn trial is at zero")
    )
    if any(one.published is not None for one in first):
        handles.append(
            Line2D(
                [], [], marker="v", ms=6, mfc="white", mec="0.4", lw=0, label="the paper's curve"
            )
        )
    legend_below(figure, handles)
    return figure


@settled
def iterations_figure(panels: Mapping[str, Sequence[Counts]]) -> Figure:
    """Draw the iterations of every trial (Figs. 6 and 9), one row for each title.

    Beside each row stand the distributions, with our mean (dot) and the paper's (open triangle).
    That Fig. 9 shows this, and not errors, is the choice FIG9-AXES.
    """
    figure, grid = canvas(
        len(panels), 2, height=0.7 + 2.0 * len(panels), width_ratios=(4, 1), sharey=True
    )
    for (left, right), (title, counts) in zip(np.atleast_2d(grid), panels.items(), strict=True):
        for position, one in enumerate(counts):
            left.plot(one.iterations, **_line(one))
            _draw_distribution(right, position, one)
        left.set_title(title, loc="left")
        left.set(ylabel="iterations", xlim=(-1, len(counts[0].iterations)))
        right.set(xticks=[], xlim=(-0.7, len(counts) - 0.3))
        right.spines["bottom"].set_visible(False)
        right.tick_params(labelleft=False)
    np.atleast_2d(grid)[-1, 0].set(xlabel="trial", ylim=(0, None))
    first = next(iter(panels.values()))
    handles = [Line2D([], [], label=one.label, **_line(one)) for one in first]
    handles.append(Line2D([], [], color="0.3", marker="o", ms=5, lw=0, label="our mean"))
    if any(one.published is not None for counts in panels.values() for one in counts):
        handles.append(
            Line2D([], [], marker="v", ms=6, mfc="white", mec="0.3", lw=0, label="the paper's mean")
        )
    legend_below(figure, handles)
    return figure


@settled
def surfaces_figure(maze: Maze, surfaces: Mapping[str, NDArray[np.float64]]) -> Figure:
    """Draw values of all states as surfaces over the maze (Fig. 7).

    Parameters
    ----------
    maze
        Gives the cells their places; obstacles are left out.
    surfaces
        Values [state] by the panel's title.
    """
    figure = Figure(figsize=(WIDTH, 2.5))
    FigureCanvasAgg(figure)
    n_rows, n_columns = maze.shape
    x, y = np.meshgrid(np.arange(n_columns), np.arange(n_rows)[::-1])
    share = 1 / len(surfaces)
    for position, (title, values) in enumerate(surfaces.items()):
        panel: Any = figure.add_axes(
            (position * share + 0.015, 0.04, share - 0.03, 0.88), projection="3d"
        )
        height = np.where(maze.free, values, np.nan).reshape(maze.shape)
        panel.plot_surface(
            x,
            y,
            height,
            rstride=1,
            cstride=1,
            lw=0.1,
            ec="0.35",
            facecolors=_face_colours(height),
            shade=False,
        )
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


@settled
def sets_figure(panels: Mapping[str, pd.DataFrame]) -> Figure:
    """Draw what each set of incorrect demonstrations saves, a panel for each reading of Eq. 9.

    Parameters
    ----------
    panels
        By title: a table with `set`, `leaving`, and `saved` with its interval `low` to `high`.
    """
    if not panels:
        columns = ["set", "leaving", "saved", "low", "high"]
        panels = {"no incorrect demonstrations": pd.DataFrame(columns=columns)}
    rows = len(next(iter(panels.values())))
    figure, axes = canvas(1, len(panels), height=1.1 + 0.26 * rows, sharex=True, sharey=True)
    for panel, (title, table) in zip(axes, panels.items(), strict=True):
        y = np.arange(len(table))
        panel.axvline(0, color="0.5", lw=0.8)
        panel.hlines(y, table["low"], table["high"], color=COLOURS["unified-incorrect"], lw=1.4)
        panel.plot(table["saved"], y, "o", ms=4.5, color=COLOURS["unified-incorrect"])
        panel.set(title=title, xlabel="iterations saved", yticks=y)
        panel.set_yticklabels(
            f"{row.set}  ({row.leaving})" for row in table.itertuples(index=False)
        )
    axes[0].invert_yaxis()
    axes[0].set_ylabel("set (leaving pairs)")
    return figure


@settled
def fit_figure(fit: Fit) -> Figure:
    """Draw a fit: the map with demonstrations and the learned path, the reward, and the errors."""
    maze = as_maze(fit.demos.environment)
    figure, axes = canvas(1, 3, height=3.0)
    _draw_map(axes[0], maze)
    for demo in fit.demos.correct:
        _draw_arrows(axes[0], maze, demo)
    x, y = _places(maze, fit.states)
    axes[0].plot(x, y, color=COLOURS["unified"], lw=4, alpha=0.45, solid_capstyle="round")
    axes[0].set_title("learned path")
    value = np.where(maze.free, fit.weights.max(axis=1), np.nan).reshape(maze.shape)
    image = axes[1].imshow(value[::-1], cmap="viridis", origin="lower")
    axes[1].set(title="largest reward weight", xticks=[], yticks=[])
    figure.colorbar(image, ax=axes[1], fraction=0.046)
    axes[2].plot(fit.errors, color=COLOURS["unified"])
    axes[2].set(title="error d", xlabel="iteration", xlim=(0, None), ylim=(0, None))
    axes[2].set_box_aspect(1)
    demo_handle = Line2D([], [], color=CORRECT_COLOUR, marker=">", ms=4, label="correct demo")
    path_handle = Line2D([], [], color=COLOURS["unified"], lw=4, alpha=0.45, label="learned path")
    legend_below(figure, [demo_handle, path_handle])
    return figure


def _face_colours(height: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the colour of each facet by its highest corner, so that peaks of one cell show."""
    corners = np.stack([height[:-1, :-1], height[1:, :-1], height[:-1, 1:], height[1:, 1:]])
    top = np.where(np.isnan(corners).any(axis=0), np.nan, corners.max(axis=0))
    scaled = (top - np.nanmin(height)) / max(np.nanmax(height) - np.nanmin(height), 1e-300)
    colours: NDArray[np.float64] = mpl.colormaps["viridis"](scaled)
    return colours


def _line(one: Curves | Counts) -> dict[str, Any]:
    return {"color": one.colour, "lw": 1.1, "ls": (0, (4, 1.5)) if one.dashed else "-"}


def _places(maze: Maze, states: NDArray[np.int64]) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Return x and y of states, y upwards as in the paper."""
    rows, columns = np.divmod(states, maze.shape[1])
    return columns, maze.shape[0] - 1 - rows


def _draw_map(panel: Axes, maze: Maze, *, grid: bool = True) -> None:
    n_rows, n_columns = maze.shape
    x, y = _places(maze, np.flatnonzero(~maze.free))
    for left, bottom in zip(x, y, strict=True):
        panel.add_patch(Rectangle((left - 0.5, bottom - 0.5), 1, 1, color=OBSTACLE_COLOUR, lw=0))
    for state, colour, letter, side in (
        (maze.start, START_COLOUR, "S", -1),
        (maze.goal, GOAL_COLOUR, "G", 1),
    ):
        ((left,), (bottom,)) = _places(maze, np.array([state]))
        panel.add_patch(Rectangle((left - 0.5, bottom - 0.5), 1, 1, color=colour, alpha=0.55, lw=0))
        # Paths run through the middles of cells: at a corner, inside the map, none covers it.
        across = side if 0 <= left + side < n_columns else -side
        upwards = side if 0 <= bottom + side < n_rows else -side
        corner = (left + across / 2, bottom + upwards / 2)
        panel.text(*corner, letter, size=7.5, ha="center", va="center_baseline", zorder=6)
    for line in range(n_columns + 1 if grid else 0):
        panel.axvline(line - 0.5, color="0.9", lw=0.4, zorder=0)
    for line in range(n_rows + 1 if grid else 0):
        panel.axhline(line - 0.5, color="0.9", lw=0.4, zorder=0)
    panel.set(xlim=(-0.5, n_columns - 0.5), ylim=(-0.5, n_rows - 0.5), aspect="equal")
    panel.set(xticks=range(0, n_columns, 5), yticks=range(0, n_rows, 5))
    panel.set(xlabel="x (cells)", ylabel="y (cells)")
    panel.spines[:].set(visible=True, linewidth=2, color="0.25")
    panel.tick_params(length=2)


def _draw_arrows(panel: Axes, maze: Maze, demo: Demo) -> None:
    x, y = _places(maze, demo.states)
    panel.quiver(
        x[:-1],
        y[:-1],
        np.diff(x),
        np.diff(y),
        angles="xy",
        scale_units="xy",
        scale=1,
        width=0.007,
        headwidth=4.5,
        headlength=5,
        headaxislength=4.5,
        color=CORRECT_COLOUR,
        zorder=5,
    )


def _draw_departure(panel: Axes, maze: Maze, demo: Demo, on_path: set[int]) -> None:
    """Draw a demonstration where it is off the correct path, with a cross where it bumps."""
    x, y = (values.astype(float) for values in _places(maze, demo.states))
    off = np.array([int(state) not in on_path for state in demo.states])
    moves = off[:-1] | off[1:] | (demo.states[:-1] == demo.states[1:])
    if not moves.any():  # it goes back along the path: draw it beside
        moves[:] = True
        x, y = x + 0.25, y - 0.25
    colour = _kind_colour(demo.kind)
    for t in np.flatnonzero(moves):
        panel.plot(x[t : t + 2], y[t : t + 2], color=colour, lw=1.3, solid_capstyle="round")
        if demo.states[t] == demo.states[t + 1]:
            panel.plot(x[t], y[t], "x", color=colour, ms=5, mew=1.5, zorder=4)


def _kind_colour(kind: str) -> str:
    return KIND_COLOURS.get(kind, OTHER_KIND_COLOUR)


def _draw_distribution(panel: Axes, position: int, counts: Counts) -> None:
    values, numbers = np.unique(counts.iterations, return_counts=True)
    half = 0.42 * numbers / numbers.max()
    panel.barh(values, 2 * half, left=position - half, height=0.9, color=counts.colour, alpha=0.35)
    panel.plot(position, counts.iterations.mean(), "o", color=counts.colour, ms=5, zorder=4)
    if counts.published is not None:
        panel.plot(
            position + 0.3, counts.published, "v", ms=6, mfc="white", mec=counts.colour, zorder=5
        )
