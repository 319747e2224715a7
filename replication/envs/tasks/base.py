"""What all tasks of a user's own have in common: numbered states, named actions, and a check."""

from __future__ import annotations

import operator
from abc import ABC, abstractmethod
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from replication.envs.environment import Environment
from replication.envs.tasks.moves import Moves
from replication.errors import UserError, clip

Ints = NDArray[np.int64]


class TaskError(UserError):
    """An environment that cannot be a task, or is asked for what it cannot do; in one line."""


@dataclass(frozen=True, eq=False)
class Walk:
    """The states that actions visit, int64 [T + 1], and the step that ended the episode, if any."""

    states: Ints
    end: int | None


class Task(ABC):
    """An environment with finitely many states and actions, known by their numbers.

    It does what :class:`replication.envs.environment.Environment` asks for. A subclass says how
    actions lead from state to state, and has what an agent learns on: the `table` of its moves, or
    an `env` of Gymnasium to step.

    Attributes
    ----------
    kind
        How demonstration files name it: "gymnasium" if they can make it again, else "own".
    n_states
        Number of states.
    actions
        Names of the actions.
    """

    kind = "own"
    n_states: int
    actions: tuple[str, ...]
    table: Moves | None = None
    env: Any = None

    def __repr__(self) -> str:
        luck = ", random" if self.is_random else ""
        kind = type(self).__name__
        return f"<{kind} of {self.n_states} states and {self.n_actions} actions{luck}>"

    @property
    def n_actions(self) -> int:
        """Number of actions."""
        return len(self.actions)

    @property
    @abstractmethod
    def is_random(self) -> bool:
        """Whether the same actions may lead to different states."""

    def number(self, observation: Any) -> int:
        """Return the number of the state that is observed; raises `TaskError` if it is none."""
        try:
            number = operator.index(observation)
        except TypeError:
            number = -1
        if not 0 <= number < self.n_states:
            shown = clip(repr(observation).replace("\n", " "))
            raise TaskError(f"there is no state {shown}; states are 0..{self.n_states - 1}")
        return number

    @abstractmethod
    def walk(self, actions: Sequence[int]) -> Walk:
        """Return where actions lead, if nothing is random; raises `TaskError` if it is."""

    @abstractmethod
    def fault(self, states: Ints, actions: Ints) -> str | None:
        """Return at which step states [T + 1] and actions [T] cannot be an episode, and why."""

    @abstractmethod
    def is_over(self, states: Ints, actions: Ints) -> bool | None:
        """Return whether an episode has ended with these states; None if that cannot be known."""

    @abstractmethod
    def describe(self) -> dict[str, Any]:
        """Return the environment as plain JSON values, including its `kind`."""

    def replay(self, actions: Iterable[int]) -> Ints:
        """Return the states that T actions visit from the start on, int64 [T + 1]."""
        numbers = [int(action) for action in actions]
        for step, action in enumerate(numbers, start=1):
            if not 0 <= action < self.n_actions:
                last = self.n_actions - 1
                raise TaskError(f"step {step} takes action {action}; actions are 0..{last}")
        walk = self.walk(numbers)
        if len(walk.states) <= len(numbers):
            raise TaskError(f"it goes on after the episode has ended at step {walk.end}; drop it")
        return walk.states

    def goal_step(self, actions: Iterable[int]) -> int | None:
        """Return the number of actions: which of them may end an episode, `fault` checks."""
        return sum(1 for _ in actions)

    def cell(self, state: int) -> tuple[int, ...]:
        """Return the numbers by which files refer to a state: its own."""
        return (int(state),)

    def cells(self, states: Ints) -> Ints:
        """Return the numbers by which files refer to states, int64 [n, 1]."""
        return np.asarray(states, np.int64)[:, None]


def is_random(environment: Environment) -> bool:
    """Return whether the same actions may lead to different states; in a maze they do not."""
    return isinstance(environment, Task) and environment.is_random


def is_over(environment: Environment, states: Ints, actions: Ints) -> bool | None:
    """Return whether an episode has ended with these states; None if that cannot be known."""
    if isinstance(environment, Task):
        return environment.is_over(states, actions)
    return environment.goal_step(actions) is not None


def named_actions(actions: Sequence[str] | None, n_actions: int) -> tuple[str, ...]:
    """Return the names of actions: their numbers, unless names are given.

    Raises
    ------
    TaskError
        If there are too few or too many names, or one stands twice.
    """
    if actions is None:
        return tuple(map(str, range(n_actions)))
    names = tuple(map(str, actions))
    if len(names) != n_actions or len(set(names)) != n_actions:
        raise TaskError(
            f"actions = {list(names)} names {len(set(names))} actions; the environment has "
            f"{n_actions}: give each its own name"
        )
    return names


def out_of_range(states: Ints, actions: Ints, n_states: int, n_actions: int) -> str | None:
    """Return what is no state or no action of a task, and at which step."""
    for step, state in enumerate(states):
        if not 0 <= state < n_states:
            return f"step {step} leads to state {state}; states are 0..{n_states - 1}"
    for step, action in enumerate(actions, start=1):
        if not 0 <= action < n_actions:
            return f"step {step} takes action {action}; actions are 0..{n_actions - 1}"
    if len(states) != len(actions) + 1:
        return (
            f"there are {len(actions)} actions and {len(states)} states; give "
            f"{len(actions) + 1} states, the last one reached included"
        )
    return None
