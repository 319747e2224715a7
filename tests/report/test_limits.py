from __future__ import annotations

import re
from io import StringIO

import numpy as np
import pandas as pd
import pytest
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from replication.evidence.limits import LEVELS, METHODS, NUMBERS, PLAIN, ROLLOUTS, SIDES
from replication.report.limits import (
    METHOD_MARKS,
    ROLLOUT_MARKS,
    growth,
    limits,
    readable_noise,
    readable_paths,
    readable_sizes,
)
from tests.report.legible import assert_legible


def around(name: str, value: float, half: float) -> dict[str, float]:
    """Make up a mean with its interval."""
    return {name: value, f"{name}_low": value - half, f"{name}_high": value + half}


PATHS = pd.DataFrame(
    {"number": number, "rollouts": rollouts, "n": 20}
    | around("d", 0.3 * number - rollouts / 1000, 0.1)
    | {"at": 30 + number, "at_low": 25.5, "at_high": 40}
    | around("learned", 0.3 * number + rollouts / 1000, 0.1)
    | {"shortest": 0.29 * number, "demo": 0.31 * number, "reached": 0.4, "nearer": 0.05}
    | {"zero": float(number == 1), "untrained": 0.25 * (rollouts == 100)}
    for number in NUMBERS
    for rollouts in ROLLOUTS
)
NOISE = pd.DataFrame(
    {"level": level, "n": 20, "iterations": 40 + 100 * level}
    | around("share", 0.9 - 3 * level, 0.1)
    | around("d", 5 * level, 0.1)
    | {"against": 15, "against_zero": 1}
    | around("contradictory", 0.1 + 4 * level, 0.02)
    for level in (PLAIN, *LEVELS)
)
SIZES = pd.DataFrame(
    {"side": side, "cells": side**2, "moves": 2 * side - 2, "method": method, "n": 5}
    | {"zero": 0.8 if (side, method) == (100, "unified") else 1.0}
    | around("iterations", 2 * side, 1)
    | around("steps", 1e4 * (1 + 9 * place) * side ** (1 + place), 1e4)
    | {"episode": 250}
    for side in SIDES
    for place, method in enumerate(METHODS)
)


@pytest.fixture(scope="module")
def figure() -> Figure:
    """Draw the three panels."""
    picture = limits(PATHS, NOISE, SIZES)
    return picture.draw(picture.numbers)


def x_of(line: Line2D) -> list[float]:
    """Return where a line's marks stand."""
    return np.asarray(line.get_xdata(), float).tolist()


def y_of(line: Line2D) -> list[float]:
    """Return how high they stand."""
    return np.asarray(line.get_ydata(), float).tolist()


def test_texts_are_legible(figure: Figure) -> None:
    """Titles, labels and the legend have room."""
    assert_legible(figure)


def test_marks_stand_at_their_values(figure: Figure) -> None:
    """Each table has its panel, in which its numbers stand where they belong."""
    left, middle, right = figure.axes
    bound, *lines = left.lines
    assert y_of(bound) == pytest.approx([0.29 * number for number in NUMBERS])
    for (rollouts, (_, colour)), line in zip(ROLLOUT_MARKS.items(), lines[::2], strict=True):
        own = PATHS[PATHS["rollouts"] == rollouts]
        assert (y_of(line), line.get_color()) == (own["d"].tolist(), colour)
        assert np.round(x_of(line)).tolist() == list(NUMBERS)
    after = [y_of(line) for line in lines[1::2]]
    assert after == [[], PATHS.loc[PATHS["rollouts"] == 100, "learned"].tolist()]
    for line, name in zip(middle.lines, ("share", "contradictory"), strict=True):
        assert y_of(line) == NOISE[name].tolist()
        np.testing.assert_allclose(x_of(line), NOISE["level"], atol=0.003)
    for line, method in zip(right.lines[::2], METHODS, strict=True):
        own = SIZES[SIZES["method"] == method]
        assert (y_of(line), line.get_marker()) == (
            own["steps"].tolist(),
            METHOD_MARKS[method][0],
        )
        np.testing.assert_allclose(x_of(line), own["cells"], rtol=0.08)
    assert [len(x_of(line)) for line in right.lines[1::2]] == [0, 0, 1]
    assert (right.get_xscale(), right.get_yscale()) == ("log", "log")


def test_it_is_drawn_from_its_file() -> None:
    """What is saved beside the figure is enough to draw it again."""
    picture = limits(PATHS, NOISE, SIZES)
    text = picture.numbers.to_csv(index=False)
    again = picture.draw(pd.read_csv(StringIO(text)))
    assert [len(panel.lines) for panel in again.axes] == [5, 2, 6]


def test_growth_is_the_power() -> None:
    """Steps that are a power of the cells give it back, each method its own."""
    cells = np.array([25, 100, 400])
    rows = [
        pd.DataFrame({"method": method, "cells": cells, "steps": 7.0 * cells**power})
        for method, power in (("one-line", 0.5), ("unified", 1.25))
    ]
    assert growth(pd.concat(rows)) == pytest.approx({"one-line": 0.5, "unified": 1.25})


def test_words_have_the_numbers() -> None:
    """Least d, where it is the untrained agent's, shares and powers are told."""
    words = limits(PATHS, NOISE, SIZES).words
    single = PATHS[PATHS["rollouts"] == 1]
    found = [float(x) for x in re.findall(r"([\d.]+) with \d", words.partition(";")[0])]
    assert found == pytest.approx(single["d"].tolist(), abs=0.005)
    assert "100 trajectories it is that of the untrained agent in 25% with 1, " in words
    assert "90% at 0, 75% at 0.05, " in words
    assert "One-line reward: 0.50, Perceptron (F = 1): 1.00, " in words


def test_tables_by_hand() -> None:
    """A row of each has the labels and the numbers of its table."""
    row = readable_paths(PATHS).iloc[3]
    assert row["Least d [95 %]"] == "0.50 [0.40, 0.60]"
    assert row["In iteration (quartiles)"] == "32 (25.5–40)"
    assert row["Least d after learning"] == "0.70 [0.60, 0.80]"
    assert (row["Demonstrations"], row["Trajectories"]) == (2, 100)
    assert (row["Nearest shortest path"], row["Before learning"]) == ("0.58", "25%")
    row = readable_noise(NOISE).iloc[1]
    assert (row["Slips a step"], row["Iterations, median"]) == ("5%", "45")
    assert row["At d = 0 of those with two actions in a state"] == "1 of 15"
    row = readable_sizes(SIZES).iloc[-1]
    assert (row["Cells"], row["Moves"], row["At d = 0"]) == ("100 × 100", 198, "80%")
    assert row["Thousand steps [95 %]"] == "190,000,000 [189,999,990, 190,000,010]"
