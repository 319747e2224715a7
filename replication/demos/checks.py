"""What makes a demonstration valid; an error says in one line where it is wrong and how to fix it.

A demonstration is checked by replaying its actions from the start. Cells count from 0.
Steps count from 1: step k takes ``actions[k - 1]`` and leads to ``states[k]``.
"""

from __future__ import annotations

from collections.abc import Iterable
from numbers import Integral

import numpy as np
from numpy.typing import NDArray

from replication.envs.environment import Environment
from replication.envs.tasks.base import Task, TaskError
from replication.errors import UserError, compact, show, unknown


class DemoError(UserError):
    """Demonstrations that cannot be used; the message is one line, with the place and the fix."""


class DemoWarning(UserWarning):
    """Demonstrations that can be used, but which no deterministic policy can match exactly."""


def action_number(environment: Environment, action: str | int) -> int:
    """Return the number of an action: of a text that names one, or of a number that is one.

    Raises
    ------
    DemoError
        If the environment does not know the action.
    """
    if isinstance(action, str) and action in environment.actions:
        return environment.actions.index(action)
    is_number = isinstance(action, Integral) and not isinstance(action, bool)
    if is_number and 0 <= int(action) < environment.n_actions:
        return int(action)
    shown = action if isinstance(action, str) else repr(action)
    last = environment.n_actions - 1
    raise DemoError(f"{unknown(shown, environment.actions, 'action')} (or a number, 0 to {last})")


def action_numbers(
    environment: Environment, name: str, actions: Iterable[str | int]
) -> NDArray[np.int64]:
    """Return the numbers of actions that a demonstration takes, int64 [T].

    Raises
    ------
    DemoError
        If the environment does not know an action of the demonstration `name`.
    """
    numbers = []
    for step, action in enumerate(actions, start=1):
        try:
            numbers.append(action_number(environment, action))
        except DemoError as error:
            raise DemoError(f"step {step} of demo {show(name)}: {error}") from None
    return np.array(numbers, dtype=np.int64)


def replay(
    environment: Environment, name: str, actions: NDArray[np.int64], claims: list[list[int]] | None
) -> NDArray[np.int64]:
    """Return the states [T + 1] that actions [T] visit from the start on.

    Raises
    ------
    DemoError
        If the recorded states (`claims`) differ from the replayed ones; in a task of the user's own
        they are taken as they are, for `check_moves` to check.
    """
    if isinstance(environment, Task):
        if claims is not None:
            return np.array([claim[0] for claim in claims], np.int64)
        try:
            return environment.replay(actions)
        except TaskError as error:
            raise DemoError(f"demo {show(name)}: {error}") from None
    states = environment.replay(actions)
    cells = environment.cells(states).tolist()
    claims = cells if claims is None else claims
    for step, (cell, claim) in enumerate(zip(cells, claims, strict=False)):
        if claim == cell:
            continue
        right, claimed = compact(cell), compact(claim)
        if step == 0:
            raise DemoError(
                f"demo {show(name)} starts at {claimed}, but the start is {right}; write {right}"
            )
        action, before = environment.actions[actions[step - 1]], cells[step - 1]
        outcome = no_op_phrase(environment) if cell == before else f"leads to {right}"
        raise DemoError(
            f"step {step} of demo {show(name)}: {action!r} from {compact(before)} {outcome}, but "
            f"the file claims {claimed}; write {right} or change the action"
        )
    if len(cells) != len(claims):
        raise DemoError(
            f"demo {show(name)} has {len(actions)} actions and {len(claims)} states; give "
            f"{len(cells)} states, the last one reached included, or leave out 'states'"
        )
    return states


def check_moves(
    environment: Environment, name: str, actions: NDArray[np.int64], states: NDArray[np.int64]
) -> None:
    """Refuse a demonstration that is empty, breaks the rules of moving, or goes on after the goal.

    Raises
    ------
    DemoError
        On the first thing that is wrong.
    """
    if not actions.size:
        raise DemoError(f"demo {show(name)} is empty; give it at least one action")
    if actions.min() < 0 or actions.max() >= environment.n_actions:
        raise DemoError(f"demo {show(name)}: actions must be 0..{environment.n_actions - 1}")
    if isinstance(environment, Task):
        if fault := environment.fault(states, actions):
            raise DemoError(f"demo {show(name)}: {fault}")
        return
    replay(environment, name, actions, environment.cells(states).tolist())
    end = environment.goal_step(actions)
    if end is not None and end < actions.size:
        raise DemoError(
            f"demo {show(name)} goes on after reaching the goal at step {end}; "
            "drop the steps that follow"
        )


def goal_phrase(environment: Environment) -> str:
    """Name the goal of an environment."""
    if environment.kind == "soccer":
        return "the gate, as no goal falls"
    goal = getattr(environment, "goal", None)
    return "the goal" if goal is None else f"the goal {compact(environment.cell(goal))}"


def no_op_phrase(environment: Environment) -> str:
    """Describe a move that leaves the state as it was."""
    return {"maze": "hits a wall and stays", "soccer": "stays in its cell"}.get(
        environment.kind, "changes nothing"
    )
