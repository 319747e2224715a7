from itertools import pairwise
from typing import Any

import gymnasium
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray
from scipy import stats

from replication.envs.tasks.moves import Moves
from replication.learning import chance, chance_reference, planning, qlearning, reference
from replication.learning.seeds import stream
from replication.source import source_hash
from tests.learning.test_qlearning import NUMBERS, problems

Array = NDArray[Any]
Problem = tuple[tuple[Array, Array, Array, Array], dict[str, Any]]


def make_stream(seed: int) -> Array:
    """Return a random stream."""
    return stream(np.random.SeedSequence(seed))


def make_moves(table: Array, starts: Any, ends: Any) -> Moves:
    """Return the moves of probabilities [state, action, successor]."""
    places = np.nonzero(table)
    outcomes = *places, table[places]
    return Moves.of(outcomes, shape=table.shape[:2], starts=starts, ends=ends)  # type: ignore[arg-type]


def certain_moves(next_state: Array, start: int, goal: int) -> Moves:
    """Return the moves of a table without chance."""
    states = np.arange(len(next_state))
    return make_moves(
        np.eye(len(states))[next_state], (states == start).astype(float), states == goal
    )


def lists(moves: Moves) -> tuple[Any, Any, Any]:
    """Return the moves as the reference takes them: outcomes, starts and ends."""
    pairs = zip(moves.bounds.tolist(), moves.successors.tolist(), strict=True)
    each = list(pairs)
    *outcomes, starts = (each[begin:end] for begin, end in pairwise(moves.first.tolist()))
    n = moves.shape[1]
    by_state = [outcomes[i : i + n] for i in range(0, len(outcomes), n)]
    return by_state, starts, moves.ends.tolist()


@st.composite
def random_problems(draw: st.DrawFn) -> tuple[tuple[Moves, Array, Array, Array], dict[str, Any]]:
    """Draw a table of moves and the options of a call; some tables leave nothing to chance."""
    rng = np.random.default_rng(draw(st.integers(0, 2**32)))
    # Each number of actions up to 16 is compiled once, so not every one is tried.
    shape = draw(st.integers(1, 7)), draw(st.sampled_from([1, 4, 16, 17]))
    table = rng.dirichlet(np.full(shape[0], 0.3), shape)
    chances = draw(st.sampled_from([0.0, 0.5, 1.0]))
    certain = rng.random(shape) >= chances
    table[certain] = np.eye(shape[0])[rng.integers(0, shape[0], shape)][certain]
    one = np.eye(shape[0])[rng.integers(shape[0])]
    starts = rng.dirichlet(np.ones(shape[0])) if draw(st.booleans()) else one
    moves = make_moves(table, starts, rng.random(shape[0]) < draw(st.sampled_from([0.0, 0.3])))
    numbers = NUMBERS[draw(st.sampled_from(sorted(NUMBERS)))]
    both = (2, *shape)
    weights, q = rng.choice(numbers, both) if numbers else rng.normal(size=both)
    rate = st.sampled_from([0.0, 0.1, 0.5, 0.7, 0.9, 1.0])
    options = {
        "episodes": draw(st.integers(1, 30)),
        "horizon": draw(st.integers(1, 20)),
        "beta": draw(rate),
        "gamma": draw(rate),
        "epsilon": draw(rate),
        "tolerance": draw(st.sampled_from([0.0, 2**-52, 1e-9, 0.5])),
        "random_ties": draw(st.booleans()),
    }
    return (moves, weights, q, rng.integers(1, 2**63, 4).astype(np.uint64)), options


@settings(max_examples=600, deadline=None)
@given(random_problems())
def test_learn_equals_the_reference(
    problem: tuple[tuple[Moves, Array, Array, Array], dict[str, Any]],
) -> None:
    """Any table has the reference's bits, for more than 16 actions, too."""
    (moves, *tables), options = problem
    q, words, *counts = chance.learn(moves, *tables, **options)
    expected = chance_reference.learn(*lists(moves), *(x.tolist() for x in tables), **options)
    assert q.tobytes() == np.array(expected[0]).tobytes()
    assert words.tolist() == expected[1]
    assert tuple(counts) == expected[2:]


@settings(max_examples=200, deadline=None)
@given(random_problems())
def test_roll_out_equals_the_reference(
    problem: tuple[tuple[Moves, Array, Array, Array], dict[str, Any]],
) -> None:
    """A roll-out takes the reference's steps and ends where it must."""
    (moves, _, q, words), options = problem
    task = {name: options[name] for name in ("horizon", "tolerance", "random_ties")}
    states, actions, after = chance.roll_out(moves, q, words, **task)
    expected = chance_reference.roll_out(*lists(moves), q.tolist(), words.tolist(), **task)
    assert (states.tolist(), actions.tolist(), after.tolist()) == expected
    assert states.dtype == actions.dtype == np.int64
    assert not moves.ends[states[1:-1]].any()
    assert moves.ends[states[-1]] or len(actions) == task["horizon"]


@settings(max_examples=200, deadline=None)
@given(problems())
def test_without_chance_nothing_changes(problem: Problem) -> None:
    """A table without chance has the bits of the learner of mazes, in learning and roll-outs."""
    (next_state, weights, q, words), options = problem
    del options["arithmetic"]
    start, goal = options.pop("start"), options.pop("goal")
    moves, ways = certain_moves(next_state, start, goal), {"start": start, "goal": goal}
    got = chance.learn(moves, weights, q, words, **options)
    wanted = qlearning.learn(next_state, weights, q, words, **ways, **options)
    assert got[0].tobytes() == wanted[0].tobytes()
    assert got[1].tolist() == wanted[1].tolist()
    assert got[2:] == wanted[2:]
    task = {name: options[name] for name in ("horizon", "tolerance", "random_ties")}
    same = zip(
        chance.roll_out(moves, q, words, **task),
        qlearning.roll_out(next_state, q, words, **ways, **task),
        strict=True,
    )
    assert all(a.tolist() == b.tolist() for a, b in same)


def frozen_lake() -> Moves:
    """Return slippery FrozenLake, from random starts."""
    env: Any = gymnasium.make("FrozenLake-v1").unwrapped
    each = [
        (state, action, successor, probability)
        for state, actions in env.P.items()
        for action, outcomes in actions.items()
        for probability, successor, _, _ in outcomes
    ]
    state, action, successor, probability = zip(*each, strict=True)
    cells = env.desc.ravel()
    free = ~np.isin(cells, [b"H", b"G"])
    outcomes = state, action, successor, probability
    return Moves.of(outcomes, shape=(16, 4), starts=free / free.sum(), ends=~free)


def test_learning_finds_what_planning_finds() -> None:
    """On slippery ice, with smaller and smaller steps, Q becomes that of exact planning."""
    moves, weights = frozen_lake(), np.random.default_rng(3).normal(size=(16, 4))
    exact = planning.plan(weights, moves.ahead, gamma=0.9)
    q, words = np.zeros((16, 4)), make_stream(1)
    options: dict[str, Any] = {"horizon": 100, "epsilon": 1.0}
    for beta in (0.3, 0.003, 0.0003):
        q, words, *_ = chance.learn(
            moves, weights, q, words, episodes=1_000_000, beta=beta, gamma=0.9, **options
        )
    inside = ~moves.ends
    np.testing.assert_allclose(q[inside], exact[inside], atol=0.2)
    ranked = np.sort(exact[inside], axis=1)
    assert (ranked[:, -1] - ranked[:, -2] > 0.5).all()  # so that each choice is clear
    assert (q[inside].argmax(axis=1) == exact[inside].argmax(axis=1)).all()
    assert (q[moves.ends] == 0.0).all()  # nothing is learned where an episode is over


def test_outcomes_and_starts_have_their_probabilities() -> None:
    """Where an episode begins, and where a move leads, is as often as the table says."""
    shares = np.array([0.1, 0.25, 0.0, 0.65])
    table = np.broadcast_to(shares, (4, 1, 4))
    moves = make_moves(table, shares[::-1], np.zeros(4, bool))
    seen, words = np.zeros((2, 4), int), make_stream(2)
    for _ in range(4000):
        states, _, words = chance.roll_out(moves, np.zeros((4, 1)), words, horizon=1)
        seen[[0, 1], states] += 1
    for counts, share in zip(seen, (shares[::-1], shares), strict=True):
        assert (counts[share == 0] == 0).all()
        assert stats.chisquare(counts[share > 0], share[share > 0] * 4000).pvalue > 1e-3


@pytest.mark.parametrize(("high", "start"), [(2**30 - 1, 0), (2**30, 1), (2**31, 2)])
def test_an_outcome_ends_exactly_at_its_bound(high: int, start: int) -> None:
    """The high half of a word takes an outcome below its bound, and the next one from there on."""
    moves = make_moves(np.eye(3)[:, None], [0.25, 0.25, 0.5], np.zeros(3, bool))
    words = [0, 1, 0, reference.rotate(high << 32, 64 - 23)]
    assert reference.draw(words[:]) == high << 32
    states, *_ = chance.roll_out(moves, np.zeros((3, 1)), np.array(words, np.uint64), horizon=1)
    assert states[0] == start


@pytest.mark.parametrize(("slips", "starts", "draws"), [(0, 1, 5), (1, 1, 10), (0, 2, 6)])
def test_only_chance_takes_draws(slips: int, starts: int, draws: int) -> None:
    """Five steps take five draws; as many more if each can slip, and one if the start varies."""
    slip = np.full((2, 1, 2), 0.5) if slips else np.eye(2)[[[1], [0]]]
    moves = make_moves(slip, np.arange(2) < starts if starts == 1 else [0.5, 0.5], [False, False])
    words = make_stream(3)
    _, _, after = chance.roll_out(moves, np.zeros((2, 1)), words, horizon=5)
    zeros = np.zeros((2, 1))
    learned = chance.learn(
        moves, zeros, zeros, words, episodes=1, horizon=5, beta=0.5, gamma=0.5, epsilon=0.5
    )
    expected = words.tolist()
    for _ in range(draws):
        reference.draw(expected)
    assert after.tolist() == learned[1].tolist() == expected


def test_what_is_compiled_is_kept_and_notices_a_change_elsewhere() -> None:
    """The loops close over the hash of what they call, and over nothing that is never the same."""
    for function in (chance._learn, chance._follow):
        plain = function.py_func
        assert plain.__code__.co_freevars == ("code",)
        assert plain.__closure__[0].cell_contents == source_hash("replication.learning.compiled")


@pytest.fixture
def arrays() -> dict[str, Any]:
    """Return the arrays of a call on slippery ice."""
    weights, q = np.random.default_rng(0).normal(size=(2, 16, 4))
    return {"moves": frozen_lake(), "weights": weights, "q": q, "stream": make_stream(0)}


RATES = {"beta": 0.7, "gamma": 0.9, "epsilon": 0.1}
OPTIONS: dict[str, Any] = {"episodes": 5, "horizon": 50, **RATES}


def test_inputs_are_not_modified(arrays: dict[str, Any]) -> None:
    """Neither learning nor a roll-out changes its arguments, whether chance moves or not."""
    certain = certain_moves(np.arange(64).reshape(16, 4) % 16, 1, 15)
    for moves in (arrays["moves"], certain):
        tables = {name: arrays[name].copy() for name in ("weights", "q", "stream")}
        chance.learn(moves, **tables, **OPTIONS)
        chance.roll_out(moves, tables["q"], tables["stream"], horizon=9)
        assert all((table == arrays[name]).all() for name, table in tables.items())


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"weights": np.zeros((15, 4))}, "weights must have the shape"),
        ({"q": np.full((16, 4), np.nan)}, "q must be finite"),
        ({"stream": np.zeros(4, np.uint64)}, "stream must be uint64"),
        ({"episodes": 0}, "episodes must be an integer from 1"),
        ({"horizon": 0}, "horizon must be an integer from 1"),
        ({"beta": 1.5}, "beta must be in"),
        ({"gamma": -0.1}, "gamma must be in"),
        ({"epsilon": np.nan}, "epsilon must be in"),
        ({"tolerance": 1}, "tolerance must be at least 0 and less than 1"),
    ],
)
def test_what_does_not_fit_is_refused(
    arrays: dict[str, Any], change: dict[str, Any], message: str
) -> None:
    """A shape or value that does not fit raises a ValueError that names the argument."""
    with pytest.raises(ValueError, match=message):
        chance.learn(**arrays | OPTIONS | change)
    task = {"moves": arrays["moves"], "q": arrays["q"], "stream": arrays["stream"], "horizon": 9}
    if change.keys() <= {"q", "stream", "horizon", "tolerance"}:
        with pytest.raises(ValueError, match=message):
            chance.roll_out(**task | change)
