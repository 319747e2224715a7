from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from replication.learning.planning import plan
from replication.learning.policy_iteration import iterate, visits

Table = tuple[NDArray[np.int64], NDArray[np.bool_], NDArray[np.float64], float]


@st.composite
def tables(draw: st.DrawFn) -> Table:
    """Any small table of moves with rewards, among them many equal ones, and a discount."""
    n_states, n_actions = draw(st.integers(1, 12)), draw(st.integers(1, 4))
    rng = np.random.default_rng(draw(st.integers(0, 2**32)))
    next_state = rng.integers(n_states, size=(n_states, n_actions))
    ends = rng.random(n_states) < draw(st.sampled_from([0.0, 0.2, 1.0]))
    weights = rng.choice([-1.0, -0.3, 0.0, 0.1, 2.0], size=next_state.shape)
    return next_state, ends, weights, draw(st.sampled_from([0.0, 0.5, 0.9, 0.99]))


def swept(table: Table) -> Any:
    """Return what value iteration finds."""
    next_state, ends, weights, gamma = table
    return plan(weights, lambda v: np.where(ends, 0.0, v)[next_state], gamma=gamma)


@given(tables())
def test_it_finds_what_value_iteration_finds(table: Table) -> None:
    """Both have the same Q, in loops and at ends, whatever ties."""
    next_state, ends, weights, gamma = table
    found = iterate(next_state, ends, weights, gamma=gamma)
    np.testing.assert_allclose(found, swept(table), rtol=0, atol=1e-9)


@given(tables(), st.integers(0, 2**32))
def test_where_it_begins_does_not_matter(table: Table, seed: int) -> None:
    """From any other Q it comes to the same values, and leaves that Q as it is."""
    next_state, ends, weights, gamma = table
    begin = np.random.default_rng(seed).normal(size=weights.shape)
    before = begin.copy()
    found = iterate(next_state, ends, weights, gamma=gamma, q=begin)
    np.testing.assert_allclose(found, swept(table), rtol=0, atol=1e-9)
    np.testing.assert_array_equal(begin, before)


@pytest.mark.parametrize("seed", range(100))
def test_rounding_does_not_keep_it_going(seed: int) -> None:
    """It ends where loops along a path are worth the same on paper, and differ in their last bits.

    After the first update an agent earns c gamma^t by moving on from cell t: so ahead and back is
    worth as much as back and ahead, and rounding could replace either by the other for ever.
    """
    rng = np.random.default_rng(seed)
    n, gamma = int(rng.integers(2, 16)), float(rng.choice([0.7, 0.9, 0.95, 0.99]))
    cells = np.arange(n + 1)
    moves = np.stack([np.maximum(cells - 1, 0), np.minimum(cells + 1, n)], axis=1)
    weights = np.zeros(moves.shape)
    weights[:n, 1] = rng.uniform(0.1, 1) * gamma ** cells[:n]
    table = moves, cells == n, weights, gamma
    found = iterate(*table[:3], gamma=gamma, q=rng.normal(size=moves.shape))
    np.testing.assert_allclose(found, swept(table), rtol=0, atol=1e-9)


@given(tables(), st.integers(0, 2**32))
def test_visits_solve_their_equations(table: Table, seed: int) -> None:
    """A visit begins at the start or comes, discounted, from another one; at ends there is none."""
    next_state, ends, _, gamma = table
    n, rng = len(ends), np.random.default_rng(seed)
    policy, start = rng.integers(next_state.shape[1], size=n), int(rng.integers(n))
    leads = np.eye(n)[next_state[np.arange(n), policy]] * ~ends[:, None]
    states = np.linalg.solve(np.eye(n) - gamma * leads.T, np.eye(n)[start]) * ~ends
    expected = states[:, None] * np.eye(next_state.shape[1])[policy]
    found = visits(next_state, ends, policy, start, gamma=gamma)
    np.testing.assert_allclose(found, expected, rtol=0, atol=1e-12)


def test_ways_of_equal_worth_have_equal_values() -> None:
    """Around the two sides of a square the values agree to the last few bits."""
    moves = np.array([[1, 2], [3, 3], [3, 3], [3, 3]])
    ends = np.array([False, False, False, True])
    weights = np.array([[0.1, 0.2], [0.2 / 0.9, 0], [0.1 / 0.9, 0], [0, 0]])
    q = iterate(moves, ends, weights, gamma=0.9)
    assert q[0, 0] == pytest.approx(q[0, 1], rel=1e-15)


@pytest.mark.parametrize("gamma", [1.0, -0.1, np.nan])
def test_sums_without_end_are_refused(gamma: float) -> None:
    """The discount is from 0 to below 1."""
    with pytest.raises(ValueError, match="below 1"):
        iterate(np.zeros((1, 1), int), np.array([False]), np.zeros((1, 1)), gamma=gamma)
