from __future__ import annotations

import re
from typing import Any

import numpy as np
import pandas as pd
import pytest
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure

from replication.evidence.bound import RUNS
from replication.evidence.explained import share_table
from replication.report.bound import (
    LOOKS,
    RUN,
    bounds,
    readable_bounds,
    readable_shares,
    run_label,
)
from tests.report.legible import assert_legible


def some_bounds() -> pd.DataFrame:
    """Make up demonstrations, and iterations that go with the length of their paths."""
    rng = np.random.default_rng(np.random.SeedSequence(1))
    rows = []
    for k, length in enumerate((4, 8, 16, 24, 31, 31, 33, 33, 33, 33)):
        delta = 0.9**length * rng.uniform(0.3, 0.5)
        for method, reading, solver in RUNS:
            mean = length * rng.uniform(0.8, 1.3)
            row: dict[str, Any] = {"world": f"maze-{k}", "vary": "length" if k < 4 else "shape"}
            row |= {"shape": "legs of 4", "length": length, "radius": 10.26, "delta": delta}
            row |= {"bound": 105 / delta**2, "method": method, "reading": reading}
            row |= {"solver": solver, "n": 10, "converged": 1.0, "mean": mean}
            rows.append(row | {"low": mean - 2, "high": mean + 2, "most": 2 * mean})
    return pd.DataFrame(rows)


TABLE = some_bounds()


@pytest.fixture(scope="module")
def figure() -> Figure:
    """Draw them."""
    return bounds(TABLE).draw(TABLE)


def test_means_stand_at_their_causes(figure: Figure) -> None:
    """Each method has its mark over the bound and over the length, with its interval."""
    for panel, cause in zip(figure.axes, ("bound", "length"), strict=True):
        means = panel.lines[: len(LOOKS)]
        spans = [one for one in panel.collections if isinstance(one, LineCollection)]
        for shown, span, (key, look) in zip(means, spans, LOOKS.items(), strict=True):
            own = TABLE[(TABLE[RUN] == list(key)).all(axis=1)]
            assert (shown.get_marker(), shown.get_color()) == look
            moved = np.asarray(shown.get_xdata()) / own[cause]
            assert np.ptp(moved) < 1e-9
            assert abs(moved.mean() - 1) < 0.13
            assert np.asarray(shown.get_ydata()).tolist() == own["mean"].tolist()
            ends = np.array([np.asarray(segment) for segment in span.get_segments()])
            assert ends[:, 0, 1].tolist() == own["low"].tolist()
            assert ends[:, 1, 1].tolist() == own["high"].tolist()
        low, high = panel.get_ylim()
        assert low < TABLE["low"].clip(lower=2.01).min()
        assert TABLE["high"].max() < high


def test_line_is_one_iteration_for_each_move(figure: Figure) -> None:
    """Only the length has it: the bound is out of sight."""
    counts = [len(panel.lines) for panel in figure.axes]
    assert counts == [len(LOOKS), len(LOOKS) + 1]
    line = figure.axes[1].lines[-1]
    assert np.array_equal(np.asarray(line.get_xdata()), np.asarray(line.get_ydata()))


def test_table_is_drawn_as_it_is_read_back(figure: Figure) -> None:
    """An empty reading is no number after a file, and is the perceptron's all the same."""
    read = TABLE.assign(reading=TABLE["reading"].replace("", np.nan))
    again = bounds(TABLE).draw(read)
    assert [len(np.asarray(line.get_xdata())) for line in again.axes[0].lines] == [
        len(np.asarray(line.get_xdata())) for line in figure.axes[0].lines
    ]


def test_texts_are_legible(figure: Figure) -> None:
    """No text overlaps another."""
    assert_legible(figure)


def test_words_have_the_numbers() -> None:
    """Bounds, how far off they are, and what each method needs for each step."""
    words = bounds(TABLE).words
    proved = TABLE[TABLE["method"] == "perceptron"]
    low, high = (proved["bound"] / proved["most"]).agg(["min", "max"])
    assert f"by a factor of {low:.0f} to {high:.0f}" in words
    per_step = [float(x) for x in re.findall(r"([\d.]+) for each step", words)]
    assert per_step == pytest.approx(
        [(own["mean"] / own["length"]).max() for _, own in TABLE.groupby(RUN, sort=False)],
        abs=0.005,
    )


def test_readable_tables_by_hand() -> None:
    """Each demonstration has its row, and each method its column; shares have their interval."""
    readable = readable_bounds(TABLE)
    assert len(readable) == 10
    labels = [run_label(*run) for run in RUNS]
    assert readable.columns.tolist() == ["Maze", "Path", "Moves", "R", "δ", "Bound", *labels]
    assert labels[0] == "Perceptron (F = 1), planning"
    assert labels[3] == "Unified, Fᵢ, Q-learning"
    for number, row in enumerate(readable.itertuples(index=False)):
        for column, value in enumerate(TABLE["mean"].iloc[4 * number : 4 * number + 4]):
            assert row[6 + column].startswith(f"{value:.2f} [")
    shares = readable_shares(share_table(TABLE))
    assert len(shares) == 4 * 2 * 2
    assert shares["Among"].iloc[0] == "6 shapes (31 or 33 moves)"
    assert shares["Cause"].tolist()[:2] == ["1/δ²", "length of the path"]
    assert re.fullmatch(r"0\.\d\d \[0\.\d\d, [01]\.\d\d\]", shares["Variance explained [95 %]"][2])
