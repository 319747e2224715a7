"""Read and write demonstration files; :mod:`replication.demos.schema` describes their format."""

from __future__ import annotations

import os
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

from replication.demos.checks import DemoError, DemoWarning, action_numbers, replay
from replication.demos.environments import OWN
from replication.demos.model import Demo, Demos, state_action_pairs
from replication.demos.schema import (
    FORMAT,
    VERSION,
    CorrectFields,
    IncorrectFields,
    read_fields,
)
from replication.demos.strict_json import layout, read_content
from replication.envs.environment import Environment
from replication.envs.tasks.base import is_random
from replication.errors import compact, show
from replication.files import printable, reason, write_file


def load_demos(path: str | os.PathLike[str], *, task: Environment | None = None) -> Demos:
    """Read and check a demonstration file.

    Parameters
    ----------
    path
        The file.
    task
        The environment in which they were made, where the file cannot make it.

    Raises
    ------
    DemoError
        On the first thing that is wrong, in one line that names the file, the place and the fix.

    Warns
    -----
    DemoWarning
        If no deterministic policy can match the correct demos exactly, or if an incorrect demo has
        no effect.
    """
    demos = _read(path, task)
    for warning in doubts(demos):
        warnings.warn(f"{printable(path)}: {warning}", DemoWarning, stacklevel=2)
    return demos


def check_demos(path: str | os.PathLike[str]) -> list[str]:
    """Check a demonstration file; returns its warnings, raises `DemoError` like `load_demos`."""
    return [f"{printable(path)}: {warning}" for warning in doubts(_read(path))]


def parse_demos(content: bytes, task: Environment | None = None) -> Demos:
    """Read and check the content of a demonstration file, in the environment that is given if any.

    Raises
    ------
    DemoError
        On the first thing that is wrong, in one line that names the place and the fix.
    """
    fields = read_fields(content)
    environment = fields.environment.build() if task is None else task
    written = fields.environment.model_dump(exclude_none=True)
    for field, value in written.items() if task is not None else ():
        if environment.describe().get(field) != value:
            raise DemoError(
                f"environment: the file was made in another one than the task that is given: its "
                f"{field!r} is {show(value)}"
            )
    return Demos(
        task=fields.task,
        environment=environment,
        correct=tuple(_demo(environment, "correct", demo) for demo in fields.correct),
        incorrect=tuple(_demo(environment, demo.kind, demo) for demo in fields.incorrect),
        description=fields.description,
    )


def demos_document(demos: Demos) -> dict[str, Any]:
    """Return what a demonstration file holds, as plain JSON values."""

    def trajectory(demo: Demo) -> dict[str, Any]:
        return {
            "actions": [demos.environment.actions[action] for action in demo.actions],
            "states": demos.environment.cells(demo.states).tolist(),
        }

    return {
        "format": FORMAT,
        "version": VERSION,
        "task": demos.task,
        "description": demos.description,
        "environment": demos.environment.describe(),
        "correct": [{"name": demo.name} | trajectory(demo) for demo in demos.correct],
        "incorrect": [
            {"name": demo.name, "kind": demo.kind} | trajectory(demo) for demo in demos.incorrect
        ],
    }


def save_demos(demos: Demos, path: str | os.PathLike[str]) -> None:
    """Write a demonstration file, always in the same layout; an old file is replaced atomically.

    Raises
    ------
    DemoError
        If the file could not be read back (a name is too long, for instance) or cannot be written.
    """
    with _naming(path):
        try:
            content = (layout(demos_document(demos)) + "\n").encode()
            own = demos.environment.kind == OWN
            parse_demos(content, demos.environment if own else None)
            write_file(path, content)
        except DemoError:
            raise
        except (OSError, ValueError) as error:
            raise DemoError(f"cannot be written ({reason(error)})") from None


def summary(demos: Demos | None) -> str:
    """Return how many demonstrations there are of each kind."""
    if demos is None:
        return "nothing yet"
    kinds = [demo.kind for demo in demos.incorrect]
    counts = [f"{kinds.count(kind)} {kind}" for kind in demos.kinds]
    return ", ".join([f"{len(demos.correct)} correct", *counts])


def _demo(environment: Environment, kind: str, fields: CorrectFields | IncorrectFields) -> Demo:
    actions = action_numbers(environment, fields.name, fields.actions)
    states = replay(environment, fields.name, actions, fields.states)
    return Demo(fields.name, kind, states, actions)


def doubts(demos: Demos) -> list[str]:
    """Return why usable demonstrations may not be learned exactly, or may have no effect."""
    messages = []
    conflicts = demos.conflicts()
    if conflicts:
        state = conflicts[0]
        taken = sorted({a for d in demos.correct for a in d.actions[d.states[:-1] == state]})
        actions = " and ".join(repr(demos.environment.actions[action]) for action in taken)
        messages.append(
            f"the correct demos take {actions} in {compact(demos.environment.cell(state))}"
            f" (one of {len(conflicts)} such states): d = 0 cannot be reached"
        )
    ways = different_ways(demos)
    if ways > 1 and not is_random(demos.environment):
        messages.append(
            f"the correct demos are {ways} different trajectories: mu_E is their average, "
            "which a single deterministic trajectory cannot match"
        )
    right = state_action_pairs(*demos.correct)
    idle = [demo for demo in demos.incorrect if state_action_pairs(demo) <= right]
    if idle:
        first, more = show(idle[0].name), len(idle) > 1
        which = f"{len(idle)} incorrect demos ({first}, ...)" if more else f"incorrect demo {first}"
        verb, whose = ("have", "their") if more else ("has", "its")
        messages.append(
            f"{which} {verb} no effect: all {whose} pairs of state and action occur in a correct "
            "demo, too"
        )
    return messages


def different_ways(demos: Demos) -> int:
    """Return how many different trajectories the correct demos are."""
    return len({(demo.states.tobytes(), demo.actions.tobytes()) for demo in demos.correct})


def _read(path: str | os.PathLike[str], task: Environment | None = None) -> Demos:
    with _naming(path):
        return parse_demos(read_content(path), task)


@contextmanager
def _naming(path: str | os.PathLike[str]) -> Iterator[None]:
    """Put the file's name in front of a refusal."""
    try:
        yield
    except DemoError as error:
        raise DemoError(f"{printable(path)}: {error}") from None
