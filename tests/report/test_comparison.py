from __future__ import annotations

import numpy as np
import pytest

from replication.evidence.comparison import conditions
from replication.evidence.experiments import GENERAL, NONE
from replication.report.comparison import (
    KEY,
    comparison,
    grouped,
    readable_comparison,
    short_label,
)
from tests.evidence.test_comparison import TABLE
from tests.report.legible import assert_legible


def test_random_mazes_are_averaged() -> None:
    """Three mazes become one row: the mean, and the interval of a mean of independent ones."""
    numbers = grouped(TABLE)
    own = TABLE[
        TABLE["task"].str.startswith("random")
        & (TABLE["method"] == "perceptron")
        & (TABLE["solver"] == "planning")
    ]
    rows = numbers[(numbers["task"] == "random") & (numbers["solver"] == "planning")]
    (found,) = rows[rows["method"] == "perceptron"].itertuples()
    assert found.iterations == pytest.approx(own["iterations"].mean())
    half = (own["iterations_high"] - own["iterations_low"]) / 2
    assert found.iterations_half == pytest.approx(np.sqrt((half**2).sum()) / 3)
    assert set(numbers["set"]) == {NONE, GENERAL}


def test_each_row_has_its_name() -> None:
    """No two rows of the figure are called alike."""
    keys = dict.fromkeys((s.method, s.reading, s.set) for s in conditions() if s.set != "all")
    labels = [short_label(*key) for key in keys]
    assert len(set(labels)) == len(labels)
    assert short_label("unified-incorrect", "updated", GENERAL) == "Unified + incorrect, Fᵢ₊₁"


def test_the_figure_is_legible() -> None:
    """No text overlaps another, and each method has its row."""
    picture = comparison(TABLE)
    figure = picture.draw(picture.numbers)
    assert_legible(figure)
    assert len(figure.axes[0].get_yticks()) == len(picture.numbers.groupby(KEY))
    assert "Perceptron" in picture.words


def test_the_table_has_a_row_for_each_method() -> None:
    """Its cells are the numbers of the figure; d is 0 only if every trial reached it."""
    table = readable_comparison(TABLE)
    assert len(table) == len(grouped(TABLE).groupby(KEY))
    cells = table.set_index("Method")
    numbers = grouped(TABLE)
    rows = numbers[(numbers["method"] == "unified") & (numbers["reading"] == "updated")]
    rows = rows.set_index(["solver", "task"])
    planned = rows.loc[("planning", "random")]
    cell = cells.loc["Unified, Fᵢ₊₁", "Planning, random"]
    assert cell == f"{planned['iterations']:.1f} ± {planned['iterations_half']:.1f}"
    assert cells.loc["Unified, Fᵢ₊₁", "Iterations, soccer"] == "–"
    reached = numbers.groupby(KEY, sort=False)["reached"].min()
    zero = [value == 1 for value in reached]
    assert [text == "0" for text in table["d at the end"]] == zero
