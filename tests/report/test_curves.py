from __future__ import annotations

import numpy as np
import pandas as pd
import pytest

from replication.evidence.experiments import Key
from replication.irl import METHODS
from replication.paper.published import TABLE_1
from replication.report.curves import (
    draw_errors,
    draw_iterations,
    draw_sets,
    errors,
    iterations,
    median_trial,
    sets,
)
from replication.trials.condition import Condition
from replication.trials.measures import error_histories
from replication.trials.results import Results

Conditions = dict[Key, Condition]

ERRORS = pd.DataFrame(
    {
        "reading": "printed",
        "method": "unified",
        "iteration": [0, 1, 2, 3],
        "trial": 0,
        "error": [3.0, 1.0, 0.0, 0.0],
        "quartile_1": [2.0, 1.0, 0.0, 0.0],
        "median": [2.5, 1.5, 0.5, 0.0],
        "quartile_3": [3.0, 2.0, 1.0, 0.0],
        "paper": 9,
    }
)
SAVED = pd.DataFrame(
    {
        "set": ["none", "hit", "none", "hit"],
        "reading": ["printed", "printed", "updated", "updated"],
        "method": ["unified", "unified-incorrect"] * 2,
        "leaving": [0, 7, 0, 7],
        "difference": [0.0, -2.0, 0.0, 1.0],
        "low": [0.0, -3.0, 0.0, -0.5],
        "high": [0.0, 0.5, 0.0, 2.0],
    }
)


def counts_of(trials: pd.DataFrame, method: str, reading: str) -> list[int]:
    """Return the iterations of the trials of a method under a reading."""
    own = trials[(trials["method"] == method) & (trials["reading"] == reading)]
    return [int(count) for count in own["iterations"]]


def test_errors_are_those_of_the_trials(
    conditions: Conditions, results: Results, trials: pd.DataFrame
) -> None:
    """Each condition has the drawn trial and the quartiles of all at each iteration."""
    for median in (False, True):
        numbers = errors(trials, {"unified": 47}, median=median).numbers
        for (method, reading), condition in conditions.items():
            rows = numbers[(numbers["method"] == method) & (numbers["reading"] == reading)]
            curves = [results.trial(condition, k).errors for k in range(results.trials)]
            every = np.array([np.pad(d, (0, len(rows) - len(d)), mode="edge") for d in curves])
            counts = np.array(counts_of(trials, method, reading))
            assert len(rows) == counts.max() + 1
            trial = median_trial(counts) if median else 0
            assert set(rows["trial"]) == {trial}
            np.testing.assert_allclose(rows["error"], every[trial], rtol=1e-9)
            columns = rows[["quartile_1", "median", "quartile_3"]].to_numpy().T
            np.testing.assert_allclose(
                columns, np.quantile(every, [0.25, 0.5, 0.75], axis=0), rtol=1e-9
            )
            assert (rows["paper"] == 47).all() == (method == "unified")


def test_iterations_are_those_of_the_trials(conditions: Conditions, trials: pd.DataFrame) -> None:
    """Every trial has a row with its count, how many are like it, our mean and the paper's."""
    numbers = iterations(trials, {"unified": TABLE_1["unified"]}).numbers
    for method, reading in conditions:
        rows = numbers[(numbers["method"] == method) & (numbers["reading"] == reading)]
        counts = counts_of(trials, method, reading)
        assert rows["iterations"].tolist() == counts
        assert rows["trials_alike"].tolist() == [counts.count(n) for n in counts]
        assert set(rows["mean"]) == {np.mean(counts)}
        assert (rows["paper"] == 40.1).all() == (method == "unified")


def test_a_method_without_a_trace_is_in_every_panel(trials: pd.DataFrame) -> None:
    """AdaBoost-IRL's line is drawn under both readings of Eq. 9, from the same rows."""
    two = trials[trials["method"].isin(["adaboost", "unified"])]
    panels = draw_iterations(iterations(two, {}).numbers).axes[::2]
    assert [panel.get_title(loc="left") for panel in panels] == ["Fᵢ (printed)", "Fᵢ₊₁ (updated)"]
    for panel in panels:
        colours = [line.get_color() for line in panel.lines]
        assert colours == [METHODS[name].colour for name in ("adaboost", "unified")]
    drawn = [np.asarray(panel.lines[0].get_ydata()).tolist() for panel in panels]
    assert drawn[0] == drawn[1] == counts_of(trials, "adaboost", "")


def test_traced_trial_ends_where_it_reaches_zero() -> None:
    """The line of Fig. 5 stops at the first zero, and the paper's mark stands at its iteration."""
    (panel,) = draw_errors(ERRORS).axes
    lines = [np.asarray(line.get_xydata()) for line in panel.lines]
    assert any(np.array_equal(line, [[0, 3], [1, 1], [2, 0]]) for line in lines)
    assert any((line == [[9, 0]]).all() for line in lines if line.shape == (1, 2))


def test_the_papers_mark_is_explained_only_where_it_is() -> None:
    """Without a published number there is no triangle, neither in the panel nor in the legend."""
    for numbers, marks in ((ERRORS, 1), (ERRORS.assign(paper=np.nan), 0)):
        figure = draw_errors(numbers)
        texts = [text.get_text() for text in figure.legends[0].get_texts()]
        assert texts.count("the paper's curve") == marks
        assert sum(line.get_marker() == "v" for line in figure.axes[0].lines) == marks


def test_iterations_are_drawn_as_given() -> None:
    """Fig. 6 shows every trial's count, unsmoothed, and the mean beside it."""
    numbers = pd.DataFrame(
        {
            "reading": "printed",
            "method": "unified",
            "trial": [0, 1, 2],
            "iterations": [44, 40, 44],
            "trials_alike": [2, 1, 2],
            "mean": 128 / 3,
            "paper": 42.0,
        }
    )
    left, right = draw_iterations(numbers).axes
    np.testing.assert_array_equal(left.lines[0].get_ydata(), [44, 40, 44])
    assert [line.get_ydata()[0] for line in right.lines] == [128 / 3, 42.0]  # type: ignore[index]
    bars = {bar.get_y() + bar.get_height() / 2: bar.get_width() for bar in right.patches}  # type: ignore[attr-defined]
    assert bars == pytest.approx({40: 0.42, 44: 0.84})


def test_saved_is_the_negative_difference() -> None:
    """What a set saves is positive where its difference is negative, with the interval turned."""
    left, right = draw_sets(SAVED).axes
    for panel, saved, ends in ((left, 2.0, (-0.5, 3.0)), (right, -1.0, (-2.0, 0.5))):
        assert panel.lines[-1].get_xdata().tolist() == [saved]  # type: ignore[union-attr]
        (segment,) = panel.collections[0].get_segments()  # type: ignore[attr-defined]
        assert segment[:, 0].tolist() == list(ends)
    assert [label.get_text() for label in left.get_yticklabels()] == ["hit  (7)"]
    assert "hit, Fᵢ (printed): 2.0 (-0.5 to 3.0)" in sets(SAVED).words


def test_no_sets_are_a_figure_too() -> None:
    """A file without incorrect demonstrations gives an empty panel that says so, not a crash."""
    (panel,) = draw_sets(SAVED[SAVED["set"] == "none"]).axes
    assert panel.get_title() == "no incorrect demonstrations"


def test_words_hold_the_numbers(trials: pd.DataFrame) -> None:
    """The alternative texts give when half of the trials are at zero, and the means."""
    one = trials[(trials["method"] == "unified") & (trials["reading"] == "printed")]
    name = "Unified, without incorrect, Fᵢ (printed)"
    below = (np.median(error_histories(one), axis=0) > 0).sum()
    words = errors(one, {}).words
    assert f"{name}: half of the trials are at zero after {below} iterations" in words
    assert f"{name}: {one['iterations'].mean():.1f} on average" in iterations(one, {}).words
