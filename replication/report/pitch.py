"""The soccer field as all pictures of it show it: walls, gate, paths, and what moves.

Axes are in metres and to scale.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.patches import Circle, Polygon
from numpy.typing import ArrayLike, NDArray

from replication.envs.soccer import rules
from replication.report.style import CORRECT_COLOUR

Floats = NDArray[np.float64]

# Okabe and Ito's colours where the mazes have none; the paper's correct demonstration is pink.
PINK, ORANGE, BLUE, YELLOW, VERMILION = "#CC79A7", "#E69F00", "#0072B2", "#F0E442", "#D55E00"

GATE_DEPTH = 0.06  # of the drawing only: in metres
EDGE: dict[str, Any] = {"ec": "0.2", "lw": 0.6}
BODY = ((-0.5, -0.5), (0.5, -0.5), (0.5, 0.5), (-0.5, 0.5))
NOSE = ((0.5, 0.0), (-0.35, -0.27), (-0.35, 0.27))  # a triangle that points ahead
STRIPE = ((-0.5, -0.16), (0.5, -0.16), (0.5, 0.16), (-0.5, 0.16))


def draw_pitch(panel: Axes, *, small: bool = True) -> None:
    """Draw walls, gate and the obstacles' paths, and set up the axes."""
    width, head, parts = (0.6, 6, 2) if small else (1.0, 10, 7)
    thick = 2 * rules.WALL_RADIUS
    low, high = rules.GATE
    gate = [(rules.WIDTH, low), (rules.WIDTH + GATE_DEPTH, low)]
    gate += [(rules.WIDTH + GATE_DEPTH, high), (rules.WIDTH, high)]
    panel.add_patch(Polygon(outline(thick), fc="0.45", lw=0, zorder=0))
    panel.add_patch(Polygon(outline(), fc="white", lw=0, zorder=0.1))
    panel.add_patch(Polygon(gate, fc="#D9EAD3", ec="#2E7D32", lw=0.8, hatch="xxxx", zorder=0.2))
    for path in rules.PATHS:
        arrow = {"arrowstyle": "<|-|>", "ls": "--", "color": "#6C8EBF", "lw": width}
        arrow |= {"shrinkA": 0, "shrinkB": 0, "mutation_scale": head}
        panel.annotate("", path.end, path.start, arrowprops=arrow, zorder=1)
    margin = thick + 0.01
    panel.set(
        xlim=(-margin, rules.WIDTH + GATE_DEPTH + 0.01),
        ylim=(-margin, rules.HEIGHT + margin),
        aspect="equal",
        anchor="N",  # else the layout, which knows nothing of the aspect, may cut a title
        xticks=np.linspace(0, rules.WIDTH, parts + 1),
        yticks=np.linspace(0, rules.HEIGHT, max(2, parts - 1) + 1),
    )
    panel.spines[:].set_visible(False)
    panel.tick_params(length=2)


def outline(grow: float = 0.0) -> Floats:
    """Return the corners of the field, or of what is further out by `grow`."""
    cut = rules.CORNER + grow * (2 - np.sqrt(2))
    low, right, top = -grow, rules.WIDTH + grow, rules.HEIGHT + grow
    lower = [(low, low + cut), (low + cut, low), (right - cut, low), (right, low + cut)]
    upper = [(right, top - cut), (right - cut, top), (low + cut, top), (low, top - cut)]
    return np.array(lower + upper)


def placed(pose: Iterable[float], shape: ArrayLike) -> Floats:
    """Turn and move a shape, given in sides of a robot, to a pose."""
    x, y, heading = pose
    turn = np.array([[np.cos(heading), np.sin(heading)], [-np.sin(heading), np.cos(heading)]])
    return np.asarray(shape) * rules.ROBOT_SIDE @ turn + (x, y)


class Movers:
    """All that moves, in one panel."""

    def __init__(self, panel: Axes, *, obstacles: bool = True) -> None:
        def patch(colour: str, **style: Any) -> Polygon:
            shape = Polygon(((0, 0),), fc=colour, **{"zorder": 4, "lw": 0} | style)
            panel.add_patch(shape)
            return shape

        n_obstacles = len(rules.PATHS) if obstacles else 0
        self.obstacles = [
            (patch(YELLOW, **EDGE), patch(CORRECT_COLOUR)) for _ in range(n_obstacles)
        ]
        self.robot = patch(BLUE, **EDGE, zorder=5), patch(CORRECT_COLOUR, zorder=5)
        self.ball = Circle((0, 0), rules.BALL_RADIUS, fc="white", ec="black", lw=0.9, zorder=5)
        panel.add_patch(self.ball)

    def place(
        self, pose: Iterable[float], ball: Iterable[float], obstacles: Sequence[Floats] = ()
    ) -> None:
        """Put everything in its place."""
        for patch, shape in zip(self.robot, (BODY, NOSE), strict=True):
            patch.set_xy(placed(pose, shape))
        x, y = ball
        self.ball.set_center((float(x), float(y)))
        for patches, (x, y) in zip(self.obstacles, obstacles, strict=False):
            for patch, shape in zip(patches, (BODY, STRIPE), strict=True):
                patch.set_xy(placed((x, y, 0.0), shape))


def obstacle_columns(*names: str) -> list[list[str]]:
    """Return the names of each obstacle's columns in a replay."""
    return [[f"obstacle_{n}_{name}" for name in names] for n in range(1, len(rules.PATHS) + 1)]
