from __future__ import annotations

from typing import Any

import hypothesis.extra.numpy as hnp
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from replication import Demos
from replication.demos.model import Demo
from replication.irl import READINGS, get_method, run_trial, unified
from replication.irl.expectations import mean_expectations, visited
from replication.paper.params import Params, Update
from replication.trials.agents import make_agent
from replication.trials.results import digest

Array = NDArray[Any]

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


@pytest.mark.parametrize(
    ("f_index", "marked", "unmarked"),
    [("printed", -0.45, -0.45), ("updated", -0.9, -0.585), ("at-once", -0.9, -0.45)],
)
def test_marked_wrong_pair_under_each_reading(f_index: str, marked: float, unmarked: float) -> None:
    """F_0 = 0.5, alpha = 0.3, residual -0.9: Algorithm 2's line 12 acts later, now, or at once."""
    f, w = np.full((1, 4), 0.5), np.zeros((1, 4))
    params = Update(alpha=0.3, f_index=f_index)
    moved, f_next = unified.update(w, f, MU_E, MU_I, AGENT_ALONE, params)
    plain, f_plain = unified.update(w, f, MU_E, MU_I, NONE, params)
    assert moved[0, 0] == pytest.approx(marked, abs=1e-15)
    assert plain[0, 0] == pytest.approx(unmarked, abs=1e-15)
    assert f_next[0, 0] == 1.0
    assert f_plain[0, 0] == pytest.approx(0.65)
    # The other pairs do not notice.
    np.testing.assert_array_equal(moved[0, 1:], plain[0, 1:])
    np.testing.assert_array_equal(f_next[0, 1:], f_plain[0, 1:])
    # In the next iteration the printed reading moves by the 1 that was set, too.
    then, f_then = unified.update(w, f_next, MU_E, MU_I, AGENT_ALONE, params)
    assert then[0, 0] == pytest.approx(-0.9, abs=1e-15)
    assert f_then[0, 0] == 1.0


def test_a_marked_pair_is_set_anew_each_time() -> None:
    """Between two marked visits the trace decays by Eq. 10; the second sets it to 1 again."""
    params = Update(alpha=0.3)
    w, f = np.zeros((1, 4)), np.full((1, 4), 0.5)
    moves = []
    for mu_i in (MU_I, MU_E, MU_I, MU_I):  # wrong, as the expert does, wrong, wrong
        then, f = unified.update(w, f, MU_E, mu_i, AGENT_ALONE, params)
        moves.append(then[0, 0] - w[0, 0])
        w = then
    assert moves == pytest.approx([-0.9 * 0.5, 0.0, -0.9 * 0.7, -0.9])


@pytest.mark.parametrize("f_index", READINGS)
@pytest.mark.parametrize("column", [1, 2, 3])
def test_incorrect_pair_of_the_experts_is_not_special(column: int, f_index: str) -> None:
    """A pair that the expert visits is never treated as incorrect, whatever mu_B says."""
    mu_b = np.zeros((1, 4), dtype=bool)
    mu_b[0, column] = True
    assert_like_unmarked(MU_E, MU_I, mu_b, f_index)


@pytest.mark.parametrize("f_index", READINGS)
def test_incorrect_pair_that_the_agent_avoids_is_not_special(f_index: str) -> None:
    """A pair that the agent did not visit is not treated as incorrect, in any iteration."""
    assert_like_unmarked(MU_E, MU_I * [[0.0, 1.0, 1.0, 1.0]], AGENT_ALONE, f_index)


def assert_like_unmarked(mu_e: Array, mu_i: Array, mu_b: Array, f_index: str) -> None:
    """Assert that marks change no bit of weights and trace."""
    f, w, params = np.full((1, 4), 0.5), np.zeros((1, 4)), Update(alpha=0.3, f_index=f_index)
    marked = unified.update(w, f, mu_e, mu_i, mu_b, params)
    plain = unified.update(w, f, mu_e, mu_i, NONE, params)
    for one, other in zip(marked, plain, strict=True):
        np.testing.assert_array_equal(one, other)


def test_start_is_f_0_everywhere() -> None:
    """Line 3 of both listings: all pairs start with the same trace."""
    assert (unified.start((3, 2), Update(f_start=0.1)) == np.full((3, 2), 0.1)).all()


visits = hnp.arrays(float, (3, 4), elements=st.floats(0, 10, allow_subnormal=False))
marks = hnp.arrays(bool, (3, 4))


@given(visits, visits, marks, st.sampled_from(READINGS))
def test_trace_stays_in_range_and_weights_follow_the_residual(
    mu_e: np.ndarray, mu_i: np.ndarray, mu_b: np.ndarray, f_index: str
) -> None:
    """F stays in (0, 1], and each weight moves to the side of its residual, never farther."""
    f = np.full((3, 4), 0.5)
    w, f_next = unified.update(np.zeros((3, 4)), f, mu_e, mu_i, mu_b, Update(f_index=f_index))
    assert ((f_next > 0) & (f_next <= 1)).all()
    assert (np.sign(w) == np.sign(mu_e - mu_i)).all()
    assert (np.abs(w) <= np.abs(mu_e - mu_i)).all()


@given(visits, visits, marks, hnp.arrays(float, (3, 4), elements=st.floats(0.01, 1)))
def test_readings_differ_by_their_trace_alone(
    mu_e: np.ndarray, mu_i: np.ndarray, mu_b: np.ndarray, f: np.ndarray
) -> None:
    """All have the same next trace; at once is the updated one where marked, else the printed."""
    w = np.zeros((3, 4))
    moved, traces = {}, []
    for reading in READINGS:
        moved[reading], f_next = unified.update(w, f, mu_e, mu_i, mu_b, Update(f_index=reading))
        traces.append(f_next)
    assert (traces[0] == traces[1]).all()
    assert (traces[0] == traces[2]).all()
    wrong = mu_b & (mu_e == 0) & (mu_i > 0)
    assert (traces[0][wrong] == 1).all()
    expected = np.where(wrong, moved["updated"], moved["printed"])
    np.testing.assert_array_equal(moved["at-once"], expected)


def digest_of(
    demos: Demos, method: str, reading: str, seed: int, *, shown: tuple[Demo, ...] = ()
) -> str:
    """Return the digest of a whole trial with these incorrect demonstrations."""
    params = Params.of(episodes=60, horizon=40, max_iterations=30, f_index=reading)
    agent = make_agent(demos.environment, params)
    mu_e = mean_expectations(demos.correct, gamma=params.learner.gamma, shape=agent.shape)
    mu_b = visited(shown, shape=agent.shape)
    root = np.random.SeedSequence(seed)
    return digest(run_trial(agent, get_method(method), mu_e, mu_b, params, seed=root))


@pytest.mark.parametrize("seed", [1, 2])
def test_at_once_is_printed_without_incorrect_demonstrations(small_demos: Demos, seed: int) -> None:
    """Identity: with nothing marked, whole trials of both readings have the same bits."""
    found = {
        (reading, bool(shown)): digest_of(
            small_demos, "unified-incorrect", reading, seed, shown=shown
        )
        for reading in READINGS
        for shown in ((), small_demos.incorrect)
    }
    assert found["at-once", False] == found["printed", False]
    assert found["at-once", True] != found["printed", True]
    assert len(set(found.values())) == 5


@pytest.mark.parametrize("reading", READINGS)
def test_algorithm_2_is_algorithm_1_without_incorrect_demonstrations(
    small_demos: Demos, reading: str
) -> None:
    """Identity: whole trials of both methods have the same bits, and not with any marked pair."""
    one = digest_of(small_demos, "unified", reading, 3)
    assert digest_of(small_demos, "unified-incorrect", reading, 3) == one
    shown = small_demos.incorrect
    assert digest_of(small_demos, "unified", reading, 3, shown=shown) == one
    assert digest_of(small_demos, "unified-incorrect", reading, 3, shown=shown) != one


@given(visits, marks)
def test_equal_expectations_change_no_weight(mu: np.ndarray, mu_b: np.ndarray) -> None:
    """Where the agent does as the expert, the weights stay and the trace decays."""
    f = np.full((3, 4), 0.5)
    w, f_next = unified.update(np.ones((3, 4)), f, mu, mu, mu_b, Update(alpha=0.3))
    assert (w == 1).all()
    np.testing.assert_allclose(f_next, 0.35)
