"""Demonstration files: one JSON file holds a task, its environment and its demonstrations.

A file looks like this (``data/demos/schema.json`` has the full structure):

.. code-block:: json

    {
      "format": "replication-demos",
      "version": 1,
      "task": "corridor",
      "description": "free text",
      "environment": {"kind": "maze", "map": ["S.G", "..."]},
      "correct": [
        {"name": "straight", "actions": ["right", "right"], "states": [[0,0], [0,1], [0,2]]}
      ],
      "incorrect": [
        {"name": "bump", "kind": "hit", "actions": ["up", "right", "right"]}
      ]
    }

What follows from the rest may be left out: ``states``, the ``actions``, ``start`` and ``goal`` of
the environment, ``description`` and ``incorrect``. What is given is checked. Every demonstration
begins at the start; a correct one ends at the goal; none goes on beyond it. Rows and columns count
from 0. Steps count from 1: step k takes ``actions[k - 1]`` and leads to ``states[k]``.
"""

from __future__ import annotations

import difflib
import hashlib
import json
import math
import os
import re
import stat
import warnings
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from pathlib import Path
from typing import Annotated, Any, Literal, NoReturn

import numpy as np
from numpy.typing import ArrayLike, NDArray
from pydantic import BaseModel, ConfigDict, Field, ValidationError

from replication.envs.maze import MAX_SIDE, Maze, MazeError
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

FORMAT = "replication-demos"
VERSION = 1
MAX_BYTES = 10_000_000
MAX_FIELDS = 50
RESERVED_KINDS = ("correct", "all", "none")

_KIND = r"^[a-z][a-z0-9-]*$"
_NAME = r"^[^\u0000-\u001f\u007f]+$"
_TASK = r"^[A-Za-z0-9][A-Za-z0-9_-]*$"
_MENDS = {
    _KIND: "use small letters, digits and '-', a letter first",
    _NAME: "write it on one line, without control characters",
    _TASK: "use letters, digits, '-' and '_', a letter or digit first",
}


class DemoError(ValueError):
    """Demonstrations that cannot be used; the message is one line with the place and the mend."""


class DemoWarning(UserWarning):
    """Demonstrations that can be used, but which no deterministic policy can match exactly."""


# --- what a program sees ---------------------------------------------------------------------


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
    environment: Maze
    correct: tuple[Demo, ...]
    incorrect: tuple[Demo, ...] = ()
    description: str = ""

    def __post_init__(self) -> None:
        object.__setattr__(self, "correct", tuple(self.correct))
        object.__setattr__(self, "incorrect", tuple(self.incorrect))
        if not re.fullmatch(_TASK, self.task):
            _fail(f"task {_show(self.task)} does not fit: {_MENDS[_TASK]}")
        if not self.correct:
            _fail("there is no correct demo; give at least one from the start to the goal")
        names: set[str] = set()
        for demo in self.correct + self.incorrect:
            if demo.name in names:
                _fail(f"two demos are named {_show(demo.name)}; give each its own name")
            names.add(demo.name)
            _check_demo(self.environment, demo)
        for demo in self.correct:
            if demo.kind != "correct":
                _fail(f"demo {_show(demo.name)} is correct; its kind must be 'correct'")
            if demo.states[-1] != self.environment.goal:
                _fail(
                    f"demo {_show(demo.name)} is correct, but ends at "
                    f"{_cell(self.environment, demo.states[-1])}, not at the goal "
                    f"{_cell(self.environment, self.environment.goal)}; "
                    "add the missing steps or move it to 'incorrect'"
                )
        for demo in self.incorrect:
            if not re.fullmatch(_KIND, demo.kind) or demo.kind in RESERVED_KINDS:
                _fail(
                    f"demo {_show(demo.name)} is incorrect, of kind {_show(demo.kind)}; "
                    f"{_MENDS[_KIND]}, but none of {', '.join(RESERVED_KINDS)}"
                )

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
                known = _clip(", ".join(("all", "none", *self.kinds)), 300)
                _fail(f"task {self.task} has no incorrect demo of kind {_show(kind)}; use {known}")
        return replace(self, incorrect=tuple(d for d in self.incorrect if d.kind in wanted))

    def conflicts(self) -> tuple[int, ...]:
        """States in which the correct demos, taken together, ask for more than one action."""
        pairs = {
            pair
            for demo in self.correct
            for pair in zip(demo.states.tolist(), demo.actions.tolist(), strict=False)
        }
        states = sorted(state for state, _ in pairs)
        return tuple(sorted({a for a, b in pairwise(states) if a == b}))


def load_demos(path: str | os.PathLike[str]) -> Demos:
    """Read and check a demonstration file.

    Raises
    ------
    DemoError
        On the first thing that is wrong, in one line that names the file, the place and the mend.

    Warns
    -----
    DemoWarning
        If no deterministic policy can match the correct demos exactly.
    """
    demos = _read(path)
    for warning in _doubts(demos):
        warnings.warn(f"{_file(path)}: {warning}", DemoWarning, stacklevel=2)
    return demos


def check_demos(path: str | os.PathLike[str]) -> list[str]:
    """Check a demonstration file; returns its warnings, raises `DemoError` like `load_demos`."""
    return [f"{_file(path)}: {warning}" for warning in _doubts(_read(path))]


def save_demos(demos: Demos, path: str | os.PathLike[str]) -> None:
    """Write a demonstration file in the one stable layout; an old file is replaced at once.

    Raises
    ------
    DemoError
        If the file could not be read back (its text is too long, for instance) or not be written.
    """
    text = _layout(demos_document(demos))
    try:
        _in_file(path, lambda: parse_demos(text.encode()))
        write_file(path, text)
    except DemoError:
        raise
    except (OSError, ValueError) as error:
        _fail(f"{_file(path)}: cannot be written ({_reason(error)})")


def content_hash(demos: Demos) -> str:
    """SHA-256, as hexadecimal text, of what a learner sees.

    That is the environment and, in order, each demo's kind, states and actions; names,
    description and the file's layout do not matter.
    """
    seen = {
        "environment": MazeFields.describe(demos.environment),
        "demos": [
            [demo.kind, demo.states.tolist(), demo.actions.tolist()]
            for demo in demos.correct + demos.incorrect
        ],
    }
    text = json.dumps(seen, sort_keys=True, separators=(",", ":"))
    return hashlib.sha256(text.encode()).hexdigest()


def json_schema() -> dict[str, Any]:
    """JSON schema of the file's structure (that the moves are right cannot be said in a schema)."""
    return {"$schema": "https://json-schema.org/draft/2020-12/schema"} | (
        DemoFile.model_json_schema()
    )


# --- what a file holds -----------------------------------------------------------------------

# A kind of environment is a class of fields here, told apart by `kind`, that can `build` the
# environment and `describe` it, and an environment with `actions`, `goal`, `replay` and `cells`.
# A second kind turns the field `environment` of DemoFile into a union, discriminated by `kind`.


class _Fields(BaseModel):
    model_config = ConfigDict(extra="forbid", strict=True, frozen=True)


_Name = Annotated[str, Field(min_length=1, max_length=100, pattern=_NAME)]
_Cell = Annotated[list[Annotated[int, Field(ge=0, lt=MAX_SIDE)]], Field(min_length=2, max_length=2)]
_Actions = Annotated[list[Annotated[str, Field(max_length=100)]], Field(fail_fast=True)]
_States = Annotated[list[_Cell], Field(fail_fast=True)]


class MazeFields(_Fields):
    """A maze; ``actions``, ``start`` and ``goal`` may be left out, as the map gives them."""

    kind: Literal["maze"]
    map: Annotated[
        list[Annotated[str, Field(max_length=MAX_SIDE)]], Field(fail_fast=True, max_length=MAX_SIDE)
    ]
    actions: _Actions | None = None
    start: _Cell | None = None
    goal: _Cell | None = None

    def build(self) -> Maze:
        """Make the environment; raises `DemoError` if what is given does not agree."""
        try:
            maze = Maze(tuple(self.map))
        except MazeError as error:
            _fail(f"environment: {error}")
        derived = self.describe(maze)
        for field in ("actions", "start", "goal"):
            given, due = getattr(self, field), derived[field]
            if given is not None and given != due:
                _fail(
                    f"environment: {field!r} is {_show(given)}, but by the map it is "
                    f"{_compact(due)}; write that, or leave it out"
                )
        return maze

    @staticmethod
    def describe(maze: Maze) -> dict[str, Any]:
        """Fields of an environment, as plain JSON values."""
        return {
            "kind": "maze",
            "map": list(maze.rows),
            "actions": list(maze.actions),
            "start": list(maze.cell(maze.start)),
            "goal": list(maze.cell(maze.goal)),
        }


class CorrectFields(_Fields):
    """A trajectory from the start to the goal; ``states`` may be left out."""

    name: _Name
    actions: _Actions
    states: _States | None = None


class IncorrectFields(_Fields):
    """A trajectory that shows a mistake of some ``kind``; ``states`` may be left out."""

    name: _Name
    kind: Annotated[str, Field(max_length=100, pattern=_KIND)]
    actions: _Actions
    states: _States | None = None


class DemoFile(_Fields):
    """A task with its environment and its demonstrations."""

    format: Literal["replication-demos"]
    version: Literal[1]
    task: Annotated[str, Field(max_length=100, pattern=_TASK)]
    description: Annotated[str, Field(max_length=10_000)] = ""
    environment: MazeFields
    # That there is at least one is checked by `Demos`, which says it better.
    correct: Annotated[
        list[CorrectFields],
        Field(fail_fast=True, max_length=10_000, json_schema_extra={"minItems": 1}),
    ]
    incorrect: Annotated[list[IncorrectFields], Field(fail_fast=True, max_length=10_000)] = []


_MODELS: dict[str, type[BaseModel]] = {
    "environment": MazeFields,
    "correct": CorrectFields,
    "incorrect": IncorrectFields,
}


# --- reading ---------------------------------------------------------------------------------


def _read(path: str | os.PathLike[str]) -> Demos:
    return _in_file(path, lambda: parse_demos(_content(path)))


def _in_file(path: str | os.PathLike[str], read: Callable[[], Demos]) -> Demos:
    try:
        return read()
    except DemoError as error:
        raise DemoError(f"{_file(path)}: {error}") from None


def _content(path: str | os.PathLike[str]) -> bytes:
    try:
        info = Path(path).stat()
        if not stat.S_ISREG(info.st_mode):
            _fail("is not a regular file; give the path of a JSON file")
        _check_size(info.st_size)
        with Path(path).open("rb") as file:
            return file.read(MAX_BYTES + 1)
    except DemoError:
        raise
    except (OSError, ValueError) as error:
        _fail(f"cannot be read ({_reason(error)})")


def _check_size(n_bytes: int) -> None:
    if n_bytes > MAX_BYTES:
        _fail(f"is larger than {MAX_BYTES // 1_000_000} MB; drop some demos")


def parse_demos(content: bytes) -> Demos:
    """Read and check the content of a demonstration file.

    Raises
    ------
    DemoError
        On the first thing that is wrong, in one line that names the place and the mend.
    """
    _check_size(len(content))
    data = _json(content)
    if not isinstance(data, dict):
        _fail(f"holds {_show(data)}; a demonstration file is one JSON object")
    for field, due in (("format", FORMAT), ("version", VERSION)):
        if field not in data:
            _fail(f'{field!r} is missing; write "{field}": {json.dumps(due)}')
        if type(data[field]) is not type(due) or data[field] != due:
            _fail(f"unknown {field} {_show(data[field])}; this program reads {json.dumps(due)}")
    try:
        fields = DemoFile.model_validate(data)
    except ValidationError as error:
        _fail(_explain(error, data))
    environment = fields.environment.build()
    return Demos(
        task=fields.task,
        environment=environment,
        correct=tuple(
            _demo(environment, demo.name, "correct", demo.actions, demo.states)
            for demo in fields.correct
        ),
        incorrect=tuple(
            _demo(environment, demo.name, demo.kind, demo.actions, demo.states)
            for demo in fields.incorrect
        ),
        description=fields.description,
    )


def _json(content: bytes) -> Any:
    try:
        text = content.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        _fail(f"is not UTF-8 text (byte {error.start + 1}); save it as UTF-8")
    if not text.strip():
        _fail("is empty; a demonstration file is one JSON object")
    try:
        return json.loads(
            text,
            object_pairs_hook=_object,
            parse_int=_integer,
            parse_float=_float,
            parse_constant=_constant,
        )
    except json.JSONDecodeError as error:
        _fail(
            f"is not JSON: {error.msg} at line {error.lineno}, column {error.colno}; mend it there"
        )
    except RecursionError:
        _fail("is nested too deeply; a demonstration file needs five levels")


def _object(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    fields = dict(pairs)
    if len(fields) < len(pairs):
        twice, _ = Counter(key for key, _ in pairs).most_common(1)[0]
        _fail(f"the field {_show(twice)} stands twice in one object; keep one")
    if len(fields) > MAX_FIELDS:
        _fail(f"an object has {len(fields)} fields; no object of this format has so many")
    return fields


def _integer(text: str) -> int:
    if len(text) > 16:
        _fail(f"the number {_clip(text)} is too large; write a small integer")
    return int(text)


def _float(text: str) -> float:
    value = float(text)
    if not math.isfinite(value):
        _fail(f"the number {_clip(text)} is too large; write a small number")
    return value


def _constant(text: str) -> NoReturn:
    _fail(f"{text} is not a JSON number; write a finite number")


def _demo(
    environment: Maze,
    name: str,
    kind: str,
    actions: Sequence[str],
    cells: Sequence[Sequence[int]] | None,
) -> Demo:
    """Turn a demo's actions into numbers, replay them, and compare with what the file claims."""
    numbers = {action: number for number, action in enumerate(environment.actions)}
    for step, action in enumerate(actions, start=1):
        if action not in numbers:
            _fail(
                f"step {step} of demo {_show(name)}: unknown action {_show(action)}; "
                f"{_suggest(action, environment.actions)}use {', '.join(environment.actions)}"
            )
    taken = np.array([numbers[action] for action in actions], dtype=np.int64)
    states = environment.replay(taken)
    if cells is not None:
        claims = np.array(cells, dtype=np.int64).reshape(len(cells), 2)
        _check_claims(environment, name, taken, states, claims)
    return Demo(name, kind, states, taken)


# --- checking --------------------------------------------------------------------------------


def _check_demo(environment: Maze, demo: Demo) -> None:
    """Refuse a demo that is empty, does not follow the moves, or goes on beyond the goal."""
    name, actions = _show(demo.name), demo.actions
    if not actions.size:
        _fail(f"demo {name} is empty; give it at least one action")
    if actions.min() < 0 or actions.max() >= environment.n_actions:
        _fail(f"demo {name}: actions must be 0..{environment.n_actions - 1}")
    states = environment.replay(actions)
    _check_claims(environment, demo.name, actions, states, environment.cells(demo.states))
    early = np.flatnonzero(states[:-1] == environment.goal)
    if early.size:
        _fail(
            f"demo {name} goes on after reaching the goal at step {early[0]}; "
            f"drop the {actions.size - early[0]} steps that follow"
        )


def _check_claims(
    environment: Maze,
    name: str,
    actions: NDArray[np.int64],
    states: NDArray[np.int64],
    claims: NDArray[np.int64],
) -> None:
    """Compare claimed cells [n, 2] with those of the replayed states [T + 1]."""
    cells = environment.cells(states)
    both = min(len(cells), len(claims))
    wrong = np.flatnonzero((cells[:both] != claims[:both]).any(axis=1))
    if wrong.size:
        step = int(wrong[0])
        due, claimed = (_compact(array[step].tolist()) for array in (cells, claims))
        if step == 0:
            _fail(f"demo {_show(name)} begins at {claimed}, but the start is {due}; write {due}")
        action = environment.actions[actions[step - 1]]
        before = _compact(cells[step - 1].tolist())
        stays = states[step] == states[step - 1]
        outcome = "hits a wall and stays" if stays else f"leads to {due}"
        _fail(
            f"step {step} of demo {_show(name)}: {action!r} from {before} {outcome}, but the file "
            f"claims {claimed}; write {due} or change the action"
        )
    if len(cells) != len(claims):
        _fail(
            f"demo {_show(name)} has {len(actions)} actions and {len(claims)} states; give "
            f"{len(cells)} states, the last one reached included, or leave 'states' out"
        )


def _doubts(demos: Demos) -> list[str]:
    """Why no deterministic policy can match the correct demos, if so."""
    doubts = []
    conflicts = demos.conflicts()
    if conflicts:
        state = conflicts[0]
        asked = sorted({a for d in demos.correct for a in d.actions[d.states[:-1] == state]})
        actions = " and ".join(repr(demos.environment.actions[action]) for action in asked)
        doubts.append(
            f"the correct demos ask for {actions} in {_cell(demos.environment, state)}"
            f" (one of {len(conflicts)} such states): d = 0 cannot be reached"
        )
    paths = {(demo.states.tobytes(), demo.actions.tobytes()) for demo in demos.correct}
    if len(paths) > 1:
        doubts.append(
            f"the correct demos are {len(paths)} different trajectories: mu_E is their average, "
            "which a single deterministic trajectory cannot match"
        )
    return doubts


def _explain(error: ValidationError, data: dict[str, Any]) -> str:
    """One line for the first thing that pydantic found."""
    first = error.errors(include_url=False)[0]
    place, kind = first["loc"], first["type"]
    where = _where(place[:-1] if kind in ("extra_forbidden", "missing") else place, data)
    if kind == "extra_forbidden":
        model = _MODELS.get(str(place[0]), DemoFile) if len(place) > 1 else DemoFile
        known = tuple(model.model_fields)
        key = str(place[-1])
        return (
            f"{where}unknown field {_show(key)}; {_suggest(key, known)}"
            f"the fields are {', '.join(known)}"
        )
    if kind == "missing":
        return f"{where}the field {place[-1]!r} is missing; add it"
    mend = _MENDS.get(first.get("ctx", {}).get("pattern", ""), _lower(first["msg"]))
    return f"{where}{_show(first['input'])} does not fit: {mend}"


def _where(place: tuple[int | str, ...], data: Any) -> str:
    """Path of a field, such as ``correct[0] ('name').actions[3]: ``."""
    text, value = "", data
    for key in place:
        text += f"[{key}]" if isinstance(key, int) else f".{key}"
        try:
            value = value[key]
        except (KeyError, IndexError, TypeError):
            break
        if isinstance(key, int) and isinstance(value, dict) and isinstance(value.get("name"), str):
            text += f" (demo {_show(value['name'])})"
    return f"{text.removeprefix('.')}: " if text else ""


# --- writing ---------------------------------------------------------------------------------


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
        "environment": MazeFields.describe(demos.environment),
        "correct": [{"name": demo.name} | trajectory(demo) for demo in demos.correct],
        "incorrect": [
            {"name": demo.name, "kind": demo.kind} | trajectory(demo) for demo in demos.incorrect
        ],
    }


def _layout(value: Any, *, key: str = "", indent: str = "\n") -> str:
    """JSON text: an object's fields and a map's rows have lines of their own, other lists one."""
    inner = indent + "  "
    if isinstance(value, dict):
        items = [f"{json.dumps(k)}: {_layout(v, key=k, indent=inner)}" for k, v in value.items()]
        text = "{" + inner + f",{inner}".join(items) + indent + "}"
    elif isinstance(value, list) and value and (key == "map" or isinstance(value[0], dict)):
        items = [_layout(item, indent=inner) for item in value]
        text = "[" + inner + f",{inner}".join(items) + indent + "]"
    elif isinstance(value, list):
        text = "[" + ", ".join(map(_compact, value)) + "]"
    else:
        text = json.dumps(value, ensure_ascii=False)
    return text if key or indent != "\n" else text + "\n"


# --- small things ----------------------------------------------------------------------------


def _integers(values: ArrayLike, name: str, field: str) -> NDArray[np.int64]:
    array = np.array(values)
    if array.ndim != 1 or (array.size and array.dtype.kind not in "iu"):
        _fail(f"demo {_show(name)}: {field} must be a one-dimensional array of integers")
    array = array.astype(np.int64)
    array.setflags(write=False)
    return array


def _cell(environment: Maze, state: int) -> str:
    return _compact(list(environment.cell(state)))


def _compact(value: Any) -> str:
    return json.dumps(value, ensure_ascii=False, separators=(",", ":"))


def _suggest(word: str, known: Sequence[str]) -> str:
    close = difflib.get_close_matches(word[:40], known, n=1)
    return f"did you mean {close[0]!r}? " if close else ""


def _show(value: Any) -> str:
    """Name any JSON value in a few words."""
    if isinstance(value, dict):
        return "an object"
    if isinstance(value, list):
        short = len(value) <= 4 and all(isinstance(item, int | str) for item in value)
        return _clip(repr(value)) if short else f"a list of {len(value)}"
    if isinstance(value, str):
        return _clip(repr(value[:200]))
    return _clip(json.dumps(value))


def _clip(text: str, length: int = 60) -> str:
    return text if len(text) <= length else f"{text[: length - 3]}..."


def _lower(text: str) -> str:
    return text[:1].lower() + text[1:]


def _file(path: str | os.PathLike[str]) -> str:
    text = os.fsdecode(path)
    return text if text.isprintable() else repr(text)


def _reason(error: Exception) -> str:
    return _lower(getattr(error, "strerror", None) or str(error))


def _fail(message: str) -> NoReturn:
    raise DemoError(message)
