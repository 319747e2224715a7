"""The picture of what was learned: the path among the correct demonstrations, and the errors."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from numpy.typing import NDArray

from replication.demos.model import Demos
from replication.envs.maze import Maze
from replication.envs.soccer.field import SoccerField, as_soccer
from replication.envs.soccer.replay import replay
from replication.report.maze import demo_numbers, draw_arrows, draw_map, map_numbers, places
from replication.report.pitch import PINK, Movers, draw_pitch
from replication.report.style import CORRECT_COLOUR, canvas, legend_below, settled

COLOUR = "#0072B2"
PATH: dict[str, Any] = {"color": COLOUR, "lw": 4, "alpha": 0.45, "solid_capstyle": "round"}


@settled
def fit_figure(
    demos: Demos,
    actions: NDArray[np.int64],
    weights: NDArray[np.float64],
    errors: NDArray[np.float64],
) -> Figure:
    """Draw what was learned: the path with the correct demonstrations, and the errors.

    `actions` make the learned path, `weights` are `[state, action]`, `errors` is d by iteration. A
    maze shows the reward, too.
    """
    environment = demos.environment
    if isinstance(environment, Maze):
        figure, (path, reward, error) = canvas(1, 3, height=3.0)
        handle = _draw_in_maze(path, environment, demos, actions)
        value = np.where(environment.free, weights.max(axis=1), np.nan).reshape(environment.shape)
        image = reward.imshow(value[::-1], cmap="viridis", origin="lower")
        reward.set(title="largest reward weight", xticks=[], yticks=[])
        figure.colorbar(image, ax=reward, fraction=0.046)
    else:
        figure, (path, error) = canvas(1, 2, height=4.0)
        handle = _draw_on_field(path, as_soccer(environment), demos, actions)
    path.set_title("learned path")
    error.plot(errors, color=COLOUR)
    error.set(title="error d", xlabel="iteration", xlim=(0, None), ylim=(0, None))
    error.set_box_aspect(1)
    legend_below(figure, [handle, Line2D([], [], label="learned path", **PATH)])
    return figure


def _draw_in_maze(panel: Axes, maze: Maze, demos: Demos, actions: NDArray[np.int64]) -> Line2D:
    """Draw demonstrations and path; return the entry of the legend for the former."""
    draw_map(panel, map_numbers(maze))
    for demo in demos.correct:
        draw_arrows(panel, demo_numbers(maze, demo))
    panel.plot(*places(maze, maze.replay(actions)), **PATH)
    return Line2D([], [], color=CORRECT_COLOUR, marker=">", ms=4, label="correct demo")


def _draw_on_field(
    panel: Axes, field: SoccerField, demos: Demos, actions: NDArray[np.int64]
) -> Line2D:
    """Draw demonstrations and path; return the entry of the legend for the former."""
    style: dict[str, Any] = {"color": PINK, "marker": "o", "ms": 2.8}
    draw_pitch(panel)
    for demo in demos.correct:
        panel.plot(*replay(field, demo.actions)[["x", "y"]].to_numpy().T, zorder=5, **style)
    path = replay(field, actions)
    panel.plot(*path[["x", "y"]].to_numpy().T, zorder=3, **PATH)
    start = path.iloc[0]
    Movers(panel, obstacles=False).place(start[["x", "y", "heading"]], start[["ball_x", "ball_y"]])
    panel.set(xlabel="x (m)", ylabel="y (m)")
    return Line2D([], [], label="correct demo", **style)
