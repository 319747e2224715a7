"""Which agent learns in which environment."""

from __future__ import annotations

from importlib import import_module

from replication.envs.environment import Environment
from replication.errors import unknown
from replication.irl.agent import Agent
from replication.paper.params import Params
from replication.paper.register import ChoiceError

AGENTS = {
    "maze": "replication.trials.table_agent",
    "soccer": "replication.trials.soccer_agent",
    "gymnasium": "replication.trials.task_agent",
    "own": "replication.trials.task_agent",
}
"""The module that makes the agent for each kind of environment.

They are named, not imported, so that the key of a trial covers the code of its own task only.
"""


def make_agent(environment: Environment, params: Params) -> Agent:
    """Return the agent that learns in `environment`.

    Raises
    ------
    ChoiceError
        If there is no such agent, or it cannot do what the parameters ask for.
    """
    if environment.kind not in AGENTS:
        raise ChoiceError(unknown(environment.kind, AGENTS, "kind of environment"))
    agent: Agent = import_module(AGENTS[environment.kind]).make_agent(environment, params)
    return agent
