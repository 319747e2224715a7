from fractions import Fraction
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
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


def make_stream(seed: int) -> Array:
    """Return a random stream."""
    return stream(np.random.SeedSequence(seed))


def learn_plain(next_state: Any, weights: Any, q: Any, **options: Any) -> tuple[Array, int]:
    """Return Q and the number of steps; the options are added to a single greedy episode."""
    task = {"start": 0, "episodes": 1, "horizon": 9, "beta": 1.0, "gamma": 0.5, "epsilon": 0.0}
    values, _, steps, _ = qlearning.learn(next_state, weights, q, make_stream(1), **task | options)
    return values, steps


def same_bits(a: Array, b: Array) -> bool:
    """Compare floats by their bits, so that zeros of both signs differ."""
    return a.tobytes() == b.tobytes()


def assert_like_reference(
    next_state: Array, weights: Array, q: Array, stream: Array, **options: Any
) -> None:
    """Assert that Q, stream and the numbers of steps and collisions are the reference's."""
    values, words, *counts = qlearning.learn(next_state, weights, q, stream, **options)
    lists = (array.tolist() for array in (next_state, weights, q, stream))
    expected, after, *expected_counts = reference.learn(*lists, **options)
    assert same_bits(values, np.array(expected))
    assert words.tolist() == after
    assert counts == expected_counts


NUMBERS = {
    "few": [-1.0, -0.0, 0.0, 0.1, 1.0],  # many ties, zeros of both signs
    "near": [1.0, 1.0 + 2**-52, 1.0 - 2**-53, -1.0, -1.0 - 2**-52],
    "huge": [-1e279, 1e279, 1e-300, 5e-324, 0.0],
    "any": [],
}


@st.composite
def problems(draw: st.DrawFn) -> tuple[tuple[Array, Array, Array, Array], dict[str, Any]]:
    """Draw a task and the options of a call.

    The task is a maze, or any table of moves: with self-loops, states that nothing leads to, and
    goals beside, at or out of reach of the start. Tables come from a seed: drawing each number
    would take most of the time.
    """
    rng = np.random.default_rng(draw(st.integers(0, 2**32)))
    if draw(st.booleans()):
        rows, columns = draw(st.integers(1, 6)), draw(st.integers(1, 6))
        cells = rows * columns
        next_state = grid(rows, columns, (*rng.integers(0, cells, rng.integers(0, 9)).tolist(),))
    else:
        # Each number of actions is compiled once, so not every one is tried.
        shape = draw(st.integers(1, 7)), draw(st.sampled_from([1, 2, 3, 4, 5, 16]))
        next_state = rng.integers(0, shape[0], shape)
    numbers = NUMBERS[draw(st.sampled_from(sorted(NUMBERS)))]
    shape = (2, *next_state.shape)
    weights, q = rng.choice(numbers, shape) if numbers else rng.normal(size=shape)
    state = st.integers(0, len(next_state) - 1)
    rate = st.sampled_from([0.0, 0.1, 0.5, 0.7, 0.9, 1.0])
    options = {
        "start": draw(state),
        "goal": draw(state),
        "episodes": draw(st.integers(1, 30)),
        "horizon": draw(st.integers(1, 20)),
        "beta": draw(rate),
        "gamma": draw(rate),
        "epsilon": draw(rate),
        "tolerance": draw(st.sampled_from([0.0, 2**-52, 1e-9, 0.5])),
        "random_ties": draw(st.booleans()),
        "arithmetic": draw(st.sampled_from(sorted(reference.ROUNDED))),
    }
    if options["arithmetic"] == "single":  # which could not hold the huge ones
        weights, q = np.clip(weights, -1e29, 1e29), np.clip(q, -1e29, 1e29)
    return (next_state, weights, q, rng.integers(1, 2**63, 4).astype(np.uint64)), options


@settings(max_examples=2_000, deadline=None)
@given(problems())
def test_learn_equals_the_reference(
    problem: tuple[tuple[Array, Array, Array, Array], dict[str, Any]],
) -> None:
    """Any task has the reference's bits."""
    arrays, options = problem
    assert_like_reference(*arrays, **options)


@pytest.mark.long
@settings(max_examples=100_000, deadline=None)
@given(problems())
def test_learn_equals_the_reference_100_000_times(
    problem: tuple[tuple[Array, Array, Array, Array], dict[str, Any]],
) -> None:
    """So it is in a hundred thousand tasks."""
    arrays, options = problem
    assert_like_reference(*arrays, **options)


RATES = {"beta": 0.7, "gamma": 0.9, "epsilon": 0.1}
LEARN: dict[str, Any] = {"start": 20, "goal": 4, "episodes": 20, "horizon": 50, **RATES}


@pytest.fixture
def arrays() -> dict[str, Any]:
    """Return the arrays of a call in a maze of 25 cells."""
    rng = np.random.default_rng(0)
    tables = {"weights": rng.normal(size=(25, 4)), "q": rng.normal(size=(25, 4))}
    return {"next_state": grid(5, 5), **tables, "stream": make_stream(0)}


@pytest.mark.parametrize("size", [12, 20])
@pytest.mark.parametrize("rounding", [{}, {"tolerance": 1e-9}, {"arithmetic": "fused"}])
def test_learn_equals_the_reference_in_a_maze_until_most_is_frozen(
    size: int, rounding: dict[str, Any]
) -> None:
    """In a maze as large as the paper's, over so many steps that few change anything any more."""
    rng = np.random.default_rng(size)
    next_state = grid(size, size, tuple(rng.integers(1, size * size - 1, size)))
    weights = rng.normal(size=next_state.shape)
    weights[rng.random(weights.shape) < 0.5] = 0.0
    options = {"start": 0, "goal": size * size - 1, "episodes": 300, "horizon": 200, **RATES}
    q = np.zeros_like(weights)
    assert_like_reference(next_state, weights, q, make_stream(3), **rounding, **options)


def test_learning_goes_on_where_it_stopped(arrays: dict[str, Any]) -> None:
    """Ten episodes, and ten more from the returned Q and stream, are twenty episodes."""
    half = LEARN | {"episodes": 10}
    q, stream, first_steps, _ = qlearning.learn(**arrays, **half)
    then = qlearning.learn(**arrays | {"q": q, "stream": stream}, **half)
    whole = qlearning.learn(**arrays, **LEARN)
    assert same_bits(then[0], whole[0])
    assert same_bits(then[1], whole[1])
    assert first_steps + then[2] == whole[2]


def test_inputs_are_not_modified(arrays: dict[str, Any]) -> None:
    """Neither learning nor a roll-out changes its arguments."""
    before = {name: array.copy() for name, array in arrays.items()}
    next_state, _, q, stream = arrays.values()
    qlearning.learn(**arrays, **LEARN)
    qlearning.roll_out(next_state, q, stream, start=20, goal=4, horizon=50)
    assert all(same_bits(array, before[name]) for name, array in arrays.items())


def test_type_and_layout_of_arguments_do_not_matter(arrays: dict[str, Any]) -> None:
    """Small or unsigned integers, lists and any order in memory mean the same."""
    whole = qlearning.learn(**arrays, **LEARN)
    next_state, weights, q, words = arrays.values()
    sparse = np.zeros(8, np.uint64)
    sparse[::2] = words
    for moves in (next_state.astype(np.uint8), np.asfortranarray(next_state), next_state.tolist()):
        for kind in (np.asfortranarray, np.ndarray.tolist):
            found = qlearning.learn(moves, kind(weights), kind(q), sparse[::2], **LEARN)
            assert all(map(same_bits, found[:2], whole[:2]))
            assert found[2:] == whole[2:]


# --- arithmetic ------------------------------------------------------------------------------


finite = st.floats(-1e100, 1e100, allow_subnormal=False)


@given(finite, finite, finite)
def test_fma_is_the_exact_result_rounded_once(a: float, b: float, c: float) -> None:
    """No other float is nearer to a b + c, computed in rational numbers, than the one returned."""
    exact = Fraction(a) * Fraction(b) + Fraction(c)
    found = reference.fma(a, b, c)
    for other in (np.nextafter(found, -np.inf), np.nextafter(found, np.inf)):
        assert abs(Fraction(found) - exact) <= abs(Fraction(float(other)) - exact)
    assert found == pytest.approx(a * b + c, rel=1e-9, abs=1e-15 * abs(c))


def test_fma_by_hand() -> None:
    """(1 + u)(1 - u) - 1 is -u^2: rounded twice it is 0, rounded once it is not."""
    u = 2.0**-30
    assert (1 + u) * (1 - u) - 1 == 0.0
    assert reference.fma(1 + u, 1 - u, -1.0) == -(u**2)
    assert reference.fused(0.0, -1.0, 1 - u, 1.0, 1 + u) == -(u**2)
    assert reference.double(0.0, -1.0, 1 - u, 1.0, 1 + u) == 0.0
    assert np.signbit(reference.fma(-1.0, 0.0, -0.0))
    assert not np.signbit(reference.fma(1.0, 0.0, -0.0))


@given(*(st.floats(-1e3, 1e3) for _ in range(3)), st.floats(0, 1), st.floats(0, 1))
def test_roundings_agree_to_their_precision(
    q: float, reward: float, value: float, beta: float, gamma: float
) -> None:
    """All three are Eq. 1 in exact numbers, but for some units of the last place."""
    exact = Fraction(q) + Fraction(beta) * (
        Fraction(reward) + Fraction(gamma) * Fraction(value) - Fraction(q)
    )
    size = abs(q) + abs(reward) + abs(value) + 1e-30
    for name, unit in (("double", 2.0**-52), ("fused", 2.0**-52), ("single", 2.0**-22)):
        found = reference.ROUNDED[name](q, reward, value, beta, gamma)
        assert abs(float(Fraction(found) - exact)) <= 4 * unit * size


@pytest.fixture(scope="module")
def rounded() -> dict[str, tuple[Array, int, int]]:
    """Learn the same task in each arithmetic, exploring in every step: along the same way."""
    rng = np.random.default_rng(4)
    weights, zeros = rng.normal(size=(25, 4)), np.zeros((25, 4))
    task = LEARN | {"epsilon": 1.0, "episodes": 200}
    found = {}
    for name in reference.ROUNDED:
        learned = qlearning.learn(
            grid(5, 5), weights, zeros, make_stream(6), **task, arithmetic=name
        )
        found[name] = (learned[0], *learned[2:])
    return found


def test_fused_differs_by_rounding_only(rounded: dict[str, tuple[Array, int, int]]) -> None:
    """Rounding once gives other bits somewhere, and nowhere another number to 13 digits."""
    double, fused = rounded["double"], rounded["fused"]
    assert (double[0] != fused[0]).any()
    np.testing.assert_allclose(fused[0], double[0], rtol=1e-13, atol=1e-13)
    assert fused[1:] == double[1:]


def test_single_is_in_32_bits(rounded: dict[str, tuple[Array, int, int]]) -> None:
    """Its values are numbers of 32 bits, near those of 64 bits, and not these, rounded at last."""
    double, single = rounded["double"], rounded["single"]
    assert (single[0].astype(np.float32) == single[0]).all()
    assert (double[0].astype(np.float32) != double[0]).any()
    assert (double[0].astype(np.float32) != single[0]).any()
    np.testing.assert_allclose(single[0], double[0], rtol=1e-4, atol=1e-5)
    assert single[1:] == double[1:]


def test_single_holds_no_large_numbers(arrays: dict[str, Any]) -> None:
    """What 32 bits could not hold is refused in 32 bits alone."""
    large = arrays | {"weights": np.full((25, 4), 1e31)}
    qlearning.learn(**large, **LEARN)
    with pytest.raises(ValueError, match="weights must be finite"):
        qlearning.learn(**large, **LEARN, arithmetic="single")


# --- by hand ---------------------------------------------------------------------------------


@pytest.mark.parametrize("learn", [qlearning.learn, reference.learn], ids=["fast", "plain"])
def test_collisions_by_hand(learn: Any) -> None:
    """In a corridor from which nothing leads back, each step that stays is a collision."""
    task: dict[str, Any] = {"start": 0, "beta": 1.0, "gamma": 0.0, "epsilon": 0.0}
    words = make_stream(1).tolist() if learn is reference.learn else make_stream(1)

    def run(next_state: list[list[int]], q: list[list[float]], **options: int) -> tuple[int, int]:
        zeros = [[0.0] * len(row) for row in q]
        steps, collisions = learn(next_state, zeros, q, words, **task, **options)[2:]
        return steps, collisions

    # Action 0 stays, action 1 moves on; staying is preferred until it has been tried: it stays in
    # cell 0, moves to cell 1, stays there, and moves to the goal.
    corridor, q = [[0, 1], [1, 2], [2, 2]], [[2.0, 1.0], [2.0, 1.0], [0.0, 0.0]]
    assert run(corridor, q, goal=2, episodes=1, horizon=9) == (4, 2)
    assert run(corridor, q, goal=2, episodes=1, horizon=3) == (3, 2)
    assert run(corridor, q, goal=2, episodes=1, horizon=1) == (1, 1)
    # In a dead end, where nothing is learned after the first step, all steps are collisions.
    assert run([[0], [1]], [[0.0], [0.0]], goal=1, episodes=3, horizon=7) == (21, 21)
    # A goal that is at the start ends each episode after its first step, which stays there.
    assert run([[0]], [[0.0]], goal=0, episodes=3, horizon=7) == (3, 3)
    # Back and forth, nothing is run into.
    assert run([[1], [0], [2]], [[0.0]] * 3, goal=2, episodes=3, horizon=7) == (21, 0)


def test_worked_example() -> None:
    """By hand: two greedy episodes along a corridor carry the last reward one state back."""
    weights = [[0.0, 0.0], [0.0, 0.0], [0.0, 8.0], [0.0, 0.0]]  # 8 for the step into the goal
    q = [[0.0, 1.0]] * 4  # so that moving on is greedy
    values, steps = learn_plain([[0, 1], [1, 2], [2, 3], [3, 3]], weights, q, goal=3, episodes=2)
    # Episode 1: Q(0) = 1/2, Q(1) = 1/2, Q(2) = 8. Episode 2: Q(0) = 1/4, Q(1) = 4, Q(2) = 8.
    assert values.tolist() == [[0.0, 0.25], [0.0, 4.0], [0.0, 8.0], [0.0, 1.0]]
    assert steps == 6


@pytest.mark.parametrize(("goal", "expected"), [(0, 6.0), (1, 1.0)], ids=["time-out", "goal"])
def test_only_the_goal_is_terminal(goal: int, expected: float) -> None:
    """A time-out bootstraps from the state it ends in; the goal is worth 0 whatever its Q."""
    values, _ = learn_plain([[1], [1]], [[1.0], [1.0]], [[0.0], [10.0]], goal=goal, horizon=1)
    assert values.tolist() == [[expected], [10.0]]


@pytest.mark.parametrize(("goal", "length"), [(3, 3), (0, 7)], ids=["goal", "time-out"])
def test_steps_are_counted(goal: int, length: int) -> None:
    """In a one-way corridor an episode has as many steps as the way, or as the horizon."""
    zeros = np.zeros((4, 1))
    options = {"goal": goal, "episodes": 5, "horizon": 7, "epsilon": 0.5}
    _, steps = learn_plain([[1], [2], [3], [3]], zeros, zeros, **options)
    assert steps == 5 * length


@pytest.mark.parametrize("epsilon", [0.1, 0.5, 1.0])
def test_exploration_is_uniform_with_probability_epsilon(epsilon: float) -> None:
    """The greedy action is taken 1 - epsilon + epsilon / 4 of the time, the others epsilon / 4."""
    episodes, beta = 20_000, 2.0**-12
    q = [[0.0, 0.0, 2.0, 0.0], [0.0] * 4]
    options = {"goal": 1, "episodes": episodes, "horizon": 1, "beta": beta, "epsilon": epsilon}
    values, _ = learn_plain([[1] * 4] * 2, np.ones((2, 4)), q, **options)
    # An update shrinks Q - 1 by 1 - beta, so Q counts its updates, and action 2 stays the best.
    counts = np.log(np.abs(values[0] - 1)) / np.log1p(-beta)
    assert np.allclose(counts, counts.round(), atol=1e-6)
    share = np.full(4, epsilon / 4)
    share[2] += 1 - epsilon
    assert counts.round().sum() == episodes
    assert stats.chisquare(counts.round(), share * episodes).pvalue > 1e-3


def test_exploration_is_uniform_when_nothing_is_computed() -> None:
    """The same shares along frozen pairs: each action leads to a corridor of its own length."""
    # From state 0, action a leads to the state from which it is a steps to the goal.
    next_state = [[4, 3, 2, 1], [4] * 4, [1] * 4, [2] * 4, [4] * 4]
    zeros, episodes = np.zeros((5, 4)), 20_000
    options = {"goal": 4, "episodes": episodes, "horizon": 9, "beta": 0.0, "epsilon": 0.5}
    q = zeros.copy()
    q[0, [0, 3]] = 1.0  # tied
    _, steps = learn_plain(next_state, zeros, q, **options)
    lengths = np.array([1, 4, 3, 2])
    shares = np.array([0.375, 0.125, 0.125, 0.375])
    mean = shares @ lengths
    spread = np.sqrt((shares @ lengths**2 - mean**2) * episodes)
    assert abs(steps - mean * episodes) < 4 * spread


@pytest.mark.parametrize("tolerance", [0.0, 0.01])
@pytest.mark.parametrize("best", [[0, 1, 2, 3], [1, 3], [0, 2, 3]])
@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_values_that_agree_to_the_tolerance_are_tied(
    best: list[int], tolerance: float, sign: float
) -> None:
    """A value less than a hundredth below the best one counts as best if the tolerance says so."""
    q = np.full((1, 4), sign - 0.5)
    q[0, best] = sign - 0.009 * np.arange(len(best))
    task: dict[str, Any] = {"start": 0, "goal": 0, "horizon": 1, "tolerance": tolerance}
    stream, seen = make_stream(2), set()
    for _ in range(100):
        _, actions, stream = qlearning.roll_out([[0] * 4], q, stream, **task)
        seen.add(int(actions[0]))
    assert seen == set(best[:2] if tolerance else best[:1])


@pytest.mark.parametrize("best", [[0, 1, 2, 3], [1, 3], [0, 2, 3]])
def test_ties_are_broken_evenly(best: list[int]) -> None:
    """Each of the best actions is taken equally often, and no other; or only the lowest."""
    q = np.zeros((1, 4))
    q[0, best] = 1.0
    loop, stream = np.zeros((1, 4), np.int64), make_stream(2)
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
    (next_state, _, q, words), options = problem
    names = "start", "goal", "horizon", "tolerance", "random_ties"
    task = {name: options[name] for name in names}
    states, actions, after = qlearning.roll_out(next_state, q, words, **task)
    expected = reference.roll_out(next_state.tolist(), q.tolist(), words.tolist(), **task)
    assert (states.tolist(), actions.tolist(), after.tolist()) == expected
    assert states[0] == task["start"]
    assert (states[1:] == next_state[states[:-1], actions]).all()
    best = q[states[:-1]].max(axis=1)
    assert (q[states[:-1], actions] >= best - task["tolerance"] * np.abs(best)).all()
    assert task["goal"] not in states[1:-1]
    assert states[-1] == task["goal"] or len(actions) == task["horizon"]


def test_draws_are_those_of_the_published_generator() -> None:
    """The stream is xoshiro256++: its state 1, 2, 3, 4 gives the known first words."""
    stream = [1, 2, 3, 4]
    words = [reference.draw(stream) for _ in range(4)]
    assert words == [41943041, 58720359, 3588806011781223, 3591011842654386]


def test_exploration_ends_exactly_at_epsilon() -> None:
    """The high half of a word explores below epsilon, and is greedy from there on."""
    row = [0.0, 1.0]
    taken = [reference.choose(row, high << 32, 0.5, True) for high in (2**31 - 1, 2**31)]
    assert taken == [0, 1]


def test_stream_is_never_all_zero() -> None:
    """A seed whose words are all 0, on which the generator would stick, still gives a stream."""

    class Zeros(np.random.SeedSequence):
        def generate_state(self, n_words: int, dtype: Any = np.uint32) -> Array:
            return np.zeros(n_words, dtype)

    assert same_bits(stream(Zeros(0)), np.ones(4, np.uint64))
    streams = np.array([make_stream(seed) for seed in range(100)])
    assert len(np.unique(streams)) == streams.size


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"next_state": np.zeros((25, 4))}, "next_state must hold integers"),
        ({"next_state": np.zeros((25, 17), int)}, "next_state must hold integers"),
        ({"next_state": np.broadcast_to(0, (2**27 + 1, 1))}, "next_state must have at most"),
        ({"next_state": np.full((25, 4), 25)}, "next_state must hold states from 0 to 24"),
        ({"next_state": np.full((25, 4), -1)}, "next_state must hold states from 0 to 24"),
        ({"weights": np.zeros((1, 25, 4))}, "weights must have the shape"),
        ({"weights": np.full((25, 4), np.nan)}, "weights must be finite"),
        ({"weights": np.full((25, 4), 1e280)}, "weights must be finite and below"),
        ({"q": np.zeros((24, 4))}, "q must have the shape"),
        ({"q": np.full((25, 4), np.inf)}, "q must be finite"),
        ({"stream": np.ones(4)}, "stream must be uint64"),
        ({"stream": np.ones(3, np.uint64)}, "stream must be uint64"),
        ({"stream": np.zeros(4, np.uint64)}, r"^stream must be uint64 \[4\] and not all zero$"),
        ({"start": 25}, "start must be an integer from 0 to 24, not 25"),
        ({"start": 1.0}, "start must be an integer"),
        ({"goal": -1}, "goal must be an integer"),
        ({"goal": 25}, "goal must be an integer from 0 to 24, not 25"),
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
        ({"tolerance": -1e-9}, "tolerance must be at least 0 and less than 1"),
        ({"tolerance": 1}, "tolerance must be at least 0 and less than 1"),
        ({"tolerance": np.nan}, "tolerance must be at least 0 and less than 1"),
        ({"arithmetic": "half"}, "arithmetic must be double, fused, single, not 'half'"),
    ],
)
def test_what_does_not_fit_is_refused(
    arrays: dict[str, Any], change: dict[str, Any], message: str
) -> None:
    """A shape or value that does not fit raises a ValueError that names the argument."""
    with pytest.raises(ValueError, match=message):
        qlearning.learn(**arrays | LEARN | change)


def test_roll_out_refuses_what_does_not_fit() -> None:
    """A roll-out wants one table and one stream."""
    q, words = np.zeros((25, 4)), np.ones(4, np.uint64)
    for values, state, message in ((q[None], words, "q must"), (q, words[None], "stream must")):
        with pytest.raises(ValueError, match=message):
            qlearning.roll_out(grid(5, 5), values, state, start=20, goal=4, horizon=5)
