from __future__ import annotations

import numpy as np
import pytest

from replication import Demos, Params
from replication.baselines import BaselineCondition, wary
from replication.irl.methods import TRACES
from replication.learning.seeds import trial_seeds
from replication.paper.params import Update
from replication.trials.results import digest

SHORT = {"episodes": 300, "horizon": 60, "max_iterations": 40}


@pytest.mark.parametrize("solver", ["q-learning", "planning"])
@pytest.mark.parametrize("reading", TRACES)
def test_it_is_algorithm_2_if_nothing_is_marked(
    small_demos: Demos, solver: str, reading: str
) -> None:
    """Identity: without incorrect demonstrations whole trials have the same bits; else not."""
    same = []
    for kinds in ("none", "all"):
        params = Params.of(solver=solver, f_index=reading, incorrect=kinds, **SHORT)
        one, other = (
            digest(BaselineCondition(small_demos, name, params).trial(seed=trial_seeds(7, 1)[0]))
            for name in ("wary", "unified-incorrect")
        )
        same.append(one == other)
    assert same == [True, False]


def test_a_marked_pair_costs_once_and_before_anything_is_learned() -> None:
    """By hand: columns are the agent's marked pair, one nobody took, the expert's, an unmarked.

    F_0 = 0.5 and alpha = 0.3: marked wrong pairs have the trace 1 from the second time on.
    """
    params = Update(alpha=0.3, f_start=0.5)
    mu_e, mu_i = np.array([[0.0, 0.0, 1.0, 0.0]]), np.array([[0.9, 0.0, 0.0, 0.9]])
    marked = np.array([[True, True, True, False]])
    w, memory = np.zeros((1, 4)), wary.start((1, 4), params)
    w, memory = wary.update(w, memory, mu_e, mu_i, marked, params)
    np.testing.assert_allclose(w, [[-1 - 0.45, -1, 0.5, -0.45]], atol=1e-15)
    w, memory = wary.update(w, memory, mu_e, mu_i, marked, params)
    np.testing.assert_allclose(w, [[-1.45 - 0.9, -1, 0.5 + 0.65, -0.45 - 0.585]], atol=1e-15)


def test_the_cost_outweighs_the_first_step() -> None:
    """The largest residual of a pair is 1, the visit of the start: it cannot make up for more."""
    params = Update(f_start=1.0)
    mu_e, mu_i = np.array([[1.0, 0.0]]), np.array([[0.0, 1.0]])
    memory = wary.start((1, 2), params)
    w, _ = wary.update(np.zeros((1, 2)), memory, mu_e, mu_i, np.array([[True, True]]), params)
    assert w[0].tolist() == [1.0, -1.0 - wary.COST]


def test_fewer_marked_pairs_are_taken_at_first(stored_demos: Demos) -> None:
    """After one iteration the agent takes no more marked pairs than Algorithm 2's, and avoids some.

    With a planner: the trials differ in nothing but those weights.
    """
    taken = []
    for name in ("wary", "unified-incorrect"):
        params = Params.of(incorrect="hit+detour+opposite", solver="planning", max_iterations=1)
        asked = BaselineCondition(stored_demos, name, params)
        pairs = {
            pair
            for demo in asked.selected.incorrect
            for pair in zip(demo.states.tolist(), demo.actions.tolist(), strict=False)
        }
        count = 0
        for seed in trial_seeds(8, 10):
            episode = asked.trial(seed=seed).episodes[-1]
            steps = set(zip(episode.states.tolist(), episode.actions.tolist(), strict=False))
            right = stored_demos.correct[0]
            expert = set(zip(right.states.tolist(), right.actions.tolist(), strict=False))
            count += len(steps & pairs - expert)
        taken.append(count)
    assert taken[0] < taken[1]
