"""Q-learning (Eq. 1) and greedy roll-outs where chance decides some moves or the start.

:mod:`replication.learning.chance_reference` defines what is computed, in plain Python: read it
first. The functions here check their arguments and return the same bits.
"""

# Numba infers the types of compiled functions.
# mypy: disable-error-code="no-untyped-def, no-untyped-call"

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from replication.envs.tasks.moves import Moves
from replication.learning import arguments, compiled, qlearning
from replication.source import source_hash

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Words = NDArray[np.uint64]


def learn(
    moves: Moves,
    weights: ArrayLike,
    q: ArrayLike,
    stream: ArrayLike,
    *,
    episodes: int,
    horizon: int,
    beta: float,
    gamma: float,
    epsilon: float,
    tolerance: float = 0.0,
    random_ties: bool = True,
) -> tuple[Floats, Words, int, int]:
    """Learn Q as :func:`replication.learning.qlearning.learn` does, which has the same results.

    Parameters
    ----------
    moves
        Where actions lead, made by `Moves.of`, for any number of actions. An episode begins in one
        of its starts and ends on reaching a state that ends it, which is worth 0 whatever its row
        of Q says.
    weights, q, stream, episodes, horizon, beta, gamma, epsilon, tolerance, random_ties
        As there. A step takes one draw for the action, and one more if the move has several
        outcomes; an episode takes one if there are several starts.

    Raises
    ------
    ValueError
        If a shape or a value does not fit.
    """
    rewards, values = (
        arguments.table(name, given, moves.shape)
        for name, given in (("weights", weights), ("q", q))
    )
    words = arguments.words(stream)
    options: dict[str, Any] = {
        "episodes": arguments.integer("episodes", episodes, 1),
        "horizon": arguments.integer("horizon", horizon, 1),
        "beta": arguments.rate("beta", beta),
        "gamma": arguments.rate("gamma", gamma),
        "epsilon": arguments.rate("epsilon", epsilon),
        "tolerance": arguments.tolerance(tolerance),
        "random_ties": bool(random_ties),
    }
    if _is_certain(moves):
        return _learn_certainly(moves, rewards, values, words, **options)
    options["epsilon"] = round(epsilon * 2**32)  # explore if the high half is below
    rule = tuple(options.values())
    steps, collisions = _learn(_actions(moves), words, values, rewards, moves, rule)
    return values, words, steps, collisions


def roll_out(
    moves: Moves,
    q: ArrayLike,
    stream: ArrayLike,
    *,
    horizon: int,
    tolerance: float = 0.0,
    random_ties: bool = True,
) -> tuple[Ints, Ints, Words]:
    """Follow the greedy policy of ``q`` until the episode ends, ``horizon`` steps at most.

    Parameters are those of `learn`. Returns the states, int64 [T + 1], the actions, int64 [T], and
    the stream after the last draw, uint64 [4]. Raises ValueError as `learn` does.
    """
    values, words = arguments.table("q", q, moves.shape), arguments.words(stream)
    rule = (
        arguments.integer("horizon", horizon, 1),
        arguments.tolerance(tolerance),
        bool(random_ties),
    )
    states, actions = _follow(_actions(moves), words, values, moves, rule)
    return states, actions, words


def _is_certain(moves: Moves) -> bool:
    """Return whether nothing is left to chance, so that `qlearning.learn` has the same bits."""
    one_each = len(moves.successors) == len(moves.first) - 1
    return (
        one_each
        and moves.shape[1] <= qlearning.MAX_ACTIONS
        and not moves.ends[moves.successors[-1]]  # there, a step may stay in a state that ends
    )


def _learn_certainly(
    moves: Moves, weights: Floats, q: Floats, stream: Words, **options: Any
) -> tuple[Floats, Words, int, int]:
    """Learn where nothing is left to chance; one more state stands for all that end an episode."""
    goal = len(moves.ends)
    next_state = np.where(moves.ends, goal, np.arange(goal))[moves.successors[:-1]]
    next_state = np.vstack([next_state.reshape(moves.shape), np.full(moves.shape[1], goal)])
    weights, q = (np.pad(table, ((0, 1), (0, 0))) for table in (weights, q))
    start = moves.successors[-1]
    q, stream, steps, collisions = qlearning.learn(
        next_state, weights, q, stream, start=start, goal=goal, **options
    )
    return q[:-1], stream, steps, collisions


def _actions(moves: Moves) -> Any:
    """Return what has a length of the number of actions.

    The length of a tuple is known to the compiler, which unrolls the loops over few actions; that
    of an array is not, so that many actions take no longer to compile.
    """
    n = moves.shape[1]
    return (0,) * n if n <= qlearning.MAX_ACTIONS else np.zeros(n, np.int8)


@compiled.cached
def _land(moves, pair, stream, drawn):
    """Return the stream, as `drawn` if a pair has several outcomes, and the one it takes.

    Nothing is called here that is compiled elsewhere, see `_compile`.
    """
    low, high = moves.first[pair], moves.first[pair + 1] - 1
    if low == high:
        return stream, moves.successors[low]
    stream, word, _ = drawn
    while low < high:
        middle = (low + high) // 2
        if moves.bounds[middle] > word:
            high = middle
        else:
            low = middle + 1
    return stream, moves.successors[low]


def _compile(code: str) -> tuple[Any, Any]:
    """Compile the two loops.

    They call what is compiled from another file, where numba would not notice a change. But numba
    looks at the values that a function closes over: here, the hash of that file.
    """

    @compiled.cached
    def learn(actions, words, values, weights, moves, rule):
        """Run all episodes; the stream's `words` and `values` [state, action] advance in place."""
        _ = code
        episodes, horizon, beta, gamma, threshold, tolerance, random_ties = rule
        stream, steps, collisions = compiled.load(words), 0, 0
        n, start = len(actions), len(moves.first) - 2
        for _episode in range(episodes):
            stream, state = _land(moves, start, stream, compiled.draw(stream))
            for _step in range(horizon):
                stream, action = compiled.choose(
                    actions, stream, values, state, threshold, tolerance, random_ties
                )
                pair = state * n + action
                stream, successor = _land(moves, pair, stream, compiled.draw(stream))
                ended = moves.ends[successor]
                value = 0.0 if ended else compiled.largest(actions, values, successor)
                target = weights[state, action] + gamma * value
                values[state, action] += beta * (target - values[state, action])
                steps += 1
                collisions += successor == state
                state = successor
                if ended:
                    break
        compiled.save(stream, words)
        return steps, collisions

    @compiled.cached
    def follow(actions, words, values, moves, rule):
        """Run one episode without exploring; the stream's `words` advance in place."""
        _ = code
        horizon, tolerance, random_ties = rule
        n = len(actions)
        stream, pair = compiled.load(words), len(moves.first) - 2
        stream, state = _land(moves, pair, stream, compiled.draw(stream))
        states, taken = [state], [0 for _ in range(0)]
        while len(taken) < horizon:
            stream, action = compiled.choose(
                actions, stream, values, state, 0, tolerance, random_ties
            )
            pair = state * n + action
            stream, state = _land(moves, pair, stream, compiled.draw(stream))
            taken.append(action)
            states.append(state)
            if moves.ends[state]:
                break
        compiled.save(stream, words)
        return np.array(states), np.array(taken)

    return learn, follow


_learn, _follow = _compile(source_hash(compiled.__name__))
