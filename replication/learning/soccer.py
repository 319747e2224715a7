"""Q-learning (Eq. 1) and greedy roll-outs in robot soccer, compiled.

The rules are those of :mod:`replication.learning.reference`: a decision takes one draw, a goal is
worth 0 in the target, and a time-out is not terminal, so its target bootstraps. Epsilon falls over
the episodes of one call (choice EPSILON-END).
"""

# Numba infers the types of compiled functions.
# mypy: disable-error-code="no-untyped-def, no-untyped-call"

from typing import Any

import numpy as np
from numba import njit
from numpy.typing import ArrayLike, NDArray

from replication.envs.soccer import compiled as physics
from replication.envs.soccer.rules import ACTIONS, N_STATES, SoccerParams
from replication.learning import compiled

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Words = NDArray[np.uint64]
Flags = NDArray[np.bool_]

_ACTIONS = (0,) * len(ACTIONS)  # an entry per action, as `compiled.choose` needs it


def learn_trial(
    params: SoccerParams,
    weights: ArrayLike,
    q: ArrayLike,
    stream: ArrayLike,
    *,
    episodes: int,
    beta: float,
    gamma: float,
    epsilon_start: float,
    epsilon_end: float,
    random_ties: bool = True,
    bootstrap_goal: bool = False,
) -> tuple[Floats, Words, int]:
    """Learn Q by epsilon-greedy Q-learning (Eq. 1) on the reward ``weights``.

    Parameters
    ----------
    params
        The world.
    weights, q
        Rewards and initial values, float64 [state, action].
    stream
        A random stream, uint64 [4], see :func:`replication.learning.seeds.stream`.
    episodes
        Number of episodes; each ends with a goal or when time is up.
    beta, gamma
        Learning rate and discount, in [0, 1].
    epsilon_start, epsilon_end
        Probability of exploring in the first and the last episode; it is linear in between.
    random_ties
        Break ties at random, or else by the lowest action.
    bootstrap_goal
        Let the target look beyond a goal, too, instead of valuing it at 0 (choice GOAL-VALUE).

    Returns
    -------
    q, stream, decisions
        The new Q, the stream after the last draw, and the number of decisions.

    Raises
    ------
    ValueError
        If a shape or a value does not fit.
    """
    rewards, values, words = _table("weights", weights), _table("q", q), _words(stream)
    if episodes < 1:
        raise ValueError(f"episodes must be at least 1, not {episodes!r}")
    rates = {"beta": beta, "gamma": gamma, "epsilon_start": epsilon_start}
    for name, value in (rates | {"epsilon_end": epsilon_end}).items():
        if not 0 <= value <= 1:
            raise ValueError(f"{name} must be in [0, 1], not {value}")
    epsilons = np.linspace(epsilon_start, epsilon_end, episodes)
    thresholds = np.array([round(epsilon * 2**32) for epsilon in epsilons.tolist()])
    keep: list[Any] = []
    engine = physics.engine(keep)
    law = physics.Law.of(params)
    decisions = _learn(
        engine,
        law,
        rewards,
        values,
        words,
        thresholds,
        float(beta),
        float(gamma),
        bool(random_ties),
        bool(bootstrap_goal),
    )
    return values, words, decisions


def roll_out(
    params: SoccerParams, q: ArrayLike, stream: ArrayLike, random_ties: bool = True
) -> tuple[Ints, Ints, Flags, Words]:
    """Follow the greedy policy of ``q`` [state, action] for an episode.

    Returns the states, int64 [T + 1]; the actions, int64 [T]; whether the robot touched an obstacle
    or a wall during each, bool [T]; and the stream after T draws. Raises ValueError like
    `learn_trial`.
    """
    values, words = _table("q", q), _words(stream)
    keep: list[Any] = []
    engine = physics.engine(keep)
    states, actions, hits = _follow(engine, physics.Law.of(params), values, words, random_ties)
    return states, actions, hits, words


# These two call what is compiled from other files. Numba would not notice a change there, so they
# are not cached on disk; they are small.


@njit
def _learn(engine, law, weights, q, stream, thresholds, beta, gamma, random_ties, bootstrap_goal):
    """Run all episodes; `q` and the stream advance in place."""
    now, clock = np.zeros(physics.N_FLOATS), np.zeros(physics.N_INTS, np.int64)
    decisions = 0
    for threshold in thresholds:
        state, outcome = physics.reset(law, now, clock), physics.GOING
        while outcome == physics.GOING:
            action = compiled.choose(_ACTIONS, q[state], stream, threshold, random_ties)
            successor, outcome = physics.step(engine, law, now, clock, action)
            terminal = outcome == physics.SCORED and not bootstrap_goal
            value = 0.0 if terminal else q[successor].max()
            target = weights[state, action] + gamma * value
            q[state, action] += beta * (target - q[state, action])
            state = successor
            decisions += 1
    return decisions


@njit
def _follow(engine, law, q, stream, random_ties):
    """Run one episode without exploring; the stream advances in place."""
    now, clock = np.zeros(physics.N_FLOATS), np.zeros(physics.N_INTS, np.int64)
    states, actions = [physics.reset(law, now, clock)], [0 for _ in range(0)]
    hits = [False for _ in range(0)]
    outcome = physics.GOING
    while outcome == physics.GOING:
        action = compiled.choose(_ACTIONS, q[states[-1]], stream, 0, random_ties)
        touched = clock[1:].sum()
        state, outcome = physics.step(engine, law, now, clock, action)
        actions.append(action)
        states.append(state)
        hits.append(clock[1:].sum() > touched)
    return np.array(states), np.array(actions), np.array(hits)


def _table(name: str, values: ArrayLike) -> Floats:
    """Check a table of values or rewards and return a contiguous copy."""
    table = np.array(values, np.float64, order="C")
    if table.shape != (N_STATES, len(ACTIONS)) or not np.isfinite(table).all():
        raise ValueError(
            f"{name} must be finite numbers [{N_STATES}, {len(ACTIONS)}], not {list(table.shape)}"
        )
    return table


def _words(stream: ArrayLike) -> Words:
    """Check a random stream and return a contiguous copy."""
    words = np.array(stream, order="C")
    if words.dtype != np.uint64 or words.shape != (4,) or not words.any():
        raise ValueError("stream must be uint64 [4] and not all zero")
    return words
