"""The picture of what was learned: the path among the demonstrations, and the errors."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import MaxNLocator
from numpy.typing import NDArray

from replication.demos.model import Demos
from replication.envs.maze import Maze
from replication.envs.soccer.field import SoccerField, as_soccer
from replication.envs.soccer.replay import replay
from replication.envs.tasks.base import Task
from replication.report.field import demonstrations as demonstrated
from replication.report.field import draw_ways
from replication.report.maze import (
    cells_of,
    demonstrations,
    draw_map,
    map_numbers,
    places,
)
from replication.report.style import canvas, legend_below, settled
from replication.report.ways import draw_demos

COLOUR = "#0072B2"
PATH: dict[str, Any] = {"color": COLOUR, "lw": 4, "alpha": 0.45, "solid_capstyle": "round"}


@settled
def fit_figure(
    demos: Demos,
    states: NDArray[np.int64],
    actions: NDArray[np.int64],
    weights: NDArray[np.float64],
    errors: NDArray[np.float64],
) -> Figure:
    """Draw what was learned: the path with all demonstrations, and the errors.

    `states` [T + 1] and `actions` [T] make the learned path, `weights` are `[state, action]`,
    `errors` is d by iteration. A maze shows the reward, too; a task that has no map shows it along
    the path.
    """
    environment = demos.environment
    if isinstance(environment, Task):
        return _task_figure(states, actions, weights, errors)
    if isinstance(environment, Maze):
        figure, (path, reward, error) = canvas(1, 3, height=3.2)
        handles = _draw_in_maze(path, environment, demos, actions)
        value = np.where(environment.free, weights.max(axis=1), np.nan).reshape(environment.shape)
        image = reward.imshow(value[::-1], cmap="viridis", origin="lower")
        reward.set(title="(b) reward", xlabel="x (cells)", facecolor="0.55")
        reward.set(xticks=path.get_xticks(), yticks=path.get_yticks())
        reward.tick_params(length=2)
        reward.set_anchor("N")
        bar: dict[str, Any] = {"location": "bottom", "shrink": 0.8, "aspect": 15}
        figure.colorbar(image, ax=reward, label="largest weight of a cell (no unit)", **bar)
    else:
        figure, (path, error) = canvas(1, 2, height=3.9)
        handles = _draw_on_field(path, as_soccer(environment), demos, actions)
    path.set_title("(a) learned path")
    _draw_errors(error, errors, "c" if isinstance(environment, Maze) else "b")
    error.set(box_aspect=1, anchor="N")
    legend_below(figure, [*handles, Line2D([], [], label="learned path", **PATH)])
    return figure


def _task_figure(
    states: NDArray[np.int64],
    actions: NDArray[np.int64],
    weights: NDArray[np.float64],
    errors: NDArray[np.float64],
) -> Figure:
    """Draw the reward along the learned path, and the errors."""
    figure, (reward, error) = canvas(1, 2, height=2.8)
    steps = np.arange(1, len(actions) + 1)
    others = weights[states[:-1]].copy()
    taken = others[np.arange(len(actions)), actions]
    others[np.arange(len(actions)), actions] = -np.inf
    handles = reward.plot(steps, taken, color=COLOUR, marker="o", ms=3, label="action taken")
    if weights.shape[1] > 1:
        best = others.max(axis=1)
        handles += reward.plot(steps, best, color="0.5", marker="s", ms=3, label="best other one")
    reward.set(title="(a) reward along the learned path", xlabel="step", ylabel="weight (no unit)")
    reward.xaxis.set_major_locator(MaxNLocator(6, integer=True))
    _draw_errors(error, errors, "b")
    legend_below(figure, handles)
    return figure


def _draw_errors(panel: Axes, errors: NDArray[np.float64], letter: str) -> None:
    panel.plot(errors, color=COLOUR, marker="o", ms=2, clip_on=False)
    panel.set(title=f"({letter}) error", xlabel="iteration", ylabel="error d", ylim=(0, None))
    panel.set_xlim(0, max(1, len(errors) - 1))
    panel.xaxis.set_major_locator(MaxNLocator(5, integer=True))


def _draw_in_maze(
    panel: Axes, maze: Maze, demos: Demos, actions: NDArray[np.int64]
) -> list[Line2D]:
    """Draw demonstrations and path; return the legend's entries for the former."""
    shown = demonstrations(demos).numbers
    path = places(maze, maze.replay(actions))
    draw_map(panel, map_numbers(maze), avoid=cells_of(shown) | {*zip(*path, strict=True)})
    panel.plot(*path, **PATH)
    panel.set_anchor("N")
    return draw_demos(panel, shown[shown["part"] != "map"])


def _draw_on_field(
    panel: Axes, field: SoccerField, demos: Demos, actions: NDArray[np.int64]
) -> list[Line2D]:
    """Draw demonstrations and path; return the legend's entries for the former."""
    handles = draw_ways(panel, demonstrated(demos).numbers)
    path = replay(field, actions)
    panel.plot(*path[["x", "y"]].to_numpy().T, zorder=3, **PATH)
    panel.set(xlabel="x (m)", ylabel="y (m)")
    return handles
