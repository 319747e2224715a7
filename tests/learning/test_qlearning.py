from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp
from numpy.typing import NDArray
from scipy import stats

from replication.learning import qlearning, reference
from replication.learning.seeds import stream

Array = NDArray[Any]


def grid(rows: int, columns: int, obstacles: tuple[int, ...] = ()) -> Array:
    """Return the transitions of a maze; moves off the map or into an obstacle stay."""
    table = np.empty((rows * columns, 4), np.int64)
    for state in range(rows * columns):
        row, column = divmod(state, columns)
        for action, (down, right) in enumerate(((-1, 0), (1, 0), (0, 1), (0, -1))):
            inside = 0 <= row + down < rows and 0 <= column + right < columns
            successor = (row + down) * columns + column + right
            table[state, action] = successor if inside and successor not in obstacles else state
    return table


def make_streams(seed: int, trials: int) -> Array:
    """Return the streams of some trials."""
    seeds = np.random.SeedSequence(seed).spawn(trials)
    return np.array([stream(s) for s in seeds], np.uint64).reshape(trials, 4)


def learn_plain(next_state: Any, weights: Array, q: Array, **options: Any) -> tuple[Array, Array]:
    """Return Q and the numbers of steps; the options are added to a single greedy episode."""
    task = {"start": 0, "episodes": 1, "horizon": 9, "beta": 1.0, "gamma": 0.5, "epsilon": 0.0}
    streams = make_streams(1, len(q))
    values, _, steps = qlearning.learn(np.array(next_state), weights, q, streams, **task | options)
    return values, steps


def same_bits(a: Array, b: Array) -> bool:
    """Compare floats by their bits, so that zeros of both signs differ."""
    return a.tobytes() == b.tobytes()


def assert_like_reference(
    next_state: Array, weights: Array, q: Array, streams: Array, **options: Any
) -> None:
    """Assert that every trial has the reference's Q, stream and number of steps."""
    values, words, steps = qlearning.learn(next_state, weights, q, streams, **options)
    assert len(values) == len(words) == len(steps) == len(q)
    for trial in range(len(q)):
        expected, stream, count = reference.learn(
            next_state.tolist(),
            weights[trial].tolist(),
            q[trial].tolist(),
            streams[trial].tolist(),
            **options,
        )
        assert same_bits(values[trial], np.array(expected))
        assert words[trial].tolist() == stream
        assert steps[trial] == count


@pytest.mark.parametrize("random_ties", [True, False])
@pytest.mark.parametrize(
    ("next_state", "trials"),
    [(grid(4, 4), 1), (grid(5, 3, (4, 7)), 3), (grid(1, 9), 25), (grid(6, 6, (8, 9, 20)), 40)],
)
def test_learn_equals_the_reference_in_mazes(
    next_state: Array, trials: int, random_ties: bool
) -> None:
    """Every trial of a maze has the reference's bits, whatever the number of trials."""
    rng = np.random.default_rng(trials)
    shape = (trials, *next_state.shape)
    weights = rng.normal(size=shape)
    # Some trials reach the goal at once and others never: their lengths differ.
    weights[::3] = (next_state == len(next_state) - 1) - 0.1
    assert_like_reference(
        next_state,
        weights,
        rng.integers(-1, 2, shape).astype(float),
        make_streams(3, trials),
        start=0,
        goal=len(next_state) - 1,
        episodes=30,
        horizon=40,
        beta=0.7,
        gamma=0.9,
        epsilon=0.1,
        random_ties=random_ties,
    )


@st.composite
def problems(draw: st.DrawFn) -> tuple[tuple[Array, Array, Array, Array], dict[str, Any]]:
    """Draw a small task with many ties, and the options of a call."""
    states = draw(st.integers(1, 7))
    # Each number of actions is compiled once, so not every one is tried.
    actions = draw(st.sampled_from([1, 2, 3, 4, 16]))
    trials = draw(st.integers(0, 20))
    table = hnp.arrays(
        np.float64, (trials, states, actions), elements=st.sampled_from([-1.0, -0.0, 0.0, 0.1, 1.0])
    )
    state = st.integers(0, states - 1)
    rate = st.sampled_from([0.0, 0.1, 0.7, 1.0])
    next_state = draw(hnp.arrays(np.int64, (states, actions), elements=state))
    options = {
        "start": draw(state),
        "goal": draw(state),
        "episodes": draw(st.integers(1, 6)),
        "horizon": draw(st.integers(1, 12)),
        "beta": draw(rate),
        "gamma": draw(rate),
        "epsilon": draw(rate),
        "random_ties": draw(st.booleans()),
    }
    streams = make_streams(draw(st.integers(0, 2**32)), trials)
    return (next_state, draw(table), draw(table), streams), options


@settings(max_examples=150, deadline=None)
@given(problems())
def test_learn_equals_the_reference_in_any_small_task(
    problem: tuple[tuple[Array, Array, Array, Array], dict[str, Any]],
) -> None:
    """Any task has the reference's bits, with zeros of both signs or a start at the goal, too."""
    arrays, options = problem
    assert_like_reference(*arrays, **options)


RATES = {"beta": 0.7, "gamma": 0.9, "epsilon": 0.1}
LEARN: dict[str, Any] = {"start": 20, "goal": 4, "episodes": 20, "horizon": 50, **RATES}


@pytest.fixture
def batch() -> tuple[Array, Array, Array]:
    """Return weights, Q and streams of 21 trials in a maze of 25 cells."""
    rng = np.random.default_rng(0)
    weights = rng.normal(size=(21, 25, 4)) * np.arange(21)[:, None, None]
    return weights, rng.normal(size=weights.shape), make_streams(0, 21)


@pytest.mark.parametrize(
    "order",
    [[4], [20, 4], list(range(21)), list(range(20, -1, -1)), [4] * 19],
    ids=["alone", "two", "all", "reversed", "repeated"],
)
def test_a_trial_does_not_depend_on_its_neighbours(
    batch: tuple[Array, Array, Array], order: list[int]
) -> None:
    """A trial has the same bits alone, among others, in another order, and beside itself."""
    whole = qlearning.learn(grid(5, 5), *batch, **LEARN)
    part = qlearning.learn(grid(5, 5), *(array[order] for array in batch), **LEARN)
    for expected, actual in zip(whole, part, strict=True):
        assert same_bits(expected[order], actual)


def test_learning_goes_on_where_it_stopped(batch: tuple[Array, Array, Array]) -> None:
    """Ten episodes, and ten more from the returned Q and stream, are twenty episodes."""
    weights, q, streams = batch
    half = LEARN | {"episodes": 10}
    first_q, first_streams, first_steps = qlearning.learn(grid(5, 5), *batch, **half)
    then = qlearning.learn(grid(5, 5), weights, first_q, first_streams, **half)
    whole = qlearning.learn(grid(5, 5), weights, q, streams, **LEARN)
    assert same_bits(then[0], whole[0])
    assert same_bits(then[1], whole[1])
    assert (first_steps + then[2] == whole[2]).all()


def test_inputs_are_not_modified(batch: tuple[Array, Array, Array]) -> None:
    """Neither learning nor a roll-out changes its arguments."""
    before = [array.copy() for array in batch]
    qlearning.learn(grid(5, 5), *batch, **LEARN)
    qlearning.roll_out(grid(5, 5), batch[1][0], batch[2][0], start=20, goal=4, horizon=50)
    assert all(same_bits(a, b) for a, b in zip(before, batch, strict=True))


@pytest.mark.parametrize("trials", [1, 12])
def test_worked_example(trials: int) -> None:
    """By hand: two greedy episodes along a corridor carry the last reward one state back."""
    next_state = [[0, 1], [1, 2], [2, 3], [3, 3]]
    weights = np.zeros((trials, 4, 2))
    weights[:, 2, 1] = 8.0  # for the step into the goal
    q = np.zeros_like(weights)
    q[:, :, 1] = 1.0  # so that moving on is greedy
    values, steps = learn_plain(next_state, weights, q, goal=3, episodes=2)
    # Episode 1: Q(0) = 1/2, Q(1) = 1/2, Q(2) = 8. Episode 2: Q(0) = 1/4, Q(1) = 4, Q(2) = 8.
    assert values[:, :, 1].tolist() == [[0.25, 4.0, 8.0, 1.0]] * trials
    assert (values[:, :, 0] == 0).all()
    assert steps.tolist() == [6] * trials


@pytest.mark.parametrize("trials", [1, 12])
@pytest.mark.parametrize(("goal", "expected"), [(0, 6.0), (1, 1.0)], ids=["time-out", "goal"])
def test_only_the_goal_is_terminal(goal: int, expected: float, trials: int) -> None:
    """A time-out bootstraps from the state it ends in; the goal is worth 0 whatever its Q."""
    q = np.zeros((trials, 2, 1))
    q[:, 1] = 10.0
    values, _ = learn_plain([[1], [1]], np.ones((trials, 2, 1)), q, goal=goal, horizon=1)
    assert values[:, :, 0].tolist() == [[expected, 10.0]] * trials


@pytest.mark.parametrize(("goal", "length"), [(3, 3), (0, 7)], ids=["goal", "time-out"])
def test_steps_are_counted(goal: int, length: int) -> None:
    """In a one-way corridor an episode has as many steps as the way, or as the horizon."""
    zeros = np.zeros((9, 4, 1))
    options = {"goal": goal, "episodes": 5, "horizon": 7, "epsilon": 0.5}
    _, steps = learn_plain([[1], [2], [3], [3]], zeros, zeros, **options)
    assert steps.tolist() == [5 * length] * 9


@pytest.mark.parametrize("trials", [4, 16], ids=["one by one", "in lanes"])
@pytest.mark.parametrize("epsilon", [0.1, 0.5, 1.0])
def test_exploration_is_uniform_with_probability_epsilon(trials: int, epsilon: float) -> None:
    """The greedy action is taken 1 - epsilon + epsilon / 4 of the time, the others epsilon / 4."""
    episodes, beta = 4000, 2.0**-10
    q = np.zeros((trials, 2, 4))
    q[:, 0, 2] = 2.0
    options = {"goal": 1, "episodes": episodes, "horizon": 1, "beta": beta, "epsilon": epsilon}
    values, _ = learn_plain(np.ones((2, 4), np.int64), np.ones((trials, 2, 4)), q, **options)
    # An update shrinks Q - 1 by 1 - beta, so Q counts its updates, and action 2 stays the best.
    counts = np.log(np.abs(values[:, 0] - 1)) / np.log1p(-beta)
    assert np.allclose(counts, counts.round(), atol=1e-6)
    share = np.full(4, epsilon / 4)
    share[2] += 1 - epsilon
    total = counts.round().sum(axis=0)
    assert total.sum() == trials * episodes
    assert stats.chisquare(total, share * trials * episodes).pvalue > 1e-3


@pytest.mark.parametrize("best", [[0, 1, 2, 3], [1, 3], [0, 2, 3]])
def test_ties_are_broken_evenly(best: list[int]) -> None:
    """Each of the best actions is taken equally often, and no other; or only the lowest."""
    q = np.zeros((1, 4))
    q[0, best] = 1.0
    loop, stream = np.zeros((1, 4), np.int64), make_streams(2, 1)[0]
    task: dict[str, Any] = {"start": 0, "goal": 0, "horizon": 1}
    counts = np.zeros(4, np.int64)
    for _ in range(2000):
        _, actions, stream = qlearning.roll_out(loop, q, stream, **task)
        counts[actions[0]] += 1
    assert counts[best].sum() == 2000
    assert stats.chisquare(counts[best]).pvalue > 1e-3
    _, actions, _ = qlearning.roll_out(loop, q, stream, **task, random_ties=False)
    assert actions.tolist() == [best[0]]


@settings(max_examples=60, deadline=None)
@given(problems())
def test_roll_out_follows_the_greedy_policy(
    problem: tuple[tuple[Array, Array, Array, Array], dict[str, Any]],
) -> None:
    """A roll-out is the reference's, greedy, obeys the transitions, and ends where it must."""
    (next_state, _, q, streams), options = problem
    task = {name: options[name] for name in ("start", "goal", "horizon", "random_ties")}
    for values, words in zip(q[:2], streams[:2], strict=True):
        states, actions, after = qlearning.roll_out(next_state, values, words, **task)
        expected = reference.roll_out(next_state.tolist(), values.tolist(), words.tolist(), **task)
        assert (states.tolist(), actions.tolist(), after.tolist()) == expected
        assert states[0] == task["start"]
        assert (states[1:] == next_state[states[:-1], actions]).all()
        assert (values[states[:-1], actions] == values[states[:-1]].max(axis=1)).all()
        assert task["goal"] not in states[1:-1]
        assert states[-1] == task["goal"] or len(actions) == task["horizon"]


def test_draws_are_those_of_the_published_generator() -> None:
    """The stream is xoshiro256++: its state 1, 2, 3, 4 gives the known first words."""
    stream = [1, 2, 3, 4]
    words = [reference.draw(stream) for _ in range(4)]
    assert words == [41943041, 58720359, 3588806011781223, 3591011842654386]


def test_stream_is_never_all_zero() -> None:
    """A seed whose words are all 0, on which the generator would stick, still gives a stream."""

    class Zeros(np.random.SeedSequence):
        def generate_state(self, n_words: int, dtype: Any = np.uint32) -> Array:
            return np.zeros(n_words, dtype)

    assert stream(Zeros(0)).any()
    streams = make_streams(0, 100)
    assert len(np.unique(streams)) == streams.size


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"next_state": np.zeros((25, 4))}, "next_state must hold integers"),
        ({"next_state": np.zeros((25, 17), int)}, "next_state must hold integers"),
        ({"next_state": np.full((25, 4), 25)}, "next_state must hold states from 0 to 24"),
        ({"next_state": np.full((25, 4), -1)}, "next_state must hold states from 0 to 24"),
        ({"weights": np.zeros((25, 4))}, "weights must have the shape"),
        ({"weights": np.zeros((20, 25, 4))}, "the same number of trials"),
        ({"weights": np.full((21, 25, 4), np.nan)}, "weights must be finite"),
        ({"q": np.zeros((21, 24, 4))}, "q must have the shape"),
        ({"q": np.full((21, 25, 4), np.inf)}, "q must be finite"),
        ({"streams": np.ones((21, 4))}, "streams must be uint64"),
        ({"streams": np.ones((21, 3), np.uint64)}, "streams must be uint64"),
        ({"streams": np.zeros((21, 4), np.uint64)}, "streams must not be all zero"),
        ({"start": 25}, "start must be an integer from 0 to 24, not 25"),
        ({"start": 1.0}, "start must be an integer"),
        ({"goal": -1}, "goal must be an integer"),
        ({"goal": True}, "goal must be an integer"),
        ({"goal": np.True_}, "goal must be an integer"),
        ({"episodes": 0}, "episodes must be an integer from 1"),
        ({"episodes": 2.5}, "episodes must be an integer from 1"),
        ({"episodes": 2**31}, "episodes must be an integer from 1"),
        ({"horizon": 0}, "horizon must be an integer from 1"),
        ({"horizon": np.float64(50)}, "horizon must be an integer from 1"),
        ({"beta": 1.5}, "beta must be in"),
        ({"gamma": -0.1}, "gamma must be in"),
        ({"epsilon": np.nan}, "epsilon must be in"),
    ],
)
def test_what_does_not_fit_is_refused(
    batch: tuple[Array, Array, Array], change: dict[str, Any], message: str
) -> None:
    """A shape or value that does not fit raises a ValueError that names the argument."""
    weights, q, streams = batch
    arrays = {"next_state": grid(5, 5), "weights": weights, "q": q, "streams": streams}
    with pytest.raises(ValueError, match=message):
        qlearning.learn(**(arrays | LEARN | change))


def test_roll_out_refuses_what_does_not_fit() -> None:
    """A roll-out wants one trial's Q and stream."""
    q, words = np.zeros((25, 4)), np.ones(4, np.uint64)
    for values, state, message in ((q[None], words, "q must"), (q, words[None], "stream must")):
        with pytest.raises(ValueError, match=message):
            qlearning.roll_out(grid(5, 5), values, state, start=20, goal=4, horizon=5)
