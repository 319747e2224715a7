from __future__ import annotations

import numpy as np

from replication import fit
from replication.baselines import margin_perceptron
from replication.demos.model import Demos
from tests.baselines.enumerated import GAMMA, all_visits, problem_of, tiny_demos


def test_the_margin_holds_against_every_policy() -> None:
    """No other policy is better, even if each visit off the expert's way were worth 1 more."""
    for rows in (("..", "SG"), ("S..G",), ("S.", ".G")):
        demos = tiny_demos(rows)
        problem = problem_of(demos)
        w = margin_perceptron.find(problem).ravel()
        mu_e = problem.mu_e.ravel()
        every = all_visits(demos)
        bonus = every @ np.where(mu_e > 0, 0.0, 1.0)
        assert (w @ mu_e - every @ w >= bonus - 1e-9).all()


def test_its_updates_by_hand() -> None:
    """Into each of three walls it runs for ever once, which are 10 visits; then the goal is best.

    It takes them one after the other, as each yet unpunished one is worth 10 by its bonus.
    """
    problem = problem_of(tiny_demos(("SG",)))
    w = margin_perceptron.find(problem)
    np.testing.assert_allclose(w, [[-10, -10, 3, -10], [0, 0, 0, 0]])
    assert problem.plans == 4


def test_its_updates_are_bounded() -> None:
    """There are at most (R^2 + 2 L) / delta^2, with delta and R over all policies."""
    demos = tiny_demos()
    problem = problem_of(demos)
    margin_perceptron.find(problem)
    updates = problem.plans - 1
    gaps = problem.mu_e.ravel() - all_visits(demos)
    gaps = gaps[np.abs(gaps).max(axis=1) > 1e-12]
    unit = np.linalg.lstsq(gaps, np.ones(len(gaps)), rcond=None)[0]
    delta = (gaps @ unit).min() / np.linalg.norm(unit)  # any unit vector gives a bound
    assert delta > 0
    largest = (gaps**2).sum(axis=1).max()
    assert 0 < updates <= (largest + 2 / (1 - GAMMA)) / delta**2


def test_it_learns_the_stored_tasks(stored_demos: Demos) -> None:
    """Q-learning on its reward is on the expert's path after one iteration."""
    result = fit(stored_demos, method="margin-perceptron", seed=1)
    assert (result.iterations, result.error) == (1, 0.0)
