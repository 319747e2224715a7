from __future__ import annotations

import itertools

import numpy as np
import pandas as pd
import pytest
from matplotlib.colors import to_rgba
from matplotlib.figure import Figure

from replication.report.ways import COLOURS, HEADS, draw_demos, kind_colours, lanes

Cell = tuple[int, int]
PATH: list[Cell] = [(0, 0), (1, 0), (2, 0), (3, 0), (4, 0)]


def rows(part: str, kind: str, demo: str, cells: list[Cell]) -> pd.DataFrame:
    """Return the rows of a demonstration."""
    x, y = np.array(cells).T
    return pd.DataFrame({"part": part, "kind": kind, "demo": demo, "x": x, "y": y})


def drawn(*demos: tuple[str, list[Cell]]) -> Figure:
    """Draw incorrect demonstrations beside the path, on a map of 20 x 20 cells."""
    parts = [rows("incorrect", kind, f"{n}", cells) for n, (kind, cells) in enumerate(demos)]
    figure = Figure(figsize=(3, 3))
    panel = figure.subplots()
    panel.set(xlim=(-0.5, 19.5), ylim=(-0.5, 19.5))
    draw_demos(panel, pd.concat([rows("correct", "correct", "c", PATH), *parts]))
    return figure


def lines(figure: Figure) -> list[np.ndarray]:
    """Return the places of each line that is no single mark."""
    every = (np.asarray(line.get_xydata()) for line in figure.axes[0].lines)
    return [places for places in every if len(places) > 1]


def test_lanes_by_hand() -> None:
    """A way takes the first lane in which it meets no way before it."""
    assert lanes(["ab", "bc", "cd", "abc", "e", "ae"], lambda a, b: bool({*a} & {*b})) == [
        *(0, 1, 0, -1, 0, 1),
    ]
    assert lanes([], lambda a, b: True) == []


def test_ways_that_are_the_same_lie_beside_each_other() -> None:
    """No two demonstrations have a point of a leg in common, and none runs on the correct path."""
    back = PATH[::-1]
    wide: list[Cell] = [(0, 0), (0, 1), (0, 2), (1, 2), (2, 2), (2, 1), (2, 0)]
    one, two, three = lines(drawn(("detour", wide), ("detour", wide), ("opposite", back)))
    middles = [way[1:-1] for way in (one, two)]
    assert not {map(tuple, middles[0])} & {map(tuple, middles[1])}
    np.testing.assert_allclose(
        middles[0] - middles[1], (middles[0] - middles[1])[:1].repeat(len(wide), 0)
    )
    assert np.abs(middles[0] - middles[1]).min() > 0.1
    assert np.abs(three[1:-1, 1]).min() > 0.1


def test_a_way_is_drawn_where_it_differs() -> None:
    """It starts and ends on the correct path, and what it shares with that is left out."""
    wide: list[Cell] = [(0, 0), (1, 0), (1, 1), (2, 1), (3, 1), (3, 0), (4, 0)]
    (way,) = lines(drawn(("detour", wide)))
    np.testing.assert_allclose(way, [(1, 0), (1, 0), (1, 1), (2, 1), (3, 1), (3, 0), (3, 0)])


def test_who_bumps_has_a_cross_and_no_way_back() -> None:
    """A cross stands where a move leads nowhere, also at a corner of the correct path."""
    figure = drawn(("hit", [(0, 0), (1, 0), (1, 1), (1, 2), (1, 2)]), ("hit", [(0, 0), (0, 0)]))
    crosses = [line for line in figure.axes[0].lines if line.get_marker() == "x"]
    assert [np.ravel(line.get_xydata()).tolist() for line in crosses] == [[1, 2], [0, 0]]


@pytest.mark.parametrize("direction", list(HEADS))
def test_heads_point_ahead(direction: Cell) -> None:
    """The head in the middle of a leg points where the leg leads."""
    x, y = direction
    figure = drawn(("detour", [(10 + x * n, 10 + y * n) for n in range(5)]))
    (head,) = (line for line in figure.axes[0].lines if line.get_marker() in HEADS.values())
    assert head.get_marker() == HEADS[direction]
    assert np.ravel(head.get_xydata()).tolist() == [10 + 2 * x, 10 + 2 * y]


def test_many_ways_fade_and_stay_within_their_cells() -> None:
    """Of a hundred demonstrations none is hidden, and none leaves its cells."""
    wide: list[Cell] = [(0, 0), (0, 1), (0, 2), (1, 2), (1, 1), (1, 0)]
    figure = drawn(*[("detour", wide)] * 100)
    ways = lines(figure)
    assert len({tuple(way.ravel()) for way in ways}) == 100
    assert all(np.abs(way[1:-1] - wide).max() < 0.5 for way in ways)
    assert {line.get_alpha() for line in figure.axes[0].lines} == {0.5}
    assert {line.get_alpha() for line in drawn(("detour", wide)).axes[0].lines} == {1.0}


def test_own_kinds_have_colours_of_their_own() -> None:
    """Kinds that we do not know differ from ours and from each other."""
    colours = kind_colours(["hit", "mine", "yours", "mine"])
    assert colours.items() >= COLOURS.items()
    for one, other in itertools.combinations(colours.values(), 2):
        assert np.abs(np.subtract(to_rgba(one), to_rgba(other))).max() > 0.1
