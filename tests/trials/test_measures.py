from __future__ import annotations

import warnings
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest
from numpy.typing import NDArray

from replication import METHODS, Demos, Params, load_demos
from replication.envs.maze import as_maze
from replication.evidence.experiments import EXPERIMENTS, NONE, Key, conditions_of
from replication.evidence.tables import read_table, write_csv
from replication.files import resolve
from replication.irl import Trial
from replication.irl.agent import Episode
from replication.trials.condition import Condition
from replication.trials.measures import (
    ALONG,
    KINDS,
    Report,
    along_path,
    early_iterations,
    error_histories,
    factors,
    kind_pairs,
    marked_pairs,
    measure,
    measure_trials,
    numbers_in,
    planned_trials,
)
from replication.trials.results import Results, digest
from replication.trials.run import run_trials
from replication.trials.store import Store

FEW = {"episodes": 100, "horizon": 40}
OF_ALL = [
    *("iterations", "converged", "early_collisions", "early_errors"),
    *("q_growth", "reward_growth", "acted", "acted_at_first"),
    *("wrong_pairs", "wrong_visits"),
]
NAMES = [
    *OF_ALL,
    *(f"{what}_{kind}" for what in ("with", "visits") for kind in ("hit", "detour", "opposite")),
]


def episode(*moves: tuple[int, int, bool]) -> Episode:
    """Make an episode of states, actions and whether each move ran into something."""
    states, actions, hits = (np.array(column) for column in zip(*moves, strict=True))
    return Episode(np.append(states, 9), actions, hits.astype(bool))


def made(demos: Demos, *, iterations: int = 8, **parts: Any) -> Trial:
    """Make up a trial."""
    shape = demos.environment.n_states, demos.environment.n_actions
    blank = np.zeros((iterations + 1, len(demos.correct[0].actions)))
    usual: dict[str, Any] = {
        "errors": np.linspace(1.0, 0.0, iterations + 1),
        "converged": True,
        "steps": 1,
        "weights": np.zeros(shape),
        "q": np.zeros(shape),
        "episodes": (episode((0, 0, False)),) * (iterations + 1),
        "collisions": np.zeros(iterations, np.int64),
        "values": blank,
        "rewards": blank,
    }
    usual |= parts
    return Trial(**{**usual, **{f: usual[f].astype(np.float32) for f in ("values", "rewards")}})


def pairs_of(demos: Demos, *pairs: tuple[int, int]) -> NDArray[np.bool_]:
    """Return an array that is true at some pairs."""
    chosen = np.zeros((demos.environment.n_states, demos.environment.n_actions), dtype=bool)
    for pair in pairs:
        chosen[pair] = True
    return chosen


def measured(
    trial: Trial, demos: Demos, *shown: tuple[int, int], report: Report | None = None
) -> dict[str, float]:
    """Measure a made-up trial, given the pairs that its method was shown."""
    kinds = kind_pairs(demos)
    pairs = pairs_of(demos, *shown)
    return measure(trial, demos, kinds, pairs, report or Report(), gamma=0.5)


# --- the initial phase -----------------------------------------------------------------------


@pytest.mark.parametrize(("early", "expected"), [(0.1, 1111), (0.25, 1111111111), (0.5, 10**10)])
def test_early_collisions_by_hand(small_demos: Demos, early: float, expected: int) -> None:
    """Those of the first E learning calls are added up: of 4, 10 or 20 here of the mazes' 40."""
    powers = 10 ** np.arange(12)
    trial = made(small_demos, iterations=12, collisions=powers)
    found = measured(trial, small_demos, report=Report(early=early))["early_collisions"]
    assert found == (expected if early < 0.5 else powers.sum())


def test_early_errors_by_hand(small_demos: Demos) -> None:
    """Hits and marked pairs count once each, in the trajectories after updates 1 to E only."""
    wrong = [(int(s), int(a)) for s, a in np.argwhere(marked_pairs(small_demos))]
    (one, up), (two, down), *_ = wrong
    fine = next((s, a) for s in range(42) for a in range(4) if (s, a) not in wrong)
    episodes = (
        episode((one, up, True), (two, down, True)),  # before the first update: not counted
        episode((*fine, True), (one, up, False), (*fine, False)),  # a hit and a marked pair: 2
        episode((one, up, True), (two, down, False)),  # one that is both, and a marked pair: 2
        episode((*fine, False)),  # none
        episode((two, down, False), (two, down, False)),  # the same pair twice: 2
        episode((*fine, True)),  # after update 5, not counted if E is 4
    )
    trial = made(small_demos, iterations=5, episodes=episodes)
    assert measured(trial, small_demos, report=Report(early=0.1))["early_errors"] == 6
    assert measured(trial, small_demos)["early_errors"] == 7


def test_errors_are_by_all_stored_mistakes(small_demos: Demos) -> None:
    """Whatever a method was shown, motions are held against every stored demonstration."""
    wrong = [(int(s), int(a)) for s, a in np.argwhere(marked_pairs(small_demos))]
    episodes = (episode((0, 0, False)), *(episode((s, a, False)) for s, a in wrong[:8]))
    trial = made(small_demos, episodes=episodes)
    for shown in ((), tuple(wrong[:3]), tuple(wrong)):
        assert measured(trial, small_demos, *shown)["early_errors"] == 8
    alone = small_demos.select("none")
    assert measured(trial, alone)["early_errors"] == 0


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


def test_initial_phase_is_the_first_quarter() -> None:
    """EARLY: 10 of the reported 40 iterations in the mazes, 4 of 15 in robot soccer."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        demos = {task: load_demos(resolve(one.demos)) for task, one in EXPERIMENTS.items()}
    found = {task: early_iterations(one, Report()) for task, one in demos.items()}
    assert found == {"open-maze": 10, "obstacle-maze": 10, "soccer": 4}
    assert early_iterations(demos["open-maze"], Report(early=0.1)) == 4
    assert early_iterations(demos["soccer"], Report(early=0.5)) == 8


# --- where incorrect demonstrations act ------------------------------------------------------


def test_acted_by_hand(small_demos: Demos) -> None:
    """Pairs that the method was shown, once per trajectory; the first trajectory is apart."""
    shown = (3, 1), (5, 2)
    episodes = (
        episode((3, 1, False), (5, 2, True), (4, 0, False), (3, 1, False)),  # 2 pairs
        episode((3, 1, False), (3, 1, False)),  # 1
        episode((3, 0, False), (4, 1, False)),  # none: another action, another state
        episode((5, 2, True), (3, 1, True)),  # 2
    )
    trial = made(small_demos, iterations=3, episodes=episodes)
    found = measured(trial, small_demos, *shown)
    assert (found["acted_at_first"], found["acted"]) == (2, 3)
    found = measured(trial, small_demos)
    assert (found["acted_at_first"], found["acted"]) == (0, 0)


def test_kinds_are_counted_by_trajectory(small_demos: Demos) -> None:
    """with_<kind>: in how many trajectories after the first a pair is that this kind marks."""
    kinds = kind_pairs(small_demos)
    assert (
        list(kinds)
        == ["hit", "detour", "opposite"]
        == [kind for kind in KINDS if kind in small_demos.kinds]
    )
    for kind, pairs in kinds.items():
        np.testing.assert_array_equal(pairs, marked_pairs(small_demos.select(kind)))
    hits, turns = (
        [(int(s), int(a)) for s, a in np.argwhere(kinds[kind] & ~kinds[other])]
        for kind, other in (("hit", "opposite"), ("opposite", "hit"))
    )
    hit, opposite = (*hits[0], True), (*turns[0], False)
    assert not kinds["detour"][turns[0]]
    episodes = (
        episode(hit, opposite),  # a random walk: not counted
        episode(hit, hit),
        episode(hit, opposite),
        episode((41, 0, False)),
        episode(opposite),
        episode(opposite),
    )
    found = measured(made(small_demos, iterations=5, episodes=episodes), small_demos)
    assert (found["with_hit"], found["with_opposite"]) == (2, 3)
    assert found["with_detour"] == 2 * kinds["detour"][hits[0]]
    assert list(found) == NAMES


def test_visits_are_discounted_and_wrong_pairs_counted_once(small_demos: Demos) -> None:
    """Half of the weight of the move before, in each trajectory; what the expert does is right."""
    demo = small_demos.correct[0]
    right = (int(demo.states[0]), int(demo.actions[0]), False)
    (state, action), *_ = np.argwhere(kind_pairs(small_demos)["opposite"]).tolist()
    turn = (state, action, False)
    episodes = (episode(turn, turn), episode(right, turn, turn), episode(turn, turn))
    found = measured(made(small_demos, iterations=2, episodes=episodes), small_demos)
    assert (found["wrong_pairs"], found["with_opposite"]) == (2, 2)
    assert found["wrong_visits"] == found["visits_opposite"] == (0.5 + 0.25) + (1.0 + 0.5)


# --- growth ----------------------------------------------------------------------------------


@pytest.mark.parametrize(("mid_term", "middle"), [(0.25, 2), (0.5, 4), (0.75, 6)])
def test_growth_is_from_the_mid_term(small_demos: Demos, mid_term: float, middle: int) -> None:
    """FIG7-MIDTERM: the mean of the last values less that after the given share of updates."""
    moves = len(small_demos.correct[0].actions)
    rng = np.random.default_rng(1)
    values, rewards = rng.normal(size=(2, 9, moves)).astype(np.float32)
    trial = made(small_demos, values=values, rewards=rewards)
    found = measured(trial, small_demos, report=Report(mid_term=mid_term))
    for name, table in (("q_growth", values), ("reward_growth", rewards)):
        due = float(table[8].mean() - table[middle].mean())
        assert found[name] == pytest.approx(due, abs=1e-6)


def test_growth_by_hand(small_demos: Demos) -> None:
    """Values that rise by one in each iteration grow by half of their number; rewards may fall."""
    moves = len(small_demos.correct[0].actions)
    rising = np.repeat(np.arange(9.0)[:, None], moves, axis=1)
    found = measured(made(small_demos, values=rising, rewards=-3 * rising), small_demos)
    assert (found["q_growth"], found["reward_growth"]) == (4.0, -12.0)


@pytest.mark.parametrize("mid_term", [0.25, 0.5])
def test_growth_along_the_path_is_in_the_order_of_its_steps(
    small_demos: Demos, mid_term: float
) -> None:
    """Q is kept by state, and told by step: once for each step of the first demonstration."""
    states = small_demos.correct[0].states[:-1]
    on_path = np.unique(states)
    values = np.arange(9.0)[:, None] * np.where(on_path == states[2], 1.234567, 0.0)
    found = along_path(made(small_demos, values=values), small_demos, Report(mid_term=mid_term))
    middle = round(8 * mid_term)
    expected = {
        "path_q": f"{middle * 1.234567:.3g}",
        "path_q_growth": f"{(8 - middle) * 1.234567:.3g}",
    }
    for name, text in expected.items():
        zeros = ["0"] * len(states)
        assert found[name].split() == [*zeros[:2], text, *zeros[3:]]


def test_growth_along_the_path_is_the_unified_methods(
    conditions: dict[Key, Condition], results: Results
) -> None:
    """Other methods have none, and its mean is the growth that is judged, to three digits."""
    table = measure_trials(results, conditions.values(), path=True)
    assert list(table)[-2:] == list(ALONG)
    own = table["method"] == "unified"
    assert (table.loc[~own, list(ALONG)] == "").all(axis=None)
    for text, growth in zip(table.loc[own, ALONG[1]], table.loc[own, "q_growth"], strict=True):
        (steps,) = numbers_in([text])
        assert steps.mean() == pytest.approx(growth, abs=0.005 * np.abs(steps).max())


def test_trial_at_the_cap_is_told(small_demos: Demos) -> None:
    """A trial that has not converged has its iterations and a zero."""
    found = measured(made(small_demos, iterations=5, converged=False), small_demos)
    assert (found["iterations"], found["converged"]) == (5, 0)


def test_states_of_all_correct_demonstrations_are_measured(small_demos: Demos) -> None:
    """With two correct demonstrations, Q is that where either acts."""
    maze, first = as_maze(small_demos.environment), small_demos.correct[0]
    turned = np.array([*[0] * 3, *[2] * 4])
    other = replace(first, name="other", actions=turned, states=maze.replay(turned.tolist()))
    both = replace(small_demos, correct=(first, other))
    (condition,) = conditions_of(both, {**FEW, "max_iterations": 2}, ["adaboost"]).values()
    trial = condition.trial(seed=np.random.SeedSequence(1))
    known = {*first.states[:-1].tolist(), *other.states[:-1].tolist()}
    assert trial.values.shape == (3, len(known))
    expected = trial.q[sorted(known)].max(axis=1)
    np.testing.assert_array_equal(trial.values[-1], expected.astype(np.float32))


# --- all trials ------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def conditions(small_demos: Demos) -> dict[Key, Condition]:
    """Return all conditions of a small maze."""
    return conditions_of(small_demos, FEW)


@pytest.fixture(scope="module")
def results(conditions: dict[Key, Condition], tmp_path_factory: pytest.TempPathFactory) -> Results:
    """Run a few trials of every method."""
    store = Store(tmp_path_factory.mktemp("measures") / "trials.sqlite")
    return run_trials(list(conditions.values()), trials=3, store=store, seed=2)


def test_there_is_a_row_for_each_trial(conditions: dict[Key, Condition], results: Results) -> None:
    """Rows are keyed by task, method, reading, set and trial, and end with steps and digest."""
    table = measure_trials(results, conditions.values())
    keys = ["task", "method", "reading", "set", "trial"]
    assert table.columns.tolist() == [*keys, "seed", *NAMES, "steps", "digest"]
    expected = [("small", *key, k) for key in conditions for k in range(3)]
    assert list(table[keys].itertuples(index=False, name=None)) == expected
    assert set(table["seed"]) == {2}
    planned = planned_trials(conditions.values(), 3, 2)
    pd.testing.assert_frame_equal(table[[*keys, "seed"]], planned)
    for key, condition in conditions.items():
        rows = table[(table[["method", "reading", "set"]] == list(key)).all(axis=1)]
        trials = [results.trial(condition, k) for k in range(3)]
        assert rows["iterations"].tolist() == [trial.iterations for trial in trials]
        assert rows["converged"].tolist() == [int(trial.converged) for trial in trials]
        assert rows["steps"].tolist() == [trial.steps for trial in trials]
        assert rows["digest"].tolist() == [digest(trial) for trial in trials]


def test_measures_of_trials_by_their_definition(
    small_demos: Demos, conditions: dict[Key, Condition], results: Results
) -> None:
    """Collisions, errors and acts of line 12, counted anew with sets of pairs."""
    table = measure_trials(results, conditions.values())
    by_key = dict(list(table.groupby(["method", "reading", "set"])))

    def taken(*demos: Any) -> set[tuple[int, int]]:
        return {
            pair for demo in demos for pair in zip(demo[0].tolist(), demo[1].tolist(), strict=False)
        }

    expert = taken(*((demo.states, demo.actions) for demo in small_demos.correct))
    stored = taken(*((demo.states, demo.actions) for demo in small_demos.incorrect)) - expert
    for key, condition in conditions.items():
        selected = [(demo.states, demo.actions) for demo in condition.selected.incorrect]
        shown = taken(*selected) - expert
        for k, row in enumerate(by_key[key].to_dict("records")):
            trial = results.trial(condition, k)
            acted = [len(taken(each[:2]) & shown) for each in trial.episodes]
            assert (row["acted_at_first"], row["acted"]) == (acted[0], sum(acted[1:]))
            errors = [
                hit or (state, action) in stored
                for states, actions, hits in trial.episodes[1:11]
                for state, action, hit in zip(
                    states[:-1].tolist(), actions.tolist(), hits.tolist(), strict=True
                )
            ]
            assert row["early_errors"] == sum(errors)
            assert row["early_collisions"] == sum(trial.collisions.tolist()[:10])
    assert table.loc[table["set"] == NONE, ["acted", "acted_at_first"]].eq(0).all(axis=None)
    assert table.loc[table["set"] != NONE, "acted_at_first"].gt(0).any()


def test_same_seed_begins_with_the_same_walk(
    conditions: dict[Key, Condition], results: Results
) -> None:
    """Trial k of all conditions has the same first trajectory: what makes comparisons paired."""
    for k in range(3):
        first = [results.trial(one, k).episodes[0].states.tolist() for one in conditions.values()]
        assert all(states == first[0] for states in first)
    starts = {tuple(results.trial(results.conditions[0], k).episodes[0].states) for k in range(3)}
    assert len(starts) == 3


def test_factors_tell_all_conditions_apart(conditions: dict[Key, Condition]) -> None:
    """No two conditions have the same task, method, reading and set."""
    keys = {tuple(factors(condition).values()) for condition in conditions.values()}
    assert keys == {("small", *key) for key in conditions}
    assert len(keys) == 9


def test_histories_are_read_back(conditions: dict[Key, Condition], results: Results) -> None:
    """Each trial's errors are in its row, to ten digits; after its end it keeps its last one."""
    table = measure_trials(results, conditions.values(), errors=True)
    trials = [results.trial(one, k) for one in conditions.values() for k in range(3)]
    histories = error_histories(table)
    assert histories.shape == (len(trials), max(trial.iterations for trial in trials) + 1)
    for row, trial in zip(histories, trials, strict=True):
        np.testing.assert_allclose(row[: trial.iterations + 1], trial.errors, rtol=1e-9)
        assert (row[trial.iterations :] == trial.errors[-1]).all()


def test_a_history_that_ends_at_the_cap_stays_where_it_is() -> None:
    """After its end a trial keeps its last error, also one above zero."""
    found = error_histories(pd.DataFrame({"errors": ["2 0.5", "3 2 1 0"]}))
    assert found.tolist() == [[2, 0.5, 0.5, 0.5], [3, 2, 1, 0]]


def test_what_a_method_does_not_use_is_not_its_set(small_demos: Demos) -> None:
    """A method without incorrect demonstrations has the set "none", whatever it is asked to use."""
    params = Params.of(incorrect="hit")
    sets = [factors(Condition(small_demos, name, params))["set"] for name in METHODS]
    assert sets == ["none", "none", "hit"]


def test_trials_survive_their_file(
    conditions: dict[Key, Condition], results: Results, tmp_path: Path
) -> None:
    """What is written to trials.csv reads back as the same table, bit by bit."""
    table = measure_trials(results, conditions.values())
    read = read_table(write_csv(table, tmp_path / "trials.csv"))
    pd.testing.assert_frame_equal(table, read, check_dtype=False, check_exact=True)


def test_report_reaches_every_trial(conditions: dict[Key, Condition], results: Results) -> None:
    """A shorter initial phase has no more errors, and the growth is from the given mid-term."""
    usual, other = (
        measure_trials(results, conditions.values(), report)
        for report in (None, Report(early=0.1, mid_term=0.75))
    )
    changed = ["early_errors", "early_collisions", "q_growth", "reward_growth"]
    assert (other[changed[:2]] <= usual[changed[:2]]).all(axis=None)
    for name in changed:
        assert (other[name] != usual[name]).any()
    same = [name for name in usual if name not in changed]
    assert usual[same].equals(other[same])
