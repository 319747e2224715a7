"""Episodes of robot soccer, moving: as a GIF, and as a player with buttons."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.animation import FuncAnimation, PillowWriter
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from replication.envs.environment import Environment
from replication.envs.soccer.field import as_soccer
from replication.envs.soccer.replay import replay
from replication.files import read_file, scratch_folder, write_file
from replication.irl import Trial
from replication.report.moving import Player, player
from replication.report.pitch import BLUE, PINK, YELLOW, Movers, draw_pitch, obstacle_columns
from replication.report.style import WIDTH, legend_below, style

FRAMES_A_SECOND, LAST_FRAMES, DPI = 5, 5, 90


@dataclass(frozen=True)
class Film:
    """A moving figure, its numbers (a row for each border between two decisions), and its words."""

    figure: Figure
    animation: FuncAnimation
    numbers: pd.DataFrame
    words: str

    def player(self) -> Player:
        """Return the film with buttons and a slider."""
        html = player(self.animation, self.words, frames_a_second=FRAMES_A_SECOND)
        return Player(html, self.numbers, self.words)

    def save_gif(self, path: Path) -> Path:
        """Write the film as a GIF, whole or not at all."""
        with scratch_folder() as folder, style():
            draft = folder / "draft.gif"
            self.animation.save(draft, writer=PillowWriter(fps=FRAMES_A_SECOND), dpi=DPI)
            return write_file(path, read_file(draft))


def turning_points(trial: Trial) -> dict[str, Iterable[int]]:
    """Return the actions of a trial's first, middle and last episode, by title."""
    iterations = (0, trial.iterations // 2, trial.iterations)
    return {f"iteration {i}": trial.episodes[i].actions.tolist() for i in iterations}


def film(
    environment: Environment, episodes: Mapping[str, Iterable[int]], *, decisions: int = 40
) -> Film:
    """Show episodes, actions by title, side by side, with a frame for each of so many decisions.

    An episode that is over keeps its last frame, and so does the whole for a second.
    """
    field = as_soccer(environment)
    tables = {title: replay(field, actions) for title, actions in episodes.items()}
    ends = {title: _end(table, decisions) for title, table in tables.items()}
    with style():
        size = min(WIDTH / len(tables), 4.0)
        figure = Figure(figsize=(WIDTH, size * 0.87 + 0.68), dpi=DPI, layout="constrained")
        FigureCanvasAgg(figure)
        panels = np.atleast_1d(figure.subplots(1, len(tables)))
        movers, trails = [], []
        for panel in panels:
            draw_pitch(panel)
            panel.set(xticks=[], yticks=[])
            trails += panel.plot([], [], color=PINK, marker="o", ms=2, lw=1.2, zorder=3)
            movers.append(Movers(panel))

        def draw(frame: int) -> list[Any]:
            for panel, mover, trail, title in zip(panels, movers, trails, tables, strict=True):
                table = tables[title]
                last = min(len(table) - 1, decisions)
                now = min(frame, last)
                row = table.iloc[now]
                obstacles = [row[names].to_numpy(float) for names in obstacle_columns("x", "y")]
                mover.place(row[["x", "y", "heading"]], row[["ball_x", "ball_y"]], obstacles)
                trail.set_data(table["x"][: now + 1], table["y"][: now + 1])
                status = ends[title] if now == last else f"{row['time']:.1f} s, decision {now}"
                panel.set_title(f"{title}\n{status}", loc="left", fontsize=8.5)
            return []

        draw(0)
        handles = [
            Line2D([], [], color=BLUE, marker="s", ms=6, lw=0, label="controlled robot"),
            Line2D([], [], color=PINK, marker="o", ms=2, label="its way, a dot a decision"),
            Line2D([], [], color=YELLOW, marker="s", ms=6, mec="0.2", lw=0, label="obstacle"),
            Line2D([], [], color="white", marker="o", ms=5, mec="black", lw=0, label="ball"),
        ]
        legend_below(figure, handles)
        figure.draw_without_rendering()
        figure.set_layout_engine("none")
        longest = min(max(map(len, tables.values())) - 1, decisions)
        frames = [*range(longest), *[longest] * LAST_FRAMES]
        pause = 1000 // FRAMES_A_SECOND
        animation = FuncAnimation(
            figure, draw, frames=frames, interval=pause, cache_frame_data=False
        )
    numbers = pd.concat(tables, names=["episode", None]).reset_index("episode")
    words = "; ".join(f"{title}: {end}" for title, end in ends.items())
    words = f"The robot's way in some episodes, moving. {words}"
    return Film(figure, animation, numbers, words)


def _end(table: pd.DataFrame, decisions: int) -> str:
    """Return how an episode ends, if at most so many decisions of it are shown."""
    taken, last = len(table) - 1, table.iloc[-1]
    if taken > decisions:
        return f"cut after {decisions} decisions"
    if last["outcome"] == "open":
        return f"ends after {taken} decisions"
    return f"{last['outcome']}: {last['time']:.1f} s, {taken} decisions"
