from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from scipy.optimize import linprog

from replication import fit
from replication.baselines import mwal
from replication.demos.model import Demos
from replication.paper.params import Loop, Update
from tests.baselines.enumerated import GAMMA, all_visits, problem_of, tiny_demos

NONE: Any = None


def test_it_is_the_published_update() -> None:
    """Log weights give the rewards of a plain version with a weight for each feature of both signs.

    Theirs is W(i) beta^G(i), with G = ((1 - gamma) (mu(i) - mu_E(i)) + 2) / 4, divided by its sum.
    """
    rng = np.random.default_rng(2)
    shape, rounds = (4, 3), Loop().max_iterations
    beta = 1 / (1 + math.sqrt(2 * math.log(24) / rounds))
    plain = [1.0] * 24
    mu_e = rng.uniform(0, 10, shape)
    w, logs = np.zeros(shape), np.zeros(shape)
    for _ in range(30):
        mu_i = rng.uniform(0, 10, shape)
        w, logs = mwal.update(w, logs, mu_e, mu_i, NONE, Update())
        signed = [sign * gap for sign in (1, -1) for gap in (mu_i - mu_e).ravel()]
        losses = [((1 - GAMMA) * gap + 2) / 4 for gap in signed]
        plain = [weight * beta**loss for weight, loss in zip(plain, losses, strict=True)]
        total = sum(plain)
        plain = [weight / total for weight in plain]
        reward = np.array(plain[:12]) - np.array(plain[12:])
        np.testing.assert_allclose(w.ravel(), reward, rtol=1e-9, atol=1e-15)
        assert np.abs(w).sum() <= 1


def test_its_mixture_is_as_good_as_the_game_allows() -> None:
    """The mean of the agent's visits is within the regret bound of the value of the game.

    The game: over all mixtures of policies, the least advantage over the expert in any feature of
    either sign; its value is a linear program over all policies.
    """
    demos = tiny_demos()
    every = all_visits(demos) * (1 - GAMMA)
    mu_e = problem_of(demos).mu_e.ravel() * (1 - GAMMA) * 0.5  # an expert whom no mixture matches
    gaps = np.hstack([every - mu_e, mu_e - every])
    n = len(every)
    best = linprog(
        np.append(np.zeros(n), -1),
        A_ub=np.hstack([-gaps.T, np.ones((gaps.shape[1], 1))]),
        b_ub=np.zeros(gaps.shape[1]),
        A_eq=[np.append(np.ones(n), 0)],
        b_eq=[1],
        bounds=[(0, None)] * n + [(None, None)],
    )
    value, rounds = -best.fun, 20_000
    k = gaps.shape[1]
    logs, total = np.zeros(mu_e.shape), np.zeros(mu_e.shape)
    for _ in range(rounds):
        mu = every[np.argmax(every @ mwal.weights(logs))]
        total += mu / rounds
        logs = logs + mwal.rate(k, rounds, GAMMA) / (1 - GAMMA) * (mu_e - mu)
    reached = np.append(total - mu_e, mu_e - total).min()
    regret = 4 * (math.sqrt(2 * math.log(k) / rounds) + math.log(k) / rounds)
    assert value - regret <= reached <= value + 1e-9
    assert value < -1e-3  # so that there is something to lose
    assert regret < abs(every.mean(axis=0) - mu_e).max()  # and that any mixture would not do


def test_large_logs_do_no_harm() -> None:
    """Weights that have run away are still finite."""
    w = mwal.weights(np.array([[1e6, -1e6, 0.0]]))
    np.testing.assert_allclose(w, [[0.5, -0.5, 0.0]], atol=1e-12)


@pytest.mark.parametrize("solver", ["q-learning", "planning"])
def test_it_learns_the_stored_tasks(stored_demos: Demos, solver: str) -> None:
    """It ends on the expert's path in both mazes of the paper."""
    assert fit(stored_demos, method="mwal", seed=1, solver=solver).error == 0
