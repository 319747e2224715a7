"""Q-learning (Eq. 1) and greedy roll-outs on tabular tasks.

:mod:`replication.learning.reference` defines what is computed, in plain Python: read it first. The
functions here check their arguments and return the same bits from
:mod:`replication.learning.compiled`.
"""

from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from replication.learning import arguments, compiled, reference

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Words = NDArray[np.uint64]

MAX_ACTIONS = 16  # compilation takes longer with more


def learn(
    next_state: ArrayLike,
    weights: ArrayLike,
    q: ArrayLike,
    stream: ArrayLike,
    *,
    start: int,
    goal: int,
    episodes: int,
    horizon: int,
    beta: float,
    gamma: float,
    epsilon: float,
    tolerance: float = 0.0,
    random_ties: bool = True,
    arithmetic: str = "double",
) -> tuple[Floats, Words, int, int]:
    """Learn Q by epsilon-greedy Q-learning (Eq. 1) on the reward ``weights``.

    Parameters
    ----------
    next_state
        Integers [state, action], for at most 16 actions.
    weights, q
        Rewards and initial values, float64 [state, action].
    stream
        A random stream, uint64 [4], see :func:`replication.learning.seeds.stream`. A step takes
        one draw, see :func:`replication.learning.reference.choose`.
    start, goal
        States. Every episode begins in ``start`` and ends on reaching ``goal``, which is worth 0
        in the target whatever its row of Q says (choice GOAL-VALUE).
    episodes, horizon
        Number of episodes, and of steps after which one ends short of the goal. Such a time-out
        is not terminal: its target bootstraps.
    beta, gamma, epsilon
        Learning rate, discount and probability of exploring, each in [0, 1].
    tolerance
        The greedy choice is among the actions whose value is at least the greatest one, less this
        part of its magnitude; in [0, 1).
    random_ties
        Choose at random among those, or else take the lowest action.
    arithmetic
        How Eq. 1 is rounded: "double", "fused" or "single", see
        :mod:`replication.learning.reference`.

    Returns
    -------
    q, stream, steps, collisions
        The new Q, the stream after the last draw, the number of steps taken, and that of steps
        that ended where they began.

    Raises
    ------
    ValueError
        If a shape or a value does not fit.
    """
    successors = _successors(next_state)
    if arithmetic not in reference.ROUNDED:
        raise ValueError(f"arithmetic must be {', '.join(reference.ROUNDED)}, not {arithmetic!r}")
    kind, integers = (np.float32, np.int32) if arithmetic == "single" else (np.float64, np.int64)
    rewards = arguments.table("weights", weights, successors.shape, kind)
    values, words = arguments.table("q", q, successors.shape, kind), arguments.words(stream)
    rule = _rule(successors, start, goal, horizon, tolerance, random_ties)._replace(
        fused=arithmetic == "fused",
        episodes=arguments.integer("episodes", episodes, 1),
        beta=arguments.rate("beta", beta),
        gamma=arguments.rate("gamma", gamma),
        threshold=round(arguments.rate("epsilon", epsilon) * 2**32),
    )
    arrays = values, values.view(integers), rewards, successors
    steps, collisions = compiled.learn(_actions(successors), words, *arrays, rule)
    return values.astype(np.float64, copy=False), words, steps, collisions


def roll_out(
    next_state: ArrayLike,
    q: ArrayLike,
    stream: ArrayLike,
    *,
    start: int,
    goal: int,
    horizon: int,
    tolerance: float = 0.0,
    random_ties: bool = True,
) -> tuple[Ints, Ints, Words]:
    """Follow the greedy policy of ``q`` [state, action] until ``goal``, ``horizon`` steps at most.

    Parameters are those of `learn`. Returns the states, int64 [T + 1], the actions,
    int64 [T], and the stream after T draws, uint64 [4]. Raises ValueError as `learn` does.
    """
    successors = _successors(next_state)
    values, words = arguments.table("q", q, successors.shape), arguments.words(stream)
    rule = _rule(successors, start, goal, horizon, tolerance, random_ties)
    states, actions = compiled.follow(_actions(successors), words, values, successors, rule)
    return states, actions, words


def _actions(successors: Ints) -> tuple[int, ...]:
    """Return a tuple with an entry per action, as the compiled functions need it."""
    return (0,) * successors.shape[1]


def _rule(
    successors: Ints, start: Any, goal: Any, horizon: Any, tolerance: float, random_ties: bool
) -> compiled.Rule:
    """Check the scalars of a greedy roll-out."""
    last = len(successors) - 1
    return compiled.Rule(
        start=arguments.integer("start", start, 0, last),
        goal=arguments.integer("goal", goal, 0, last),
        horizon=arguments.integer("horizon", horizon, 1),
        tolerance=arguments.tolerance(tolerance),
        random_ties=bool(random_ties),
    )


def _successors(next_state: ArrayLike) -> Ints:
    """Check the transitions and return them as a contiguous array."""
    table = np.asarray(next_state)
    if table.ndim != 2 or table.dtype.kind not in "iu" or not 1 <= table.shape[1] <= MAX_ACTIONS:
        raise ValueError(
            f"next_state must hold integers [state, action] for 1 to {MAX_ACTIONS} actions, "
            f"not {table.dtype} {list(table.shape)}"
        )
    if len(table) > compiled.MAX_STATES:
        raise ValueError(f"next_state must have at most {compiled.MAX_STATES} states")
    if table.min(initial=0) < 0 or table.max(initial=0) >= len(table):
        raise ValueError(f"next_state must hold states from 0 to {len(table) - 1}")
    return np.ascontiguousarray(table, np.int64)
