from __future__ import annotations

import numpy as np
import pandas as pd

from replication.paper.published import TABLE_1
from replication.report.sets import draw, savings
from tests.report.legible import assert_legible

SAVED = pd.DataFrame(
    {
        "set": ["opposite", "hit+detour", "hit"] * 2,
        "reading": ["printed"] * 3 + ["updated"] * 3,
        "leaving": [30, 7, 7] * 2,
        "saved": [5.0, 2.0, 2.0, 6.0, -1.0, 1.0],
        "low": [4.0, -0.5, -0.5, 5.0, -2.0, 0.5],
        "high": [6.5, 3.0, 3.0, 7.0, 0.5, 1.5],
    }
)
SAME = SAVED.assign(
    saved=[5.0, 2.0, 2.0, 6.0, -1.0, -1.0],
    low=[4.0, -0.5, -0.5, 5.0, -2.0, -2.0],
    high=[6.5, 3.0, 3.0, 7.0, 0.5, 0.5],
)


def test_savings_are_to_scale() -> None:
    """A dot stands at what a set saves, on its interval, in the panel of each reading."""
    figure = draw(savings(SAVED, {}).numbers)
    rows = SAVED.sort_values("leaving", kind="stable")
    for panel, (_, own) in zip(figure.axes, rows.groupby("reading", sort=False), strict=True):
        dots = [line for line in panel.lines if line.get_marker() == "o"]
        places = [np.asarray(dot.get_xydata())[0].tolist() for dot in dots]
        assert places == [[saved, y] for y, saved in enumerate(own["saved"])]
        segments = [collection.get_segments()[0] for collection in panel.collections]  # type: ignore[attr-defined]
        ends = [segment[:, 0].tolist() for segment in segments]
        assert ends == own[["low", "high"]].to_numpy().tolist()
    left, right = figure.axes
    assert [panel.get_title() for panel in (left, right)] == ["Fᵢ (printed)", "Fᵢ₊₁ (updated)"]
    labels = [label.get_text() for label in left.get_yticklabels()]
    assert labels == ["named kinds (7)", "hits (7)", "opposite direction (30)"]
    assert left.yaxis_inverted()


def test_sets_that_save_the_same_are_one_row() -> None:
    """Only if they do so under every reading."""
    left, _ = draw(savings(SAME, {}).numbers).axes
    labels = [label.get_text() for label in left.get_yticklabels()]
    assert labels == ["named kinds (7)\nhits (7)", "opposite direction (30)"]


def test_sets_without_an_effect_are_not_taken_for_the_same() -> None:
    """What has trials at the cap has no effect: nobody knows whether it saves the same."""
    left, _ = draw(savings(SAVED.assign(saved=np.nan, low=np.nan, high=np.nan), {}).numbers).axes
    assert len(left.get_yticklabels()) == 3


def test_the_papers_saving_is_marked_where_it_is_known() -> None:
    """A line stands at the paper's difference of means, with its number, in every panel."""
    for published, due in ((TABLE_1, ["paper: 3.62"]), ({}, [])):
        picture = savings(SAVED, published)
        for panel in picture.draw(picture.numbers).axes:
            texts = [text.get_text() for text in panel.texts]
            assert [text for text in texts if text.startswith("paper")] == due
            upright = [line.get_xdata()[0] for line in panel.lines if line.get_marker() != "o"]  # type: ignore[index]
            assert np.allclose(sorted(upright), [0, 3.62][: 1 + len(due)])


def test_texts_are_legible() -> None:
    """Nothing is too small, cut off or written over."""
    for table in (SAVED, SAME):
        assert_legible(draw(savings(table, TABLE_1).numbers))


def test_words_hold_the_numbers() -> None:
    """The alternative text has every saving with its interval, by set."""
    words = savings(SAME, {}).words
    assert "named kinds (7) or hits (7): 2.00 [-0.50, 3.00], -1.00 [-2.00, 0.50];" in words
    assert "Fᵢ (printed); Fᵢ₊₁ (updated): named" in words
