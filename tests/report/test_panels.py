from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from replication import Demos, Params
from replication.envs.maze import as_maze
from replication.evidence.experiments import method_conditions
from replication.report.figures import Counts, Curves
from replication.report.panels import (
    demo_numbers,
    describe_demos,
    describe_errors,
    describe_iterations,
    describe_sets,
    describe_surfaces,
    error_numbers,
    error_panels,
    iteration_numbers,
    iteration_panels,
    set_panels,
    surface_numbers,
    surfaces,
)
from replication.trials.compute import TRACED_TRIAL
from replication.trials.condition import Condition
from replication.trials.measures import Report
from replication.trials.results import Results
from replication.trials.run import run_trials
from replication.trials.store import Store

FEW = {"episodes": 100, "horizon": 40}


@pytest.fixture(scope="module")
def results(small_demos: Demos, tmp_path_factory: pytest.TempPathFactory) -> Results:
    """Run a few trials of every method."""
    store = Store(tmp_path_factory.mktemp("panels") / "trials.sqlite")
    conditions = list(method_conditions(small_demos, FEW).values())
    return run_trials(conditions, trials=4, store=store, seed=2)


def test_panels_hold_the_trials_of_their_reading(small_demos: Demos, results: Results) -> None:
    """Each panel has the curves and counts of one reading; AdaBoost-IRL stands in both."""
    conditions = method_conditions(small_demos, FEW)
    names = ["adaboost", "unified"]
    errors = error_panels(results, conditions, names, {"unified": 47})
    counts = iteration_panels(results, conditions, names, {"unified": 40.1})
    for (f, curves), numbers in zip(errors.items(), counts.values(), strict=True):
        reading = "printed" if "printed" in f else "updated"
        keys = [("adaboost", ""), ("unified", reading)]
        for key, one, count in zip(keys, curves, numbers, strict=True):
            np.testing.assert_array_equal(one.errors, results.errors(conditions[key]))
            np.testing.assert_array_equal(count.iterations, results.iterations(conditions[key]))
        assert [one.published for one in curves] == [None, 47]
        assert [one.published for one in numbers] == [None, 40.1]


def test_numbers_are_what_is_drawn(small_demos: Demos, results: Results) -> None:
    """The stored numbers have a row for each point, and the median lies between the quartiles."""
    conditions = method_conditions(small_demos, FEW)
    errors = error_panels(results, conditions, ["unified"], {})
    table = error_numbers(errors)
    assert len(table) == sum(one.errors.shape[1] for each in errors.values() for one in each)
    assert (table["quartile_1"] <= table["median"]).all()
    assert (table["median"] <= table["quartile_3"]).all()
    counts = iteration_panels(results, conditions, ["unified"], {})
    assert len(iteration_numbers(counts)) == 2 * results.trials


def test_surfaces_are_those_of_the_traced_trial(small_demos: Demos, results: Results) -> None:
    """Fig. 7: the best or mean action of Q half-way, Q at the end, and the reward at the end."""
    condition = Condition(small_demos, "unified", Params.of(**FEW))
    trial = results.trial(condition, TRACED_TRIAL, snapshots=True)
    assert trial.snapshots is not None
    best = list(surfaces(trial, Report()).values())
    middle = round(trial.iterations / 2)
    np.testing.assert_array_equal(best[0], trial.snapshots.q[middle].max(axis=1))
    np.testing.assert_array_equal(best[1], trial.q.max(axis=1))
    np.testing.assert_array_equal(best[2], trial.weights.max(axis=1))
    mean = list(surfaces(trial, Report(surface="mean")).values())
    np.testing.assert_array_equal(mean[1], trial.q.mean(axis=1))


def test_cells_count_from_the_lower_left(small_demos: Demos) -> None:
    """In the numbers, as in the figures, x goes right and y goes up; obstacles are left out."""
    maze = as_maze(small_demos.environment)
    table = surface_numbers(maze, {"state": np.arange(maze.n_states, dtype=float)})
    assert len(table) == maze.free.sum()
    start = table[table["state"] == maze.start].iloc[0]
    assert (start["x"], start["y"]) == (1, 1)
    first = demo_numbers(small_demos).iloc[0]
    assert (first["x"], first["y"], first["step"], first["kind"]) == (1, 1, 0, "correct")


def test_demo_numbers_have_a_row_for_each_visit(small_demos: Demos) -> None:
    """Every state of every demonstration is there once."""
    demos = (*small_demos.correct, *small_demos.incorrect)
    assert len(demo_numbers(small_demos)) == sum(len(demo.states) for demo in demos)


def test_saved_is_the_negative_difference() -> None:
    """What a set saves is positive where its difference is negative, with the interval turned."""
    table = pd.DataFrame(
        {
            "set": ["none", "hit"],
            "F": "printed",
            "leaving": [0, 7],
            "difference": [0.0, -2.0],
            "low": [0.0, -3.0],
            "high": [0.0, 0.5],
        }
    )
    (panel,) = set_panels(table).values()
    assert panel[["set", "saved", "low", "high"]].to_numpy().tolist() == [["hit", 2.0, -0.5, 3.0]]
    assert "2.0 (-0.5 to 3.0)" in describe_sets({"left": panel})


def test_descriptions_say_the_finding(small_demos: Demos) -> None:
    """The alternative texts hold the numbers that the figures show."""
    curves = Curves("A", "k", np.array([[2.0, 1.0, 0.0], [1.0, 0.5, 0.0]]))
    assert "zero after 2 iterations" in describe_errors({"left": [curves]})
    counts = Counts("A", "k", np.array([40, 41]))
    assert "A, left: 40.5 on average" in describe_iterations({"left": [counts]})
    assert "Q: -1 to 2" in describe_surfaces({"Q": np.array([-1.0, 2.0])})
    moves = len(small_demos.correct[0].actions)
    hits = small_demos.select("hit")
    text = describe_demos(hits)
    assert f"{moves} moves" in text
    assert f"{len(hits.incorrect)} hit" in text


def test_outputs_show_what_they_write(tmp_path: Path, small_demos: Demos) -> None:
    """A figure comes with its numbers and an alternative text, a table with its full precision."""
    from replication.report.figures import maze_figure
    from replication.report.outputs import Outputs

    shown = Outputs(tmp_path / "out")
    image = shown.figure(
        maze_figure(small_demos), "map", numbers=demo_numbers(small_demos), alt="A map."
    )
    table = pd.DataFrame({"x": [1 / 3]})
    text = shown.table(table, "numbers", readable=pd.DataFrame({"x": ["0.33"]}))
    assert image.alt == "A map."
    assert image.data == (tmp_path / "out" / "map.png").read_bytes()
    assert text.data == (tmp_path / "out" / "numbers.md").read_text(encoding="utf-8")
    assert (tmp_path / "out" / "numbers.csv").read_text(encoding="utf-8") == "x\n0.3333333333\n"
    assert {path.name for path in (tmp_path / "out").iterdir()} == {
        "map.png",
        "map.svg",
        "map.csv",
        "numbers.csv",
        "numbers.md",
    }
