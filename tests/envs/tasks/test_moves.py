from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from replication.envs.tasks.moves import CERTAIN, Moves

Array = NDArray[Any]


def dense(moves: Moves) -> tuple[Array, Array]:
    """Return the probabilities of a table, [state, action, successor], and those of its starts."""
    n_states, n_actions = moves.shape
    table = np.zeros((n_states * n_actions + 1, n_states))
    table[np.repeat(np.arange(len(table)), np.diff(moves.first)), moves.successors] = (
        moves.probabilities
    )
    return table[:-1].reshape(n_states, n_actions, n_states), table[-1]


@settings(max_examples=100, deadline=None)
@given(st.integers(0, 2**32))
def test_a_table_keeps_its_probabilities(seed: int) -> None:
    """Outcomes in any order, in parts or impossible, give the table of their probabilities."""
    rng = np.random.default_rng(seed)
    shape = int(rng.integers(1, 6)), int(rng.integers(1, 4))
    wanted = rng.dirichlet(np.full(shape[0], 0.5), shape)
    wanted[rng.random(shape) < 0.3] = np.eye(shape[0])[0]  # no chance
    starts = rng.dirichlet(np.ones(shape[0]))
    ends = rng.random(shape[0]) < 0.3
    outcomes = [x.ravel().repeat(2) for x in (*np.indices(wanted.shape), wanted / 2)]
    order = rng.permutation(len(outcomes[0]))
    state, action, successor, probability = (x[order] for x in outcomes)
    moves = Moves.of((state, action, successor, probability), shape=shape, starts=starts, ends=ends)
    table, begins = dense(moves)
    assert moves.shape == shape
    np.testing.assert_allclose(table, wanted, rtol=1e-12)
    np.testing.assert_allclose(begins, starts, rtol=1e-12)
    assert (moves.probabilities > 0).all()
    assert moves.ends.tolist() == ends.tolist()
    for begin, end in zip(moves.first[:-1], moves.first[1:], strict=True):
        assert (np.diff(moves.successors[begin:end]) > 0).all()
        exact = moves.probabilities[begin:end].cumsum() * CERTAIN
        assert (np.abs(moves.bounds[begin:end].astype(float) - exact) <= 0.51).all()
        assert moves.bounds[end - 1] == CERTAIN
    values = rng.normal(size=shape[0])
    expected = wanted @ np.where(ends, 0.0, values)
    np.testing.assert_allclose(moves.ahead(values), expected, atol=1e-12)


def test_equal_outcomes_are_one() -> None:
    """A wall on two sides of a cell, twice 1/2, leaves nothing to chance."""
    moves = Moves.of(
        ([0, 0], [0, 0], [0, 0], [0.5, 0.5]), shape=(1, 1), starts=[1], ends=np.array([False])
    )
    assert moves.first.tolist() == [0, 1, 2]
    assert moves.bounds.tolist() == [CERTAIN, CERTAIN]


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"outcomes": ([0, 2], [0, 0], [1, 1], [1, 1])}, "states must be .* from 0 to 1"),
        ({"outcomes": ([0, -1], [0, 0], [1, 1], [1, 1])}, "states must be .* from 0 to 1"),
        ({"outcomes": ([0, 1], [0, 1], [1, 1], [1, 1])}, "actions must be .* from 0 to 0"),
        ({"outcomes": ([0, 1], [0, 0], [1.0, 1.0], [1, 1])}, "successors must be .* from 0 to 1"),
        ({"outcomes": ([[0, 1]], [0, 0], [1, 1], [1, 1])}, "states must be a list"),
        ({"outcomes": ([0, 1], [0, 0], [1, 1], [1])}, "four lists of the same length"),
        ({"outcomes": ([0, 1], [0, 0], [1, 1], [1, 2])}, "state 1, action 0 must sum to 1, not 2"),
        ({"outcomes": ([0], [0], [1], [1])}, "state 1, action 0 must sum to 1, not 0"),
        ({"outcomes": ([0, 1], [0, 0], [1, 1], [1, 0.99999])}, "must sum to 1, not 0.99999"),
        ({"outcomes": ([0, 1, 1], [0] * 3, [1] * 3, [1, 2, -1])}, "must not be negative"),
        ({"outcomes": ([0, 1], [0, 0], [1, 1], [1, np.nan])}, "must not be negative"),
        ({"starts": [0.5, 0.4]}, "probabilities of the starts must sum to 1, not 0.9"),
        ({"starts": [1]}, "starts and ends must have 2 entries"),
        ({"ends": [False]}, "starts and ends must have 2 entries"),
        ({"ends": [0, 1]}, "those of ends bool"),
        ({"shape": (2, 0)}, "there must be an action"),
    ],
)
def test_what_does_not_fit_is_refused(change: dict[str, Any], message: str) -> None:
    """What is no table of probabilities raises a ValueError that says why."""
    table: dict[str, Any] = {
        "outcomes": ([0, 1], [0, 0], [1, 1], [1, 1]),
        "shape": (2, 1),
        "starts": [1, 0],
        "ends": [False, True],
    }
    Moves.of(**table)
    with pytest.raises(ValueError, match=message):
        Moves.of(**table | change)
