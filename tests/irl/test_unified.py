from __future__ import annotations

import hypothesis.extra.numpy as hnp
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from replication.irl import unified
from replication.paper.params import Update

# A row of four pairs: the agent alone, the expert earlier, the expert alone, both at one time.
# (Fig. 2 of the paper draws such a row, but with visits that cannot all occur in one trajectory:
# two different pairs of the expert's have the same discount.)
MU_E = np.array([[0.0, 0.9, 0.81, 1.0]])
MU_I = np.array([[0.9, 0.81, 0.0, 1.0]])
NONE = np.zeros((1, 4), dtype=bool)
AGENT_ALONE = np.array([[True, False, False, False]])


def test_printed_reading_moves_weights_by_the_old_trace() -> None:
    """Eqs. 8-10 on given numbers: w moves by F_i, and F approaches 1 or 0 by alpha."""
    f = np.full((1, 4), 0.5)
    w, f_next = unified.update(np.zeros((1, 4)), f, MU_E, MU_I, NONE, Update(alpha=0.3))
    np.testing.assert_allclose(w, [[-0.45, 0.045, 0.405, 0.0]], atol=1e-15)
    np.testing.assert_allclose(f_next, [[0.65, 0.65, 0.65, 0.35]], atol=1e-15)


def test_updated_reading_moves_weights_by_the_new_trace() -> None:
    """With F-INDEX updated the same numbers move w by F_(i+1)."""
    f = np.full((1, 4), 0.5)
    params = Update(alpha=0.3, f_index="updated")
    w, _ = unified.update(np.zeros((1, 4)), f, MU_E, MU_I, NONE, params)
    np.testing.assert_allclose(w, [[-0.585, 0.0585, 0.5265, 0.0]], atol=1e-15)


def test_incorrect_pair_that_the_agent_visits_gets_the_largest_trace() -> None:
    """Algorithm 2, lines 11-12: F is 1 where the agent is wrong, the expert never, mu_B is set."""
    params = Update(alpha=0.3, f_index="updated")
    f = np.full((1, 4), 0.5)
    w, f_next = unified.update(np.zeros((1, 4)), f, MU_E, MU_I, AGENT_ALONE, params)
    assert f_next[0, 0] == 1.0
    assert w[0, 0] == pytest.approx(-0.9)


@pytest.mark.parametrize("column", [1, 2, 3])
def test_incorrect_pair_of_the_experts_is_not_special(column: int) -> None:
    """A pair that the expert visits is never treated as incorrect, whatever mu_B says."""
    mu_b = np.zeros((1, 4), dtype=bool)
    mu_b[0, column] = True
    f = np.full((1, 4), 0.5)
    marked = unified.update(np.zeros((1, 4)), f, MU_E, MU_I, mu_b, Update())
    plain = unified.update(np.zeros((1, 4)), f, MU_E, MU_I, NONE, Update())
    for one, other in zip(marked, plain, strict=True):
        np.testing.assert_array_equal(one, other)


def test_start_is_f_0_everywhere() -> None:
    """Line 3 of both listings: all pairs start with the same trace."""
    assert (unified.start((3, 2), Update(f_start=0.1)) == np.full((3, 2), 0.1)).all()


visits = hnp.arrays(float, (3, 4), elements=st.floats(0, 10, allow_subnormal=False))
marks = hnp.arrays(bool, (3, 4))


@given(visits, visits, marks, st.sampled_from(["printed", "updated"]))
def test_trace_stays_in_range_and_weights_follow_the_residual(
    mu_e: np.ndarray, mu_i: np.ndarray, mu_b: np.ndarray, f_index: str
) -> None:
    """F stays in (0, 1], and each weight moves to the side of its residual, never farther."""
    f = np.full((3, 4), 0.5)
    w, f_next = unified.update(np.zeros((3, 4)), f, mu_e, mu_i, mu_b, Update(f_index=f_index))
    assert ((f_next > 0) & (f_next <= 1)).all()
    assert (np.sign(w) == np.sign(mu_e - mu_i)).all()
    assert (np.abs(w) <= np.abs(mu_e - mu_i)).all()


@given(visits, marks)
def test_equal_expectations_change_no_weight(mu: np.ndarray, mu_b: np.ndarray) -> None:
    """Where the agent does as the expert, the weights stay and the trace decays."""
    f = np.full((3, 4), 0.5)
    w, f_next = unified.update(np.ones((3, 4)), f, mu, mu, mu_b, Update(alpha=0.3))
    assert (w == 1).all()
    np.testing.assert_allclose(f_next, 0.35)
