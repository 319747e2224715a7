from __future__ import annotations

import warnings
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray
from scipy import stats

from replication import Demos, Params, load_demos
from replication.envs.maze import as_maze
from replication.evidence.experiments import EXPERIMENTS, method_conditions
from replication.evidence.tables import read_table, write_csv
from replication.files import resolve
from replication.irl import Trial
from replication.irl.agent import Episode
from replication.trials.condition import Condition
from replication.trials.measures import (
    Report,
    early_errors,
    early_iterations,
    error_histories,
    marked_pairs,
    measure,
    measure_trials,
    shown_demos,
    slope,
)
from replication.trials.results import Results, digest
from replication.trials.run import run_trials
from replication.trials.store import Store

FEW = {"episodes": 100, "horizon": 40}
NAMES = ["iterations", "converged", "early_errors", "q_growth", "q_slope", "reward_slope"]


def episode(*moves: tuple[int, int, bool]) -> Episode:
    """Make an episode of states, actions and whether each move ran into something."""
    states, actions, hits = (np.array(column) for column in zip(*moves, strict=True))
    return Episode(np.append(states, 9), actions, hits.astype(bool))


def made(
    demos: Demos,
    *,
    iterations: int = 8,
    values: NDArray[np.floating] | None = None,
    weights: NDArray[np.float64] | None = None,
    episodes: tuple[Episode, ...] = (),
    converged: bool = True,
) -> Trial:
    """Make up a trial."""
    shape = demos.environment.n_states, demos.environment.n_actions
    moves = len(demos.correct[0].actions)
    blank = np.zeros((iterations + 1, moves)) if values is None else values
    return Trial(
        errors=np.linspace(1.0, 0.0, iterations + 1),
        converged=converged,
        steps=1,
        weights=np.zeros(shape) if weights is None else weights,
        q=np.zeros(shape),
        episodes=episodes,
        values=blank.astype(np.float32),
    )


# --- erroneous motions -----------------------------------------------------------------------


def test_early_errors_by_hand() -> None:
    """Hits and marked pairs count once each, after updates 1 to E only."""
    marked = np.zeros((10, 4), dtype=bool)
    marked[2, 1] = marked[3, 0] = True
    episodes = (
        episode((2, 1, True), (3, 0, True)),  # before the first update: not counted
        episode((1, 0, True), (2, 1, False), (2, 0, False)),  # a hit and a marked pair: 2
        episode((2, 1, True), (2, 1, False)),  # one motion that is both, and a marked pair: 2
        episode((4, 0, False)),  # none
        episode((3, 0, False), (3, 0, False)),  # the same pair twice: 2
    )
    demos = load_demos(resolve(EXPERIMENTS["open-maze"].demos))
    trial = made(demos, iterations=4, episodes=episodes)
    assert [early_errors(trial, marked, early) for early in (0, 1, 2, 3, 4, 10)] == [
        0,
        2,
        4,
        4,
        6,
        6,
    ]


def test_without_marked_pairs_only_hits_count(small_demos: Demos, results: Results) -> None:
    """Identity: with nothing marked, the measure is the number of hits in the trajectories."""
    for condition in results.conditions:
        trial = results.trial(condition, 1)
        nothing = np.zeros(trial.weights.shape, dtype=bool)
        due = sum(int(one.hits.sum()) for one in trial.episodes[1:11])
        assert early_errors(trial, nothing, 10) == due
        assert early_errors(trial, nothing, 10) <= early_errors(
            trial, marked_pairs(small_demos), 10
        )


def test_marked_pairs_are_those_of_no_correct_demonstration(small_demos: Demos) -> None:
    """A pair is marked if an incorrect demonstration takes it and no correct one does."""
    taken = {
        kind: {
            pair
            for demo in demos
            for pair in zip(demo.states.tolist(), demo.actions.tolist(), strict=False)
        }
        for kind, demos in (("no", small_demos.incorrect), ("yes", small_demos.correct))
    }
    found = {(int(s), int(a)) for s, a in np.argwhere(marked_pairs(small_demos))}
    assert found == taken["no"] - taken["yes"]
    assert not marked_pairs(small_demos.select("none")).any()


def test_every_method_is_measured_by_the_same_pairs(small_demos: Demos) -> None:
    """The method that is not shown incorrect demonstrations has its motions counted by them."""
    for kinds in ("hit+detour", "hit"):
        conditions = method_conditions(small_demos, {**FEW, "incorrect": kinds}).values()
        assert {condition.selected.incorrect for condition in conditions} == {
            (),
            small_demos.select(kinds).incorrect,
        }
        for condition in conditions:
            assert shown_demos(condition) == small_demos.select(kinds)


def test_initial_phase_is_the_first_quarter() -> None:
    """EARLY: 10 of the reported 40 iterations in the mazes, 4 of 15 in robot soccer."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        demos = {task: load_demos(resolve(one.demos)) for task, one in EXPERIMENTS.items()}
    found = {task: early_iterations(one, Report()) for task, one in demos.items()}
    assert found == {"open-maze": 10, "obstacle-maze": 10, "soccer": 4}
    assert early_iterations(demos["open-maze"], Report(early=0.1)) == 4
    assert early_iterations(demos["soccer"], Report(early=0.5)) == 8


# --- slopes ----------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("values", "due"),
    [
        ([1.0, 2.0, 30.0], 1.0),
        ([3.0, 2.5, -1.0], -1.0),
        ([2.0, 2.0, 2.0], 0.0),
        ([5.0], 0.0),
        ([1.0, 1.0, 2.0], 0.75**0.5),  # ranks 1.5, 1.5, 3 against 1, 2, 3
    ],
)
def test_slope_by_hand(values: list[float], due: float) -> None:
    """The rank correlation with the position: 1 if all grow, -1 if all fall, 0 if none does."""
    assert slope(np.array(values)) == pytest.approx(due)


@given(st.lists(st.integers(-5, 5), min_size=2, max_size=30))
def test_slope_is_spearmans(values: list[int]) -> None:
    """With any ties it is SciPy's coefficient, and 0 where that does not exist."""
    sample = np.array(values, dtype=float)
    if np.ptp(sample) == 0:
        assert slope(sample) == 0.0
    else:
        due = stats.spearmanr(np.arange(len(sample)), sample).statistic
        assert slope(sample) == pytest.approx(due)


# --- one trial -------------------------------------------------------------------------------


def test_values_are_read_along_the_path(small_demos: Demos) -> None:
    """Columns of values are states in ascending order; the slope is along the demonstration."""
    path = small_demos.correct[0].states[:-1]
    assert path.tolist() != sorted(path.tolist())
    steps = np.argsort(np.argsort(path))  # the column of the state of each step
    values = np.zeros((9, len(path)))
    values[-1, steps] = np.arange(len(path))  # Q grows with each step
    weights = np.zeros((small_demos.environment.n_states, 4))
    weights[path, 2] = -np.arange(len(path)) - 1.0  # and the best reward falls
    weights[path, :2] = weights[path, 3:] = -100.0
    trial = made(small_demos, values=values, weights=weights)
    found = measure(trial, small_demos, np.zeros((42, 4), dtype=bool), Report())
    assert found["q_slope"] == pytest.approx(1.0)
    assert found["reward_slope"] == pytest.approx(-1.0)
    assert list(found) == NAMES


@pytest.mark.parametrize(("mid_term", "middle"), [(0.25, 2), (0.5, 4), (0.75, 6)])
def test_growth_is_from_the_mid_term(small_demos: Demos, mid_term: float, middle: int) -> None:
    """FIG7-MIDTERM: the mean of the last values less that after the given share of updates."""
    moves = len(small_demos.correct[0].actions)
    values = np.random.default_rng(1).normal(size=(9, moves)).astype(np.float32)
    trial = made(small_demos, values=values)
    marked = np.zeros((42, 4), dtype=bool)
    found = measure(trial, small_demos, marked, Report(mid_term=mid_term))["q_growth"]
    assert found == pytest.approx(float(values[8].mean() - values[middle].mean()), abs=1e-6)


def test_states_that_other_demonstrations_add_are_left_out(small_demos: Demos) -> None:
    """With two correct demonstrations the values of the first one's path are the measured ones."""
    maze, first = as_maze(small_demos.environment), small_demos.correct[0]
    turned = np.array([*[0] * 3, *[2] * 4])
    other = replace(first, name="other", actions=turned, states=maze.replay(turned.tolist()))
    both = replace(small_demos, correct=(first, other))
    known = np.unique(np.concatenate([first.states[:-1], other.states[:-1]]))
    values = np.zeros((9, len(known)))
    values[-1] = np.isin(known, first.states)
    trial = made(small_demos, values=values)
    found = measure(trial, both, np.zeros((42, 4), dtype=bool), Report())
    assert found["q_growth"] == 1.0


def test_trial_at_the_cap_is_told(small_demos: Demos) -> None:
    """A trial that has not converged has its iterations and a zero."""
    trial = made(small_demos, iterations=5, converged=False)
    found = measure(trial, small_demos, np.zeros((42, 4), dtype=bool), Report())
    assert (found["iterations"], found["converged"]) == (5, 0)


# --- all trials ------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def results(small_demos: Demos, tmp_path_factory: pytest.TempPathFactory) -> Results:
    """Run a few trials of every method."""
    conditions = list(method_conditions(small_demos, FEW).values())
    store = Store(tmp_path_factory.mktemp("measures") / "trials.sqlite")
    return run_trials(conditions, trials=3, store=store, seed=2)


def test_there_is_a_row_for_each_trial_and_method(small_demos: Demos, results: Results) -> None:
    """Rows are keyed by task, method, reading, set and trial, and end with steps and digest."""
    conditions = method_conditions(small_demos, FEW)
    table = measure_trials(results, conditions.values())
    keys = ["task", "method", "reading", "set", "trial"]
    assert table.columns.tolist() == [*keys, "seed", *NAMES, "steps", "digest"]
    sets = {"adaboost": "none", "unified": "none", "unified-incorrect": "hit+detour"}
    expected = [("small", name, f, sets[name], k) for name, f in conditions for k in range(3)]
    assert list(table[keys].itertuples(index=False, name=None)) == expected
    assert set(table["seed"]) == {2}
    for (method, f), condition in conditions.items():
        rows = table[(table["method"] == method) & (table["reading"] == f)]
        trials = [results.trial(condition, k) for k in range(3)]
        assert rows["iterations"].tolist() == [trial.iterations for trial in trials]
        assert rows["converged"].tolist() == [int(trial.converged) for trial in trials]
        assert rows["steps"].tolist() == [trial.steps for trial in trials]
        assert rows["digest"].tolist() == [digest(trial) for trial in trials]
    assert set(table[table["method"] == "adaboost"]["reading"]) == {""}


def test_histories_are_read_back(small_demos: Demos, results: Results) -> None:
    """Each trial's errors are in its row, to ten digits; after its end it keeps its last one."""
    conditions = method_conditions(small_demos, FEW)
    table = measure_trials(results, conditions.values(), errors=True)
    trials = [results.trial(one, k) for one in conditions.values() for k in range(3)]
    histories = error_histories(table)
    assert histories.shape == (len(trials), max(trial.iterations for trial in trials) + 1)
    for row, trial in zip(histories, trials, strict=True):
        np.testing.assert_allclose(row[: trial.iterations + 1], trial.errors, rtol=1e-9)
        assert (row[trial.iterations :] == trial.errors[-1]).all()


def test_trials_survive_their_file(small_demos: Demos, results: Results, tmp_path: Path) -> None:
    """What is written to trials.csv reads back as the same table, bit by bit."""
    table = measure_trials(results, method_conditions(small_demos, FEW).values())
    read = read_table(write_csv(table, tmp_path / "trials.csv"))
    pd.testing.assert_frame_equal(table, read, check_dtype=False, check_exact=True)


def test_report_reaches_every_trial(small_demos: Demos, results: Results) -> None:
    """A longer initial phase has no fewer errors, and the growth is from the given mid-term."""
    conditions = method_conditions(small_demos, FEW)
    usual, other = (
        measure_trials(results, conditions.values(), report)
        for report in (None, Report(early=0.5, mid_term=0.75))
    )
    assert (other["early_errors"] >= usual["early_errors"]).all()
    assert (other["q_growth"] != usual["q_growth"]).any()
    same = [name for name in usual if name not in ("early_errors", "q_growth")]
    assert usual[same].equals(other[same])


def test_setting_without_demonstrations_counts_hits(small_demos: Demos, results: Results) -> None:
    """Where no incorrect demonstrations are chosen, the measured errors are hits alone."""
    condition = Condition(small_demos, "unified", Params.of(**FEW, incorrect="none"))
    own = measure_trials(results, [condition])
    for k, errors in enumerate(own["early_errors"]):
        episodes = results.trial(condition, k).episodes[1:11]
        assert errors == sum(int(one.hits.sum()) for one in episodes)
