"""What the IRL loop needs of a learner: Q from reward weights, and a greedy episode from Q.

A new kind of task is a class with these two methods in a module of its own, see
:mod:`replication.trials.condition`; nothing in the loop or in the methods changes.
"""

from __future__ import annotations

from typing import NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Streams = NDArray[np.uint64]


class Episode(NamedTuple):
    """What an agent did in one episode.

    Attributes
    ----------
    states
        int64 [T + 1], the last being where it ended.
    actions
        int64 [T].
    hits
        bool [T]: whether the action ran into a wall or an obstacle.
    """

    states: NDArray[np.int64]
    actions: NDArray[np.int64]
    hits: NDArray[np.bool_]


class Agent(Protocol):
    """A learner on a task with a finite number of states and actions."""

    @property
    def shape(self) -> tuple[int, int]:
        """Number of states and number of actions."""
        ...

    @property
    def batch_size(self) -> int:
        """How many trials are best learned in one call."""
        ...

    def learn(
        self, weights: Array, q: Array, streams: Streams
    ) -> tuple[Array, Streams, NDArray[np.int64]]:
        """Return the learned tables, the streams' new positions and the steps taken.

        The arrays are `[trial, state, action]`, `[trial, 4]` and `[trial]`; a trial's result must
        not depend on the other trials.
        """
        ...

    def roll_out(self, q: Array, stream: Streams) -> tuple[Episode, Streams]:
        """Return a greedy episode, and the stream's position after it."""
        ...
