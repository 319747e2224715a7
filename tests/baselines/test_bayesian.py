from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise, product

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy import stats

from replication import Demos, Params
from replication.baselines import BaselineCondition, Problem, bayesian, condition, table_of
from replication.baselines.bayesian import Likelihood, draw_proposals, plan_again, walk
from replication.demos.model import Demo, state_action_pairs
from replication.envs.tasks.moves import Moves
from replication.learning.planning import plan

Array = NDArray[np.float64]


def table(next_state: Sequence[Sequence[int]]) -> Moves:
    """Return a table without chance or end, with episodes from state 0."""
    moves = np.array(next_state)
    states, actions = np.indices(moves.shape).reshape(2, -1)
    ends = np.zeros(len(moves), bool)
    outcomes = (states, actions, moves.ravel(), np.ones(moves.size))
    return Moves.of(outcomes, shape=moves.shape, starts=np.eye(len(moves))[0], ends=ends)


def demo(name: str, states: Sequence[int], actions: Sequence[int]) -> Demo:
    """Return a demonstration."""
    return Demo(name, "correct", np.array(states), np.array(actions))


# Two states between which one may go; the wrong demonstration begins like the right one.
NEXT = ((1, 0), (0, 1))
GAMMA = 0.5
RIGHT = demo("right", [0, 1], [0])
WRONG = demo("wrong", [0, 1, 0], [0, 0])


def exact(wrong: bool) -> tuple[Array, Array, Array]:
    """Return the share of each orthant, means and standard deviations of the posterior, on a grid.

    Q is the best over the four policies, whose values are solved for; marked is (1, 0) alone.
    """
    axis = (np.arange(36) + 0.5) / 36 * 8 - 4
    w: Array = np.array(np.meshgrid(*[axis] * 4, indexing="ij")).reshape(2, 2, -1)
    values = []
    for policy in product((0, 1), repeat=2):
        leads = np.eye(2)[[NEXT[s][policy[s]] for s in (0, 1)]]
        rewards = np.stack([w[s, policy[s]] for s in (0, 1)])
        values.append(np.linalg.solve(np.eye(2) - GAMMA * leads, rewards))
    q = w + GAMMA * np.max(values, axis=0)[np.array(NEXT)]
    pi = np.exp(bayesian.ALPHA * q) / np.exp(bayesian.ALPHA * q).sum(axis=1, keepdims=True)
    density = np.exp(-(w**2).sum(axis=(0, 1)) / 2) * pi[0, 0]
    if wrong:
        density *= 1 - pi[1, 0]
    density /= density.sum()
    flat = w.reshape(4, -1)
    mean = flat @ density
    deviation = np.sqrt((flat - mean[:, None]) ** 2 @ density)
    return np.bincount(orthant(flat.T), density, 16).astype(float), mean, deviation


def orthant(w: Array) -> NDArray[np.int64]:
    """Return which of four weights are positive, as a number; w is [n, 4]."""
    return (w > 0) @ (1 << np.arange(4))


@pytest.mark.parametrize("wrong", [False, True])
def test_the_chain_samples_the_posterior(wrong: bool) -> None:
    """Of a task with two states it has the exact one: shares, means and standard deviations.

    Runs with other seeds are off by 0.02 to 0.03 in total variation, and means by up to 0.06.
    """
    problem = Problem(table(NEXT), [RIGHT], [WRONG] if wrong else [], GAMMA)
    likelihood = Likelihood.of(problem)
    drawn = draw_proposals(likelihood.rows, (2, 2), 60_000, seed=5)
    chain = np.array([w.ravel().copy() for w in walk(problem, likelihood, drawn)])[1000:]
    shares, mean, deviation = exact(wrong)
    found = np.bincount(orthant(chain), minlength=16) / len(chain)
    assert np.abs(found - shares).sum() / 2 < 0.05
    np.testing.assert_allclose(chain.mean(axis=0), mean, rtol=0, atol=0.1)
    np.testing.assert_allclose(chain.std(axis=0), deviation, rtol=0, atol=0.1)
    if wrong:  # the two posteriors can be told apart
        assert np.abs(exact(False)[1] - mean).max() > 0.4


def test_without_demonstrations_the_chain_samples_the_prior() -> None:
    """If nothing has been seen, each weight is standard normal."""
    problem = Problem(table(NEXT), [RIGHT], [], GAMMA)
    nothing = Likelihood(np.arange(2), np.zeros((2, 2)), np.zeros((2, 2), bool))
    drawn = draw_proposals(nothing.rows, (2, 2), 40_000, seed=6)
    chain = np.array([w.ravel().copy() for w in walk(problem, nothing, drawn)])[::40]
    assert all(stats.kstest(w, "norm").pvalue > 0.001 for w in chain.T)


def test_likelihood_is_that_of_plain_bayesian_irl(small_demos: Demos) -> None:
    """Correct steps count by log pi; marked pairs, but no others of incorrect ones, by 1 - pi."""
    rng = np.random.default_rng(1)
    moves = table_of(small_demos.environment)
    assert moves is not None
    q = rng.normal(size=moves.shape)
    pi = np.exp(bayesian.ALPHA * q)
    pi /= pi.sum(axis=1, keepdims=True)
    right = small_demos.correct[0]
    plain = sum(np.log(pi[pair]) for pair in zip(right.states[:-1], right.actions, strict=True))
    without = Problem(moves, small_demos.correct, [], 0.9)
    assert Likelihood.of(without).log(q) == pytest.approx(plain, rel=1e-12)
    marked = state_action_pairs(*small_demos.incorrect) - state_action_pairs(right)
    assert state_action_pairs(right) & state_action_pairs(*small_demos.incorrect)
    full = plain + sum(np.log(1 - pi[pair]) for pair in marked)
    with_them = Problem(moves, small_demos.correct, small_demos.incorrect, 0.9)
    assert Likelihood.of(with_them).log(q) == pytest.approx(full, rel=1e-9)


def test_steps_count_as_often_as_they_are_shown() -> None:
    """Twice the demonstration has twice the log likelihood, and a marked pair counts once."""
    q = np.array([[0.3, 0.0], [0.1, 0.4]])
    alone, marked = (
        Likelihood.of(Problem(table(NEXT), [RIGHT], wrong, GAMMA)).log(q) for wrong in ([], [WRONG])
    )
    twice = Likelihood.of(Problem(table(NEXT), [RIGHT] * 2, [WRONG] * 2, GAMMA)).log(q)
    assert twice == pytest.approx(2 * alone + (marked - alone), rel=1e-12)


def test_an_improbable_pair_has_no_rounding() -> None:
    """Where pi is 1 to the last bit, log(1 - pi) is still a number, and the right one."""
    moves = table(NEXT)
    likelihood = Likelihood.of(Problem(moves, [RIGHT], [WRONG], GAMMA))
    q = np.array([[0.0, 0.0], [60.0, 0.0]])
    assert likelihood.log(q) == pytest.approx(np.log(0.5) - 600, rel=1e-12)


def test_what_is_planned_again_is_exact() -> None:
    """Along a walk Q is the optimal one of the weights, with chance or not, and most cost no plan.

    The oracle is plain value iteration.
    """
    rng = np.random.default_rng(2)
    chances = rng.dirichlet(np.ones(5), size=20).ravel()
    states, actions, after = np.indices((5, 4, 5)).reshape(3, -1)
    ends = np.arange(5) == 4
    shape = 5, 4
    outcomes = states, actions, after, chances
    luck = Moves.of(outcomes, shape=shape, starts=np.eye(5)[0], ends=ends)
    sure = table(rng.integers(5, size=shape).tolist())
    for moves in (luck, sure):
        problem = Problem(moves, [], [], 0.9)
        w = rng.normal(size=shape)
        q = problem.plan(w)
        for pair, step in zip(rng.integers(20, size=200), rng.normal(size=200), strict=True):
            w.flat[pair] += step
            q = plan_again(problem.plan, w, q, int(pair), float(step))
            np.testing.assert_allclose(q, plan(w, moves.ahead, gamma=0.9), rtol=0, atol=1e-9)
        assert 20 < problem.plans < 160


def test_a_rejected_move_leaves_everything(small_demos: Demos) -> None:
    """Weights change in the one pair that was proposed, by that step, or not at all."""
    found = table_of(small_demos.environment)
    assert found is not None
    problem = Problem(found, small_demos.correct, small_demos.incorrect, 0.9)
    likelihood = Likelihood.of(problem)
    drawn = draw_proposals(likelihood.rows, found.shape, 400, seed=7)
    chain = [np.zeros(found.shape), *(w.copy() for w in walk(problem, likelihood, drawn))]
    moved = [after - before for before, after in pairwise(chain)]
    for change, pair, step in zip(moved, drawn.pairs, drawn.steps, strict=True):
        assert change.flat[pair] in (0.0, pytest.approx(step, abs=1e-12))
        assert np.count_nonzero(change) <= 1
    kept = [change.any() for change in moved]
    assert 0.2 < np.mean(kept) < 0.98


def test_half_of_the_moves_are_where_demonstrations_are() -> None:
    """Rows get half of the moves and their share of the rest; all actions get the same."""
    drawn = draw_proposals(np.array([3, 7]), (10, 4), 40_000, seed=8)
    state, action = np.divmod(drawn.pairs, 4)
    assert np.isin(state, [3, 7]).mean() == pytest.approx(0.6, abs=0.01)
    assert set(state) == set(range(10))
    np.testing.assert_allclose(np.bincount(action) / 40_000, 0.25, atol=0.01)
    assert (drawn.levels <= 0).all()


def test_the_estimate_is_the_mean_of_the_second_half(
    small_demos: Demos, monkeypatch: pytest.MonkeyPatch
) -> None:
    """It has equal bits each time, whatever the seed of the trial."""
    monkeypatch.setattr(bayesian, "LENGTH", 501)
    monkeypatch.setattr(condition, "_FOUND", {})
    params = Params.of(incorrect="hit", solver="planning")
    asked = BaselineCondition(small_demos, "bayesian", params)
    found = table_of(small_demos.environment)
    assert found is not None
    some = small_demos.select("hit")
    problem = Problem(found, some.correct, some.incorrect, params.learner.gamma)
    likelihood = Likelihood.of(problem)
    drawn = draw_proposals(likelihood.rows, found.shape, 501, seed=bayesian.ROOT)
    chain = np.array([w.copy() for w in walk(problem, likelihood, drawn)])
    np.testing.assert_allclose(asked.found.weights, chain[250:].mean(axis=0), atol=1e-12)
    one, other = (asked.trial(seed=np.random.SeedSequence(seed)).weights for seed in (1, 2))
    np.testing.assert_array_equal(one, other)
    np.testing.assert_array_equal(one, bayesian.find(problem))
