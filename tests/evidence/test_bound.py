from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import pandas as pd
import pytest

from replication import Maze
from replication.baselines import BaselineCondition
from replication.demos.maze_expert import Expert, correct_actions, demonstrate
from replication.demos.model import Demos
from replication.envs.maze import MazeError, as_maze
from replication.evidence import bound
from replication.evidence.bound import (
    LENGTHS,
    RUNS,
    Case,
    bound_table,
    cases,
    conditions,
    plan,
    problem_of,
    radius,
)
from replication.evidence.margin import margin
from replication.evidence.statistics import mean_interval
from replication.evidence.variations import maze_demos
from replication.irl.expectations import feature_expectations
from replication.paper.params import Params

MAZES = 1000


@pytest.fixture(autouse=True)
def _without_random_mazes(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """Leave the random mazes out: to find them takes seconds."""
    monkeypatch.setattr(bound, "MAPS", ("open", "obstacles"))
    cases.cache_clear()
    yield
    cases.cache_clear()


def small_mazes(number: int, seed: np.random.SeedSequence) -> Iterator[Maze]:
    """Yield mazes with sides of 3 to 7 and up to a third of obstacles."""
    rng = np.random.default_rng(seed)
    while number:
        rows, columns = rng.integers(3, 8, size=2)
        cells = np.where(rng.random(rows * columns) < rng.uniform(0, 1 / 3), "#", ".")
        cells[rng.choice(rows * columns, 2, replace=False)] = "S", "G"
        try:
            maze = Maze(tuple("".join(row) for row in cells.reshape(rows, columns)))
        except MazeError:  # the goal cannot be reached
            continue
        yield maze
        number -= 1


def test_no_perceptron_makes_more_mistakes_than_the_bound() -> None:
    """The theorem, on a thousand random mazes; and each distance is at most R."""
    params = Params.of(solver="planning", incorrect="none")
    tightest = np.inf
    for k, maze in enumerate(small_mazes(MAZES, np.random.SeedSequence(1))):
        path = demonstrate("small", maze, params=Expert(leg=1 + k % 4)).correct
        demos = Demos("small", maze, path, ())
        problem = problem_of(demos)
        r, delta = radius(problem), margin(problem).delta
        trial = BaselineCondition(demos, "perceptron", params).trial(
            seed=np.random.SeedSequence(2, spawn_key=(k,))
        )
        assert trial.converged
        assert trial.errors.max() <= r
        # The first inequality of the proof, with the distances as they were.
        moved = np.linalg.norm(trial.weights)
        assert trial.iterations * delta <= moved * (1 + 1e-9)
        assert moved <= np.sqrt((trial.errors[:-1] ** 2).sum()) * (1 + 1e-9)
        assert trial.iterations <= (r / delta) ** 2
        tightest = min(tightest, (r / delta) ** 2 / max(trial.iterations, 1))
    assert tightest < 100  # else the bound would be tested by nothing


@pytest.mark.parametrize("text", ["S..\n..G", "...\n.S.\n..G", "SG"])
def test_no_trajectory_is_farther_than_r(text: str) -> None:
    """All trajectories up to a length are listed, each with its last action for ever."""
    maze = Maze.from_text(text)
    problem = problem_of(demonstrate("small", maze))
    farthest = 0.0
    for number in range(4**5):
        actions = [number // 4**i % 4 for i in range(5)]
        actions += [actions[-1]] * 400
        end = maze.goal_step(actions)
        actions = actions[:end]
        mu = feature_expectations(
            maze.replay(actions), np.array(actions), gamma=0.9, shape=problem.moves.shape
        )
        farthest = max(farthest, float(np.linalg.norm(problem.mu_e - mu)))
    assert farthest <= radius(problem)
    if text != "...\n.S.\n..G":  # there is a wall beside the start
        assert farthest == pytest.approx(radius(problem))


def test_cases_are_what_the_names_say() -> None:
    """Every shape is there once; nearer starts lie on the default path, and have its legs."""
    found = cases()
    paths = [(case.world, case.demos.correct[0].actions.tobytes()) for case in found]
    assert len(set(paths)) == len(paths) == 2 * (6 + len(LENGTHS))
    assert {len(case.demos.correct[0].actions) for case in found if case.vary == "shape"} == {
        31,
        33,
    }
    for case in found:
        if case.vary == "length":
            (demo,), (whole,) = case.demos.correct, maze_demos(case.world, Expert()).correct
            assert len(demo.actions) in LENGTHS
            assert demo.states[0] == whole.states[-1 - len(demo.actions)]
            assert demo.states[-1] == whole.states[-1]
            maze, leg = as_maze(case.demos.environment), Expert().leg
            assert demo.actions.tolist() == correct_actions(maze, leg=leg)


def test_of_equal_paths_the_first_counts(monkeypatch: pytest.MonkeyPatch) -> None:
    """Two shapes may have the same path in a maze; in another maze it is another case."""
    demos = maze_demos("open", Expert())
    made = [
        Case(world, "shape", shape, demos)
        for world, shape in (("open", "one"), ("open", "other"), ("obstacles", "one"))
    ]
    monkeypatch.setattr(bound, "_shapes", lambda: iter(made))
    monkeypatch.setattr(bound, "_lengths", lambda: iter(()))
    assert [case[:3] for case in cases()] == [made[0][:3], made[2][:3]]


def test_plan_has_a_group_for_each_condition() -> None:
    """Its place among all is its number, and by it the table finds its case and its run."""
    groups = plan(3)
    every = list(conditions())
    assert [group.labels for group in groups] == [
        {"part": "bound", "number": n} for n in range(len(every))
    ]
    assert len(every) == len(cases()) * len(RUNS)
    for number, condition in enumerate(every):
        method, reading, solver = RUNS[number % len(RUNS)]
        params = condition.params
        assert (condition.method, params.learner.solver) == (method, solver)
        assert reading in ("", params.update.f_index)
        assert params.demonstrations.incorrect == "none"
        assert condition.demos is cases()[number // len(RUNS)].demos


def made_trials() -> pd.DataFrame:
    """Make trials up, in any order, with trials of another part among them."""
    rng = np.random.default_rng(np.random.SeedSequence(4))
    rows = [
        {
            "part": part,
            "number": n,
            "trial": k,
            "iterations": n + rng.integers(1, 9),
            "converged": int(k != n % 5),
        }
        for part in ("bound", "other")
        for n in range(len(cases()) * len(RUNS))
        for k in range(5)
    ]
    return pd.DataFrame(rows).sample(frac=1.0, random_state=1)


def test_table_joins_bound_and_trials() -> None:
    """Each row has the iterations of its number, and the bound of its demonstration."""
    trials = made_trials()
    table = bound_table(trials)
    assert list(table[["method", "reading", "solver"]].itertuples(index=False, name=None)) == (
        list(RUNS) * len(cases())
    )
    for number in (0, 5, len(table) - 1):
        row = table.iloc[number]
        own = trials[(trials["part"] == "bound") & (trials["number"] == number)]
        counts = own["iterations"].to_numpy(float)
        assert (row["n"], row["mean"], row["most"]) == (5, counts.mean(), counts.max())
        assert (row["low"], row["high"]) == pytest.approx(tuple(map(float, mean_interval(counts))))
        assert row["converged"] == own["converged"].mean()
        case = cases()[number // len(RUNS)]
        problem = problem_of(case.demos)
        assert (row["world"], row["vary"], row["shape"]) == case[:3]
        assert row["length"] == len(case.demos.correct[0].actions)
        assert row["delta"] == margin(problem).delta
        assert row["bound"] == pytest.approx(radius(problem) ** 2 / row["delta"] ** 2)
