"""Demonstrations from a table of steps, as a spreadsheet or a program writes it."""

from __future__ import annotations

import csv
import io
import os
from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from replication.demos.checks import DemoError, action_number, check_moves
from replication.demos.model import Demo, Demos
from replication.envs.environment import Environment
from replication.envs.maze import Maze, MazeError
from replication.envs.tasks.base import TaskError
from replication.errors import show, unknown
from replication.files import printable, read_text

COLUMNS = ("episode", "step", "state", "action")
CELL = ("row", "column")


@dataclass
class _Episode:
    """The rows of an episode, and the lines of the first and the last one."""

    kind: str
    lines: list[int] = field(default_factory=list)
    steps: list[int] = field(default_factory=list)
    states: list[int] = field(default_factory=list)
    actions: list[int] = field(default_factory=list)


def read_csv(
    path: str | os.PathLike[str], environment: Environment, task: str = "recorded"
) -> Demos:
    """Read demonstrations from a CSV file with a row for each step.

    Parameters
    ----------
    path
        A file with the columns ``episode`` (any text), ``step`` (counted from 0 or 1), ``state``
        (before the action; of a maze also ``row`` and ``column`` instead), ``action`` (a name or
        number), and perhaps ``kind``: "correct", which is also meant if it is missing or empty, or
        the kind of mistake. An episode may end with a row that has a state and no action; else the
        state that its last action leads to is found by replaying it.
    environment
        Where the demonstrations were made.
    task
        Name of the task.

    Raises
    ------
    FileError
        If the file cannot be read.
    DemoError
        On the first thing that is wrong, in one line that names the file, the line and the fix.
    """
    try:
        episodes = _episodes(read_text(path).removeprefix("\ufeff"), environment)
        demos = [_demo(environment, name, episode) for name, episode in episodes.items()]
        correct = tuple(demo for demo in demos if demo.kind == "correct")
        incorrect = tuple(demo for demo in demos if demo.kind != "correct")
        return Demos(task, environment, correct, incorrect)
    except DemoError as error:
        raise DemoError(f"{printable(path)}: {error}") from None


def _episodes(text: str, environment: Environment) -> dict[str, _Episode]:
    reader = csv.reader(io.StringIO(text, newline=None))
    header = [name.strip() for name in next(reader, [])]
    needed = [name for name in COLUMNS if name != "state" or not _by_cell(header, environment)]
    known = (*COLUMNS, "kind", *(CELL if isinstance(environment, Maze) else ()))
    for name in needed:
        if name not in header:
            raise DemoError(f"line 1: there is no column {name!r}; give {', '.join(needed)}")
    for name in header:
        if name not in known or header.count(name) > 1:
            raise DemoError(f"line 1: {_odd(name, known)}")
    episodes: dict[str, _Episode] = {}
    for row in _rows(reader):
        values = [value.strip() for value in row]
        if not any(values):
            continue
        try:
            if len(values) != len(header):
                raise DemoError(f"there are {len(values)} values for {len(header)} columns")
            _add(episodes, dict(zip(header, values, strict=True)), reader.line_num, environment)
        except DemoError as error:
            raise DemoError(f"line {reader.line_num}: {error}") from None
    return episodes


def _rows(reader: Any) -> Iterator[list[str]]:
    try:
        yield from reader
    except csv.Error as error:
        raise DemoError(f"line {reader.line_num}: is not CSV ({error})") from None


def _odd(name: str, known: tuple[str, ...]) -> str:
    return f"the column {name!r} stands twice" if name in known else unknown(name, known, "column")


def _by_cell(header: list[str], environment: Environment) -> bool:
    return isinstance(environment, Maze) and "state" not in header and set(CELL) <= set(header)


def _add(
    episodes: dict[str, _Episode], row: dict[str, str], line: int, environment: Environment
) -> None:
    """Add a row to its episode; raises `DemoError` if it does not fit."""
    name, kind = row["episode"], row.get("kind") or "correct"
    episode = episodes.setdefault(name, _Episode(kind))
    step = _number(row["step"], "step")
    if episode.steps and step != episode.steps[-1] + 1:
        raise DemoError(
            f"step {step} of episode {show(name)} follows step {episode.steps[-1]}; write a row "
            "for each step, in order"
        )
    if not episode.steps and step not in (0, 1):
        raise DemoError(f"episode {show(name)} begins with step {step}; begin with 0 or 1")
    if len(episode.actions) < len(episode.states):
        raise DemoError(f"episode {show(name)} goes on after a row without an action; give one")
    if kind != episode.kind:
        raise DemoError(
            f"episode {show(name)} is of kind {show(kind)} here, and {show(episode.kind)} before; "
            "an episode has one kind"
        )
    episode.lines.append(line)
    episode.steps.append(step)
    episode.states.append(_state(row, environment))
    if row["action"]:
        text = row["action"]
        action = int(text) if text.isdecimal() and text not in environment.actions else text
        episode.actions.append(action_number(environment, action))


def _state(row: dict[str, str], environment: Environment) -> int:
    if isinstance(environment, Maze) and "state" not in row:
        try:
            return environment.state(*(_number(row[name], name) for name in CELL))
        except MazeError as error:
            raise DemoError(str(error)) from None
    state = _number(row["state"], "state")
    if state >= environment.n_states:
        last = environment.n_states - 1
        raise DemoError(f"there is no state {state}; states are 0..{last}")
    return state


def _number(text: str, what: str) -> int:
    if not text.isdecimal() or len(text) > 16:
        raise DemoError(f"the {what} is {show(text)}; give a whole number")
    return int(text)


def _demo(environment: Environment, name: str, episode: _Episode) -> Demo:
    """Return the demonstration of an episode, replayed."""
    actions = np.array(episode.actions, dtype=np.int64)
    states = episode.states
    try:
        if len(states) == len(actions):
            states = [*states, _last_state(environment, actions)]
        demo = Demo(f"episode {name}", episode.kind, np.array(states), actions)
        check_moves(environment, demo.name, demo.actions, demo.states)
    except DemoError as error:
        raise DemoError(f"lines {episode.lines[0]} to {episode.lines[-1]}: {error}") from None
    return demo


def _last_state(environment: Environment, actions: NDArray[np.int64]) -> int:
    try:
        return int(environment.replay(actions)[-1])
    except TaskError:
        raise DemoError(
            "moves or the start are random; end the episode by a row with its last state and no "
            "action"
        ) from None
