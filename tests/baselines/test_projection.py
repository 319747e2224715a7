from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from scipy.optimize import nnls

from replication import fit
from replication.baselines import projection
from replication.demos.model import Demos
from replication.paper.params import Update
from tests.baselines.enumerated import all_visits, problem_of, tiny_demos

NONE: Any = None


def distances(rounds: int, mu_e: np.ndarray[Any, Any], every: np.ndarray[Any, Any]) -> list[float]:
    """Return |mu_E - mixture| after each round, with the best of all policies as the agent's."""
    memory = projection.start(mu_e.shape, Update())
    w, found = np.zeros(mu_e.shape), []
    for _ in range(rounds):
        mu_i = every[np.argmax(every @ w)]
        w, memory = projection.update(w, memory, mu_e, mu_i, NONE, Update())
        np.testing.assert_allclose(w, mu_e - memory)
        found.append(float(np.linalg.norm(w)))
    return found


def test_the_mixture_comes_as_near_as_the_convex_hull() -> None:
    """It never gets farther away, and its limit is the distance to all mixtures of policies."""
    every = all_visits(tiny_demos())
    rng = np.random.default_rng(1)
    for _ in range(5):
        mu_e = np.array(rng.uniform(0, 3, every.shape[1]))
        found = distances(3000, mu_e, every)
        assert (np.diff(found) <= 1e-12).all()
        heavy = 1e4  # weights of the mixture that sum to one
        system = np.vstack([every.T, np.full(len(every), heavy)])
        _, least = nnls(system, np.append(mu_e, heavy))
        assert found[-1] == pytest.approx(least, rel=2e-2)


def test_an_expert_among_the_policies_is_reached() -> None:
    """The distance to a policy that the agent can have goes to zero."""
    demos = tiny_demos()
    found = distances(300, problem_of(demos).mu_e.ravel(), all_visits(demos))
    assert found[-1] < 1e-3


def test_a_step_by_hand() -> None:
    """From (1, 0) toward (0, 1), the point nearest to (0, 0.5) has a share of 3/4."""
    mu_e, mixture, mu_i = np.array([[0.0, 0.5]]), np.array([[1.0, 0.0]]), np.array([[0.0, 1.0]])
    w, memory = projection.update(NONE, mixture, mu_e, mu_i, NONE, Update())
    np.testing.assert_allclose(memory, [[0.25, 0.75]])
    np.testing.assert_allclose(w, [[-0.25, -0.25]])
    for beyond, kept in ((np.array([[2.0, 0.0]]), mixture), (mixture, mixture)):
        _, memory = projection.update(NONE, mixture, mu_e, beyond, NONE, Update())
        np.testing.assert_array_equal(memory, kept)
    _, memory = projection.update(NONE, mixture, np.array([[-9.0, 9.0]]), mu_i, NONE, Update())
    np.testing.assert_array_equal(memory, mu_i)


def test_the_mixture_begins_with_the_first_trajectory() -> None:
    """It is the agent's whole first trajectory, even if the expert is nearer to nothing at all."""
    mu_e, mu_i = np.array([[0.1, 0.0]]), np.array([[0.0, 1.0]])
    w, memory = projection.update(
        NONE, projection.start((1, 2), Update()), mu_e, mu_i, NONE, Update()
    )
    np.testing.assert_array_equal(memory, mu_i)
    np.testing.assert_array_equal(w, [[0.1, -1.0]])


@pytest.mark.parametrize("solver", ["q-learning", "planning"])
def test_it_learns_the_stored_tasks(stored_demos: Demos, solver: str) -> None:
    """It ends on the expert's path in both mazes of the paper."""
    assert fit(stored_demos, method="projection", seed=1, solver=solver).error == 0
