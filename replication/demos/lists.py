"""Demonstrations in a task of one's own, from plain lists."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import numpy as np

from replication.demos.checks import DemoError, action_numbers
from replication.demos.model import Demo, Demos
from replication.envs.environment import Environment
from replication.envs.tasks.base import TaskError
from replication.errors import UserError, show

Trajectory = Sequence[str | int] | tuple[Sequence[int], Sequence[str | int]]
"""Actions by name or number; or the states [T + 1], by number, and the actions [T]."""


def make_demos(
    environment: Environment,
    trajectories: Mapping[str, Iterable[Trajectory]],
    *,
    name: str = "mine",
) -> Demos:
    """Return checked demonstrations.

    Parameters
    ----------
    environment
        The world in which they were made: a task, a maze or the soccer field.
    trajectories
        Demonstrations by kind: "correct", and any kinds of mistakes. Each is a list of actions, by
        name or number, or, where moves or the start are random, a pair of states and actions.
    name
        Short name of the task.

    Raises
    ------
    DemoError
        If the environment does not know an action or a state, or cannot have gone that way; or if
        there is no correct demonstration. The message names the demonstration and the step.

    Examples
    --------
    >>> from replication.envs.tasks.table import TabularTask
    >>> task = TabularTask([[0, 1], [0, 2], [2, 2]], terminal=[2], actions=("back", "on"))
    >>> demos = make_demos(task, {"correct": [["on", "on"]], "dawdle": [["on", "back", "on"]]})
    >>> demos.correct[0].states.tolist(), demos.kinds
    ([0, 1, 2], ('dawdle',))
    """
    if not isinstance(trajectories, Mapping):
        raise DemoError('give demonstrations by kind: {"correct": [...], "mistake": [...]}')
    made = {
        kind: tuple(
            _demo(environment, kind, f"{kind}-{number}", way)
            for number, way in enumerate(ways, start=1)
        )
        for kind, ways in trajectories.items()
    }
    correct = made.pop("correct", ())
    incorrect = tuple(demo for demos in made.values() for demo in demos)
    return Demos(name, environment, correct, incorrect)


def _demo(environment: Environment, kind: str, name: str, way: Trajectory) -> Demo:
    if isinstance(way, str):
        raise DemoError(f"demo {show(name)} is {show(way)}; each is a list of actions: [[...]]")
    states: Any = None
    actions: Any = way
    try:
        if len(way) == 2 and not isinstance(way[0], str) and isinstance(way[0], Iterable):
            states, actions = way
        numbers = action_numbers(environment, name, actions)
        states = environment.replay(numbers) if states is None else _whole(states)
    except DemoError:
        raise
    except UserError as error:
        raise DemoError(f"demo {show(name)}: {error}") from None
    except (TypeError, ValueError) as error:
        raise DemoError(
            f"demo {show(name)} must be a list of actions, or a pair of states and actions "
            f"({error})"
        ) from None
    return Demo(name, kind, states, numbers)


def _whole(states: Any) -> Any:
    """Return the numbers of states, after checking that they are whole."""
    array = np.asarray(states)
    if array.dtype.kind not in "iu" or array.ndim != 1:
        raise TaskError(f"states are whole numbers [T + 1], not {array.dtype} {list(array.shape)}")
    return array.astype(np.int64)
