from __future__ import annotations

import numpy as np
import pytest

from replication import Demos, Maze, Params, fit, make_demos
from replication.baselines import BaselineCondition
from replication.demos.checks import DemoWarning
from replication.learning.seeds import trial_seeds


@pytest.mark.parametrize("solver", ["q-learning", "planning"])
def test_nothing_is_left_to_learn(stored_demos: Demos, solver: str) -> None:
    """In the paper's mazes d = 0 before the first iteration, without a step and a reward."""
    asked = BaselineCondition(stored_demos, "cloning", Params.of(solver=solver))
    for seed in trial_seeds(9, 3):
        trial = asked.trial(seed=seed)
        assert (trial.iterations, trial.errors.tolist(), trial.steps) == (0, [0.0], 0)
        assert not trial.weights.any()


def test_soccer_is_copied_too(soccer_demos: Demos) -> None:
    """It needs no table: the goal falls as the expert scored it."""
    result = fit(soccer_demos, method="cloning", seed=1)
    assert (result.iterations, result.error, result.converged) == (0, 0.0, True)
    assert result.actions.tolist() == soccer_demos.correct[0].actions.tolist()


def test_the_policy_is_the_experts_action(stored_demos: Demos) -> None:
    """Where the expert acts it is the action by mu_E; elsewhere all actions are as good."""
    result = fit(stored_demos, method="cloning", seed=1)
    right = stored_demos.correct[0]
    discounts = 0.9 ** np.arange(len(right.actions))
    np.testing.assert_allclose(result.q[right.states[:-1], right.actions], discounts)
    assert result.policy()[right.states[:-1]].tolist() == right.actions.tolist()
    others = np.setdiff1d(np.arange(stored_demos.environment.n_states), right.states[:-1])
    assert not result.q[others].any()


def test_of_several_actions_it_takes_the_most_frequent() -> None:
    """Two of three go up first: so does the copy, and d is what the third one adds to mu_E."""
    up, across = ["up", "right"], ["right", "up"]
    square = Maze.from_text("""
        .G
        S.
    """)
    demos = make_demos(square, {"correct": [up, up, across]})
    with pytest.warns(DemoWarning):
        result = fit(
            {"correct": [up, up, across]},
            task=square,
            method="cloning",
            plateau=0,
            max_iterations=3,
            seed=1,
        )
    assert result.actions.tolist() == demos.correct[0].actions.tolist()
    assert not result.weights.any()  # though there were three updates
    # Each of two pairs has 2/3 of its visit instead of all, each of two others 1/3 instead of none.
    assert result.errors[0] == pytest.approx(np.sqrt(2 * (1 + 0.9**2)) / 3)
