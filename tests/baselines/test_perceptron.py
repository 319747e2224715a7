from __future__ import annotations

import numpy as np
import pytest

from replication import Demos, Params
from replication.baselines import BaselineCondition, perceptron
from replication.irl.expectations import feature_expectations
from replication.learning.seeds import trial_seeds
from replication.paper.params import Update
from replication.trials.condition import Condition
from replication.trials.results import digest

SHORT = {"episodes": 300, "horizon": 60, "max_iterations": 60}


@pytest.mark.parametrize("solver", ["q-learning", "planning"])
@pytest.mark.parametrize("reading", ["printed", "updated"])
def test_it_is_algorithm_1_with_a_trace_of_one(
    small_demos: Demos, solver: str, reading: str
) -> None:
    """Identity: unified with F_0 = 1 that never moves has the same bits in whole trials."""
    params = Params.of(solver=solver, **SHORT)
    fixed = Params.of(solver=solver, alpha=0.0, f_start=1.0, f_index=reading, **SHORT)
    for seed in trial_seeds(4, 2):
        one = BaselineCondition(small_demos, "perceptron", params).trial(seed=seed)
        other = BaselineCondition(small_demos, "unified", fixed).trial(seed=seed)
        assert one.iterations > 1
        assert digest(one) == digest(other)
        if solver == "q-learning":
            assert digest(Condition(small_demos, "unified", fixed).trial(seed=seed)) == digest(one)


def test_weights_are_the_sum_of_all_mistakes(small_demos: Demos) -> None:
    """After a trial w is the sum of mu_E - mu_i over the trajectories that were mistakes."""
    asked = BaselineCondition(small_demos, "perceptron", Params.of(solver="planning"))
    trial = asked.trial(seed=trial_seeds(5, 1)[0])
    right, shape = small_demos.correct[0], trial.weights.shape
    total = np.zeros(shape)
    for episode in trial.episodes[:-1]:
        total += feature_expectations(right.states, right.actions, gamma=0.9, shape=shape)
        total -= feature_expectations(episode.states, episode.actions, gamma=0.9, shape=shape)
    assert trial.converged
    np.testing.assert_allclose(trial.weights, total, rtol=0, atol=1e-12)


def test_a_step_by_hand() -> None:
    """Each weight moves by its residual, whatever is marked and whatever the parameters say."""
    mu_e, mu_i = np.array([[1.0, 0.0, 0.9]]), np.array([[0.0, 1.0, 0.9]])
    marked = np.array([[False, True, False]])
    w, memory = perceptron.update(
        np.array([[0.5, 0.5, 0.5]]), np.zeros((1, 3)), mu_e, mu_i, marked, Update(alpha=0.9)
    )
    np.testing.assert_array_equal(w, [[1.5, -0.5, 0.5]])
    assert not memory.any()
