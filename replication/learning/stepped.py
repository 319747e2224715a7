"""Q-learning (Eq. 1) and greedy roll-outs where the environment can only be stepped.

The environment is Gymnasium's; a function tells which state, a whole number, an observation is. The
rules are those of :mod:`replication.learning.reference`: a step takes one draw, a state in which
the environment terminates is worth 0 in the target, and a time-out, the horizon's or the
environment's own, is not terminal, so its target bootstraps.

Each call takes one draw more, the first one, to seed the environment at its first reset. Later on
the environment draws from its own generator, so all that it does follows from the stream.
"""

# Numba infers the types of compiled functions.
# mypy: disable-error-code="no-untyped-def, no-untyped-call"

from __future__ import annotations

from collections.abc import Callable
from operator import index
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from replication.learning import arguments, compiled, reference
from replication.source import source_hash

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Words = NDArray[np.uint64]

# A compiled call takes a tenth of a microsecond for each array that it is given. So all is in one
# array of 64-bit words: the stream, whole numbers, floats, the table of values, that of rewards.
_STATE, _ACTION, _STEPS, _COLLISIONS, _LEFT = range(4, 9)
_N_ACTIONS, _HORIZON, _THRESHOLD, _RANDOM_TIES = range(9, 13)
_TOLERANCE, _BETA, _GAMMA, _TABLES = range(13, 17)


def learn(
    env: Any,
    state_of: Callable[[Any], int],
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
    env
        A Gymnasium environment whose actions are numbered from 0. Its own reward is not used.
    state_of
        Returns the state of an observation.
    weights, q, stream, episodes, horizon, beta, gamma, epsilon, tolerance, random_ties
        As there.

    Raises
    ------
    ValueError
        If a shape or a value does not fit, or a state is not one of Q.
    TypeError
        If a state is not an integer.
    """
    memory = _Memory(q, stream, horizon, tolerance, random_ties, weights)
    episodes = arguments.integer("episodes", episodes, 1)
    memory.floats[_BETA] = arguments.rate("beta", beta)
    memory.floats[_GAMMA] = arguments.rate("gamma", gamma)
    memory.words[_THRESHOLD] = round(arguments.rate("epsilon", epsilon) * 2**32)
    words, step = memory.words, env.step
    seed: int | None = memory.seed()
    for _ in range(episodes):
        observation, _ = env.reset(seed=seed)
        seed = None
        action = _advance(words, index(state_of(observation)), True, False, False)
        while action >= 0:
            observation, _, terminated, truncated, _ = step(action)
            state = index(state_of(observation))
            action = _advance(words, state, False, bool(terminated), bool(truncated))
    return memory.q, memory.stream, int(words[_STEPS]), int(words[_COLLISIONS])


def roll_out(
    env: Any,
    state_of: Callable[[Any], int],
    q: ArrayLike,
    stream: ArrayLike,
    *,
    horizon: int,
    tolerance: float = 0.0,
    random_ties: bool = True,
) -> tuple[Ints, Ints, Words]:
    """Follow the greedy policy of ``q`` until the episode ends, ``horizon`` steps at most.

    Parameters are those of `learn`. Returns the states, int64 [T + 1], the actions, int64 [T], and
    the stream after T + 1 draws, uint64 [4]. Raises as `learn` does.
    """
    memory = _Memory(q, stream, horizon, tolerance, random_ties)
    observation, _ = env.reset(seed=memory.seed())
    states, actions, over = [index(state_of(observation))], list[int](), False
    while len(actions) < horizon and not over:
        actions.append(_advance(memory.words, states[-1], True, False, False))
        observation, _, terminated, truncated, _ = env.step(actions[-1])
        states.append(index(state_of(observation)))
        over = terminated or truncated
    return np.array(states), np.array(actions), memory.stream


class _Memory:
    """What a compiled step reads and writes, in one array."""

    def __init__(
        self,
        q: ArrayLike,
        stream: ArrayLike,
        horizon: int,
        tolerance: float,
        random_ties: bool,
        weights: ArrayLike | None = None,
    ) -> None:
        self.shape = np.shape(q)
        if len(self.shape) != 2 or 0 in self.shape:
            raise ValueError(f"q must have the shape [state, action], not {list(self.shape)}")
        values = arguments.table("q", q, self.shape)
        rewards = values if weights is None else arguments.table("weights", weights, self.shape)
        self.words = np.zeros(_TABLES + 2 * values.size, np.uint64)
        self.floats = self.words.view(np.float64)
        self.words[:4] = arguments.words(stream)
        self.words[_N_ACTIONS] = self.shape[1]
        self.words[_HORIZON] = arguments.integer("horizon", horizon, 1)
        self.floats[_TOLERANCE] = arguments.tolerance(tolerance)
        self.words[_RANDOM_TIES] = bool(random_ties)
        self.floats[_TABLES:] = np.concatenate([values, rewards]).ravel()

    def seed(self) -> int:
        """Draw a seed for the environment."""
        stream = self.stream.tolist()
        word = reference.draw(stream)
        self.words[:4] = stream
        return word >> 33  # 31 bits, which any generator takes

    @property
    def stream(self) -> Words:
        """The stream after the last draw."""
        return self.words[:4].copy()

    @property
    def q(self) -> Floats:
        """The values."""
        return self.floats[_TABLES:].reshape(2, *self.shape)[0].copy()


def _compile(code: str) -> Any:
    """Compile a step.

    It calls what is compiled from another file, where numba would not notice a change. But numba
    looks at the values that a function closes over: here, the hash of that file.
    """

    @compiled.cached
    def advance(memory, state, begins, terminated, truncated):
        """Learn from the step that led to a state, unless an episode begins there.

        Returns the next action, or -1 if the episode is over.
        """
        _ = code
        floats = memory.view(np.float64)
        tables = floats[_TABLES:].reshape(2, -1, np.int64(memory[_N_ACTIONS]))
        values, weights = tables[0], tables[1]
        actions = values[0]  # whose length is their number
        if not 0 <= state < len(values):
            raise ValueError("an observation became a state that q does not have")
        if begins:
            memory[_LEFT] = memory[_HORIZON]
        else:
            was, action = memory[_STATE], memory[_ACTION]
            value = 0.0 if terminated else compiled.largest(actions, values, state)
            target = weights[was, action] + floats[_GAMMA] * value
            values[was, action] += floats[_BETA] * (target - values[was, action])
            memory[_STEPS] += compiled.ONE
            memory[_COLLISIONS] += np.uint64(state == np.int64(was))
            memory[_LEFT] -= compiled.ONE
            if terminated or truncated or memory[_LEFT] == 0:
                return -1
        stream, action = compiled.choose(
            actions,
            compiled.load(memory),
            values,
            state,
            memory[_THRESHOLD],
            floats[_TOLERANCE],
            memory[_RANDOM_TIES] != 0,
        )
        compiled.save(stream, memory)
        memory[_STATE], memory[_ACTION] = state, action
        return action

    return advance


_advance = _compile(source_hash(compiled.__name__))
