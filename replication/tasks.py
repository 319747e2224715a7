"""What the IRL loop needs of a task: learn Q from reward weights, and roll Q out.

A new kind of task (a physics world, a user's own) is a class with these two methods and a line in
:func:`make_task`; nothing in the loop or in the methods changes.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from replication import qlearning, soccer_learning
from replication.choices import ChoiceError
from replication.envs.base import Environment
from replication.envs.field import SoccerField
from replication.envs.maze import Maze
from replication.params import Learner, Params

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


class Task(Protocol):
    """A task with a finite number of states and actions."""

    @property
    def shape(self) -> tuple[int, int]:
        """Number of states and number of actions."""
        ...

    @property
    def together(self) -> int:
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


@dataclass(frozen=True)
class MazeTask:
    """Q-learning (Eq. 1) and greedy episodes in a maze."""

    maze: Maze
    learner: Learner
    rollout_ties: str
    together: int = 25  # enough to keep the compiled learner's lanes busy

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

    def learn(
        self, weights: Array, q: Array, streams: Streams
    ) -> tuple[Array, Streams, NDArray[np.int64]]:
        """Learn by Q-learning, see :func:`replication.qlearning.learn`."""
        return qlearning.learn(
            self.maze.next_state,
            weights,
            q,
            streams,
            start=self.maze.start,
            goal=self.maze.goal,
            episodes=self.learner.episodes,
            horizon=self.learner.horizon,
            beta=self.learner.beta,
            gamma=self.learner.gamma,
            epsilon=self.learner.epsilon,
            random_ties=self.learner.ties == "random",
        )

    def roll_out(self, q: Array, stream: Streams) -> tuple[Episode, Streams]:
        """Follow the greedy policy, see :func:`replication.qlearning.roll_out`."""
        states, actions, stream = qlearning.roll_out(
            self.maze.next_state,
            q,
            stream,
            start=self.maze.start,
            goal=self.maze.goal,
            horizon=self.learner.horizon,
            random_ties=self.rollout_ties == "random",
        )
        return Episode(states, actions, states[1:] == states[:-1]), stream


@dataclass(frozen=True)
class SoccerTask:
    """Q-learning (Eq. 1) and greedy episodes in robot soccer; its own time limit is the horizon."""

    field: SoccerField
    learner: Learner
    rollout_ties: str
    together: int = 1

    @property
    def shape(self) -> tuple[int, int]:
        """Number of states and number of actions."""
        return self.field.n_states, self.field.n_actions

    def learn(
        self, weights: Array, q: Array, streams: Streams
    ) -> tuple[Array, Streams, NDArray[np.int64]]:
        """Learn by Q-learning, see :func:`replication.soccer_learning.learn_trial`."""
        learned = [
            soccer_learning.learn_trial(
                self.field.params,
                *one,
                episodes=self.learner.episodes,
                beta=self.learner.beta,
                gamma=self.learner.gamma,
                epsilon_start=self.learner.epsilon,
                epsilon_end=self.learner.epsilon_end,
                random_ties=self.learner.ties == "random",
                bootstrap_goal=self.learner.goal_value == "bootstrap",
            )
            for one in zip(weights, q, streams, strict=True)
        ]
        tables, words, steps = zip(*learned, strict=True)
        return np.array(tables), np.array(words), np.array(steps)

    def roll_out(self, q: Array, stream: Streams) -> tuple[Episode, Streams]:
        """Follow the greedy policy, see :func:`replication.soccer_learning.roll_out`."""
        states, actions, hits, stream = soccer_learning.roll_out(
            self.field.params, q, stream, random_ties=self.rollout_ties == "random"
        )
        return Episode(states, actions, hits), stream


def make_task(environment: Environment, params: Params) -> Task:
    """Return the task that the demonstrations of `environment` belong to.

    Raises
    ------
    ChoiceError
        If there is no task for such an environment, or it cannot do what the parameters ask for.
    """
    if isinstance(environment, Maze):
        return MazeTask(environment, params.learner, params.loop.rollout_ties)
    if isinstance(environment, SoccerField):
        return SoccerTask(environment, params.learner, params.loop.rollout_ties)
    raise ChoiceError(f"there is no task for a {type(environment).__name__}")
