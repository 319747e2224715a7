from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from matplotlib.figure import Figure
from numpy.typing import NDArray

from replication import Demos
from replication.envs.maze import MazeError, as_maze
from replication.evidence.experiments import NONE, Key
from replication.evidence.tables import read_table, write_csv
from replication.irl import Trial
from replication.report.picture import Picture
from replication.report.value_panels import grid_of
from replication.report.values import map_values, values
from replication.trials.condition import Condition
from replication.trials.measures import Report, measure_trials
from replication.trials.results import Results
from tests.report.legible import assert_legible

READINGS = ["printed", "updated"]


@pytest.fixture(scope="module")
def trial(conditions: dict[Key, Condition], results: Results) -> Trial:
    """Return a trial of the unified method that kept every iteration."""
    return results.trial(conditions["unified", "printed", NONE], 0, snapshots=True)


@pytest.fixture(scope="module")
def rows(conditions: dict[Key, Condition], results: Results) -> pd.DataFrame:
    """Return the table of the unified method's trials, with Q along the path."""
    own = [conditions["unified", reading, NONE] for reading in READINGS]
    return measure_trials(results, own, path=True)


@pytest.fixture(scope="module")
def picture(trial: Trial, rows: pd.DataFrame, small_demos: Demos) -> Picture:
    """Make the picture."""
    return values(trial, small_demos, Report(), rows)


@pytest.fixture(scope="module")
def figure(picture: Picture) -> Figure:
    """Draw it."""
    return picture.draw(picture.numbers)


def test_maps_are_those_of_the_traced_trial(small_demos: Demos, trial: Trial) -> None:
    """Fig. 7: the best or mean action of Q half-way, Q at the end, and the reward at the end."""
    assert trial.snapshots is not None
    maze = as_maze(small_demos.environment)
    middle, end = round(trial.iterations / 2), trial.iterations
    tables = {"q_mid": trial.snapshots.q[middle], "q_end": trial.q, "reward_end": trial.weights}
    for report, reduce in ((Report(), np.max), (Report(surface="mean"), np.mean)):
        numbers = map_values(trial, maze, report)
        assert numbers["surface"].unique().tolist() == list(tables)
        for name, table in tables.items():
            shown = numbers[numbers["surface"] == name]["value"].to_numpy()
            np.testing.assert_allclose(
                shown[maze.free], reduce(table, axis=1)[maze.free], atol=1e-8
            )
            assert np.isnan(shown[~maze.free]).all()
        first = numbers.groupby("surface", sort=False)["iteration"].first()
        assert first.tolist() == [middle, end, end]


def test_dust_of_rounding_is_zero(small_demos: Demos, trial: Trial) -> None:
    """What is left of a sum that is zero on paper is shown as zero, and without a minus."""
    weights = np.zeros_like(trial.weights)
    weights[0, :], weights[1, :] = 2.0, -8.67e-20
    dusty = Trial(**{**vars(trial), "weights": weights})
    numbers = map_values(dusty, as_maze(small_demos.environment), Report())
    reward = numbers[numbers["surface"] == "reward_end"]["value"].dropna()
    assert sorted(set(reward)) == [0.0, 2.0]


def test_q_has_one_scale(figure: Figure, picture: Picture) -> None:
    """(a) and (b) share their colours, (c) is their difference, with white at zero."""
    images = [panel.images[0] for panel in figure.axes[:4]]
    assert images[0].get_clim() == images[1].get_clim()
    low, high = images[2].get_clim()
    assert low == -high
    middle, end = (grid_of(picture.numbers, name) for name in ("q_mid", "q_end"))
    shown: NDArray[np.float64] = np.ma.asarray(images[2].get_array()).filled(np.nan)
    np.testing.assert_array_equal(shown, end - middle)
    bars = [panel.get_xlabel() for panel in figure.axes[4:7]]
    assert bars == ["Q of a cell, in (a) and (b)", "change of Q", "reward weight"]


def test_maps_have_the_experts_path(figure: Figure, small_demos: Demos) -> None:
    """Each map has the path of the expert on top."""
    length = len(small_demos.correct[0].states)
    for panel in figure.axes[:4]:
        (line,) = panel.lines
        assert len(np.asarray(line.get_xydata())) == length


def test_along_the_path_all_trials_count(picture: Picture, rows: pd.DataFrame) -> None:
    """The growth along the path is the mean of all trials, and its mean is what is judged."""
    numbers = picture.numbers
    for reading in READINGS:
        own = rows[rows["reading"] == reading]
        part = numbers[numbers["reading"] == reading].groupby("surface")["value"]
        growth = own["q_growth"].mean()
        size = np.abs(part.get_group("along_growth")).max()
        assert part.get_group("growth").item() == pytest.approx(growth, abs=0.01 * size)
        levels = [part.get_group(name).to_numpy() for name in ("along_mid", "along_end")]
        due = part.get_group("along_growth").to_numpy()
        np.testing.assert_allclose(levels[1] - levels[0], due, atol=1e-9)
    assert set(numbers["n"].dropna()) == {4}


def test_a_table_of_one_trial_is_drawn(
    trial: Trial, rows: pd.DataFrame, small_demos: Demos
) -> None:
    """Without a spread there are lines without bands."""
    one = values(trial, small_demos, Report(), rows[rows["trial"] == 0])
    numbers = one.numbers[one.numbers["surface"] == "along_growth"]
    assert (numbers["low"] == numbers["high"]).all()
    assert np.isfinite(one.draw(one.numbers).axes[-4].get_ylim()).all()


def test_texts_are_legible(picture: Picture, figure: Figure, tmp_path: Path) -> None:
    """Titles, bars, means and legends have room, as drawn from the file as well."""
    again = picture.draw(read_table(write_csv(picture.numbers, tmp_path / "v.csv")))
    for each in (figure, again):
        each.draw_without_rendering()  # which applies the aspect
        assert_legible(each)


def test_words_have_the_numbers(picture: Picture, trial: Trial) -> None:
    """The words say between which values the maps lie, and what is judged with its interval."""
    assert f"of {trial.iterations} iterations" in picture.words
    assert "4 trials with its 95 % interval" in picture.words
    assert "under Fᵢ (printed)" in picture.words
    assert "e-" not in picture.words


def test_soccer_is_refused(trial: Trial, rows: pd.DataFrame, soccer_demos: Demos) -> None:
    """What is no maze is refused in a line."""
    with pytest.raises(MazeError, match="a maze is needed"):
        values(trial, soccer_demos, Report(), rows)
