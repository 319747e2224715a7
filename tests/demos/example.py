"""A small demonstration file that a person can check, and ways to change it."""

from __future__ import annotations

import copy
from typing import Any

import numpy as np

from replication.demos.model import Demo
from replication.envs.maze import ACTIONS, Maze
from replication.files import PROJECT

DATA = PROJECT / "data" / "demos"
STORED = sorted(path for path in DATA.glob("*.json") if path.name != "schema.json")

MAZE = Maze(("S.#", "..G"))

EXAMPLE: dict[str, Any] = {
    "format": "replication-demos",
    "version": 1,
    "task": "tiny",
    "description": "Käse\n",
    "environment": MAZE.describe(),
    "correct": [
        {
            "name": "c",
            "actions": ["right", "down", "right"],
            "states": [[0, 0], [0, 1], [1, 1], [1, 2]],
        }
    ],
    "incorrect": [
        {"name": "h", "kind": "hit", "actions": ["up", "down"], "states": [[0, 0], [0, 0], [1, 0]]},
        {
            "name": "d",
            "kind": "detour",
            "actions": ["down", "right", "right"],
            "states": [[0, 0], [1, 0], [1, 1], [1, 2]],
        },
        {"name": "h2", "kind": "hit", "actions": ["left"], "states": [[0, 0], [0, 0]]},
    ],
}

Changes = dict[str, Any]
"""New values by place, such as "correct.0.states"; ... deletes what stands there."""


def edited(changes: Changes) -> dict[str, Any]:
    """Copy the example and change it; what stands one beyond the end of a list is appended."""
    document = copy.deepcopy(EXAMPLE)
    for place, value in changes.items():
        holder: Any = document
        *way, last = (int(key) if key.isdigit() else key for key in place.split("."))
        for key in way:
            holder = holder[key]
        if value is ...:
            del holder[last]
        elif isinstance(holder, list) and last == len(holder):
            holder.append(value)
        else:
            holder[last] = value
    return document


def demo(name: str, kind: str, *actions: str, maze: Maze = MAZE) -> Demo:
    """Replay the named actions."""
    numbers = [ACTIONS.index(action) for action in actions]
    return Demo(name, kind, maze.replay(numbers), np.array(numbers))
