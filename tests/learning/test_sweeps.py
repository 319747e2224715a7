from typing import Any, NamedTuple

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from replication.envs.tasks.moves import Moves
from replication.learning import planning, sweeps
from tests.learning import plain
from tests.learning.test_chance import make_moves

Array = NDArray[Any]


class Case(NamedTuple):
    """A table of moves, weights, a start of Q, a policy, and a discount factor."""

    moves: Moves
    weights: Array
    q: Array
    policy: Array
    gamma: float


@st.composite
def cases(draw: st.DrawFn) -> Case:
    """Draw tables with and without chance, ends, several starts, and weights of any sign."""
    rng = np.random.default_rng(draw(st.integers(0, 2**32)))
    shape = draw(st.integers(1, 8)), draw(st.integers(1, 5))
    table = rng.dirichlet(np.full(shape[0], 0.3), shape)
    certain = rng.random(shape) >= draw(st.sampled_from([0.0, 0.5, 1.0]))
    table[certain] = np.eye(shape[0])[rng.integers(0, shape[0], shape)][certain]
    ends = rng.random(shape[0]) < draw(st.sampled_from([0.0, 0.3]))
    one = np.eye(shape[0])[rng.integers(shape[0])]
    starts = rng.dirichlet(np.ones(shape[0])) if draw(st.booleans()) else one
    scale = draw(st.sampled_from([0.0, 1.0, 100.0]))
    weights = scale * (rng.normal(size=shape) - draw(st.sampled_from([0.0, 2.0])))
    policy = rng.dirichlet(np.full(shape[1], draw(st.sampled_from([0.01, 1.0]))), shape[0])
    gamma = draw(st.sampled_from([0.0, 0.5, 0.9, 0.97]))
    return Case(
        make_moves(table, starts, ends), weights, 300 * rng.normal(size=shape), policy, gamma
    )


def near(found: Array, expected: Array) -> bool:
    """Return whether two arrays agree to 1e-9 of their largest number, or of one."""
    return bool(np.abs(found - expected).max() <= 1e-9 * max(1.0, np.abs(expected).max()))


@settings(max_examples=300)
@given(cases())
def test_optimal_values_are_those_of_the_reference(case: Case) -> None:
    """On any table, the optimal Q is that of plain value iteration."""
    found = sweeps.optimal(case.moves, case.weights, gamma=case.gamma)
    assert near(found, planning.plan(case.weights, case.moves.ahead, gamma=case.gamma))


@settings(max_examples=300)
@given(cases())
def test_soft_values_are_those_of_a_plain_iteration(case: Case) -> None:
    """On any table, the soft Q is the fixed point of log sum exp, found in plain NumPy."""
    found = sweeps.soft(case.moves, case.weights, gamma=case.gamma)
    assert near(found, plain.plan_softly(case.moves, case.weights, gamma=case.gamma))


@settings(max_examples=200)
@given(cases(), st.booleans())
def test_a_start_changes_nothing(case: Case, softly: bool) -> None:
    """From whatever Q planning begins, above or below, far or near, it ends at the same one."""
    find = sweeps.soft if softly else sweeps.optimal
    cold = find(case.moves, case.weights, gamma=case.gamma)
    for q in (case.q, cold + 1e-3, cold):
        assert near(find(case.moves, case.weights, gamma=case.gamma, q=q), cold)


@pytest.mark.parametrize("seed", range(40))
def test_without_rewards_nothing_is_worth_anything(seed: int) -> None:
    """From a Q far away, values without rewards fall until they are nothing, and planning ends."""
    rng = np.random.default_rng(seed)
    table = rng.dirichlet(np.full(6, 0.3), (6, 2))
    moves = make_moves(table, np.eye(6)[0], np.zeros(6, bool))
    q = 300 * rng.normal(size=(6, 2))
    assert near(sweeps.optimal(moves, np.zeros((6, 2)), gamma=0.9, q=q), np.zeros((6, 2)))


@settings(max_examples=300)
@given(cases())
def test_visits_solve_their_equations(case: Case) -> None:
    """On any table, the visits of a policy are the solution of a system of linear equations."""
    found = sweeps.visits(case.moves, case.policy, gamma=case.gamma)
    assert near(found, plain.visits(case.moves, case.policy, gamma=case.gamma))
    assert (found >= 0).all()
    assert not found[case.moves.ends].any()


@settings(max_examples=200)
@given(cases())
def test_no_time_is_lost(case: Case) -> None:
    """What is not spent in states, (1 - gamma) of each visit, is what has come to an end."""
    mu = sweeps.visits(case.moves, case.policy, gamma=case.gamma)
    begin = case.moves.probabilities[case.moves.first[-2] :]
    ended = begin[case.moves.ends[case.moves.starts]].sum()
    inside = plain.transitions(case.moves).sum(axis=2)
    ended += case.gamma * (mu * (1 - inside)).sum()
    assert near((1 - case.gamma) * mu.sum() + ended, np.array(1.0))


@settings(max_examples=100)
@given(cases(), st.booleans())
def test_an_end_is_worth_nothing(case: Case, softly: bool) -> None:
    """What an end would pay changes no value of another state."""
    find, inside = (sweeps.soft if softly else sweeps.optimal), ~case.moves.ends
    other = np.where(inside[:, None], case.weights, case.weights + 1000)
    found = [find(case.moves, w, gamma=case.gamma)[inside] for w in (case.weights, other)]
    assert near(*found) if inside.any() else True


@settings(max_examples=100)
@given(cases())
def test_inputs_are_not_modified(case: Case) -> None:
    """Neither weights, nor the Q to begin from, nor a policy, nor the table is written to."""
    given = (case.weights, case.q, case.policy, case.moves.probabilities)
    before = [array.copy() for array in given]
    for find in (sweeps.optimal, sweeps.soft):
        find(case.moves, case.weights, gamma=case.gamma, q=case.q)
    sweeps.visits(case.moves, case.policy, gamma=case.gamma)
    assert all((a == b).all() for a, b in zip(given, before, strict=True))


@pytest.mark.parametrize("gamma", [0.999999, 1 - 1e-9])
def test_planning_ends_just_below_one(gamma: float) -> None:
    """In a corridor of 300 cells that costs 1 a move, values are the costs to its end, to the ppm.

    Softly, of two moves that both lead on, each cell adds log 2.
    """
    n = 300
    table = np.eye(n)[np.minimum(np.arange(n) + 1, n - 1)][:, None].repeat(2, axis=1)
    moves = make_moves(table, np.eye(n)[0], np.arange(n) == n - 1)
    weights = np.full((n, 2), -1.0)
    left = np.arange(n - 1, 0, -1)
    hard, soft = (f(moves, weights, gamma=gamma)[:-1] for f in (sweeps.optimal, sweeps.soft))
    discounted = -np.expm1(left * np.log(gamma)) / (1 - gamma)
    np.testing.assert_allclose(hard[:, 0], -discounted, rtol=1e-9)
    np.testing.assert_allclose(soft[:, 0], -discounted + (discounted - 1) * np.log(2), rtol=1e-9)
    mu = sweeps.visits(moves, np.full((n, 2), 0.5), gamma=gamma)
    np.testing.assert_allclose(mu.sum(), discounted[0], rtol=1e-9)


@pytest.mark.parametrize("gamma", [1.0, 1.5, -0.1, np.nan])
def test_a_discount_without_limit_is_refused(gamma: float) -> None:
    """A discount factor of 1, or none, raises a ValueError that says which are possible."""
    moves = make_moves(np.ones((1, 1, 1)), [1.0], [False])
    for function in (sweeps.optimal, sweeps.soft, sweeps.visits):
        with pytest.raises(ValueError, match="from 0 to below 1, not"):
            function(moves, np.ones((1, 1)), gamma=gamma)
