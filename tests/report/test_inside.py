from __future__ import annotations

from replication.evidence.comparison import noise_table, start_table
from replication.report.inside import beginning, noise, readable_noise
from tests.evidence.test_comparison import TRIALS
from tests.report.legible import assert_legible

NOISE, START = noise_table(TRIALS), start_table(TRIALS)


def test_every_trial_is_a_point() -> None:
    """Both mazes have a point for each trial of each method and solver, and a mean."""
    picture = noise(NOISE)
    figure = picture.draw(picture.numbers)
    assert_legible(figure)
    for panel, (_, own) in zip(figure.axes, NOISE.groupby("task", sort=False), strict=True):
        points = [len(line.get_xdata()) for line in panel.lines]  # type: ignore[arg-type]
        assert points == list(own["n"].repeat(2))


def test_its_table_says_the_same() -> None:
    """Mean, SD and difference of the first row, by hand."""
    (row, *_) = NOISE.itertuples()
    table = readable_noise(NOISE)
    assert table["Q-learning: mean (SD)"][0] == f"{row.learned:.1f} ({row.learned_sd:.1f})"
    assert table["Difference [95 %]"][0].startswith(f"{row.noise:.2f} [")


def test_the_beginning_is_drawn() -> None:
    """A curve for each method, legible, and its words have the numbers."""
    picture = beginning(START)
    figure = picture.draw(picture.numbers)
    assert_legible(figure)
    assert len(figure.axes[0].lines) == START["method"].nunique()
    row = next(START.itertuples())
    assert f"{row.errors:.1f} erroneous motions" in picture.words
