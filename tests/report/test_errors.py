from __future__ import annotations

import numpy as np
import pandas as pd
import pytest
from matplotlib.axes import Axes

from replication.evidence.experiments import GENERAL, NONE, Key
from replication.evidence.statistics import share_interval
from replication.paper.published import FIGURE_5
from replication.report.errors import draw, falling, median_trial
from replication.report.looks import LISTED
from replication.trials.condition import Condition
from replication.trials.results import Results
from tests.report.legible import assert_legible, shown_texts

Conditions = dict[Key, Condition]

ERRORS = pd.DataFrame(
    {
        "reading": "printed",
        "method": "unified",
        "set": NONE,
        "iteration": [0, 1, 2, 3],
        "at_zero": [0.0, 0.0, 0.5, 1.0],
        "low": [0.0, 0.0, 0.2, 0.8],
        "high": [0.2, 0.2, 0.8, 1.0],
        "trial": 0,
        "error": [3.0, 1.0, 0.0, 0.0],
        "quartile_1": [2.0, 1.0, 0.0, 0.0],
        "median": [2.5, 1.5, 0.5, 0.0],
        "quartile_3": [3.0, 2.0, 1.0, 0.0],
        "paper": 9,
    }
)


def rows_of(table: pd.DataFrame, key: Key) -> pd.DataFrame:
    """Return the rows of a method, a reading and a set."""
    return table[(table[["method", "reading", "set"]] == list(key)).all(axis=1)]


def drawn(panel: Axes, colour: str) -> list[list[tuple[float, float]]]:
    """Return the lines of a panel in some colour."""
    lines = [line for line in panel.lines if line.get_color() == colour]
    return [list(map(tuple, np.asarray(line.get_xydata()).tolist())) for line in lines]


def test_numbers_are_those_of_the_trials(
    conditions: Conditions, results: Results, trials: pd.DataFrame
) -> None:
    """Each condition has its share at zero, the drawn trial and the quartiles at each iteration."""
    for median in (False, True):
        numbers = falling(trials, {"unified": 47}, median=median).numbers
        for key, condition in conditions.items():
            rows = rows_of(numbers, key)
            curves = [results.trial(condition, k).errors for k in range(results.trials)]
            every = np.array([np.pad(d, (0, len(rows) - len(d)), mode="edge") for d in curves])
            counts = rows_of(trials, key)["iterations"].to_numpy()
            assert len(rows) == counts.max() + 1
            ended = [(counts <= i).sum() for i in rows["iteration"]]
            assert rows["at_zero"].tolist() == [k / len(counts) for k in ended]
            ends = [share_interval(int(k), len(counts)) for k in ended]
            assert list(zip(rows["low"], rows["high"], strict=True)) == ends
            trial = median_trial(counts) if median else 0
            assert set(rows["trial"]) == {trial}
            np.testing.assert_allclose(rows["error"], every[trial], rtol=1e-9)
            columns = rows[["quartile_1", "median", "quartile_3"]].to_numpy().T
            np.testing.assert_allclose(
                columns, np.quantile(every, [0.25, 0.5, 0.75], axis=0), rtol=1e-9
            )
            assert (rows["paper"] == 47).all() == (key[0] == "unified")


def test_each_panel_shows_its_reading(trials: pd.DataFrame) -> None:
    """Shares go on to the end of the axis; median and trial end where they reach zero."""
    numbers = falling(trials, {}).numbers
    figure = draw(numbers)
    for place, reading in enumerate(("printed", "updated", "at-once")):
        own = rows_of(numbers, ("unified-incorrect", reading, GENERAL))
        upper, lower = figure.axes[place], figure.axes[place + 3]
        (shares,) = drawn(upper, LISTED)
        assert [y for _, y in shares] == [*own["at_zero"], own["at_zero"].iloc[-1]]
        assert shares[-1][0] > upper.get_xlim()[1]
        for line, name in zip(drawn(lower, LISTED), ("median", "error"), strict=True):
            end = int(np.argmax(own[name].to_numpy() <= 0))
            assert [y for _, y in line] == own[name].tolist()[: end + 1]


def test_axes_end_where_the_data_end() -> None:
    """The shares end with the last trial or the paper's curve, the errors where all are zero."""
    upper, lower = draw(ERRORS).axes
    assert upper.get_xlim() == pytest.approx((0, 1.02 * 9))
    assert lower.get_xlim() == (0, 3)
    upper, _ = draw(ERRORS.assign(paper=np.nan)).axes
    assert upper.get_xlim() == pytest.approx((0, 1.02 * 3))


@pytest.mark.parametrize("paper", [1, 9, np.nan])
def test_the_papers_curve_is_marked_where_it_ends(paper: float) -> None:
    """A line stands at its iteration, with the number; without one there is neither."""
    upper, _ = draw(ERRORS.assign(paper=paper)).axes
    upright = [line for line in upper.lines if list(line.get_ydata()) == [0, 1]]  # type: ignore[arg-type]
    places = [list(line.get_xdata()) for line in upright]  # type: ignore[arg-type]
    texts = [text.get_text() for text in upper.texts if text.get_text().startswith("paper")]
    known = not np.isnan(paper)
    assert places == ([[paper, paper]] if known else [])
    assert texts == ([f"paper: {paper}"] if known else [])


def test_the_figure_says_which_trials_are_drawn() -> None:
    """One number if all are the same, else one for each method, in its colour."""
    other = ERRORS.assign(method="adaboost", reading="", trial=4)
    for numbers, names in (
        (ERRORS, ["trial 0"]),
        (pd.concat([ERRORS, other]), ["trial 4", "trial 0"]),
    ):
        figure = draw(numbers)
        texts = [text.get_text() for text in figure.axes[-1].texts]
        assert [text for text in texts if text.startswith("trial")] == names


def test_texts_are_legible(trials: pd.DataFrame) -> None:
    """With all methods, readings and sets, nothing is too small, cut off or written over."""
    for median in (False, True):
        picture = falling(trials, FIGURE_5, median=median)
        figure = picture.draw(picture.numbers)
        assert_legible(figure)
        assert "paper: 47" in [text.get_text() for text in shown_texts(figure)]


def test_words_hold_the_numbers(trials: pd.DataFrame) -> None:
    """The alternative text gives when half are at zero, and the share at the paper's iteration."""
    key = "unified", "updated", NONE
    counts = rows_of(trials, key)["iterations"]
    paper = int(counts.median())
    words = falling(trials, {"unified": paper}).words
    half = sorted(counts)[(len(counts) - 1) // 2]
    share = 100 * (counts <= paper).mean()
    due = f"half after {half} iterations, {share:.0f} % after the paper's {paper}"
    assert f"Unified, without incorrect, Fᵢ₊₁ (updated): {due}" in words


def test_trials_end_where_they_say() -> None:
    """A trial counts from its last iteration if it converged, above zero too; at the cap, never."""
    ends = [("3 0.05", 1, 1), ("3 2 1", 2, 0), ("0", 0, 1)]
    rows = pd.DataFrame(ends, columns=["errors", "iterations", "converged"])
    trials = rows.assign(method="unified", reading="printed", set=NONE, trial=rows.index)
    assert falling(trials, {}).numbers["at_zero"].tolist() == [1 / 3, 2 / 3, 2 / 3]
    capped, right = falling(trials.iloc[1:2], {}), falling(trials.iloc[2:], {})
    assert "less than half in the end" in capped.words
    for picture in (capped, right):
        assert_legible(picture.draw(picture.numbers))
