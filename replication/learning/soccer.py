"""Q-learning (Eq. 1) and greedy roll-outs in robot soccer, compiled.

The rules are those of :mod:`replication.learning.reference`: a decision takes one draw, a goal is
worth 0 in the target, and a time-out is not terminal, so its target bootstraps. Epsilon falls over
the episodes of one call (choice EPSILON-END).
"""

# Numba infers the types of compiled functions.
# mypy: disable-error-code="no-untyped-def, no-untyped-call"

from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from replication.envs.soccer import compiled as physics
from replication.envs.soccer.rules import ACTIONS, N_STATES, SoccerParams
from replication.learning import arguments, compiled
from replication.source import source_hash

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Words = NDArray[np.uint64]
Flags = NDArray[np.bool_]

_SHAPE = N_STATES, len(ACTIONS)
_ACTIONS = (0,) * len(ACTIONS)  # an entry per action, as `compiled.choose` needs it


def learn(
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
    tolerance: float = 0.0,
    random_ties: bool = True,
    bootstrap_goal: bool = False,
) -> tuple[Floats, Words, int, int]:
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
    tolerance, random_ties
        How the greedy action is chosen, see :func:`replication.learning.qlearning.learn`.
    bootstrap_goal
        Let the target look beyond a goal, too, instead of valuing it at 0 (choice GOAL-VALUE).

    Returns
    -------
    q, stream, decisions, collisions
        The new Q, the stream after the last draw, the number of decisions, and that of decisions
        during which the robot touched an obstacle or a wall.

    Raises
    ------
    ValueError
        If a shape or a value does not fit.
    """
    rewards, values = (
        arguments.table(name, given, _SHAPE) for name, given in (("weights", weights), ("q", q))
    )
    words = arguments.words(stream)
    epsilons = np.linspace(
        arguments.rate("epsilon_start", epsilon_start),
        arguments.rate("epsilon_end", epsilon_end),
        arguments.integer("episodes", episodes, 1),
    )
    thresholds = np.array([round(epsilon * 2**32) for epsilon in epsilons.tolist()])
    keep: list[Any] = []
    engine = physics.engine(keep)
    law = physics.Law.of(params)
    rule = (
        arguments.rate("beta", beta),
        arguments.rate("gamma", gamma),
        arguments.tolerance(tolerance),
        bool(random_ties),
        bool(bootstrap_goal),
    )
    decisions, collisions = _learn(engine, law, rewards, values, words, thresholds, rule)
    return values, words, decisions, collisions


def roll_out(
    params: SoccerParams,
    q: ArrayLike,
    stream: ArrayLike,
    tolerance: float = 0.0,
    random_ties: bool = True,
) -> tuple[Ints, Ints, Flags, Words]:
    """Follow the greedy policy of ``q`` [state, action] for an episode.

    Returns the states, int64 [T + 1]; the actions, int64 [T]; whether the robot touched an obstacle
    or a wall during each, bool [T]; and the stream after T draws. Raises ValueError as
    `learn` does.
    """
    values, words = arguments.table("q", q, _SHAPE), arguments.words(stream)
    keep: list[Any] = []
    engine = physics.engine(keep)
    law, ties = physics.Law.of(params), (arguments.tolerance(tolerance), bool(random_ties))
    states, actions, hits = _follow(engine, law, values, words, *ties)
    return states, actions, hits, words


def _compile(code: str) -> tuple[Any, Any]:
    """Compile the two loops.

    They call what is compiled from other files, where numba would not notice a change. But numba
    looks at the values that a function closes over: here, the hash of those files.
    """

    @compiled.cached
    def learn(engine, law, weights, q, words, thresholds, rule):
        """Run all episodes; `q` and the stream advance in place."""
        _ = code
        beta, gamma, tolerance, random_ties, bootstrap_goal = rule
        now, clock = np.zeros(physics.N_FLOATS), np.zeros(physics.N_INTS, np.int64)
        stream, decisions, collisions = compiled.load(words), 0, 0
        for threshold in thresholds:
            state, outcome = physics.reset(law, now, clock), physics.GOING
            while outcome == physics.GOING:
                stream, action = compiled.choose(
                    _ACTIONS, stream, q, state, threshold, tolerance, random_ties
                )
                touched = clock[1:].sum()
                successor, outcome = physics.step(engine, law, now, clock, action)
                collisions += clock[1:].sum() > touched
                terminal = outcome == physics.SCORED and not bootstrap_goal
                value = 0.0 if terminal else q[successor].max()
                target = weights[state, action] + gamma * value
                q[state, action] += beta * (target - q[state, action])
                state = successor
                decisions += 1
        compiled.save(stream, words)
        return decisions, collisions

    @compiled.cached
    def follow(engine, law, q, words, tolerance, random_ties):
        """Run one episode without exploring; the stream advances in place."""
        _ = code
        now, clock = np.zeros(physics.N_FLOATS), np.zeros(physics.N_INTS, np.int64)
        states, actions = [physics.reset(law, now, clock)], [0 for _ in range(0)]
        hits = [False for _ in range(0)]
        stream, outcome = compiled.load(words), physics.GOING
        while outcome == physics.GOING:
            stream, action = compiled.choose(
                _ACTIONS, stream, q, states[-1], 0, tolerance, random_ties
            )
            touched = clock[1:].sum()
            state, outcome = physics.step(engine, law, now, clock, action)
            actions.append(action)
            states.append(state)
            hits.append(clock[1:].sum() > touched)
        compiled.save(stream, words)
        return np.array(states), np.array(actions), np.array(hits)

    return learn, follow


_learn, _follow = _compile(source_hash(physics.__name__, compiled.__name__))
