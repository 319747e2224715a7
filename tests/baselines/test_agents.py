from __future__ import annotations

import numpy as np
import pytest

from replication import fit
from replication.baselines import BaselineCondition
from replication.demos.model import Demos
from replication.irl import METHODS
from replication.learning.seeds import trial_seeds
from replication.paper.params import Params
from replication.trials.condition import Condition


@pytest.mark.parametrize("method", METHODS)
def test_the_quick_planner_does_what_the_plain_one_does(small_demos: Demos, method: str) -> None:
    """Each trial takes the same trajectories to the same end."""
    params = Params.of(solver="planning", incorrect="all", gamma=0.8)
    for seed in trial_seeds(3, 4):
        quick = BaselineCondition(small_demos, method, params).trial(seed=seed)
        plain = Condition(small_demos, method, params).trial(seed=seed)
        np.testing.assert_array_equal(quick.errors, plain.errors)
        np.testing.assert_allclose(quick.weights, plain.weights, rtol=0, atol=1e-12)
        np.testing.assert_allclose(quick.q, plain.q, rtol=0, atol=1e-9)
        assert quick.steps == plain.steps == 0
        assert not quick.collisions.any()


def test_a_copier_does_what_the_expert_does(small_demos: Demos) -> None:
    """It is at the goal before the first iteration, by the expert's way, without a step."""
    result = fit(small_demos, method="cloning", seed=1)
    expert = small_demos.correct[0]
    assert (result.iterations, result.error, result.converged) == (0, 0.0, True)
    assert result.actions.tolist() == expert.actions.tolist()
    assert result.policy()[expert.states[:-1]].tolist() == expert.actions.tolist()
