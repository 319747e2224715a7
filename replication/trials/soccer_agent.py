"""The agent in robot soccer: Q-learning (Eq. 1) and greedy episodes in the physics world."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from replication.envs.environment import Environment
from replication.envs.soccer.field import SoccerField, as_soccer
from replication.irl.agent import Episode
from replication.learning import soccer
from replication.paper.params import Learner, Params
from replication.paper.register import ChoiceError

Array = NDArray[np.float64]
Stream = NDArray[np.uint64]


@dataclass(frozen=True)
class SoccerAgent:
    """Q-learning (Eq. 1) and greedy episodes in robot soccer; the time limit is the horizon."""

    field: SoccerField
    learner: Learner
    rollout_ties: str

    @property
    def shape(self) -> tuple[int, int]:
        """Number of states and number of actions."""
        return self.field.n_states, self.field.n_actions

    def __post_init__(self) -> None:
        if self.learner.arithmetic != "double":
            raise ChoiceError('in soccer all operations are rounded: set arithmetic = "double"')
        if self.learner.solver != "q-learning":
            raise ChoiceError('soccer has no table to plan on: set solver = "q-learning"')

    def learn(self, weights: Array, q: Array, stream: Stream) -> tuple[Array, Stream, int, int]:
        """Learn by Q-learning, see :func:`replication.learning.soccer.learn`."""
        return soccer.learn(
            self.field.params,
            weights,
            q,
            stream,
            episodes=self.learner.episodes,
            beta=self.learner.beta,
            gamma=self.learner.gamma,
            epsilon_start=self.learner.epsilon,
            epsilon_end=self.learner.epsilon_end,
            tolerance=self.learner.tie_tolerance,
            random_ties=self.learner.ties == "random",
            bootstrap_goal=self.learner.goal_value == "bootstrap",
        )

    def roll_out(self, q: Array, stream: Stream) -> tuple[Episode, Stream]:
        """Follow the greedy policy, see :func:`replication.learning.soccer.roll_out`."""
        states, actions, hits, stream = soccer.roll_out(
            self.field.params,
            q,
            stream,
            tolerance=self.learner.tie_tolerance,
            random_ties=self.rollout_ties == "random",
        )
        return Episode(states, actions, hits), stream


def make_agent(environment: Environment, params: Params) -> SoccerAgent:
    """Return the agent that learns on the soccer field."""
    return SoccerAgent(as_soccer(environment), params.learner, params.loop.rollout_ties)
