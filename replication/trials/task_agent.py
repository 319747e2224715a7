"""The agents in tasks of a user's own: on their table where there is one, else by stepping."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from replication.envs.environment import Environment
from replication.envs.tasks.base import Task, TaskError
from replication.envs.tasks.gymnasium import GymTask
from replication.envs.tasks.moves import Moves
from replication.irl.agent import Agent, Episode
from replication.learning import chance, planning, stepped
from replication.paper.params import Params
from replication.paper.register import ChoiceError

Array = NDArray[np.float64]
Stream = NDArray[np.uint64]


@dataclass(frozen=True, eq=False)
class ChanceAgent:
    """Q-learning (Eq. 1) or exact planning, and greedy episodes, on a table of moves."""

    table: Moves
    params: Params

    @property
    def shape(self) -> tuple[int, int]:
        """Number of states and number of actions."""
        return self.table.shape

    def learn(self, weights: Array, q: Array, stream: Stream) -> tuple[Array, Stream, int, int]:
        """Learn by Q-learning, see :func:`replication.learning.chance.learn`, or plan."""
        if self.params.learner.solver == "planning":
            gamma = self.params.learner.gamma
            return planning.plan(weights, self.table.ahead, gamma=gamma), stream, 0, 0
        return chance.learn(self.table, weights, q, stream, **_learning(self.params))

    def roll_out(self, q: Array, stream: Stream) -> tuple[Episode, Stream]:
        """Follow the greedy policy, see :func:`replication.learning.chance.roll_out`."""
        rolled = chance.roll_out(self.table, q, stream, **_rolling(self.params))
        return _episode(*rolled)


@dataclass(frozen=True, eq=False)
class SteppedAgent:
    """Q-learning (Eq. 1) and greedy episodes in an environment that can only be stepped."""

    task: Task
    params: Params

    def __post_init__(self) -> None:
        if self.params.learner.solver != "q-learning":
            raise ChoiceError('there is no table to plan on: set solver = "q-learning"')

    @property
    def shape(self) -> tuple[int, int]:
        """Number of states and number of actions."""
        return self.task.n_states, self.task.n_actions

    def learn(self, weights: Array, q: Array, stream: Stream) -> tuple[Array, Stream, int, int]:
        """Learn by Q-learning, see :func:`replication.learning.stepped.learn`."""
        env, number = self.task.env, self.task.number
        return stepped.learn(env, number, weights, q, stream, **_learning(self.params))

    def roll_out(self, q: Array, stream: Stream) -> tuple[Episode, Stream]:
        """Follow the greedy policy, see :func:`replication.learning.stepped.roll_out`."""
        env, number = self.task.env, self.task.number
        return _episode(*stepped.roll_out(env, number, q, stream, **_rolling(self.params)))


def make_agent(environment: Environment, params: Params) -> Agent:
    """Return the agent that learns in a task.

    Raises
    ------
    ChoiceError
        If it cannot do what the parameters ask for.
    TaskError
        If it is no task.
    """
    learner = params.learner
    if learner.epsilon_end != learner.epsilon:
        raise ChoiceError(
            "here the exploration probability does not change: "
            f"set epsilon_end = {learner.epsilon} as well"
        )
    if learner.arithmetic != "double":
        raise ChoiceError('here all operations are rounded: set arithmetic = "double"')
    if learner.solver == "planning" and learner.gamma == 1:
        raise ChoiceError("planning needs a discount below 1: set gamma = 0.99")
    task = environment.task if isinstance(environment, GymTask) else environment
    if isinstance(task, Task) and task.table is not None:
        return ChanceAgent(task.table, params)
    if isinstance(task, Task) and task.env is not None:
        return SteppedAgent(task, params)
    raise TaskError("an agent needs a task that has a table of moves or an environment to step")


def _learning(params: Params) -> dict[str, Any]:
    """Return the arguments of Q-learning."""
    learner = params.learner
    return {
        "episodes": learner.episodes,
        "horizon": learner.horizon,
        "beta": learner.beta,
        "gamma": learner.gamma,
        "epsilon": learner.epsilon,
        "tolerance": learner.tie_tolerance,
        "random_ties": learner.ties == "random",
    }


def _rolling(params: Params) -> dict[str, Any]:
    """Return the arguments of a greedy episode."""
    return {
        "horizon": params.learner.horizon,
        "tolerance": params.learner.tie_tolerance,
        "random_ties": params.loop.rollout_ties == "random",
    }


def _episode(
    states: NDArray[np.int64], actions: NDArray[np.int64], stream: Stream
) -> tuple[Episode, Stream]:
    return Episode(states, actions, states[1:] == states[:-1]), stream
