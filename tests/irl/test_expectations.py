from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from replication import Demos
from replication.irl.expectations import feature_expectations, mean_expectations, visited

SHAPE = (5, 3)
PAIRS = st.lists(st.tuples(st.integers(0, 4), st.integers(0, 2)), max_size=30)
GAMMAS = st.floats(0.0, 1.0)


@dataclass(frozen=True)
class Way:
    """A trajectory."""

    states: NDArray[np.int64]
    actions: NDArray[np.int64]


def way(pairs: list[tuple[int, int]], last: int = 0) -> Way:
    """Make a trajectory of pairs that ends in the state `last`."""
    states = np.array([*(state for state, _ in pairs), last], dtype=np.int64)
    return Way(states, np.array([action for _, action in pairs], dtype=np.int64))


def mu(pairs: list[tuple[int, int]], gamma: float) -> NDArray[np.float64]:
    """Return the feature expectations of a trajectory of pairs."""
    one = way(pairs)
    return feature_expectations(one.states, one.actions, gamma=gamma, shape=SHAPE)


def test_worked_example() -> None:
    """Three steps, the pair of the first visited again: 1 + .25 for it, .5 for the other."""
    found = mu([(2, 1), (0, 0), (2, 1)], 0.5)
    due = np.zeros(SHAPE)
    due[2, 1], due[0, 0] = 1.25, 0.5
    assert found.tolist() == due.tolist()


@given(PAIRS, GAMMAS)
def test_each_visit_counts_its_discount(pairs: list[tuple[int, int]], gamma: float) -> None:
    """Eq. 7 term by term: the sum over t of gamma**t where the pair is visited at t."""
    due = np.zeros(SHAPE)
    for t, pair in enumerate(pairs):
        due[pair] += gamma**t
    np.testing.assert_allclose(mu(pairs, gamma), due, rtol=1e-12, atol=1e-300)


@given(PAIRS, st.floats(0.0, 0.999))
def test_sum_is_the_geometric_series(pairs: list[tuple[int, int]], gamma: float) -> None:
    """All expectations of T steps add up to (1 - gamma**T) / (1 - gamma)."""
    due = (1 - gamma ** len(pairs)) / (1 - gamma)
    assert mu(pairs, gamma).sum() == pytest.approx(due, rel=1e-9)


def test_extreme_discounts() -> None:
    """Without a future only the first pair counts; without a discount visits are counted."""
    pairs = [(1, 1), (2, 2), (1, 1)]
    assert np.argwhere(mu(pairs, 0.0)).tolist() == [[1, 1]]
    assert mu(pairs, 0.0)[1, 1] == 1.0
    assert mu(pairs, 1.0)[1, 1] == 2.0
    assert not mu([], 0.9).any()


@given(PAIRS, PAIRS, PAIRS, GAMMAS)
def test_equal_beginnings_have_equal_bits(
    begin: list[tuple[int, int]],
    one: list[tuple[int, int]],
    other: list[tuple[int, int]],
    gamma: float,
) -> None:
    """What two trajectories add after an equal beginning leaves the other pairs' bits alone."""
    first, second = mu(begin + one, gamma), mu(begin + other, gamma)
    untouched = np.ones(SHAPE, dtype=bool)
    for pair in one + other:
        untouched[pair] = False
    assert first[untouched].tobytes() == second[untouched].tobytes()
    assert first[untouched].tobytes() == mu(begin, gamma)[untouched].tobytes()


def test_last_state_is_optional() -> None:
    """The state that is reached last has no action, so it changes nothing."""
    one = way([(2, 1), (0, 0)], last=4)
    short = feature_expectations(one.states[:2], one.actions, gamma=0.9, shape=SHAPE)
    assert short.tolist() == mu([(2, 1), (0, 0)], 0.9).tolist()
    assert not short[4].any()


@given(st.lists(PAIRS, min_size=1, max_size=5), GAMMAS)
def test_mean_expectations_are_the_mean(ways: list[list[tuple[int, int]]], gamma: float) -> None:
    """Eq. 5: the sum over the demonstrations, divided by their number; one has its own bits."""
    found = mean_expectations([way(pairs) for pairs in ways], gamma=gamma, shape=SHAPE)
    due = sum((mu(pairs, gamma) for pairs in ways), np.zeros(SHAPE)) / len(ways)
    np.testing.assert_allclose(found, due, rtol=1e-12, atol=1e-300)
    alone = mean_expectations([way(ways[0])], gamma=gamma, shape=SHAPE)
    assert alone.tobytes() == mu(ways[0], gamma).tobytes()


@given(st.lists(PAIRS, min_size=1, max_size=5), st.randoms(use_true_random=False), GAMMAS)
def test_equal_shares_have_equal_bits(
    ways: list[list[tuple[int, int]]], random: Any, gamma: float
) -> None:
    """Neither the order of trajectories nor a common multiple of their numbers changes a bit."""
    found = mean_expectations([way(pairs) for pairs in ways], gamma=gamma, shape=SHAPE)
    mixed = [*ways, *ways]
    random.shuffle(mixed)
    again = mean_expectations([way(pairs) for pairs in mixed], gamma=gamma, shape=SHAPE)
    assert again.tobytes() == found.tobytes()


@given(st.lists(PAIRS, max_size=5))
def test_visited_is_the_indicator_of_the_counts(ways: list[list[tuple[int, int]]]) -> None:
    """INCORRECT-INDICATOR: true exactly where the undiscounted count of Eq. 11 is not zero."""
    counts = np.zeros(SHAPE)
    for pairs in ways:
        for pair in pairs:
            counts[pair] += 1
    found = visited([way(pairs, last=3) for pairs in ways], shape=SHAPE)
    assert found.dtype == bool
    assert (found == (counts != 0)).all()


def test_stored_demonstrations(stored_demos: Demos) -> None:
    """A stored correct demonstration visits a pair a step, none twice, by falling discounts."""
    maze, (correct,) = stored_demos.environment, stored_demos.correct
    shape = (maze.n_states, maze.n_actions)
    found = mean_expectations([correct], gamma=0.9, shape=shape)
    steps = np.argsort(-found, axis=None)[: len(correct.actions)]
    assert (np.count_nonzero(found)) == len(correct.actions)
    assert [divmod(int(k), 4) for k in steps] == list(
        zip(correct.states.tolist(), correct.actions.tolist(), strict=False)
    )
