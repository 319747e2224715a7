from __future__ import annotations

from itertools import product

import numpy as np
import pandas as pd
import pytest
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure

from replication.evidence.elsewhere import CHANGES
from replication.evidence.specifications import MAPS
from replication.evidence.transfer import FEATURES, LIMIT, PREDICTED, verdict_table
from replication.report.drawing import PURPLE
from replication.report.transfer import MARKS, colour, label, readable_transfer, transfer
from tests.report.legible import assert_legible


def some_transfer() -> pd.DataFrame:
    """Make up the value lost; the one-line reward alone transfers, to two changes."""
    rng = np.random.default_rng(np.random.SeedSequence(1))
    rows = []
    for task, method, change in product(MAPS, PREDICTED, CHANGES):
        small = method == "one-line" and change in ("none", "slip 0.1")
        lost, half = (0.02 if small else rng.uniform(0.2, 1)), (0.0 if small else 0.05)
        row = {"task": task, "method": method, "change": change, "n": 20, "lost": lost}
        rows.append(row | {"low": lost - half, "high": lost + half, "d": 0.0})
    return pd.DataFrame(rows)


TABLE = some_transfer()
VERDICTS = verdict_table(TABLE)


@pytest.fixture(scope="module")
def figure() -> Figure:
    """Draw the values."""
    return transfer(TABLE).draw(TABLE)


def test_values_stand_at_their_changes(figure: Figure) -> None:
    """Each task has a panel with all methods, and a last one has the worst task of each."""
    assert [panel.get_title(loc="left") for panel in figure.axes] == [
        "(a) open",
        "(b) obstacles",
        "(c) random 1",
        "(d) random 2",
        "(e) random 3",
        "(f) worst of these",
    ]
    tables = [*(TABLE[TABLE["task"] == task] for task in MAPS), VERDICTS]
    for panel, rows in zip(figure.axes, tables, strict=True):
        limit, *lines = panel.lines
        assert set(np.asarray(limit.get_ydata()).tolist()) == {LIMIT}
        spans = [one for one in panel.collections if isinstance(one, LineCollection)]
        for line, span, method, mark in zip(lines, spans, PREDICTED, MARKS, strict=False):
            own = rows[rows["method"] == method].set_index("change").loc[list(CHANGES)]
            assert (line.get_color(), line.get_marker()) == (colour(method), mark)
            assert np.asarray(line.get_ydata()).tolist() == own["lost"].tolist()
            places = np.asarray(line.get_xdata())
            assert np.round(places).tolist() == list(range(len(CHANGES)))
            ends = [np.asarray(segment)[:, 1].tolist() for segment in span.get_segments()]
            assert ends == own[["low", "high"]].to_numpy().tolist()
        assert len(lines) == len(spans) == len(PREDICTED)


def test_methods_stand_side_by_side_and_look_different(figure: Figure) -> None:
    """Methods that lose the same do not hide one another."""
    first = sorted(np.asarray(line.get_xdata())[0] for line in figure.axes[0].lines[1:])
    assert (np.diff(first) > 0.1).all()
    assert len({colour(method) for method in PREDICTED}) == len(PREDICTED)
    assert (colour(FEATURES), label(FEATURES)) == (PURPLE, "Perceptron, five features")
    assert label("one-line") == "One-line reward"


def test_texts_are_legible(figure: Figure) -> None:
    """Names of changes and the legend have room."""
    assert_legible(figure)


def test_words_tell_where_each_reward_holds() -> None:
    """They follow from the verdicts."""
    words = transfer(TABLE).words
    assert "at most 0.1 of it is lost in every task" in words
    assert "One-line reward: the task itself, slip 0.1;" in words
    assert "Copying the expert: nowhere;" in words


def test_readable_transfer_by_hand() -> None:
    """A row a method and change: what the rule says, what was expected, and the worst task."""
    rows = VERDICTS[VERDICTS["method"] == "one-line"].iloc[:3]
    rows = rows.assign(worst="random-2", lost=0.25, low=0.125, high=0.375)
    shown = readable_transfer(rows)
    assert [" | ".join(row) for row in shown.to_numpy()] == [
        "One-line reward | the task itself | transfers | transfers | random 2 | 0.25 [0.12, 0.38]",
        "One-line reward | other starts | does not transfer | does not transfer | random 2 | "
        "0.25 [0.12, 0.38]",
        "One-line reward | slip 0.1 | transfers | does not transfer | random 2 | 0.25 [0.12, 0.38]",
    ]
