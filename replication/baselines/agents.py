"""Agents that have another one's episodes, but plan, or copy the expert, instead of learning."""

from __future__ import annotations

from dataclasses import dataclass

from replication.baselines.problem import plan_on
from replication.envs.tasks.moves import Moves
from replication.irl.agent import Agent, Array, Episode, Stream
from replication.trials import soccer_agent, table_agent, task_agent

AGENTS = (soccer_agent, table_agent, task_agent)
"""Whose episodes these are: named here, their code is part of the key of a stored trial."""


@dataclass(frozen=True, eq=False)
class _Wrapper:
    agent: Agent

    @property
    def shape(self) -> tuple[int, int]:
        """Number of states and number of actions."""
        return self.agent.shape

    def roll_out(self, q: Array, stream: Stream) -> tuple[Episode, Stream]:
        """Return a greedy episode."""
        return self.agent.roll_out(q, stream)


@dataclass(frozen=True, eq=False)
class Planner(_Wrapper):
    """An agent that plans on the table of moves; each time it begins with the last policy."""

    moves: Moves
    gamma: float

    def learn(self, weights: Array, q: Array, stream: Stream) -> tuple[Array, Stream, int, int]:
        """Return the optimal Q; it takes neither steps nor draws."""
        return plan_on(self.moves, weights, gamma=self.gamma, q=q), stream, 0, 0


@dataclass(frozen=True, eq=False)
class Copier(_Wrapper):
    """An agent that does what the expert does most, by `preferences` [state, action]."""

    preferences: Array

    def learn(self, weights: Array, q: Array, stream: Stream) -> tuple[Array, Stream, int, int]:
        """Return the preferences: there is nothing to learn."""
        return self.preferences, stream, 0, 0

    def roll_out(self, q: Array, stream: Stream) -> tuple[Episode, Stream]:
        """Return an episode that follows the preferences."""
        return self.agent.roll_out(self.preferences, stream)
