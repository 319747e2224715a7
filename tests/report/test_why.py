from __future__ import annotations

import itertools

import numpy as np
import pandas as pd
import pytest
from matplotlib.collections import LineCollection
from matplotlib.colors import to_hex
from matplotlib.figure import Figure

from replication import Demos
from replication.envs.maze import as_maze
from replication.evidence.experiments import NONE, Key
from replication.irl import Trial
from replication.report.drawing import READING_MARKS
from replication.report.maze import places
from replication.report.picture import Picture
from replication.report.why import ALONE, MARKED, why
from replication.trials.condition import Condition
from replication.trials.results import Results
from tests.report.legible import assert_legible

KINDS = pd.DataFrame(
    [
        (reading, kind, share)
        for reading, shares in (("printed", (0.0, 0.22, 0.51)), ("updated", (0.01, 0.25, 0.53)))
        for kind, share in zip(("hit", "detour", "opposite"), shares, strict=True)
    ],
    columns=["reading", "kind", "weight"],
).assign(share=0.9)
SAVED = pd.DataFrame(
    [
        (set, reading, saved, saved - 1, saved + 2)
        for set, first in zip(("near-detour", *ALONE), (9, 0, 1, 4, 2, 6), strict=True)
        for reading, saved in (("printed", first), ("updated", first + 0.5), ("at-once", -first))
    ],
    columns=["set", "reading", "saved", "low", "high"],
)


@pytest.fixture(scope="module")
def trial(conditions: dict[Key, Condition], results: Results) -> Trial:
    """Return the trial whose trajectory is drawn."""
    return results.trial(conditions["unified", "printed", NONE], 0, snapshots=True)


@pytest.fixture(scope="module")
def picture(trial: Trial, small_demos: Demos) -> Picture:
    """Make the picture."""
    return why(KINDS, SAVED, {("unified", "printed", NONE): trial}, small_demos)


@pytest.fixture(scope="module")
def figure(picture: Picture) -> Figure:
    """Draw it."""
    return picture.draw(picture.numbers)


def test_the_walk_is_that_after_the_first_update(
    picture: Picture, figure: Figure, trial: Trial, small_demos: Demos
) -> None:
    """On the map are the expert's path and each move of the agent, with how often it is made."""
    maze = as_maze(small_demos.environment)
    path = np.asarray(figure.axes[0].lines[-1 - _bumps(picture)].get_xydata())
    np.testing.assert_allclose(path.T, places(maze, small_demos.correct[0].states))
    episode = trial.episodes[1]
    moves = picture.numbers[picture.numbers["part"] == "move"]
    assert moves["count"].sum() == len(episode.actions)
    pairs = {*zip(episode.states[:-1].tolist(), episode.actions.tolist(), strict=True)}
    assert len(moves) == len(pairs)
    correct = moves[moves["kind"] == "correct"]
    steps = itertools.pairwise(zip(*places(maze, small_demos.correct[0].states), strict=True))
    expert = {(*start, *end) for start, end in steps}
    shown = correct[["x", "y", "to_x", "to_y"]].itertuples(index=False, name=None)
    assert set(shown) <= expert


def _bumps(picture: Picture) -> int:
    moves = picture.numbers[picture.numbers["part"] == "move"]
    return int(((moves["x"] == moves["to_x"]) & (moves["y"] == moves["to_y"])).sum())


def test_the_walk_is_in_view(picture: Picture, figure: Figure) -> None:
    """The part of the map that is shown has every cell of the walk, and ends within the map."""
    moves = picture.numbers[picture.numbers["part"] == "move"]
    for name, size in (("x", 7), ("y", 6)):
        low, high = getattr(figure.axes[0], f"get_{name}lim")()
        both = moves[[name, f"to_{name}"]]
        assert low < both.min(axis=None)
        assert both.max(axis=None) < high
        assert -0.5 <= low < high <= size - 0.5


def test_bars_are_the_shares(figure: Figure) -> None:
    """Each kind has a bar for each reading: its share of what goes wrong, also as a number."""
    panel = figure.axes[1]
    bars = panel.containers
    for container, (reading, own) in zip(bars, KINDS.groupby("reading", sort=False), strict=True):
        assert [bar.get_width() for bar in container] == pytest.approx(100 * own["weight"])
        heights = [bar.get_y() + bar.get_height() / 2 for bar in container]
        assert np.round(heights).tolist() == [0, 1, 2]
        colours = {to_hex(bar.get_facecolor()[:3]) for bar in container}
        assert colours == {READING_MARKS[str(reading)][1].lower()}
    shown = [float(text.get_text()) for text in panel.texts]
    assert shown == pytest.approx(100 * KINDS["weight"])
    names = [label.get_text() for label in panel.get_yticklabels()]
    assert names == ["hit", "detour", "opposite"]
    assert panel.yaxis_inverted()
    assert panel.get_xlim()[1] > 53


def test_savings_stand_at_their_values(figure: Figure) -> None:
    """Each set that stands for itself or is judged has its saving and interval by reading."""
    panel = figure.axes[2]
    dots = [line for line in panel.lines if line.get_marker() in ("o", "s", "D")]
    spans = [one for one in panel.collections if isinstance(one, LineCollection)]
    shown = SAVED[SAVED["set"] != "near-detour"]
    for dot, span, (reading, own) in zip(
        dots, spans, shown.groupby("reading", sort=False), strict=True
    ):
        assert (dot.get_marker(), dot.get_color()) == READING_MARKS[str(reading)]
        assert np.asarray(dot.get_xdata()).tolist() == own["saved"].tolist()
        assert np.round(np.asarray(dot.get_ydata())).tolist() == [0, 1, 2, 3, 4]
        ends = [np.asarray(segment)[:, 0].tolist() for segment in span.get_segments()]
        assert ends == own[["low", "high"]].to_numpy().tolist()
    labels = [label.get_text() for label in panel.get_yticklabels()]
    assert labels == ["hit", "detour", "opposite", "named kinds", "general list"]
    assert panel.yaxis_inverted()


def test_texts_are_legible(figure: Figure) -> None:
    """Numbers beside bars, labels and the legend have room."""
    assert_legible(figure)


def test_the_legend_names_moves_and_readings(picture: Picture, figure: Figure) -> None:
    """Who sees the map or a mark finds in the legend what it is, and how many moves there are."""
    (legend,) = figure.legends
    labels = [text.get_text() for text in legend.get_texts()]
    moves = picture.numbers[picture.numbers["part"] == "move"]
    counts = moves.groupby("kind")["count"].sum()
    named = [f"{text}: {counts[kind]:.0f} moves" for kind, text in MARKED.items() if kind in counts]
    readings = ["Fᵢ (printed)", "Fᵢ₊₁ (updated)", "Fᵢ, maximum at once"]
    assert labels == ["the expert's path", *named, *readings]
    assert len(named) > 1


def test_words_have_the_shares(picture: Picture, trial: Trial) -> None:
    """Who does not see the picture reads how long the loop is, and the share of each kind."""
    episode = trial.episodes[1]
    cells = len(np.unique(episode.states))
    assert f"walks {cells} cells of the map in {len(episode.actions)} moves" in picture.words
    assert "opposite, Fᵢ (printed): 51%" in picture.words
    assert "hit, Fᵢ₊₁ (updated): 1%" in picture.words
