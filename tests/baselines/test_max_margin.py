from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from scipy.optimize import minimize

from replication import fit
from replication.baselines import max_margin
from replication.baselines.max_margin import MARKED, RIDGE, losses
from replication.demos.model import Demos
from tests.baselines.enumerated import all_visits, problem_of, tiny_demos


def objective(demos: Demos, w: Any, *, incorrect: bool = False) -> float:
    """Return what is minimised, with the best of all policies by trying each."""
    problem, every = problem_of(demos, incorrect=incorrect), all_visits(demos)
    worth = every @ (w + losses(problem).ravel())
    return float(max_margin.RIDGE / 2 * w @ w + worth.max() - w @ problem.mu_e.ravel())


@pytest.mark.parametrize("incorrect", [False, True])
@pytest.mark.parametrize("ridge", [1.0, 0.1, RIDGE])
def test_it_is_near_the_least_objective(
    monkeypatch: pytest.MonkeyPatch, incorrect: bool, ridge: float
) -> None:
    """A quadratic program over all policies is hardly better, and not worse."""
    monkeypatch.setattr(max_margin, "RIDGE", ridge)
    demos = tiny_demos()
    problem, every = problem_of(demos, incorrect=incorrect), all_visits(demos)
    loss, mu_e = losses(problem).ravel(), problem.mu_e.ravel()
    used = every.any(axis=0) | (mu_e > 0)
    n = int(used.sum())

    def value(x: Any) -> float:
        return float(ridge / 2 * x[:n] @ x[:n] + x[n] - x[:n] @ mu_e[used])

    best = minimize(
        value,
        np.zeros(n + 1),
        jac=lambda x: np.append(ridge * x[:n] - mu_e[used], 1.0),
        constraints={
            "type": "ineq",
            "fun": lambda x: x[n] - every[:, used] @ x[:n] - every @ loss,
            "jac": lambda _: np.hstack([-every[:, used], np.ones((len(every), 1))]),
        },
        method="SLSQP",
        options={"maxiter": 500, "ftol": 1e-12},
    )
    assert best.success
    found = objective(demos, max_margin.find(problem).ravel(), incorrect=incorrect)
    assert best.fun - 1e-6 <= found <= best.fun + 0.1
    assert objective(demos, np.zeros(problem.mu_e.size)) > best.fun + 1  # where it begins


def test_its_step_is_a_subgradient() -> None:
    """Where one trajectory is best, it agrees with central differences of the objective."""
    demos = tiny_demos()
    problem = problem_of(demos)
    loss = losses(problem)
    rng = np.random.default_rng(3)
    for _ in range(5):
        w = rng.normal(size=loss.shape)
        mu = problem.follow(problem.plan(w + loss))
        gradient = (mu - problem.mu_e + RIDGE * w).ravel()
        for i in np.flatnonzero(np.abs(gradient) > 0.05):
            step = 1e-6 * np.eye(w.size)[i]
            up, down = (objective(demos, w.ravel() + sign * step) for sign in (1, -1))
            assert gradient[i] == pytest.approx((up - down) / 2e-6, abs=1e-5)


def test_marked_pairs_cost_twice() -> None:
    """The expert's pairs cost nothing, marked ones 2, all others 1."""
    problem = problem_of(tiny_demos(("...", "...", "S.G")), incorrect=True)
    loss = losses(problem)
    assert (loss[problem.mu_e > 0] == 0).all()
    assert problem.marked.any()
    assert (loss[problem.marked] == MARKED).all()
    assert (loss[~problem.marked & (problem.mu_e == 0)] == 1).all()


def test_it_learns_the_stored_tasks(stored_demos: Demos) -> None:
    """Q-learning on its reward is on the expert's path after one iteration."""
    result = fit(stored_demos, method="max-margin", seed=1)
    assert (result.iterations, result.error) == (1, 0.0)
