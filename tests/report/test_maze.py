from __future__ import annotations

import numpy as np
import pytest

from replication import Demos
from replication.envs.maze import MazeError, as_maze
from replication.envs.soccer.field import SoccerField
from replication.evidence.experiments import NONE, Key
from replication.irl import Trial
from replication.report.maze import demonstrations, draw_surfaces, map_numbers, surfaces
from replication.trials.condition import Condition
from replication.trials.measures import Report
from replication.trials.results import Results


@pytest.fixture
def trial(conditions: dict[Key, Condition], results: Results) -> Trial:
    """Return a trial of the unified method that kept every iteration."""
    return results.trial(conditions["unified", "printed", NONE], 0, snapshots=True)


def test_surfaces_are_those_of_the_traced_trial(small_demos: Demos, trial: Trial) -> None:
    """Fig. 7: the best or mean action of Q half-way, Q at the end, and the reward at the end."""
    assert trial.snapshots is not None
    free = as_maze(small_demos.environment).free
    middle, end = round(trial.iterations / 2), trial.iterations
    tables = {"q_mid": trial.snapshots.q[middle], "q_end": trial.q, "reward_end": trial.weights}
    for report, reduce in ((Report(), np.max), (Report(surface="mean"), np.mean)):
        numbers = surfaces(trial, small_demos.environment, report).numbers
        assert numbers["surface"].unique().tolist() == list(tables)
        for name, table in tables.items():
            values = numbers[numbers["surface"] == name]["value"].to_numpy()
            np.testing.assert_array_equal(values[free], reduce(table, axis=1)[free])
            assert np.isnan(values[~free]).all()
        first = numbers.groupby("surface", sort=False)["iteration"].first()
        assert first.tolist() == [middle, end, end]


def test_surfaces_are_named_in_words_and_titles(small_demos: Demos, trial: Trial) -> None:
    """Titles say after how many iterations, the words also between which values."""
    picture = surfaces(trial, small_demos.environment, Report())
    titles = [panel.get_title() for panel in draw_surfaces(picture.numbers).axes]
    assert titles[1] == f"(b) Q at the end ({trial.iterations})"
    values = picture.numbers.groupby("surface")["value"].agg(["min", "max"]).loc["q_end"]
    assert f"{titles[1]}: {values['min']:.3g} to {values['max']:.3g}" in picture.words


def test_map_by_hand(small_demos: Demos) -> None:
    """A map's rows are its corner, start, goal and obstacles; x goes right and y goes up."""
    rows = map_numbers(as_maze(small_demos.environment))[["kind", "x", "y"]]
    cells = [("corner", 6, 5), ("start", 1, 1), ("goal", 5, 4), ("obstacle", 3, 3)]
    assert list(rows.itertuples(index=False, name=None)) == cells


def test_every_visit_has_a_row(small_demos: Demos) -> None:
    """Every state of every demonstration is there once, beside the map, from the start on."""
    demos = (*small_demos.correct, *small_demos.incorrect)
    numbers = demonstrations(small_demos).numbers
    shown = numbers[numbers["part"] != "map"]
    assert len(shown) == sum(len(demo.states) for demo in demos)
    assert shown["demo"].unique().tolist() == [demo.name for demo in demos]
    first = shown.iloc[0][["part", "kind", "step", "x", "y"]]
    assert first.tolist() == ["correct", "correct", 0, 1, 1]


def test_words_count_the_demonstrations(small_demos: Demos) -> None:
    """The words give the moves of the correct demonstration, and the incorrect ones by kind."""
    hits = small_demos.select("hit")
    words = demonstrations(hits).words
    assert f"{len(small_demos.correct[0].actions)} moves" in words
    assert f"{len(hits.incorrect)} hit" in words


def test_soccer_is_refused(trial: Trial) -> None:
    """What is no maze is refused in a line."""
    with pytest.raises(MazeError, match="a maze is needed"):
        surfaces(trial, SoccerField(), Report())
