from __future__ import annotations

from pathlib import Path

import matplotlib as mpl
import numpy as np
import pandas as pd
import pytest
from matplotlib.figure import Figure

from replication import Demos, Params, fit
from replication.envs.maze import as_maze
from replication.report.figures import (
    Counts,
    Curves,
    error_figure,
    fit_figure,
    iterations_figure,
    maze_figure,
    sets_figure,
    surfaces_figure,
)
from replication.report.style import save_figure

CURVES = [
    Curves(
        "Unified, without incorrect",
        "#0072B2",
        np.array([[3.0, 1.0, 0.0, 0.0], [2.0, 2.0, 1.0, 0.0]]),
        published=9,
    ),
    Curves(
        "Unified, with incorrect", "#D55E00", np.array([[3.0, 1.0, 1.0, 0.0], [2.0, 2.0, 0.0, 0.0]])
    ),
]
COUNTS = [
    Counts("Unified, without incorrect", "#0072B2", np.array([40, 41, 44]), published=42.0),
    Counts("Unified, with incorrect", "#D55E00", np.array([30, 35, 34])),
]
SAVED = pd.DataFrame(
    {
        "set": ["hit", "opposite"],
        "leaving": [7, 30],
        "saved": [0.1, 4.0],
        "low": [-1, 3],
        "high": [1, 5],
    }
)


@pytest.fixture(scope="module")
def drawings(small_demos: Demos) -> dict[str, Figure]:
    """Draw each kind of figure once."""
    maze = as_maze(small_demos.environment)
    result = fit(small_demos, params=Params.of(incorrect="all", episodes=200, horizon=50), seed=1)
    return {
        "maze": maze_figure(small_demos),
        "errors": error_figure({"left": CURVES, "right": CURVES}),
        "errors without the paper's": error_figure({"left": CURVES[1:] * 2}),
        "iterations": iterations_figure({"top": COUNTS, "bottom": COUNTS}),
        "surfaces": surfaces_figure(maze, {"Q": np.arange(42.0), "w": np.ones(42)}),
        "sets": sets_figure({"left": SAVED, "right": SAVED}),
        "fit": fit_figure(result),
    }


KINDS = ["maze", "errors", "errors without the paper's", "iterations", "surfaces", "sets", "fit"]


@pytest.mark.parametrize("kind", KINDS)
def test_equal_numbers_give_equal_bytes(
    kind: str, drawings: dict[str, Figure], tmp_path: Path
) -> None:
    """Saving twice gives the same PNG and SVG, without a time or a version in them."""
    once = [path.read_bytes() for path in save_figure(drawings[kind], tmp_path / "a")]
    twice = [path.read_bytes() for path in save_figure(drawings[kind], tmp_path / "b")]
    assert once == twice
    assert b"Matplotlib" not in once[0]
    assert b"dc:date" not in once[1]


@pytest.mark.parametrize("kind", KINDS)
def test_nothing_is_cut_off(kind: str, drawings: dict[str, Figure]) -> None:
    """All that is drawn, texts included, lies within the figure."""
    figure = drawings[kind]
    box = figure.get_tightbbox(figure.canvas.get_renderer())  # type: ignore[attr-defined]
    width, height = figure.get_size_inches()
    assert min(box.x0, box.y0) > -0.01
    assert box.x1 < width + 0.01
    assert box.y1 < height + 0.01


def test_traced_trial_ends_where_it_reaches_zero(drawings: dict[str, Figure]) -> None:
    """The line of Fig. 5 stops at the first zero, and the paper's mark stands at its iteration."""
    panel = drawings["errors"].axes[0]
    lines = [np.asarray(line.get_xydata()) for line in panel.lines]
    assert any(np.array_equal(line, [[0, 3], [1, 1], [2, 0]]) for line in lines)
    assert any((line == [[9, 0]]).all() for line in lines if line.shape == (1, 2))


def test_no_sets_are_a_figure_too() -> None:
    """A file without incorrect demonstrations gives an empty panel that says so, not a crash."""
    (panel,) = sets_figure({}).axes
    assert panel.get_title() == "no incorrect demonstrations"


def test_iterations_are_drawn_as_given(drawings: dict[str, Figure]) -> None:
    """Fig. 6 shows every trial's count, unsmoothed, and the mean beside it."""
    left, right = drawings["iterations"].axes[:2]
    np.testing.assert_array_equal(left.lines[0].get_ydata(), [40, 41, 44])
    assert any(np.allclose(line.get_ydata(), 125 / 3) for line in right.lines)


def test_caller_style_does_not_matter(small_demos: Demos, tmp_path: Path) -> None:
    """A user's own matplotlib conditions do not change a figure."""
    (before, _) = save_figure(maze_figure(small_demos), tmp_path / "before")
    with mpl.rc_context({"font.size": 20, "axes.facecolor": "black", "savefig.dpi": 30}):
        (after, _) = save_figure(maze_figure(small_demos), tmp_path / "after")
    assert before.read_bytes() == after.read_bytes()
