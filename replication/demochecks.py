"""What a demonstration has to be; a refusal is one line that names the place and the mend.

A demonstration is checked by replaying its actions from the start. Cells count from 0.
Steps count from 1: step k takes ``actions[k - 1]`` and leads to ``states[k]``.
"""

from __future__ import annotations

import difflib
import json
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from replication.envs.base import Environment


class DemoError(ValueError):
    """Demonstrations that cannot be used; the message is one line with the place and the mend."""


class DemoWarning(UserWarning):
    """Demonstrations that can be used, but which no deterministic policy can match exactly."""


def action_numbers(
    environment: Environment, name: str, actions: Sequence[str]
) -> NDArray[np.int64]:
    """Return the numbers of named actions, int64 [T].

    Raises
    ------
    DemoError
        If the environment does not know an action of the demonstration `name`.
    """
    numbers = {action: number for number, action in enumerate(environment.actions)}
    for step, action in enumerate(actions, start=1):
        if action not in numbers:
            raise DemoError(
                f"step {step} of demo {show(name)}: unknown action {show(action)}; "
                f"{suggest(action, environment.actions)}use {', '.join(environment.actions)}"
            )
    return np.array([numbers[action] for action in actions], dtype=np.int64)


def replay(
    environment: Environment, name: str, actions: NDArray[np.int64], claims: list[list[int]] | None
) -> NDArray[np.int64]:
    """Return the states [T + 1] that actions [T] visit from the start on.

    Raises
    ------
    DemoError
        If `claims`, the numbers that stand for each state, tells another way.
    """
    states = environment.replay(actions)
    cells = environment.cells(states).tolist()
    claims = cells if claims is None else claims
    for step, (due, claim) in enumerate(zip(cells, claims, strict=False)):
        if claim == due:
            continue
        right, claimed = compact(due), compact(claim)
        if step == 0:
            raise DemoError(
                f"demo {show(name)} begins at {claimed}, but the start is {right}; write {right}"
            )
        action, before = environment.actions[actions[step - 1]], cells[step - 1]
        outcome = environment.stay if due == before else f"leads to {right}"
        raise DemoError(
            f"step {step} of demo {show(name)}: {action!r} from {compact(before)} {outcome}, but "
            f"the file claims {claimed}; write {right} or change the action"
        )
    if len(cells) != len(claims):
        raise DemoError(
            f"demo {show(name)} has {len(actions)} actions and {len(claims)} states; give "
            f"{len(cells)} states, the last one reached included, or leave 'states' out"
        )
    return states


def check_moves(
    environment: Environment, name: str, actions: NDArray[np.int64], states: NDArray[np.int64]
) -> None:
    """Refuse a demonstration that is empty, leaves the moves, or goes on beyond the goal.

    Raises
    ------
    DemoError
        On the first thing that is wrong.
    """
    if not actions.size:
        raise DemoError(f"demo {show(name)} is empty; give it at least one action")
    if actions.min() < 0 or actions.max() >= environment.n_actions:
        raise DemoError(f"demo {show(name)}: actions must be 0..{environment.n_actions - 1}")
    replay(environment, name, actions, environment.cells(states).tolist())
    end = environment.goal_step(actions)
    if end is not None and end < actions.size:
        raise DemoError(
            f"demo {show(name)} goes on after reaching the goal at step {end}; "
            f"drop the {actions.size - end} steps that follow"
        )


# --- the words of a message ------------------------------------------------------------------


def compact(value: Any) -> str:
    """JSON text without blanks."""
    return json.dumps(value, ensure_ascii=False, separators=(",", ":"))


def suggest(word: str, known: Sequence[str]) -> str:
    """Ask whether a similar word was meant, if there is one."""
    close = difflib.get_close_matches(word[:40], known, n=1)
    return f"did you mean {close[0]!r}? " if close else ""


def show(value: Any) -> str:
    r"""Name any JSON value in a few words.

    Examples
    --------
    >>> show([1, 2]), show([0] * 9), show("two\nlines"), show(None)
    ('[1, 2]', 'a list of 9', "'two\\nlines'", 'null')
    """
    if isinstance(value, dict):
        return "an object"
    if isinstance(value, list):
        short = len(value) <= 4 and all(isinstance(item, int | str) for item in value)
        return clip(repr(value)) if short else f"a list of {len(value)}"
    if isinstance(value, str):
        return clip(repr(value[:200]))
    return clip(json.dumps(value))


def clip(text: str, length: int = 60) -> str:
    """Cut a long text."""
    return text if len(text) <= length else f"{text[: length - 3]}..."
