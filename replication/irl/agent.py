"""What the IRL loop needs of an agent: Q from reward weights, and a greedy episode from Q.

A new kind of task needs a class with these two methods, in its own module, see
:mod:`replication.trials.agents`; the loop and the methods stay as they are.
"""

from __future__ import annotations

from typing import NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Stream = NDArray[np.uint64]


class Episode(NamedTuple):
    """What an agent did in one episode.

    Attributes
    ----------
    states
        int64 [T + 1]; the last is where it ended.
    actions
        int64 [T].
    hits
        bool [T]: whether the action ran into a wall or an obstacle.
    """

    states: NDArray[np.int64]
    actions: NDArray[np.int64]
    hits: NDArray[np.bool_]


class Agent(Protocol):
    """A learner in an environment with finitely many states and actions."""

    @property
    def shape(self) -> tuple[int, int]:
        """Number of states and number of actions."""
        ...

    def learn(self, weights: Array, q: Array, stream: Stream) -> tuple[Array, Stream, int, int]:
        """Return the table learned from `q` [state, action], and the advanced stream.

        Behind them stand the numbers of steps and of collisions: steps that ran into a wall or an
        obstacle.
        """
        ...

    def roll_out(self, q: Array, stream: Stream) -> tuple[Episode, Stream]:
        """Return a greedy episode and the advanced stream."""
        ...
