from __future__ import annotations

from typing import Any

import numpy as np
import pandas as pd
import pytest
from matplotlib.axes import Axes

from replication.evidence.experiments import GENERAL, NAMED, NONE, Key
from replication.irl import METHODS
from replication.paper.published import TABLE_1
from replication.report.curves import (
    LISTED,
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

PANELS = ["Fᵢ (printed)", "Fᵢ₊₁ (updated)", "Fᵢ, maximum at once"]
ERRORS = pd.DataFrame(
    {
        "reading": "printed",
        "method": "unified",
        "set": NONE,
        "iteration": [0, 1, 2, 3],
        "trial": 0,
        "error": [3.0, 1.0, 0.0, 0.0],
        "quartile_1": [2.0, 1.0, 0.0, 0.0],
        "median": [2.5, 1.5, 0.5, 0.0],
        "quartile_3": [3.0, 2.0, 1.0, 0.0],
        "paper": 9,
    }
)
COUNTS = pd.DataFrame(
    {
        "reading": "printed",
        "method": "unified",
        "set": NONE,
        "trial": [0, 1, 2],
        "iterations": [44, 40, 44],
        "trials_alike": [2, 1, 2],
        "mean": 128 / 3,
        "paper": 42.0,
    }
)
SAVED = pd.DataFrame(
    {
        "set": ["hit", "opposite"] * 2,
        "reading": ["printed"] * 2 + ["updated"] * 2,
        "leaving": [7, 30] * 2,
        "saved": [2.0, 5.0, -1.0, 6.0],
        "low": [-0.5, 4.0, -2.0, 5.0],
        "high": [3.0, 6.5, 0.5, 7.0],
    }
)


def rows_of(table: pd.DataFrame, key: Key) -> pd.DataFrame:
    """Return the rows of a method, a reading and a set."""
    return table[(table[["method", "reading", "set"]] == list(key)).all(axis=1)]


def counts_of(trials: pd.DataFrame, key: Key) -> list[int]:
    """Return the iterations of the trials of a condition."""
    return [int(count) for count in rows_of(trials, key)["iterations"]]


def lines_of(panel: Axes) -> dict[tuple[Any, bool], list[list[float]]]:
    """Return the long lines of a panel, by colour and whether they are dashed."""
    return {
        (line.get_color(), line.is_dashed()): np.asarray(line.get_xydata()).tolist()
        for line in panel.lines
        if line.get_marker() == "None" and line.get_linewidth() > 1
    }


def test_errors_are_those_of_the_trials(
    conditions: Conditions, results: Results, trials: pd.DataFrame
) -> None:
    """Each condition has the drawn trial and the quartiles of all at each iteration."""
    for median in (False, True):
        numbers = errors(trials, {"unified": 47}, median=median).numbers
        for key, condition in conditions.items():
            rows = rows_of(numbers, key)
            curves = [results.trial(condition, k).errors for k in range(results.trials)]
            every = np.array([np.pad(d, (0, len(rows) - len(d)), mode="edge") for d in curves])
            counts = np.array(counts_of(trials, key))
            assert len(rows) == counts.max() + 1
            trial = median_trial(counts) if median else 0
            assert set(rows["trial"]) == {trial}
            np.testing.assert_allclose(rows["error"], every[trial], rtol=1e-9)
            columns = rows[["quartile_1", "median", "quartile_3"]].to_numpy().T
            np.testing.assert_allclose(
                columns, np.quantile(every, [0.25, 0.5, 0.75], axis=0), rtol=1e-9
            )
            assert (rows["paper"] == 47).all() == (key[0] == "unified")


def test_iterations_are_those_of_the_trials(conditions: Conditions, trials: pd.DataFrame) -> None:
    """Every trial has a row with its count, how many are like it, our mean and the paper's."""
    numbers = iterations(trials, {"unified": TABLE_1["unified"]}).numbers
    for key in conditions:
        rows, counts = rows_of(numbers, key), counts_of(trials, key)
        assert rows["iterations"].tolist() == counts
        assert rows["trials_alike"].tolist() == [counts.count(n) for n in counts]
        assert set(rows["mean"]) == {np.mean(counts)}
        assert (rows["paper"] == 40.1).all() == (key[0] == "unified")


@pytest.mark.parametrize(
    ("methods", "titles"),
    [(["adaboost", "unified"], PANELS[:2]), (["adaboost", "unified", "unified-incorrect"], PANELS)],
)
def test_each_reading_has_a_panel_with_all_that_counts_in_it(
    methods: list[str], titles: list[str], trials: pd.DataFrame
) -> None:
    """AdaBoost-IRL is in every panel; the printed trials count as those with the maximum at once.

    A set of incorrect demonstrations has a line of its own.
    """
    panels = draw_iterations(iterations(trials[trials["method"].isin(methods)], {}).numbers).axes[
        ::2
    ]
    assert [panel.get_title(loc="left") for panel in panels] == titles
    for panel, reading in zip(panels, ("printed", "updated", "at-once"), strict=False):
        trace = "printed" if reading == "at-once" else reading
        due = {
            (METHODS["adaboost"].colour, False): ("adaboost", "", NONE),
            (METHODS["unified"].colour, False): ("unified", trace, NONE),
            (METHODS["unified-incorrect"].colour, True): ("unified-incorrect", reading, NAMED),
            (LISTED, True): ("unified-incorrect", reading, GENERAL),
        }
        drawn = {look: [y for _, y in line] for look, line in lines_of(panel).items()}
        assert drawn == {
            look: counts_of(trials, key) for look, key in due.items() if key[0] in methods
        }


def test_the_errors_of_each_panel_are_those_of_its_reading(trials: pd.DataFrame) -> None:
    """The drawn lines are those of the file, each up to its first zero, where a dot stands."""
    numbers = errors(trials, {}).numbers
    figure = draw_errors(numbers)
    assert [panel.get_title() for panel in figure.axes] == PANELS
    for panel, reading in zip(figure.axes, ("printed", "updated", "at-once"), strict=True):
        own = rows_of(numbers, ("unified-incorrect", reading, GENERAL))
        end = int(np.argmax(own["error"].to_numpy() <= 0))
        drawn = lines_of(panel)[LISTED, True]
        assert [y for _, y in drawn] == own["error"].tolist()[: end + 1]
        dots = [line for line in panel.lines if line.get_marker() == "o"]
        ends = [float(np.asarray(dot.get_xdata())[0]) for dot in dots if dot.get_color() == LISTED]
        assert ends == [end]


def test_the_legend_names_what_is_drawn(trials: pd.DataFrame) -> None:
    """Each line has an entry in its own colour and dashes, once, whatever the number of panels."""
    labels = [
        "AdaBoost-IRL (R1)",
        "Unified, without incorrect",
        "Unified, with incorrect (named kinds)",
        "Unified, with incorrect (general list)",
    ]
    pictures = errors(trials, {}), iterations(trials, {})
    for figure in (picture.draw(picture.numbers) for picture in pictures):
        (legend,) = figure.legends
        texts = [text.get_text() for text in legend.get_texts()]
        assert texts[: len(labels)] == labels
        looks = [(line.get_color(), line.is_dashed()) for line in legend.get_lines()]
        assert set(lines_of(figure.axes[0])) <= set(looks)


def test_dots_that_end_together_are_all_seen() -> None:
    """Where two curves reach zero at once, the dot that is drawn first shows around the other."""
    two = pd.concat([ERRORS, ERRORS.assign(method="unified-incorrect", set=NAMED)])
    (panel,) = draw_errors(two).axes
    sizes = [line.get_markersize() for line in panel.lines if line.get_marker() == "o"]
    assert sizes == sorted(sizes, reverse=True)
    assert len(set(sizes)) == 2


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
        places = [np.asarray(line.get_xydata()).tolist() for line in figure.axes[0].lines]
        assert places.count([[9.0, 0.0]]) == marks


def test_iterations_are_drawn_as_given() -> None:
    """Fig. 6 shows every trial's count, unsmoothed, and the mean beside it."""
    left, right = draw_iterations(COUNTS).axes
    np.testing.assert_array_equal(left.lines[0].get_ydata(), [44, 40, 44])
    assert [line.get_ydata()[0] for line in right.lines] == [128 / 3, 42.0]  # type: ignore[index]
    bars = {bar.get_y() + bar.get_height() / 2: bar.get_width() for bar in right.patches}  # type: ignore[attr-defined]
    assert bars == pytest.approx({40: 0.42, 44: 0.84})


def test_more_trials_than_the_papers_are_in_the_distribution_alone() -> None:
    """The lines show as many trials as the paper has; the bars count all of them."""
    many = pd.DataFrame({"trial": range(250), "iterations": [40, 41] * 125}).assign(
        reading="printed", method="unified", set=NONE, trials_alike=125, mean=40.5, paper=np.nan
    )
    left, right = draw_iterations(many).axes
    assert len(np.asarray(left.lines[0].get_xdata())) == 100
    assert left.get_xlim() == (-0.5, 99.5)
    assert len(right.patches) == 2


def test_the_papers_mean_is_not_cut_off() -> None:
    """A published mean above all of our trials is drawn whole."""
    _, right = draw_iterations(COUNTS.assign(paper=80.0)).axes
    (mark,) = (line for line in right.lines if line.get_marker() == "v")
    assert not mark.get_clip_on()
    assert right.get_ylim()[1] > 80


def test_savings_are_to_scale() -> None:
    """A dot stands at what a set saves, on its interval, in the panel of each reading."""
    figure = draw_sets(SAVED)
    for panel, (_, own) in zip(figure.axes, SAVED.groupby("reading", sort=False), strict=True):
        (dots,) = (line for line in panel.lines if line.get_marker() == "o")
        assert np.asarray(dots.get_xdata()).tolist() == own["saved"].tolist()
        segments = panel.collections[0].get_segments()  # type: ignore[attr-defined]
        ends = [segment[:, 0].tolist() for segment in segments]
        assert ends == own[["low", "high"]].to_numpy().tolist()
        heights = [float(segment[0, 1]) for segment in segments]
        assert heights == np.asarray(dots.get_ydata()).tolist()
    left, right = figure.axes
    assert [panel.get_title() for panel in (left, right)] == PANELS[:2]
    assert [label.get_text() for label in left.get_yticklabels()] == ["hit  (7)", "opposite  (30)"]
    assert left.yaxis_inverted()
    assert "hit, Fᵢ (printed): 2.0 (-0.5 to 3.0)" in sets(SAVED).words


def test_words_hold_the_numbers(trials: pd.DataFrame) -> None:
    """The alternative texts give when half of the trials are at zero, and the means."""
    one = rows_of(trials, ("unified-incorrect", "updated", GENERAL))
    name = "Unified, with incorrect (general list), Fᵢ₊₁ (updated)"
    below = (np.median(error_histories(one), axis=0) > 0).sum()
    words = errors(one, {}).words
    assert f"{name}: half of the trials are at zero after {below} iterations" in words
    assert f"{name}: {one['iterations'].mean():.1f} on average" in iterations(one, {}).words
