from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.optimize import approx_fprime, minimize

from replication import Demos, Params
from replication.baselines import BaselineCondition, Problem, ranking, table_of
from replication.demos.model import Demo
from replication.irl.expectations import feature_expectations

Array = NDArray[np.float64]


def problem_of(demos: Demos, *, right: Sequence[Demo], wrong: Sequence[Demo]) -> Problem:
    """Return the problem of ranking `right` above `wrong`."""
    moves = table_of(demos.environment)
    assert moves is not None
    return Problem(moves, right, wrong, 0.9)


@pytest.fixture(scope="module")
def problem(small_demos: Demos) -> Problem:
    """Two demonstrations are to be above all others."""
    first, *others = small_demos.incorrect
    return problem_of(small_demos, right=(*small_demos.correct, first), wrong=others)


def differences_of(problem: Problem) -> Array:
    """Return mu_correct - mu_incorrect, pair by pair, [pair, state * action]."""

    def mu(demo: Demo) -> Array:
        shape = problem.moves.shape
        found = feature_expectations(demo.states, demo.actions, gamma=problem.gamma, shape=shape)
        return found.ravel()

    return np.array([mu(up) - mu(down) for up in problem.correct for down in problem.incorrect])


def plain_loss(w: Array, differences: Array) -> float:
    """Return what is minimised, as the formula has it."""
    ranked = sum(np.log(1 / (1 + np.exp(-(w @ difference)))) for difference in differences)
    return float(ranking.RIDGE / 2 * np.sum(w**2) - ranked)


def test_loss_is_the_formula_and_the_gradient_its_slope(problem: Problem) -> None:
    """Both agree with the plain formula, the slope by differences, at several weights."""
    differences = differences_of(problem)
    np.testing.assert_allclose(ranking.gains(problem), differences, rtol=0, atol=1e-15)
    rng = np.random.default_rng(1)
    for scale in (0.0, 0.3, 3.0):
        w = np.multiply(scale, rng.normal(size=differences.shape[1]))
        value, gradient = ranking.loss(w, differences)
        assert value == pytest.approx(plain_loss(w, differences), rel=1e-12)
        slope = approx_fprime(w, plain_loss, 1e-6, differences)
        np.testing.assert_allclose(gradient, slope, rtol=0, atol=1e-4)


def test_from_another_start_the_optimum_is_the_same(problem: Problem) -> None:
    """Another search from random weights ends at the same ones."""
    differences = differences_of(problem)
    start = np.random.default_rng(2).normal(size=differences.shape[1])
    found = minimize(
        ranking.loss, start, args=(differences,), jac=True, method="BFGS", options={"gtol": 1e-8}
    )
    np.testing.assert_allclose(ranking.find(problem).ravel(), found.x, rtol=0, atol=1e-6)


def test_weights_are_a_combination_of_the_differences(problem: Problem) -> None:
    """They are those of the dual: a probability of being wrong for each pair.

    minimise |theta D|^2 / (2 ridge) - sum of entropies H(theta);  w = theta D / ridge.
    """
    differences = differences_of(problem)

    def dual(theta: Array) -> float:
        entropy = -np.sum(theta * np.log(theta) + (1 - theta) * np.log(1 - theta))
        return float(np.sum((theta @ differences) ** 2) / (2 * ranking.RIDGE) - entropy)

    begin = np.full(len(differences), 0.4)
    limits = [(1e-9, 1 - 1e-9)] * len(begin)
    found = minimize(dual, begin, bounds=limits, options={"ftol": 1e-15, "gtol": 1e-9})
    w = found.x @ differences / ranking.RIDGE
    np.testing.assert_allclose(ranking.find(problem).ravel(), w, rtol=0, atol=1e-4)


def test_reversed_ranks_reverse_the_weights(small_demos: Demos, problem: Problem) -> None:
    """If the incorrect ones are to be above, each weight has the other sign."""
    right, wrong = problem.correct, problem.incorrect
    turned = problem_of(small_demos, right=wrong, wrong=right)
    np.testing.assert_allclose(ranking.find(turned), -ranking.find(problem), rtol=0, atol=1e-8)


def test_one_pair_has_a_weight_by_hand(small_demos: Demos) -> None:
    """With one pair and standard normal weights w = c D, where c solves c = sigmoid(-c |D|^2)."""
    problem = problem_of(small_demos, right=small_demos.correct, wrong=small_demos.incorrect[:1])
    (difference,) = differences_of(problem)
    size, c = np.sum(difference**2), 0.0
    for _ in range(200):  # halving
        c = (c + 1 / (1 + np.exp(c * size))) / 2
    np.testing.assert_allclose(ranking.find(problem).ravel(), c * difference, rtol=0, atol=1e-8)


def test_correct_demonstrations_are_worth_more(stored_demos: Demos) -> None:
    """In the paper's mazes, each more than any incorrect one, and without a plan."""
    params = Params.of(incorrect="hit+detour+opposite", solver="planning")
    found = BaselineCondition(stored_demos, "ranking", params).found
    some = stored_demos.select("hit+detour+opposite")
    problem = problem_of(stored_demos, right=some.correct, wrong=some.incorrect)
    assert (differences_of(problem) @ found.weights.ravel() > 0).all()
    assert found.plans == 0
