"""What a method is given that finds a reward from demonstrations and the table of moves alone."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from replication.demos.model import Demo
from replication.envs.environment import Environment
from replication.envs.maze import Maze
from replication.envs.tasks.base import Task
from replication.envs.tasks.gymnasium import GymTask
from replication.envs.tasks.moves import Moves
from replication.irl.expectations import feature_expectations, mean_expectations, visited
from replication.learning import policy_iteration, sweeps

Array = NDArray[np.float64]


@dataclass(eq=False)
class Problem:
    """Demonstrations on a table of moves, and how often it was planned on.

    Attributes
    ----------
    moves
        The table.
    correct, incorrect
        The demonstrations that the method is given.
    gamma
        Discount factor of values and feature expectations, below 1.
    plans
        The number of times that an optimal, or soft-optimal, policy was computed.
    """

    moves: Moves
    correct: Sequence[Demo]
    incorrect: Sequence[Demo]
    gamma: float
    plans: int = field(default=0, init=False)

    @cached_property
    def mu_e(self) -> Array:
        """Feature expectations of the correct demonstrations, [state, action] (Eq. 5)."""
        return mean_expectations(self.correct, gamma=self.gamma, shape=self.moves.shape)

    @cached_property
    def mu_wrong(self) -> Array:
        """Feature expectations of each incorrect demonstration, [demo, state, action]."""
        shape = self.moves.shape
        each = [
            feature_expectations(demo.states, demo.actions, gamma=self.gamma, shape=shape)
            for demo in self.incorrect
        ]
        return np.array(each).reshape(-1, *shape)

    @cached_property
    def marked(self) -> NDArray[np.bool_]:
        """The pairs of incorrect demonstrations that no correct one visits, [state, action]."""
        return visited(self.incorrect, shape=self.moves.shape) & (self.mu_e == 0)

    def plan(self, weights: Array, q: Array | None = None) -> Array:
        """Return the optimal Q, see :func:`plan_on`."""
        self.plans += 1
        return plan_on(self.moves, weights, gamma=self.gamma, q=q)

    def plan_softly(self, weights: Array, q: Array | None = None) -> Array:
        """Return the soft-optimal Q, see :func:`replication.learning.sweeps.soft`."""
        self.plans += 1
        return sweeps.soft(self.moves, weights, gamma=self.gamma, q=q)

    def visits(self, policy: Array) -> Array:
        """Return the feature expectations of a policy that is given as probabilities."""
        return sweeps.visits(self.moves, policy, gamma=self.gamma)

    def follow(self, q: Array) -> Array:
        """Return the feature expectations of the greedy policy; the first of equals is taken."""
        policy = q.argmax(axis=1)
        next_state = certain(self.moves)
        if next_state is None or len(self.moves.starts) > 1:
            return self.visits(np.eye(q.shape[1])[policy])
        start, ends = self.moves.starts[0], self.moves.ends
        return policy_iteration.visits(next_state, ends, policy, start, gamma=self.gamma)


def plan_on(moves: Moves, weights: Array, *, gamma: float, q: Array | None = None) -> Array:
    """Return the optimal Q [state, action] of a reward, by the faster way that the table allows.

    `q` is where to begin: the nearer it is, the sooner it is done.
    """
    next_state = certain(moves)
    if next_state is None:
        return sweeps.optimal(moves, weights, gamma=gamma, q=q)
    return policy_iteration.iterate(next_state, moves.ends, weights, gamma=gamma, q=q)


def certain(moves: Moves) -> NDArray[np.int64] | None:
    """Return where each action leads, [state, action]; None if chance decides some move."""
    n_pairs = len(moves.first) - 2
    if moves.first[-2] > n_pairs:
        return None
    return moves.successors[:n_pairs].reshape(moves.shape)


def table_of(environment: Environment) -> Moves | None:
    """Return the table of an environment's moves; None if it has none."""
    task = environment.task if isinstance(environment, GymTask) else environment
    if isinstance(task, Maze):
        states, actions = np.indices(task.next_state.shape).reshape(2, -1)
        outcomes = (states, actions, task.next_state.ravel(), np.ones(states.size))
        places = np.arange(task.n_states)
        starts, ends = (places == task.start).astype(float), places == task.goal
        return Moves.of(outcomes, shape=task.next_state.shape, starts=starts, ends=ends)
    return task.table if isinstance(task, Task) else None
