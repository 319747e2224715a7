"""Where players let things happen: a maze or the soccer field as SVG, from above, y going down."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from replication.demos.model import Demos
from replication.envs.maze import as_maze
from replication.envs.soccer import rules
from replication.envs.soccer.field import SoccerField
from replication.envs.soccer.replay import replay
from replication.report.moving import path
from replication.report.pitch import GATE_DEPTH, outline

SIDE = 10
"""Of a cell of a maze, in units of the drawing."""

METRE = 500
"""Of the soccer field, in the same."""

EXPERT = '<path class="expert" stroke-width="7" d="M-9 0H9"/>'
"""The expert's way, for a key that is 24 units wide."""

Points = list[tuple[int, int]]
Ints = NDArray[np.int64]
Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Stage:
    """What stands still, and where on it something is.

    Attributes
    ----------
    view
        Left, top, width and height of the drawing.
    still
        What stands still, as SVG: walls, and the way of the first correct demonstration.
    marks
        How rewards are drawn, see :func:`replication.report.moving.player_page`.
    close
        What is seen of one mark from close to, as `view`.
    steps
        What the agent's steps are called.
    points
        Returns where a trajectory, given as states and actions, leads.
    weights
        Returns the weights of what is marked, [iteration, place], given all of them.
    """

    view: str
    still: str
    marks: dict[str, Any]
    close: str
    steps: str
    points: Callable[[Ints, Ints], Points]
    weights: Callable[[Floats], Floats]


def stage(demos: Demos) -> Stage:
    """Return where demonstrations take place."""
    return (_field if isinstance(demos.environment, SoccerField) else _maze)(demos)


def metres(places: ArrayLike) -> Points:
    """Return places on the soccer field, x and y in metres, as points of the drawing."""
    x, y = np.asarray(places, dtype=float).T
    return _points(METRE * x, METRE * (rules.HEIGHT - y))


def _points(x: Floats, y: Floats) -> Points:
    across, down = (np.rint(each).astype(int).tolist() for each in (x, y))
    return list(zip(across, down, strict=True))


def _maze(demos: Demos) -> Stage:
    """Draw a maze; each move is rewarded at its side of the cell."""
    maze = as_maze(demos.environment)
    n_rows, n_columns = maze.shape
    width, height = SIDE * n_columns, SIDE * n_rows

    def points(states: Ints, actions: Ints) -> Points:
        rows, columns = np.divmod(states, n_columns)
        return _points(SIDE * (columns + 0.5), SIDE * (rows + 0.5))

    def square(state: int, look: str) -> str:
        row, column = divmod(state, n_columns)
        place = f'x="{SIDE * column}" y="{SIDE * row}"'
        return f'<rect {place} width="{SIDE}" height="{SIDE}" {look}/>'

    lines = [f"M{SIDE * i} 0V{height}" for i in range(1, n_columns)]
    lines += [f"M0 {SIDE * i}H{width}" for i in range(1, n_rows)]
    still = [f'<path class="grid" d="{"".join(lines)}"/>']
    still += [square(state, 'class="block"') for state in np.flatnonzero(~maze.free).tolist()]
    way = points(demos.correct[0].states, demos.correct[0].actions)
    still.append(f'<path class="expert" stroke-width="7" d="{path(way)}"/>')
    for state, letter in ((maze.start, "S"), (maze.goal, "G")):
        ((x, y),) = points(np.array([state]), np.array([]))
        still.append(square(state, 'fill="#e69f00" fill-opacity=".45"'))
        still.append(f'<text x="{x}" y="{y}">{letter}</text>')
    still.append(f'<rect class="edge" width="{width}" height="{height}"/>')
    marks = {
        "columns": n_columns,
        "size": [SIDE, SIDE],
        "turns": [-90, 90, 0, 180],  # of the actions up, down, right, left
        "shapes": [
            "M1.2-2.9L4.7 0 1.2 2.9z",
            "M3-3.7h1.7v7.4h-1.7z",
            "M3 0a.85.85 0 1 0 1.7 0a.85.85 0 1 0-1.7 0",
        ],
    }
    return Stage(
        view=f"-1 -1 {width + 2} {height + 2}",
        still="".join(still),
        marks=marks,
        close="-3.4 -4.4 12.8 8.8",
        steps="moves",
        points=points,
        weights=lambda weights: weights.reshape(len(weights), -1),
    )


def _field(demos: Demos) -> Stage:
    """Draw the soccer field; a cell shows its weight of greatest size, as actions have no side."""
    field = demos.environment
    assert isinstance(field, SoccerField)

    def points(states: Ints, actions: Ints) -> Points:
        return metres(replay(field, actions.tolist())[["x", "y"]])

    def weights(every: Floats) -> Floats:
        cells = every.reshape(len(every), rules.COLUMNS, rules.ROWS, -1)
        greatest = np.abs(cells).argmax(axis=3)[..., None]
        shown = np.take_along_axis(cells, greatest, axis=3)[..., 0]
        return shown.transpose(0, 2, 1)[:, ::-1].reshape(len(every), -1)

    right, depth = METRE * rules.WIDTH, METRE * GATE_DEPTH
    high, low = (METRE * (rules.HEIGHT - y) for y in rules.GATE[::-1])
    edges = [f"{path(metres(outline(grow)))}z" for grow in (2 * rules.WALL_RADIUS, 0)]
    still = [f'<path class="block" fill-rule="evenodd" d="{"".join(edges)}"/>']
    gate = f"M{right:g} {high:g}h{depth:g}V{low:g}h-{depth:g}z"
    still.append(f'<path fill="#009e73" fill-opacity=".3" d="{gate}"/>')
    for lane in rules.PATHS:
        ends = path(metres([lane.start, lane.end]))
        still.append(f'<path class="edge" stroke-dasharray="4 4" d="{ends}"/>')
    way = points(demos.correct[0].states, demos.correct[0].actions)
    still.append(f'<path class="expert" stroke-width="30" d="{path(way)}"/>')
    marks = {
        "columns": rules.COLUMNS,
        "size": [METRE * rules.WIDTH / rules.COLUMNS, METRE * rules.HEIGHT / rules.ROWS],
        "turns": [0],
        "shapes": [
            "M-19-22h38v44h-38z",
            "M-17-6h34v12h-34z",
            "M-4 0a4 4 0 1 0 8 0a4 4 0 1 0-8 0",
        ],
    }
    return Stage(
        view="-12 -12 744 624",
        still="".join(still),
        marks=marks,
        close="-40 -27.5 80 55",
        steps="decisions",
        points=points,
        weights=weights,
    )
