"""The scripted expert in robot soccer: the rules behind the stored demonstrations.

``correct``
    Drives to the ball, more slowly while an obstacle is detected, and kicks it into the goal. Its
    action is a function of the discretised state, or else d = 0 could not be reached.

The expert shows the paper's four kinds of mistakes. It leaves the correct path at its start and
wherever its action changes, or at every decision (choice SOCCER-INCORRECT), and then

``hit``
    drives on to the right, or to the left, until it touches an obstacle or a wall;
``detour``
    goes to the right, or to the left, for four decisions, or fewer if it would touch something,
    and from there to the ball as usual (the number is that of DETOUR-WIDTH);
``overspeed``
    never slows down again, until a contact or the goal;
``opposite``
    drives away from the ball, for as many decisions as it has driven, but at least four.

Equal demonstrations are kept once.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np

from replication.demos.checks import DemoError
from replication.demos.model import Demo, Demos
from replication.envs.soccer.compiled import FastSoccerWorld
from replication.envs.soccer.field import SoccerField
from replication.envs.soccer.rules import BACKWARD, FORWARD, LEFT, RIGHT, expert_action
from replication.paper.register import Chosen, choice, load_choices


@dataclass(frozen=True)
class SoccerExpert(Chosen):
    """Where the scripted soccer expert leaves the correct path to show a mistake."""

    leave: str = choice("SOCCER-INCORRECT")


LONGEST = 100
"""Number of decisions after which the expert gives up a drive."""

WIDTH = int(load_choices()["DETOUR-WIDTH"].default)


def demonstrate_soccer(
    task: str,
    field: SoccerField | None = None,
    *,
    params: SoccerExpert | None = None,
    description: str = "",
) -> Demos:
    """Return the demonstrations of all kinds on a field.

    Raises
    ------
    DemoError
        If the expert does not score there.
    """
    field = field or SoccerField()
    correct = _drive(field, [], expert_action)
    if correct is None:
        raise DemoError("the expert does not score on this field; change the world's parameters")
    return Demos(
        task=task,
        environment=field,
        correct=(_demo(field, correct, "correct", "correct"),),
        incorrect=tuple(incorrect_demos(field, correct, params=params or SoccerExpert())),
        description=description,
    )


def incorrect_demos(
    field: SoccerField, correct: list[int], *, params: SoccerExpert
) -> Iterator[Demo]:
    """Yield the incorrect demonstrations of every kind that belong to a correct one."""
    leave = [t for t in range(len(correct)) if t == 0 or correct[t] != correct[t - 1]]
    if params.leave == "every":
        leave = list(range(len(correct)))
    sides = (RIGHT, LEFT)
    drives: dict[str, list[list[int] | None]] = {
        "hit": [_crash(field, correct[:t], side) for t in leave for side in sides],
        "detour": [_detour(field, correct, t, side) for t in leave for side in sides],
        "overspeed": [_crash(field, correct[:t], FORWARD) for t in leave],
        "opposite": [_opposite(field, correct[:t]) for t in leave],
    }
    seen = {tuple(correct)}
    for kind, attempts in drives.items():
        number = 0
        for actions in attempts:
            if actions is not None and tuple(actions) not in seen:
                seen.add(tuple(actions))
                number += 1
                yield _demo(field, actions, f"{kind}-{number}", kind)


def _crash(field: SoccerField, begin: list[int], action: int) -> list[int] | None:
    return _drive(field, begin, lambda state: action, at_contact="end")


def _opposite(field: SoccerField, begin: list[int]) -> list[int]:
    actions = [*begin, *[BACKWARD] * max(len(begin), WIDTH)]
    return actions[: field.goal_step(actions)]  # the ball may be rolling by then


def _detour(field: SoccerField, correct: list[int], at: int, side: int) -> list[int] | None:
    for width in range(WIDTH, 0, -1):
        begin = [*correct[:at], *[side] * width]
        actions = _drive(field, begin, expert_action, at_contact="fail")
        if actions is not None and len(actions) > len(correct):
            return actions
    return None


def _drive(
    field: SoccerField,
    begin: list[int],
    policy: Callable[[int], int],
    *,
    at_contact: str = "go on",
) -> list[int] | None:
    """Take actions, then follow a policy to the goal, or "end" at a contact; None if it fails."""
    world = FastSoccerWorld(field.params)
    state, actions = world.reset(), list[int]()
    while len(actions) < LONGEST:
        action = begin[len(actions)] if len(actions) < len(begin) else policy(state)
        state, scored, timed_out = world.step(action)
        actions.append(action)
        touched = any(world.contacts)
        if touched and at_contact == "fail":
            return None
        if scored or (touched and at_contact == "end" and len(actions) > len(begin)):
            return actions
        if timed_out:
            return None
    return None


def _demo(field: SoccerField, actions: list[int], name: str, kind: str) -> Demo:
    return Demo(name=name, kind=kind, states=field.replay(actions), actions=np.array(actions))
