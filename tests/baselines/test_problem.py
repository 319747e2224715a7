from __future__ import annotations

import gymnasium
import numpy as np
import pytest
from hypothesis import assume, given, settings

from replication import Demos, GymTask, TabularTask
from replication.baselines import Problem, table_of
from replication.demos.model import state_action_pairs
from replication.envs.maze import Maze
from replication.envs.tasks.moves import Moves
from replication.irl.expectations import feature_expectations
from replication.learning.planning import plan
from tests.envs.mazes import mazes
from tests.learning import plain
from tests.learning.test_sweeps import Case, cases


@pytest.fixture
def problem(small_demos: Demos) -> Problem:
    """All demonstrations of a small maze on its table."""
    moves = table_of(small_demos.environment)
    assert moves is not None
    return Problem(moves, small_demos.correct, small_demos.incorrect, 0.9)


@given(mazes())
def test_the_table_is_that_of_the_maze(maze: Maze) -> None:
    """Each move leads where the maze says, episodes begin at its start and end at its goal."""
    moves = table_of(maze)
    assert moves is not None
    pairs = np.ndindex(maze.next_state.shape)
    assert all(moves.after(*pair).tolist() == [maze.next_state[pair]] for pair in pairs)
    assert moves.starts.tolist() == [maze.start]
    assert np.flatnonzero(moves.ends).tolist() == [maze.goal]


def test_tasks_with_a_table_have_it_and_others_none(soccer_demos: Demos) -> None:
    """A task's own table is taken, and that of Gymnasium's lake; soccer has none."""
    lake = GymTask(gymnasium.make("FrozenLake-v1"))
    own = TabularTask([[1, 0], [1, 1]], terminal=[1])
    assert table_of(lake) is lake.table is not None
    assert table_of(own) is own.table is not None
    assert table_of(soccer_demos.environment) is None


def test_demonstrations_are_counted_as_in_the_loop(small_demos: Demos, problem: Problem) -> None:
    """mu_E and each mu of a wrong one are discounted visits; marked are the pairs of none right."""
    shape = problem.moves.shape
    right = small_demos.correct[0]
    expected = np.zeros(shape)
    for t, pair in enumerate(zip(right.states[:-1], right.actions, strict=True)):
        expected[pair] += 0.9**t
    np.testing.assert_allclose(problem.mu_e, expected, rtol=1e-12)
    assert len(problem.mu_wrong) == len(small_demos.incorrect)
    for demo, mu in zip(small_demos.incorrect, problem.mu_wrong, strict=True):
        steps = len(demo.actions)
        assert mu.sum() == pytest.approx((1 - 0.9**steps) / 0.1)
        assert set(zip(*np.nonzero(mu), strict=True)) == state_action_pairs(demo)
    marked = state_action_pairs(*small_demos.incorrect) - state_action_pairs(right)
    assert set(zip(*np.nonzero(problem.marked), strict=True)) == marked
    alone = Problem(problem.moves, problem.correct, (), 0.9)
    assert alone.mu_wrong.shape == (0, *shape)
    assert not alone.marked.any()


def test_planning_is_exact_and_counted(problem: Problem) -> None:
    """Both planners find the fixed points of their equations, from any start; following is free."""
    rng = np.random.default_rng(1)
    w = rng.normal(size=problem.moves.shape)
    expected = plan(w, problem.moves.ahead, gamma=0.9)
    for begin in (None, rng.normal(size=w.shape)):
        np.testing.assert_allclose(problem.plan(w, begin), expected, rtol=0, atol=1e-9)
        q = problem.plan_softly(w, begin)
        v = np.log(np.exp(q).sum(axis=1))
        np.testing.assert_allclose(q, w + 0.9 * problem.moves.ahead(v), rtol=0, atol=1e-9)
    assert problem.plans == 4
    problem.follow(expected)
    assert problem.plans == 4


def test_chance_is_planned_on_too() -> None:
    """On slippery ice, where it is the sweeps that plan."""
    moves = table_of(GymTask(gymnasium.make("FrozenLake-v1", is_slippery=True)))
    assert isinstance(moves, Moves)
    w = np.random.default_rng(2).normal(size=moves.shape)
    found = Problem(moves, (), (), 0.9).plan(w)
    np.testing.assert_allclose(found, plan(w, moves.ahead, gamma=0.9), rtol=0, atol=1e-9)


def test_following_the_expert_gives_his_visits(small_demos: Demos, problem: Problem) -> None:
    """The greedy policy of a Q that prefers his actions has his feature expectations."""
    right = small_demos.correct[0]
    expected = feature_expectations(
        right.states, right.actions, gamma=0.9, shape=problem.moves.shape
    )
    np.testing.assert_allclose(problem.follow(problem.mu_e), expected, rtol=0, atol=1e-12)
    policy = np.full(problem.moves.shape, 0.25)
    mu = problem.visits(policy)
    # Flow: what is visited began there or came from elsewhere.
    came = np.zeros(len(mu))
    for state, action in np.ndindex(mu.shape):
        (after,) = problem.moves.after(state, action)
        came[after] += 0.9 * mu[state, action]
    came[problem.moves.starts] += 1
    came[problem.moves.ends] = 0
    np.testing.assert_allclose(mu.sum(axis=1), came, rtol=0, atol=1e-9)


@settings(max_examples=200)
@given(cases())
def test_following_takes_the_first_of_equals(case: Case) -> None:
    """With chance or without, from one start or several: visits of the first best actions."""
    assume(case.gamma > 0 or not case.moves.ends[case.moves.starts].any())
    q = np.round(case.q / 300)  # so that many tie
    first = [row.index(max(row)) for row in q.tolist()]
    found = Problem(case.moves, (), (), case.gamma).follow(q)
    expected = plain.visits(case.moves, np.eye(q.shape[1])[first], gamma=case.gamma)
    np.testing.assert_allclose(found, expected, rtol=0, atol=1e-9)
