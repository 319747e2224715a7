"""Players of the agent while it learns: where it goes, its rewards, how far it is from the expert.

Methods are shown side by side, with a frame for each iteration. One file because what a player
shows of a trial (`Course`) and how that is drawn change together.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.animation import FuncAnimation
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.cm import ScalarMappable
from matplotlib.collections import PolyCollection
from matplotlib.colors import Normalize
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from numpy.typing import NDArray

from replication.demos.model import Demos
from replication.envs.maze import as_maze
from replication.envs.soccer import rules
from replication.envs.soccer.field import SoccerField
from replication.envs.soccer.replay import replay
from replication.evidence.experiments import Key
from replication.irl import Trial, get_method
from replication.report.maze import draw_map, map_numbers, places
from replication.report.moving import DPI, Player, player
from replication.report.pitch import draw_pitch
from replication.report.readable import full_label
from replication.report.style import legend_below, style

Floats = NDArray[np.float64]

FRAMES_A_SECOND = 3
MOST_FRAMES = 120
REWARD_MAP = "PiYG"


@dataclass(frozen=True)
class Course:
    """One trial, iteration by iteration: entry i is what there is after i weight updates.

    Attributes
    ----------
    method, reading, set
        What learned, under which reading of Eq. 9, and from which incorrect demonstrations.
    errors
        d (Eq. 6), [n + 1].
    ways
        Where the greedy agent goes, x and y of each step: n + 1 arrays [T + 1, 2].
    weights
        Reward weights of what is coloured, [n + 1, cell or pair].
    """

    method: str
    reading: str
    set: str
    errors: Floats
    ways: tuple[Floats, ...]
    weights: Floats

    @property
    def label(self) -> str:
        """How it is called."""
        return full_label(self.method, self.reading, self.set)

    @property
    def iterations(self) -> int:
        """Number of weight updates."""
        return len(self.errors) - 1


def courses(demos: Demos, trials: Mapping[Key, Trial]) -> list[Course]:
    """Return the courses of trials that kept their snapshots, in a maze or on the soccer field."""
    shown = []
    for (method, reading, set), trial in trials.items():
        assert trial.snapshots is not None, "a player needs trials that kept their snapshots"
        ways = tuple(_way(demos, episode.states, episode.actions) for episode in trial.episodes)
        weights = _shown_weights(demos, trial.snapshots.weights)
        shown.append(Course(method, reading, set, trial.errors, ways, weights))
    return shown


def learning_player(demos: Demos, shown: Sequence[Course]) -> Player:
    """Return a player of some courses.

    A method that has converged keeps its last frame until all have. Of very many iterations some
    are left out, evenly.
    """
    ends = [
        f"{course.label}: d = 0 after {course.iterations}"
        if course.errors[-1] == 0
        else f"{course.label}: d = {course.errors[-1]:.3g}"
        for course in shown
    ]
    words = (
        "The agent's way, its reward weights and its error, iteration by iteration, one trial of "
        f"each method side by side. Iterations to the end: {'; '.join(ends)}."
    )
    html = player(_animation(demos, shown), words, frames_a_second=FRAMES_A_SECOND)
    return Player(html, pd.concat(map(_numbers, shown), ignore_index=True), words)


def _numbers(course: Course) -> pd.DataFrame:
    """Return a row for each iteration."""
    return pd.DataFrame(
        {
            "method": course.method,
            "reading": course.reading,
            "set": course.set,
            "iteration": range(course.iterations + 1),
            "error": course.errors,
            "moves": [len(way) - 1 for way in course.ways],
            "last_x": [way[-1, 0] for way in course.ways],
            "last_y": [way[-1, 1] for way in course.ways],
            "lowest_weight": course.weights.min(axis=1),
            "highest_weight": course.weights.max(axis=1),
        }
    )


def _animation(demos: Demos, shown: Sequence[Course]) -> FuncAnimation:
    with style():
        figure = Figure(figsize=(2.75 * len(shown) + 0.5, 4.35), dpi=DPI, layout="constrained")
        _Canvas(figure)
        grid = figure.subplots(2, len(shown), height_ratios=(3, 1), squeeze=False)
        # Colours show the root of a weight's size: one wrong loop outweighs all that is learned.
        most = np.sqrt(max(np.abs(course.weights).max() for course in shown)) or 1.0
        norm = Normalize(-most, most)
        panels = [_Panel(demos, course, norm, *grid[:, at]) for at, course in enumerate(shown)]
        longest = max(course.iterations for course in shown)
        highest = max(course.errors.max() for course in shown)
        for curve in grid[1]:
            curve.set(xlim=(0, longest), ylim=(0, highest * 1.05), xlabel="iteration")
            curve.label_outer()
        grid[1, 0].set_ylabel("error d")
        colours = ScalarMappable(norm, REWARD_MAP)
        bar = figure.colorbar(colours, ax=grid[0].tolist(), shrink=0.8, pad=0.01)
        bar.set_ticks([-most, 0, most], labels=["avoid", "0", "seek"])
        bar.set_label("reward weight (√ of its size)", labelpad=-2)
        handles = [
            Line2D([], [], color="0.1", label="the agent's way", lw=1.6),
            Line2D([], [], color="0.1", marker="o", ms=4, lw=0, label="where it ends"),
            Line2D([], [], color="0.45", ls=":", lw=1.4, label="the expert's way"),
        ]
        legend_below(figure, handles)

        def draw(frame: int) -> list[Any]:
            for panel in panels:
                panel.draw(frame)
            return []

        draw(longest)
        for _ in range(2):  # the first layout does not know yet how high the titles stand
            figure.draw_without_rendering()
        figure.set_layout_engine("none")
        frames = np.linspace(0, longest, min(longest + 1, MOST_FRAMES)).round().astype(int)
        return FuncAnimation(figure, draw, frames=frames, cache_frame_data=False)


class _Canvas(FigureCanvasAgg):
    """Draws a frame when it is saved, and not once more before."""

    def draw_idle(self, *_: Any, **__: Any) -> None:
        """Draw nothing."""


class _Panel:
    """One method in a player: the map above, the error below."""

    def __init__(
        self, demos: Demos, course: Course, norm: Normalize, above: Axes, below: Axes
    ) -> None:
        self.course = course
        self.above = above
        corners = _backdrop(demos, above)
        self.coloured = np.flatnonzero(course.weights.any(axis=0))
        shapes = list(corners[self.coloured])
        self.rewards = PolyCollection(shapes, cmap=REWARD_MAP, norm=norm, lw=0, zorder=1)
        above.add_collection(self.rewards, autolim=False)
        expert = _way(demos, demos.correct[0].states, demos.correct[0].actions)
        above.plot(*expert.T, color="0.45", ls=":", lw=1.4, zorder=4)
        (self.way,) = above.plot([], [], color="0.1", lw=1.6, solid_capstyle="round", zorder=6)
        (self.end,) = above.plot([], [], "o", color="0.1", ms=4, zorder=6)
        colour = get_method(course.method).colour
        below.plot(course.errors, color=colour, lw=0.8, alpha=0.35)
        (self.error,) = below.plot([], [], color=colour, lw=1.4)
        (self.now,) = below.plot([], [], "o", color=colour, ms=4, clip_on=False)

    def draw(self, frame: int) -> None:
        """Show the state after so many iterations, or the last one."""
        course, i = self.course, min(frame, self.course.iterations)
        weights = course.weights[i, self.coloured]
        self.rewards.set_array(np.sign(weights) * np.sqrt(np.abs(weights)))
        self.way.set_data(*course.ways[i].T)
        self.end.set_data(*course.ways[i][-1:].T)
        self.error.set_data(np.arange(i + 1), course.errors[: i + 1])
        self.now.set_data([i], [course.errors[i]])
        status = f"iteration {i}: {len(course.ways[i]) - 1} moves, d = {course.errors[i]:.2f}"
        if i == course.iterations:
            status = f"ends after {i} iterations, d = {course.errors[i]:.3g}"
        self.above.set_title(f"{course.label}\n{status}", loc="left", fontsize=8)


def _backdrop(demos: Demos, panel: Axes) -> Floats:
    """Draw where the agent moves; return the corners of what rewards colour, [shape, corner, 2]."""
    if isinstance(demos.environment, SoccerField):
        draw_pitch(panel)
        panel.set(xticks=[], yticks=[])
        x = np.linspace(0, rules.WIDTH, rules.COLUMNS + 1)
        y = np.linspace(0, rules.HEIGHT, rules.ROWS + 1)
        left, low = (side.ravel() for side in np.meshgrid(x[:-1], y[:-1], indexing="ij"))
        right, high = (side.ravel() for side in np.meshgrid(x[1:], y[1:], indexing="ij"))
        corners = [(left, low), (right, low), (right, high), (left, high)]
        return np.stack([np.stack(corner, axis=1) for corner in corners], axis=1)
    maze = as_maze(demos.environment)
    draw_map(panel, map_numbers(maze), grid=False)
    panel.set(xticks=[], yticks=[], xlabel="", ylabel="", anchor="N")
    centre = np.stack(places(maze, np.arange(maze.n_states)), axis=1)
    # A cell's four triangles are its actions: up, down, right, left.
    sides = 0.5 * np.array(
        [((-1, 1), (1, 1)), ((-1, -1), (1, -1)), ((1, -1), (1, 1)), ((-1, -1), (-1, 1))]
    )
    shapes = np.zeros((maze.n_states, maze.n_actions, 3, 2)) + centre[:, None, None]
    shapes[:, :, 1:] += sides
    return shapes.reshape(-1, 3, 2)


def _way(demos: Demos, states: NDArray[np.int64], actions: NDArray[np.int64]) -> Floats:
    """Return where an episode leads, x and y [T + 1, 2]."""
    if isinstance(demos.environment, SoccerField):
        return replay(demos.environment, actions)[["x", "y"]].to_numpy()
    return np.stack(places(as_maze(demos.environment), states), axis=1).astype(float)


def _shown_weights(demos: Demos, weights: Floats) -> Floats:
    """Return what is coloured: the weight of each pair in a maze, of each cell in soccer.

    Actions in soccer have no side of the cell: a cell shows its weight of greatest size.
    """
    if not isinstance(demos.environment, SoccerField):
        return weights.reshape(len(weights), -1)
    cells = weights.reshape(len(weights), rules.COLUMNS * rules.ROWS, -1)
    greatest = np.abs(cells).argmax(axis=2)
    return np.take_along_axis(cells, greatest[..., None], axis=2)[..., 0]
