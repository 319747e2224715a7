from __future__ import annotations

from dataclasses import replace

import pytest
from matplotlib.figure import Figure

from replication import Demos, Maze, demonstrate
from replication.envs.maze import MazeError, as_maze
from replication.report.maze import (
    demonstrations,
    draw_demonstrations,
    draw_map,
    map_numbers,
    ticks,
)
from tests.report.legible import assert_legible


def test_map_by_hand(small_demos: Demos) -> None:
    """A map's rows are its corner, start, goal and obstacles; x goes right and y goes up."""
    rows = map_numbers(as_maze(small_demos.environment))[["kind", "x", "y"]]
    cells = [("corner", 6, 5), ("start", 1, 1), ("goal", 5, 4), ("obstacle", 3, 3)]
    assert list(rows.itertuples(index=False, name=None)) == cells


def test_every_visit_has_a_row(small_demos: Demos) -> None:
    """Every state of every demonstration is there once, beside the map, from the start on."""
    demos = (*small_demos.correct, *small_demos.incorrect)
    numbers = demonstrations(small_demos).numbers
    shown = numbers[numbers["part"] != "map"]
    assert len(shown) == sum(len(demo.states) for demo in demos)
    assert shown["demo"].unique().tolist() == [demo.name for demo in demos]
    first = shown.iloc[0][["part", "kind", "step", "x", "y"]]
    assert first.tolist() == ["correct", "correct", 0, 1, 1]


def test_words_count_the_demonstrations(small_demos: Demos) -> None:
    """The words give the moves of the correct demonstration, and the incorrect ones by kind."""
    hits = small_demos.select("hit")
    words = demonstrations(hits).words
    assert f"{len(small_demos.correct[0].actions)} moves" in words
    assert f"{len(hits.incorrect)} hit" in words


def test_words_tell_correct_demonstrations_apart() -> None:
    """Several correct demonstrations are counted, with the moves of each."""
    demos = demonstrate("two", Maze.from_text("...G\nS..."))
    again = replace(demos.correct[0], name="again")
    two = Demos(demos.task, demos.environment, (demos.correct[0], again), ())
    assert "2 correct demonstrations of 4 moves" in demonstrations(two).words


def test_both_panels_show_the_same_map(stored_demos: Demos) -> None:
    """Ticks end with the grid, the legend counts each kind, and all texts are legible."""
    picture = demonstrations(stored_demos)
    figure = draw_demonstrations(picture.numbers)
    for panel in figure.axes:
        assert panel.get_xticks().tolist() == panel.get_yticks().tolist() == [0, 5, 10, 15, 19]
    (legend,) = figure.legends
    kinds = [demo.kind for demo in (*stored_demos.correct, *stored_demos.incorrect)]
    expected = [f"{kind} ({kinds.count(kind)})" for kind in dict.fromkeys(kinds)]
    assert [text.get_text() for text in legend.get_texts()] == expected
    figure.draw_without_rendering()  # which applies the aspect
    assert_legible(figure)


def test_letters_stand_beside_cells_where_no_way_is(stored_demos: Demos) -> None:
    """S and G are beside the start's and the goal's cell, in none that a demonstration visits."""
    picture = demonstrations(stored_demos)
    shown = picture.numbers[picture.numbers["part"] != "map"]
    visited = set(zip(shown["x"], shown["y"], strict=True))
    own = map_numbers(as_maze(stored_demos.environment)).set_index("kind")[["x", "y"]]
    for panel in draw_demonstrations(picture.numbers).axes:
        for text, kind in zip(panel.texts, ("start", "goal"), strict=True):
            x, y = (round(value) for value in text.get_position())
            assert max(abs(x - own.loc[kind, "x"]), abs(y - own.loc[kind, "y"])) == 1
            assert text.get_text() == kind[0].upper()
            assert (x, y) not in visited


def test_letters_find_a_place_where_ways_are_everywhere() -> None:
    """With no cell free of ways, a letter stands beside its cell all the same."""
    numbers = map_numbers(as_maze(Maze.from_text("S#\nG.")))
    panel = Figure().subplots()
    draw_map(panel, numbers, avoid={(x, y) for x in range(2) for y in range(2)})
    assert [text.get_text() for text in panel.texts] == ["S", "G"]


@pytest.mark.parametrize(
    ("count", "expected"),
    [(1, [0]), (7, [0, 1, 2, 3, 4, 5, 6]), (17, [0, 5, 10, 16]), (20, [0, 5, 10, 15, 19])],
)
def test_ticks_end_with_the_grid(count: int, expected: list[int]) -> None:
    """The last tick is at the last cell, and none is too near to it."""
    assert ticks(count) == expected


def test_a_wide_map_leaves_no_empty_space() -> None:
    """The figure is as high as its maps need."""
    wide = demonstrate("wide", Maze.from_text("S" + "." * 30 + "G\n" + "." * 32 + "\n" + "." * 32))
    square = demonstrate("square", Maze.from_text("S..\n...\n..G"))
    heights = [
        picture.draw(picture.numbers).get_size_inches()[1]
        for picture in map(demonstrations, (wide, square))
    ]
    assert heights[0] < heights[1] / 1.5


def test_soccer_is_refused(soccer_demos: Demos) -> None:
    """What is no maze is refused in a line."""
    with pytest.raises(MazeError, match="a maze is needed"):
        demonstrations(soccer_demos)
