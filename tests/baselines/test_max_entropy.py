from itertools import pairwise
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from replication import Demos, Maze, fit
from replication.baselines import max_entropy
from replication.baselines.problem import Problem, table_of
from replication.demos.model import Demo
from tests.learning import plain
from tests.learning.test_chance import make_moves

Array = NDArray[Any]


def problem_of(demos: Demos) -> Problem:
    """Return the problem of some demonstrations in a maze."""
    moves = table_of(demos.environment)
    assert moves is not None
    return Problem(moves, demos.correct, demos.incorrect, 0.9)


@settings(max_examples=30)
@given(st.integers(0, 2**32))
def test_the_gradient_is_that_of_the_likelihood(seed: int) -> None:
    """In any direction, on any table, L changes as central differences say."""
    rng = np.random.default_rng(seed)
    shape = 6, 3
    starts, ends = rng.dirichlet(np.ones(6)), rng.random(6) < 0.3
    moves = make_moves(rng.dirichlet(np.full(6, 0.3), shape), starts, ends)
    w, direction, target = rng.normal(size=(3, *shape))
    problem = Problem(moves, (), (), gamma=0.9)

    def value(step: float) -> tuple[float, Array]:
        at = w + step * direction
        q = problem.plan_softly(at)
        return max_entropy.likelihood(problem, target, at, q, ridge=0.1)

    slope = (value(1e-4)[0] - value(-1e-4)[0]) / 2e-4
    assert (value(0)[1] * direction).sum() == pytest.approx(slope, abs=1e-6)


def all_ways(maze: Maze, steps: int) -> list[tuple[list[int], list[int]]]:
    """Return the states and actions of all ways to the goal in at most that many steps."""
    ways, open_ways = [], [([maze.start], list[int]())]
    for _ in range(steps):
        longer = [
            ([*states, maze.next_state.item(states[-1], action)], [*actions, action])
            for states, actions in open_ways
            for action in range(4)
        ]
        ways += [way for way in longer if way[0][-1] == maze.goal]
        open_ways = [way for way in longer if way[0][-1] != maze.goal]
    return ways


def test_a_trajectory_is_as_likely_as_its_reward_says() -> None:
    """Without discount and chance, each way to the goal has a share of exp(its sum of weights).

    So the visits are found by writing down all ways of a maze of four cells; at weights of about
    -6, those of more than seven steps do not show.
    """
    maze = Maze.from_text("""
        .G
        S.
    """)
    moves = table_of(maze)
    assert moves is not None
    w = np.random.default_rng(1).uniform(-7, -6, size=(4, 4))
    total, mu = 0.0, np.zeros((4, 4))
    for states, actions in all_ways(maze, 7):
        share = np.exp(w[states[:-1], actions].sum())
        total += share
        np.add.at(mu, (states[:-1], actions), share)
    problem = Problem(moves, (), (), gamma=1 - 1e-10)
    found = problem.visits(max_entropy.soft_policy(problem.plan_softly(w)))
    np.testing.assert_allclose(found, mu / total, rtol=1e-8, atol=1e-10)


def test_visits_are_the_experts_but_for_the_ridge(stored_demos: Demos) -> None:
    """At the maximum, mu_E - mu_pi = RIDGE w, with mu_pi by iteration and a linear solve."""
    problem = problem_of(stored_demos)
    w = max_entropy.find(problem)
    mu = plain.soft_visits(problem.moves, w, gamma=0.9)
    np.testing.assert_allclose(problem.mu_e - mu, max_entropy.RIDGE * w, atol=1e-7)
    assert np.abs(problem.mu_e - mu).max() < 0.01  # so that the expert is matched, too


def test_weights_of_choices_are_their_log_odds() -> None:
    """Where each action ends the episode, weights differ by the logarithms of their shares."""
    moves = make_moves(np.array([[[0.0, 1.0]] * 3] * 2), [1.0, 0.0], [False, True])
    states = np.array([0, 1])
    shown = np.array([[0], [0], [0], [0], [1], [1], [2]])
    correct = [Demo(str(i), "correct", states, a) for i, a in enumerate(shown)]
    w = max_entropy.find(Problem(moves, correct, (), gamma=0.9))
    np.testing.assert_allclose(-np.diff(w[0]), np.log([2, 2]), atol=2e-3)
    assert not w[1].any()


def test_a_fit_matches_the_expert(small_demos: Demos) -> None:
    """The agent needs one iteration, and incorrect demonstrations change nothing."""
    options: dict[str, Any] = {"method": "max-entropy", "solver": "planning", "seed": 1}
    results = [fit(small_demos.select(kinds), **options) for kinds in ("none", "all")]
    assert all(result.converged and result.iterations == 1 for result in results)
    assert all((a.weights == b.weights).all() for a, b in pairwise(results))
