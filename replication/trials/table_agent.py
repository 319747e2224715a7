"""The agent where the table of moves is known: Q-learning (Eq. 1) or exact planning."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from replication.envs.environment import Environment
from replication.envs.maze import as_maze
from replication.irl.agent import Episode
from replication.learning import planning, qlearning
from replication.paper.params import Params
from replication.paper.register import ChoiceError

Array = NDArray[np.float64]
Stream = NDArray[np.uint64]


@dataclass(frozen=True, eq=False)
class TableAgent:
    """Q-learning or exact planning, and greedy episodes, where no move is random.

    Attributes
    ----------
    next_state
        The state that an action leads to, int64 [state, action].
    start, goal
        States; an episode ends at the goal.
    params
        Of the learner and of the roll-out.
    """

    next_state: NDArray[np.int64]
    start: int
    goal: int
    params: Params

    def __post_init__(self) -> None:
        learner = self.params.learner
        if learner.epsilon_end != learner.epsilon:
            raise ChoiceError(
                "here the exploration probability does not change: "
                f"set epsilon_end = {learner.epsilon} as well"
            )
        if learner.solver == "planning" and learner.gamma == 1:
            raise ChoiceError("planning needs a discount below 1: set gamma = 0.99")

    @property
    def shape(self) -> tuple[int, int]:
        """Number of states, those that cannot be entered included, and number of actions."""
        n_states, n_actions = self.next_state.shape
        return n_states, n_actions

    def learn(self, weights: Array, q: Array, stream: Stream) -> tuple[Array, Stream, int, int]:
        """Learn by Q-learning, see :func:`replication.learning.qlearning.learn`, or plan."""
        learner = self.params.learner
        if learner.solver == "planning":  # neither steps nor draws
            return planning.plan(weights, self._ahead, gamma=learner.gamma), stream, 0, 0
        return qlearning.learn(
            self.next_state,
            weights,
            q,
            stream,
            start=self.start,
            goal=self.goal,
            episodes=learner.episodes,
            horizon=learner.horizon,
            beta=learner.beta,
            gamma=learner.gamma,
            epsilon=learner.epsilon,
            tolerance=learner.tie_tolerance,
            random_ties=learner.ties == "random",
            arithmetic=learner.arithmetic,
        )

    def roll_out(self, q: Array, stream: Stream) -> tuple[Episode, Stream]:
        """Follow the greedy policy, see :func:`replication.learning.qlearning.roll_out`."""
        states, actions, stream = qlearning.roll_out(
            self.next_state,
            q,
            stream,
            start=self.start,
            goal=self.goal,
            horizon=self.params.learner.horizon,
            tolerance=self.params.learner.tie_tolerance,
            random_ties=self.params.loop.rollout_ties == "random",
        )
        return Episode(states, actions, states[1:] == states[:-1]), stream

    def _ahead(self, values: Array) -> Array:
        """Return what the next state is worth, [state, action]: nothing beyond the goal."""
        return np.where(self.next_state == self.goal, 0.0, values[self.next_state])


def make_agent(environment: Environment, params: Params) -> TableAgent:
    """Return the agent that learns in a maze."""
    maze = as_maze(environment)
    return TableAgent(maze.next_state, maze.start, maze.goal, params)
