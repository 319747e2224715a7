from __future__ import annotations

import numpy as np
import pandas as pd
import pytest

from replication.evidence.experiments import GENERAL, NAMED, NONE, Key
from replication.evidence.statistics import mean_interval
from replication.evidence.tables import contrasts_table
from replication.irl import METHODS
from replication.paper.published import TABLE_1
from replication.report.iterations import draw, per_trial
from replication.report.readable import interval
from tests.report.legible import assert_legible, shown_texts


def made(counts: list[int], others: list[int], **columns: object) -> pd.DataFrame:
    """Return a table of trials of AdaBoost-IRL and of the unified method, all converged."""
    keys = ("adaboost", "", counts), ("unified", "printed", others)
    parts = [
        pd.DataFrame({"trial": range(len(own)), "iterations": own}).assign(
            method=method, reading=reading, set=NONE, converged=1
        )
        for method, reading, own in keys
    ]
    return pd.concat(parts, ignore_index=True).assign(**columns)


FEW = made([44, 40, 45, 47], [40, 40, 41, 39])


def rows_of(table: pd.DataFrame, key: Key) -> pd.DataFrame:
    """Return the rows of a method, a reading and a set."""
    return table[(table[["method", "reading", "set"]] == list(key)).all(axis=1)]


def test_numbers_are_those_of_the_trials(trials: pd.DataFrame) -> None:
    """Every trial has its count, what it saves with the same seed, and the paper's numbers."""
    numbers = per_trial(trials, TABLE_1).numbers
    bases = {
        ("unified", "updated", NONE): ("adaboost", "", NONE),
        ("unified-incorrect", "updated", GENERAL): ("unified", "updated", NONE),
        ("unified-incorrect", "at-once", NAMED): ("unified", "printed", NONE),
    }
    for key, base in bases.items():
        own, counts = rows_of(numbers, key), rows_of(trials, key)["iterations"]
        assert own["iterations"].tolist() == counts.tolist()
        saved = rows_of(trials, base)["iterations"].to_numpy() - counts.to_numpy()
        assert own["saved"].tolist() == saved.tolist()
        published, other = TABLE_1[key[0]], TABLE_1[base[0]]
        columns = own[["paper", "paper_sd", "paper_saved"]].drop_duplicates()
        assert columns.to_numpy().tolist() == [
            [published.mean, published.sd, other.mean - published.mean]
        ]
    assert rows_of(numbers, ("adaboost", "", NONE))["saved"].isna().all()


def test_words_and_figure_agree_with_the_table(trials: pd.DataFrame) -> None:
    """What is saved, with its interval, is that of the contrasts."""
    picture = per_trial(trials, {})
    figure = picture.draw(picture.numbers)
    texts = [text.get_text() for text in figure.axes[2].texts]
    for row in contrasts_table(trials).itertuples():
        effect = interval(row.saved, row.low, row.high)
        assert f"saved {effect}" in picture.words
        if row.reading == "printed":
            first = effect.replace(" ", "\n", 1).replace("-", "\N{MINUS SIGN}")
            assert any(text.startswith(first) for text in texts)


def test_a_row_has_its_mean_interval_and_spread() -> None:
    """Our mean stands in its interval and SD, and the paper's in its own."""
    figure = draw(per_trial(FEW, TABLE_1).numbers)
    _, middle, right = figure.axes
    counts = np.array([40.0, 40, 41, 39])
    colour = METHODS["unified"].colour
    low, high = mean_interval(counts)
    sd = counts.std(ddof=1)
    dots, spread, width, mark, theirs, triangle = (
        np.sort(np.asarray(line.get_xdata(), dtype=float))
        for line in middle.lines
        if colour in (line.get_color(), line.get_markeredgecolor())
    )
    assert dots.tolist() == sorted(counts)
    assert spread == pytest.approx([counts.mean() - sd, counts.mean() + sd])
    assert width == pytest.approx([float(low), float(high)])
    assert mark.tolist() == [counts.mean()]
    assert theirs == pytest.approx([40.10 - 4.73, 40.10 + 4.73])
    assert triangle.tolist() == [40.10]
    marks = [line.get_xdata()[0] for line in right.lines if line.get_marker() == "v"]  # type: ignore[index]
    assert marks == [pytest.approx(44.94 - 40.10)]


def test_methods_are_named_on_the_axis() -> None:
    """Each row is named in its colour, and the axis says against what is saved."""
    _, middle, right = draw(per_trial(FEW, {}).numbers).axes
    names = {text.get_text(): text.get_color() for text in middle.get_yticklabels()}
    assert names == {
        "AdaBoost-IRL\n(R1)": METHODS["adaboost"].colour,
        "Unified, without\nincorrect": METHODS["unified"].colour,
    }
    assert right.get_xlabel() == "iterations saved against\nAdaBoost-IRL (R1)"


@pytest.mark.parametrize(("others", "said"), [([44, 40, 45, 40], True), ([1, 2, 3, 4], False)])
def test_equal_trials_are_said_where_they_are_many(others: list[int], said: bool) -> None:
    """The share of trials without a difference stands beside them, unless there are hardly any."""
    _, _, right = draw(per_trial(made([44, 40, 45, 47], others), {}).numbers).axes
    assert any("equal in 75 %" in text.get_text() for text in right.texts) == said


def test_a_trial_at_the_cap_has_no_count() -> None:
    """Then there is neither a mean nor a difference, and the words say so."""
    capped = FEW.assign(converged=[1, 0, 1, 1, 1, 1, 1, 1])
    picture = per_trial(capped, {})
    assert "AdaBoost-IRL (R1): 1 of 4 trials at the cap" in picture.words
    assert "saved –" in picture.words
    _, middle, _ = picture.draw(picture.numbers).axes
    colour = METHODS["adaboost"].colour
    marks = [
        line for line in middle.lines if (line.get_marker(), line.get_color()) == ("|", colour)
    ]
    assert [np.isnan(mark.get_xdata()[0]) for mark in marks] == [True]  # type: ignore[index]


def test_more_trials_than_the_papers_are_in_the_clouds_alone() -> None:
    """The lines show as many trials as the paper has; the dots are all of them."""
    left, middle, _ = draw(per_trial(made([44, 40] * 125, [40, 41] * 125), {}).numbers).axes
    assert len(np.asarray(left.lines[0].get_xdata())) == 100
    assert left.get_xlim() == (-0.5, 99.5)
    dots = [line for line in middle.lines if line.get_marker() == "o"]
    assert [len(np.asarray(line.get_xdata())) for line in dots] == [250, 250]


def test_texts_are_legible(trials: pd.DataFrame) -> None:
    """With all methods, readings and sets, nothing is too small, cut off or written over."""
    picture = per_trial(trials, TABLE_1)
    figure = picture.draw(picture.numbers)
    assert_legible(figure)
    assert "(c) differences, same seed" in [text.get_text() for text in shown_texts(figure)]
