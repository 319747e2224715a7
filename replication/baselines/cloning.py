"""Copying the expert: the demonstrated action where there is one, any other where there is none.

There is no reward, and nothing is learned: in a task without chance one correct demonstration is
matched before the first iteration.
"""

from __future__ import annotations

from dataclasses import dataclass

from replication.irl.agent import Agent, Array, Episode, Stream
from replication.trials import soccer_agent, table_agent, task_agent

AGENTS = (soccer_agent, table_agent, task_agent)
"""Whose episodes these are: named here, their code is part of the key of a stored trial."""


@dataclass(frozen=True, eq=False)
class Copier:
    """An agent whose episodes follow `preferences` [state, action], whatever it learns."""

    agent: Agent
    preferences: Array

    @property
    def shape(self) -> tuple[int, int]:
        """Number of states and number of actions."""
        return self.agent.shape

    def learn(self, weights: Array, q: Array, stream: Stream) -> tuple[Array, Stream, int, int]:
        """Return the preferences: there is nothing to learn."""
        return self.preferences, stream, 0, 0

    def roll_out(self, q: Array, stream: Stream) -> tuple[Episode, Stream]:
        """Do what the expert does most."""
        return self.agent.roll_out(self.preferences, stream)
