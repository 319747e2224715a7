"""Ways over the cells of a maze, in lanes as on the map of a metro, so that none hides another."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Collection, Iterable, Sequence
from typing import Any, TypeVar

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.lines import Line2D
from numpy.typing import NDArray

from replication.report.style import CORRECT_COLOUR, KIND_COLOURS, OTHER_KIND_COLOUR

Way = TypeVar("Way")
Cell = tuple[int, int]
Move = tuple[Cell, Cell]

PANEL = 210  # points along the longer side of a map
LANE = 3.8  # points between neighbouring lanes, if cells have room for that
MANY = 20  # from so many demonstrations on they fade
COLOURS = KIND_COLOURS | {"opposite": OTHER_KIND_COLOUR}
SPARE_COLOURS = ("#E69F00", "#CC79A7", "#000000", "#7A5195")
HEADS = {(1, 0): ">", (-1, 0): "<", (0, 1): "^", (0, -1): "v"}


def lanes(ways: Sequence[Way], meet: Callable[[Way, Way], bool]) -> list[int]:
    """Return a lane for each way: the first of 0, 1, -1, 2, ... where it meets no earlier way."""
    chosen: list[int] = []
    for way in ways:
        taken = {lane for other, lane in zip(ways, chosen, strict=False) if meet(way, other)}
        numbers = itertools.chain([0], (side * n for n in itertools.count(1) for side in (1, -1)))
        chosen.append(next(lane for lane in numbers if lane not in taken))
    return chosen


def draw_demos(panel: Axes, numbers: pd.DataFrame) -> list[Line2D]:
    """Draw demonstrations, each in a lane of its own where they share a way.

    An incorrect one is drawn where it does what no correct one does, with a cross where it bumps.
    Returned are the entries of the legend.
    """
    correct, incorrect = (
        [(kind, _cells(demo)) for (kind, _), demo in rows.groupby(["kind", "demo"], sort=False)]
        for rows in (numbers[numbers["part"] == "correct"], numbers[numbers["part"] == "incorrect"])
    )
    right = {move for _, cells in correct for move in itertools.pairwise(cells)}
    stretches = [_departures(cells, right) for _, cells in incorrect]
    ways = [[cells] for _, cells in correct] + stretches
    chosen = lanes([_edges(way) for way in ways], lambda one, other: bool(one & other))
    cells = np.ptp([panel.get_xlim(), panel.get_ylim()], axis=1).max()
    fine = min(1.0, 20 / cells)
    apart = min(LANE * cells / PANEL, 0.42 / max(1, *map(abs, chosen)))
    shifts = [(lane * apart, -lane * apart) for lane in chosen]
    for (_, cells), shift in zip(correct, shifts, strict=False):
        _draw_arrows(panel, np.add(cells, shift), fine)
    style: dict[str, Any] = {"alpha": min(1.0, max(0.5, MANY / max(len(incorrect), 1)))}
    on_path = {cell for move in right for cell in move}
    colours = kind_colours([str(kind) for kind, _ in incorrect])
    for (kind, _), stretch, shift in zip(incorrect, stretches, shifts[len(correct) :], strict=True):
        for way in stretch:
            _draw_way(panel, way, shift, on_path, fine, color=colours[str(kind)], **style)
    return _handles(len(correct), [str(kind) for kind, _ in incorrect])


def kind_colours(kinds: Iterable[str]) -> dict[str, str]:
    """Return a colour for each kind of mistake, the user's own kinds included."""
    own = (kind for kind in dict.fromkeys(kinds) if kind not in COLOURS)
    return COLOURS | dict(zip(own, itertools.cycle(SPARE_COLOURS), strict=False))


def _handles(n_correct: int, kinds: list[str]) -> list[Line2D]:
    label = f"correct ({n_correct})"
    handles = [Line2D([], [], color=CORRECT_COLOUR, marker=">", ms=4, label=label)]
    for kind in dict.fromkeys(kinds):
        head: dict[str, Any] = {"marker": ">", "ms": 3}
        style = {"marker": "x", "ms": 5, "mew": 1.5} if kind == "hit" else head
        colour = kind_colours(kinds)[kind]
        label = f"{kind} ({kinds.count(kind)})"
        handles.append(Line2D([], [], color=colour, label=label, **style))
    return handles


def _cells(demo: pd.DataFrame) -> list[Cell]:
    return list(zip(demo["x"].tolist(), demo["y"].tolist(), strict=True))


def _departures(cells: list[Cell], right: Collection[Move]) -> list[list[Cell]]:
    """Return the stretches of a way, each as its cells, but for what right ones have, too."""
    moves = list(itertools.pairwise(cells))
    parts = itertools.groupby(moves, key=lambda move: move in right)
    found = [list(part) for known, part in parts if not known]
    return [[part[0][0], *(end for _, end in part)] for part in found]


def _edges(stretches: Iterable[list[Cell]]) -> set[frozenset[Cell]]:
    """Return the pairs of neighbouring cells that a way connects; a single cell where it bumps."""
    return {frozenset(move) for cells in stretches for move in itertools.pairwise(cells)}


def _draw_arrows(panel: Axes, way: NDArray[np.float64], fine: float) -> None:
    """Draw a correct demonstration as arrows."""
    style: dict[str, Any] = {"angles": "xy", "scale_units": "xy", "scale": 1}
    style |= {"width": 0.007 * fine, "headwidth": 4, "headlength": 5, "headaxislength": 4.5}
    panel.quiver(*way[:-1].T, *np.diff(way, axis=0).T, color=CORRECT_COLOUR, zorder=5, **style)


def _draw_way(
    panel: Axes,
    cells: list[Cell],
    shift: tuple[float, float],
    on_path: Collection[Cell],
    fine: float,
    **style: Any,
) -> None:
    """Draw a stretch in its lane, from the correct path on; a head in the middle of each leg."""
    bumps = cells[-1] == cells[-2]
    way = np.add(cells, shift)
    begin = [cells[0]] if cells[0] in on_path else []
    end = [cells[-1]] if cells[-1] in on_path and not bumps else []
    line = np.array([*begin, *way, *end], dtype=float)
    panel.plot(*line.T, lw=1.2 * fine, solid_capstyle="round", zorder=3, **style)
    for start, steps, direction in _legs(cells):
        if steps > 1:
            middle = way[start] + np.array(direction) * steps / 2
            head: dict[str, Any] = {
                "marker": HEADS[direction],
                "ms": 4.2 * fine,
                "mew": 0,
                "zorder": 3.5,
            }
            panel.plot(*middle, **style, **head)
    if bumps:
        panel.plot(*way[-1], "x", ms=5 * fine, mew=1.5 * fine, zorder=6, **style)


def _legs(cells: list[Cell]) -> list[tuple[int, int, Cell]]:
    """Return where each straight leg starts, how many moves it has, and its direction."""
    directions = [(c - a, d - b) for (a, b), (c, d) in itertools.pairwise(cells)]
    legs, start = [], 0
    for direction, moves in itertools.groupby(directions):
        steps = len(list(moves))
        if direction in HEADS:
            legs.append((start, steps, direction))
        start += steps
    return legs
