from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from replication import Demos, Maze, demonstrate, fit
from replication.baselines import from_failure, max_entropy
from replication.baselines.from_failure import SCALE
from replication.baselines.max_entropy import RIDGE
from replication.baselines.problem import Problem
from tests.baselines.test_max_entropy import problem_of
from tests.learning import plain

Array = NDArray[Any]


@pytest.fixture(scope="module")
def problem(small_demos: Demos) -> Problem:
    """Return a problem with all kinds of incorrect demonstrations."""
    return problem_of(small_demos)


def parts(problem: Problem, w: Array) -> tuple[Array, Array, Array]:
    """Return w_S, w_F and the visits of the soft policy of their sum, found in plain NumPy.

    In w_F a visit more than failures have earns 1.
    """
    mu = plain.soft_visits(problem.moves, w, gamma=problem.gamma)
    repelling = mu - problem.mu_wrong.mean(axis=0)
    return w - repelling, repelling, mu


def test_its_conditions_hold(stored_demos: Demos) -> None:
    """What is left of the reward when w_F is taken away balances the visits, as w_S must."""
    problem = problem_of(stored_demos)
    w_s, w_f, mu = parts(problem, from_failure.find(problem))
    np.testing.assert_allclose(problem.mu_e - mu, RIDGE * w_s, atol=1e-7)
    assert np.abs(w_f).max() > 0.05  # so that it would show if it were left out


@pytest.mark.parametrize("seed", [None, 0, 1])
def test_algorithm_1_ends_there(seed: int | None) -> None:
    """Gradient steps of w_S with w_F under annealing, from zero or anywhere, find this reward.

    The steps are those of Shiarlis et al. (2016); a large ridge makes them few. That they settle
    takes a scale that suits the discount: with gamma = 0.9 and a scale of 1 or less they never did.
    """
    maze = Maze.from_text("""
        ..G
        S#.
        ...
    """)
    problem = replace(problem_of(demonstrate("tiny", maze)), gamma=0.5)
    moves, mu_e, mu_f = problem.moves, problem.mu_e, problem.mu_wrong.mean(axis=0)
    ridge, floor, rate, scale = 0.2, 0.5, 0.5, 10.0
    start = np.zeros(moves.shape)
    w_s = start if seed is None else np.random.default_rng(seed).normal(size=moves.shape)
    w_f = start
    for _ in range(200):
        mu = plain.soft_visits(moves, w_s + w_f, gamma=problem.gamma)
        w_s = w_s + rate * (mu_e - mu - ridge * w_s)
        w_f = (mu - mu_f) / scale
        scale = max(floor, 0.9 * scale)
    found = from_failure.balance(problem, ridge=ridge, scale=floor)
    np.testing.assert_allclose(found, w_s + w_f, atol=1e-6)


def test_without_incorrect_demonstrations_it_is_maximum_entropy(small_demos: Demos) -> None:
    """There is nothing to repel, and all bits are those of the other method."""
    problem = problem_of(small_demos.select("none"))
    assert from_failure.find(problem).tobytes() == max_entropy.find(problem).tobytes()


def test_a_large_scale_repels_nothing(problem: Problem) -> None:
    """As the scale grows, w_S + w_F becomes the reward of maximum entropy."""
    alone = max_entropy.find(problem)
    far = from_failure.balance(problem, ridge=RIDGE, scale=1e13)
    near = from_failure.balance(problem, ridge=RIDGE, scale=SCALE)
    np.testing.assert_allclose(far, alone, atol=1e-9)
    assert np.abs(near - alone).max() > 1e-3


def test_what_is_success_and_failure_at_once_is_not_repelled(problem: Problem) -> None:
    """If failures are the successes, w_F is w_S times -RIDGE, and hardly anything."""
    both = replace(problem, incorrect=problem.correct)
    w_s, w_f, _ = parts(both, from_failure.find(both))
    np.testing.assert_allclose(w_f, -RIDGE * w_s, atol=1e-7)
    assert np.abs(w_f).max() < 2e-3


def test_failures_lose_what_successes_gain(problem: Problem) -> None:
    """Pairs of incorrect demonstrations alone are worth less than in maximum entropy."""
    change = from_failure.find(problem) - max_entropy.find(problem)
    assert change[problem.marked].mean() < 0 < change[problem.mu_e > 0].mean()


def test_a_fit_matches_the_expert(small_demos: Demos) -> None:
    """The agent needs one iteration."""
    result = fit(small_demos, method="from-failure", solver="planning", seed=1)
    assert result.converged
    assert result.iterations == 1
