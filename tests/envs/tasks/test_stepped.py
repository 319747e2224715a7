from __future__ import annotations

from itertools import count
from typing import Any

import gymnasium
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from replication import Bins, TaskError, WrappedTask

BINS = Bins(low=[-1.2, -0.07], high=[0.6, 0.07], counts=[20, 10])


def car() -> gymnasium.Env[Any, Any]:
    """Return Gymnasium's mountain car, whose start is random."""
    return gymnasium.make("MountainCar-v0")


def test_randomness_is_found_out() -> None:
    """A random start makes a task random; a seed for resets fixes it."""
    assert WrappedTask(car(), BINS).is_random
    assert not WrappedTask(car(), BINS, reset_seed=3).is_random


def test_a_replay_is_what_stepping_gives() -> None:
    """States of a replay are the numbers of the observations."""
    env, task = car(), WrappedTask(car(), BINS, reset_seed=3)
    states = [BINS(env.reset(seed=3)[0])]
    for action in (2, 2, 0):
        states.append(BINS(env.step(action)[0]))
    assert task.replay([2, 2, 0]).tolist() == states
    assert task.fault(np.array(states), np.array([2, 2, 0])) is None
    wrong = np.array([*states[:2], (states[2] + 1) % 200, states[3]])
    found = task.fault(wrong, np.array([2, 2, 0]))
    assert found == f"step 2 leads to state {states[2]}, not to {wrong[2]}"


def test_random_environments_are_checked_as_far_as_possible() -> None:
    """Where the start is random any states may be, but a replay is refused."""
    task = WrappedTask(car(), BINS)
    assert task.fault(np.array([5, 6]), np.array([0])) is None
    assert "states are 0..199" in str(task.fault(np.array([5, 200]), np.array([0])))
    with pytest.raises(TaskError, match="moves or the start are random: give the states"):
        task.replay([0])


@pytest.mark.parametrize(
    ("state", "n_states", "message"),
    [
        (lambda _: 0.5, 4, r"is 0\.5; it must be a whole number from 0 to 3$"),
        (lambda _: 4, 4, "is 4; it must be a whole number from 0 to 3"),
        (lambda _: -1, 4, "is -1"),
        (lambda _: None, 4, "is None"),
        (count().__next__, 10_000, "is once 0 and once 1; it must depend on the observation alone"),
        (lambda _: 0, None, "say how many states there are"),
    ],
)
def test_a_function_that_numbers_no_states_is_refused(
    state: Any, n_states: int | None, message: str
) -> None:
    """Floats, numbers out of range and a change of mind are one line each."""
    numbered = (lambda _: state()) if state.__class__ is type(count().__next__) else state
    with pytest.raises(TaskError, match=message) as caught:
        WrappedTask(car(), numbered, n_states)
    assert str(caught.value).startswith("MountainCar-v0: ")
    assert "\n" not in str(caught.value)


def test_a_function_that_looks_at_the_environment_is_refused() -> None:
    """The number of an observation may not change while the environment moves on."""
    env = gymnasium.make("FrozenLake-v1", is_slippery=False)
    with pytest.raises(TaskError, match="must depend on the observation alone"):
        WrappedTask(env, lambda _: env.unwrapped.s, 16)  # type: ignore[attr-defined]


@given(
    st.lists(st.tuples(st.floats(-5, 5), st.floats(0.1, 5), st.integers(1, 7)), min_size=1).map(
        lambda parts: parts[:4]
    ),
    st.data(),
)
def test_bins_number_every_vector(
    parts: list[tuple[float, float, int]], data: st.DataObject
) -> None:
    """A number is that of the cell in which a vector lies, or of the nearest one."""
    low, width, counts = zip(*parts, strict=True)
    high = [a + b for a, b in zip(low, width, strict=True)]
    bins = Bins(low=low, high=high, counts=counts)
    vector = [data.draw(st.floats(-20, 20)) for _ in parts]
    cells = [
        int(min(np.searchsorted(np.linspace(a, b, n + 1)[1:-1], x, side="right"), n - 1))
        for a, b, n, x in zip(low, high, counts, vector, strict=True)
    ]
    found = np.unravel_index(bins(vector), counts)
    near = [abs(one - other) for one, other in zip(found, cells, strict=True)]
    assert max(near) <= 1  # where a border is met, rounding decides
    assert 0 <= bins(vector) < bins.n_states


@pytest.mark.parametrize(
    "wrong",
    [
        {"counts": [0, 5]},
        {"counts": [5]},
        {"low": [2.0, 0.0]},
        {"high": [float("inf"), 1.0]},
    ],
)
def test_bins_that_cut_nothing_are_refused(wrong: dict[str, Any]) -> None:
    """Bins need finite ranges, as many as there are counts, and one bin at least."""
    usual: dict[str, Any] = {"low": [0.0, 0.0], "high": [1.0, 1.0], "counts": [5, 5]}
    with pytest.raises(TaskError, match="Bins: low, high and counts"):
        Bins(**usual | wrong)
