"""Q-learning (Eq. 1) and greedy roll-outs on tabular tasks, many trials at a time.

:mod:`replication.learning.reference` defines what is computed, in plain Python: read it first. The
functions here check their arguments and return the same bits from
:mod:`replication.learning.compiled`.
"""

import operator
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from replication.learning import compiled

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Words = NDArray[np.uint64]

MAX_ACTIONS = 16  # compilation takes longer with more
LARGEST = 1e280  # far from overflow: among NaN no action is the largest
MAX_COUNT = 2**31 - 1  # so that the number of steps fits in an int64


def learn(
    next_state: ArrayLike,
    weights: ArrayLike,
    q: ArrayLike,
    streams: ArrayLike,
    *,
    start: int,
    goal: int,
    episodes: int,
    horizon: int,
    beta: float,
    gamma: float,
    epsilon: float,
    random_ties: bool = True,
) -> tuple[Floats, Words, Ints]:
    """Learn Q by epsilon-greedy Q-learning (Eq. 1) on the reward ``weights``, trial by trial.

    To the last bit, a trial's result depends only on its own stream, weights and Q.

    Parameters
    ----------
    next_state
        Integers [state, action], for at most 16 actions.
    weights, q
        Rewards and initial values, float64 [trial, state, action].
    streams
        Random streams, uint64 [trial, 4], see :func:`replication.learning.seeds.stream`. A step
        takes one draw, see :func:`replication.learning.reference.choose`.
    start, goal
        States. Every episode begins in ``start`` and ends on reaching ``goal``, which is worth 0
        in the target whatever its row of Q says (choice GOAL-VALUE).
    episodes, horizon
        Number of episodes, and of steps after which one ends short of the goal. Such a time-out
        is not terminal: its target bootstraps.
    beta, gamma, epsilon
        Learning rate, discount and probability of exploring, each in [0, 1].
    random_ties
        Break ties at random, or else by the lowest action.

    Returns
    -------
    q, streams, steps
        New arrays: Q, float64 [trial, state, action]; the streams after the last draw,
        uint64 [trial, 4]; and the number of steps taken, int64 [trial].

    Raises
    ------
    ValueError
        If a shape or a value does not fit.
    """
    successors = _successors(next_state)
    initial, words = _table("q", q, successors, 3), _words("streams", streams, 2)
    rewards = _table("weights", weights, successors, 3)
    if not len(initial) == len(rewards) == len(words):
        raise ValueError(
            "weights, q and streams must have the same number of trials, "
            f"not {len(rewards)}, {len(initial)} and {len(words)}"
        )
    for name, value in (("beta", beta), ("gamma", gamma), ("epsilon", epsilon)):
        if not 0 <= value <= 1:
            raise ValueError(f"{name} must be in [0, 1], not {value}")
    rule = _rule(successors, start, goal, horizon, random_ties)._replace(
        beta=float(beta), gamma=float(gamma), threshold=round(epsilon * 2**32)
    )
    progress = np.zeros((len(words), 4), np.int64)
    progress[:, compiled.STATE] = rule.start
    progress[:, compiled.LEFT] = _integer("episodes", episodes, 1, MAX_COUNT)

    tables = np.stack((initial, rewards), axis=2)
    compiled.run(_actions(successors), words, progress, tables, successors, rule)
    return tables[:, :, 0].copy(), words, progress[:, compiled.STEPS].copy()


def roll_out(
    next_state: ArrayLike,
    q: ArrayLike,
    stream: ArrayLike,
    *,
    start: int,
    goal: int,
    horizon: int,
    random_ties: bool = True,
) -> tuple[Ints, Ints, Words]:
    """Follow the greedy policy of ``q`` [state, action] until ``goal``, ``horizon`` steps at most.

    Parameters are those of `learn`, for one trial. Returns the states, int64 [T + 1], the actions,
    int64 [T], and the stream after T draws, uint64 [4]. Raises ValueError as `learn` does.
    """
    successors = _successors(next_state)
    values, words = _table("q", q, successors, 2), _words("stream", stream, 1)
    rule = _rule(successors, start, goal, horizon, random_ties)
    states, actions = compiled.follow(_actions(successors), words, values, successors, rule)
    return states, actions, words


def _actions(successors: Ints) -> tuple[int, ...]:
    """Return a tuple with an entry per action, as the compiled functions need it."""
    return (0,) * successors.shape[1]


def _rule(
    successors: Ints, start: Any, goal: Any, horizon: Any, random_ties: bool
) -> compiled.Rule:
    """Check the scalars of a greedy roll-out."""
    last = len(successors) - 1
    return compiled.Rule(
        start=_integer("start", start, 0, last),
        goal=_integer("goal", goal, 0, last),
        horizon=_integer("horizon", horizon, 1, MAX_COUNT),
        beta=0.0,
        gamma=0.0,
        threshold=0,
        random_ties=bool(random_ties),
    )


def _integer(name: str, value: Any, low: int, high: int) -> int:
    """Check a whole number and return it as an int."""
    try:
        number = operator.index(value)
    except TypeError:
        number = low - 1
    if isinstance(value, bool) or not low <= number <= high:
        raise ValueError(f"{name} must be an integer from {low} to {high}, not {value!r}")
    return number


def _successors(next_state: ArrayLike) -> Ints:
    """Check the transitions and return them as a contiguous array."""
    table = np.asarray(next_state)
    if table.ndim != 2 or table.dtype.kind not in "iu" or not 1 <= table.shape[1] <= MAX_ACTIONS:
        raise ValueError(
            f"next_state must hold integers [state, action] for 1 to {MAX_ACTIONS} actions, "
            f"not {table.dtype} {list(table.shape)}"
        )
    if table.min(initial=0) < 0 or table.max(initial=0) >= len(table):
        raise ValueError(f"next_state must hold states from 0 to {len(table) - 1}")
    return np.ascontiguousarray(table, np.int64)


def _table(name: str, values: ArrayLike, successors: Ints, ndim: int) -> Floats:
    """Check a table of values or rewards and return it as a contiguous array."""
    table = np.ascontiguousarray(values, np.float64)
    if table.ndim != ndim or table.shape[-2:] != successors.shape:
        raise ValueError(
            f"{name} must have the shape [{'trial, ' * (ndim - 2)}state, action] with "
            f"{list(successors.shape)} states and actions, not {list(table.shape)}"
        )
    if not (np.abs(table) < LARGEST).all():
        raise ValueError(f"{name} must be finite and below {LARGEST}")
    return table


def _words(name: str, streams: ArrayLike, ndim: int) -> Words:
    """Check random streams and return a contiguous copy."""
    words = np.array(streams, order="C")
    if words.dtype != np.uint64 or words.ndim != ndim or words.shape[-1] != 4:
        raise ValueError(f"{name} must be uint64 [{'trial, ' * (ndim - 1)}4]")
    if not words.any(axis=-1).all():
        raise ValueError(f"{name} must not be all zero")
    return words
