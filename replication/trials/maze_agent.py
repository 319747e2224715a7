"""The agent in a maze: Q-learning (Eq. 1) and greedy episodes on the table of moves."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from replication.envs.environment import Environment
from replication.envs.maze import Maze, as_maze
from replication.irl.agent import Episode
from replication.learning import qlearning
from replication.paper.params import Learner, Params
from replication.paper.register import ChoiceError

Array = NDArray[np.float64]
Stream = NDArray[np.uint64]


@dataclass(frozen=True)
class MazeAgent:
    """Q-learning (Eq. 1) and greedy episodes in a maze."""

    maze: Maze
    learner: Learner
    rollout_ties: str

    def __post_init__(self) -> None:
        if self.learner.epsilon_end != self.learner.epsilon:
            raise ChoiceError(
                "in mazes the exploration probability does not change: "
                f"set epsilon_end = {self.learner.epsilon} as well"
            )

    @property
    def shape(self) -> tuple[int, int]:
        """Number of states, obstacle cells included, and number of actions."""
        return self.maze.n_states, self.maze.n_actions

    def learn(self, weights: Array, q: Array, stream: Stream) -> tuple[Array, Stream, int, int]:
        """Learn by Q-learning, see :func:`replication.learning.qlearning.learn`."""
        return qlearning.learn(
            self.maze.next_state,
            weights,
            q,
            stream,
            start=self.maze.start,
            goal=self.maze.goal,
            episodes=self.learner.episodes,
            horizon=self.learner.horizon,
            beta=self.learner.beta,
            gamma=self.learner.gamma,
            epsilon=self.learner.epsilon,
            tolerance=self.learner.tie_tolerance,
            random_ties=self.learner.ties == "random",
            arithmetic=self.learner.arithmetic,
        )

    def roll_out(self, q: Array, stream: Stream) -> tuple[Episode, Stream]:
        """Follow the greedy policy, see :func:`replication.learning.qlearning.roll_out`."""
        states, actions, stream = qlearning.roll_out(
            self.maze.next_state,
            q,
            stream,
            start=self.maze.start,
            goal=self.maze.goal,
            horizon=self.learner.horizon,
            tolerance=self.learner.tie_tolerance,
            random_ties=self.rollout_ties == "random",
        )
        return Episode(states, actions, states[1:] == states[:-1]), stream


def make_agent(environment: Environment, params: Params) -> MazeAgent:
    """Return the agent that learns in a maze."""
    return MazeAgent(as_maze(environment), params.learner, params.loop.rollout_ties)
