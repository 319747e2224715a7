"""Demonstrations of a task: the objects, and how they are read from files and saved in them.

:mod:`replication.demofile` describes the files, :mod:`replication.demochecks` the checks.
"""

from __future__ import annotations

import hashlib
import json
import os
import re
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from replication.demochecks import (
    DemoError,
    DemoWarning,
    action_numbers,
    check_moves,
    clip,
    compact,
    replay,
    show,
)
from replication.demofile import (
    FORMAT,
    KIND,
    MENDS,
    TASK,
    VERSION,
    CorrectFields,
    IncorrectFields,
    json_schema,
    read_fields,
)
from replication.demojson import layout, read_content, reason
from replication.envs.base import Environment
from replication.envs.maze import Maze
from replication.files import write_file

__all__ = [
    "Demo",
    "DemoError",
    "DemoWarning",
    "Demos",
    "check_demos",
    "content_hash",
    "demos_document",
    "json_schema",
    "load_demos",
    "parse_demos",
    "save_demos",
]

RESERVED_KINDS = ("correct", "all", "none")


@dataclass(frozen=True, eq=False)
class Demo:
    """One demonstrated trajectory of T steps.

    Parameters
    ----------
    name
        Unique within its file.
    kind
        "correct", or the kind of mistake, such as "hit" or "detour".
    states
        Visited states, int64 [T + 1], with the state that is reached last; read-only.
    actions
        Actions taken, int64 [T]; read-only.
    """

    name: str
    kind: str
    states: NDArray[np.int64]
    actions: NDArray[np.int64]

    def __post_init__(self) -> None:
        for field in ("states", "actions"):
            object.__setattr__(self, field, _integers(getattr(self, field), self.name, field))

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Demo) and self._key() == other._key()

    def __hash__(self) -> int:
        return hash(self._key())

    def _key(self) -> tuple[str, str, bytes, bytes]:
        return self.name, self.kind, self.states.tobytes(), self.actions.tobytes()


@dataclass(frozen=True)
class Demos:
    """A task's demonstrations, validated when they are made.

    Parameters
    ----------
    task
        Short name of the task: letters, digits, ``-`` and ``_``.
    environment
        The world that the demonstrations were made in.
    correct
        At least one trajectory from the start to the goal.
    incorrect
        Trajectories from the start that show mistakes, each of some kind.
    description
        Free text.

    Raises
    ------
    DemoError
        If a demonstration does not follow the environment's moves, is empty, goes on beyond the
        goal or (a correct one) misses it, or if names or kinds are not usable.
    """

    task: str
    environment: Environment
    correct: tuple[Demo, ...]
    incorrect: tuple[Demo, ...] = ()
    description: str = ""

    def __post_init__(self) -> None:
        object.__setattr__(self, "correct", tuple(self.correct))
        object.__setattr__(self, "incorrect", tuple(self.incorrect))
        if not re.fullmatch(TASK, self.task):
            raise DemoError(f"task {show(self.task)} does not fit: {MENDS[TASK]}")
        if not self.correct:
            raise DemoError(
                "there is no correct demo; give at least one from the start to the goal"
            )
        names: set[str] = set()
        for demo in self.correct + self.incorrect:
            if demo.name in names:
                raise DemoError(f"two demos are named {show(demo.name)}; give each its own name")
            names.add(demo.name)
            check_moves(self.environment, demo.name, demo.actions, demo.states)
        for demo in self.correct:
            if demo.kind != "correct":
                raise DemoError(f"demo {show(demo.name)} is correct; its kind must be 'correct'")
            if self.environment.goal_step(demo.actions) is None:
                end = compact(self.environment.cell(int(demo.states[-1])))
                raise DemoError(
                    f"demo {show(demo.name)} is correct, but ends at {end} and misses "
                    f"{self.environment.aim}; add the missing steps or move it to 'incorrect'"
                )
        for demo in self.incorrect:
            if not re.fullmatch(KIND, demo.kind) or demo.kind in RESERVED_KINDS:
                raise DemoError(
                    f"demo {show(demo.name)} is incorrect, of kind {show(demo.kind)}; "
                    f"{MENDS[KIND]}, but none of {', '.join(RESERVED_KINDS)}"
                )

    @property
    def maze(self) -> Maze:
        """The environment of a task that is a maze.

        Raises
        ------
        DemoError
            If it is of another kind.
        """
        if not isinstance(self.environment, Maze):
            raise DemoError(f"task {self.task} is not a maze")
        return self.environment

    @property
    def kinds(self) -> tuple[str, ...]:
        """Kinds of the incorrect demos, each once, in the order of the file."""
        return tuple(dict.fromkeys(demo.kind for demo in self.incorrect))

    def select(self, kinds: str) -> Demos:
        """Keep the incorrect demos of some kinds only, and all correct ones.

        Parameters
        ----------
        kinds
            "all", "none", or kinds joined by ``+``, such as "hit+detour".

        Raises
        ------
        DemoError
            If there is no incorrect demo of a kind that is asked for.
        """
        if kinds == "all":
            return self
        wanted = () if kinds == "none" else tuple(kinds.split("+"))
        for kind in wanted:
            if kind not in self.kinds:
                known = clip(", ".join(("all", "none", *self.kinds)), 300)
                raise DemoError(
                    f"task {self.task} has no incorrect demo of kind {show(kind)}; use {known}"
                )
        return replace(self, incorrect=tuple(d for d in self.incorrect if d.kind in wanted))

    def conflicts(self) -> tuple[int, ...]:
        """States in which the correct demos, taken together, ask for more than one action."""
        states = sorted(state for state, _ in _pairs(*self.correct))
        return tuple(sorted({a for a, b in pairwise(states) if a == b}))


# --- files -----------------------------------------------------------------------------------


def load_demos(path: str | os.PathLike[str]) -> Demos:
    """Read and check a demonstration file.

    Raises
    ------
    DemoError
        On the first thing that is wrong, in one line that names the file, the place and the mend.

    Warns
    -----
    DemoWarning
        If no deterministic policy can match the correct demos exactly, or if an incorrect demo
        has no effect.
    """
    demos = _read(path)
    for doubt in _doubts(demos):
        warnings.warn(f"{_file(path)}: {doubt}", DemoWarning, stacklevel=2)
    return demos


def check_demos(path: str | os.PathLike[str]) -> list[str]:
    """Check a demonstration file; returns its warnings, raises `DemoError` like `load_demos`."""
    return [f"{_file(path)}: {doubt}" for doubt in _doubts(_read(path))]


def parse_demos(content: bytes) -> Demos:
    """Read and check the content of a demonstration file.

    Raises
    ------
    DemoError
        On the first thing that is wrong, in one line that names the place and the mend.
    """
    fields = read_fields(content)
    environment = fields.environment.build()
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
    """Write a demonstration file in the one stable layout; an old file is replaced at once.

    Raises
    ------
    DemoError
        If the file could not be read back (its text is too long, for instance) or not be written.
    """
    with _naming(path):
        try:
            content = (layout(demos_document(demos)) + "\n").encode()
            parse_demos(content)
            write_file(path, content)
        except DemoError:
            raise
        except (OSError, ValueError) as error:
            raise DemoError(f"cannot be written ({reason(error)})") from None


def content_hash(demos: Demos) -> str:
    """SHA-256, as hexadecimal text, of what a learner sees.

    That is the environment and, in order, each demo's kind, states and actions; names,
    description and the file's layout do not matter.
    """
    seen = {
        "environment": demos.environment.describe(),
        "demos": [
            [demo.kind, demo.states.tolist(), demo.actions.tolist()]
            for demo in demos.correct + demos.incorrect
        ],
    }
    text = json.dumps(seen, sort_keys=True, separators=(",", ":"))
    return hashlib.sha256(text.encode()).hexdigest()


def _demo(environment: Environment, kind: str, fields: CorrectFields | IncorrectFields) -> Demo:
    actions = action_numbers(environment, fields.name, fields.actions)
    states = replay(environment, fields.name, actions, fields.states)
    return Demo(fields.name, kind, states, actions)


def _doubts(demos: Demos) -> list[str]:
    """Say what cannot be learned from the demonstrations, though they can be used."""
    doubts = []
    conflicts = demos.conflicts()
    if conflicts:
        state = conflicts[0]
        asked = sorted({a for d in demos.correct for a in d.actions[d.states[:-1] == state]})
        actions = " and ".join(repr(demos.environment.actions[action]) for action in asked)
        doubts.append(
            f"the correct demos ask for {actions} in {compact(demos.environment.cell(state))}"
            f" (one of {len(conflicts)} such states): d = 0 cannot be reached"
        )
    paths = {(demo.states.tobytes(), demo.actions.tobytes()) for demo in demos.correct}
    if len(paths) > 1:
        doubts.append(
            f"the correct demos are {len(paths)} different trajectories: mu_E is their average, "
            "which a single deterministic trajectory cannot match"
        )
    right = _pairs(*demos.correct)
    doubts += [
        f"incorrect demo {show(demo.name)} has no effect: each of its pairs of a state and an "
        "action is a correct demo's, too"
        for demo in demos.incorrect
        if _pairs(demo) <= right
    ]
    return doubts


def _pairs(*demos: Demo) -> set[tuple[int, int]]:
    """All pairs of a state and the action taken there."""
    return {
        pair
        for demo in demos
        for pair in zip(demo.states.tolist(), demo.actions.tolist(), strict=False)
    }


def _read(path: str | os.PathLike[str]) -> Demos:
    with _naming(path):
        return parse_demos(read_content(path))


@contextmanager
def _naming(path: str | os.PathLike[str]) -> Iterator[None]:
    """Put the file's name before what is refused."""
    try:
        yield
    except DemoError as error:
        raise DemoError(f"{_file(path)}: {error}") from None


def _file(path: str | os.PathLike[str]) -> str:
    text = os.fsdecode(path)
    return text if text.isprintable() else repr(text)


def _integers(values: ArrayLike, name: str, field: str) -> NDArray[np.int64]:
    array = np.array(values)
    if array.ndim != 1 or (array.size and array.dtype.kind not in "iu"):
        raise DemoError(f"demo {show(name)}: {field} must be a one-dimensional array of integers")
    array = array.astype(np.int64)
    array.setflags(write=False)
    return array
