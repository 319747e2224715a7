"""Demonstrations as objects that are checked when they are made.

:mod:`replication.demos.files` reads and writes them, :mod:`replication.demos.checks` checks them.
"""

from __future__ import annotations

import hashlib
import json
import re
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from numpy.typing import ArrayLike, NDArray

from replication.demos.checks import DemoError, check_moves, goal_phrase
from replication.envs.environment import Environment
from replication.errors import clip, compact, show

KIND = r"^[a-z][a-z0-9-]*$"
NAME = r"^[^\u0000-\u001f\u007f]+$"
TASK = r"^[A-Za-z0-9][A-Za-z0-9_-]*$"
FIXES = {
    KIND: "use small letters, digits and '-', a letter first",
    NAME: "write it on one line, without control characters",
    TASK: "use letters, digits, '-' and '_', a letter or digit first",
}


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
        Visited states, int64 [T + 1], the one reached last included; read-only.
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
    """All demonstrations of a task, validated when they are made.

    Parameters
    ----------
    task
        Short name of the task: letters, digits, ``-`` and ``_``.
    environment
        The world in which the demonstrations were made.
    correct
        At least one trajectory from the start to the goal.
    incorrect
        Trajectories from the start that show mistakes, each of a named kind.
    description
        Free text.

    Raises
    ------
    DemoError
        If a demonstration is empty, breaks the rules of moving, goes on after the goal or (a
        correct one) misses it, or if a name or kind is not allowed.
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
            raise DemoError(f"task {show(self.task)} does not fit: {FIXES[TASK]}")
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
                    f"{goal_phrase(self.environment)}; add the missing steps or move it to "
                    "'incorrect'"
                )
        for demo in self.incorrect:
            if not re.fullmatch(KIND, demo.kind) or demo.kind in RESERVED_KINDS:
                raise DemoError(
                    f"demo {show(demo.name)} is incorrect, of kind {show(demo.kind)}; "
                    f"{FIXES[KIND]}, but none of {', '.join(RESERVED_KINDS)}"
                )

    @property
    def kinds(self) -> tuple[str, ...]:
        """Kinds of the incorrect demos, each once, in order of appearance."""
        return tuple(dict.fromkeys(demo.kind for demo in self.incorrect))

    def select(self, kinds: str) -> Demos:
        """Return the correct demos and only some kinds of the incorrect ones.

        Parameters
        ----------
        kinds
            "all", "none", or kinds joined by ``+``, such as "hit+detour".

        Raises
        ------
        DemoError
            If there is no incorrect demo of a requested kind.
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
        """States in which the correct demos, taken together, show more than one action."""
        states = sorted(state for state, _ in state_action_pairs(*self.correct))
        return tuple(sorted({a for a, b in pairwise(states) if a == b}))


def content_hash(demos: Demos) -> str:
    """Return the SHA-256, as hexadecimal text, of what a learner sees.

    That is the environment and, in order, each demo's kind, states and actions; names, description
    and layout of the file do not count.
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


def state_action_pairs(*demos: Demo) -> set[tuple[int, int]]:
    """Return all pairs of a state and the action taken there."""
    return {
        pair
        for demo in demos
        for pair in zip(demo.states.tolist(), demo.actions.tolist(), strict=False)
    }


def _integers(values: ArrayLike, name: str, field: str) -> NDArray[np.int64]:
    array = np.array(values)
    if array.ndim != 1 or (array.size and array.dtype.kind not in "iu"):
        raise DemoError(f"demo {show(name)}: {field} must be a one-dimensional array of integers")
    array = array.astype(np.int64)
    array.setflags(write=False)
    return array
