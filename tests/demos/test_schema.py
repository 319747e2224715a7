from __future__ import annotations

import copy
import json
import re
from pathlib import Path
from typing import Any

import jsonschema  # type: ignore[import-untyped] # it ships no types
import pytest

from replication.demos import schema
from replication.demos.checks import DemoError
from replication.demos.schema import MazeFields, json_schema, read_fields
from replication.envs.maze import ACTIONS, Maze
from replication.files import PROJECT

DATA = PROJECT / "data" / "demos"
STORED = sorted(path for path in DATA.glob("*.json") if path.name != "schema.json")

EXAMPLE: dict[str, Any] = {
    "format": "replication-demos",
    "version": 1,
    "task": "tiny",
    "description": "Käse\n",
    "environment": {"kind": "maze", "map": ["S.#", "..G"]},
    "correct": [
        {
            "name": "c",
            "actions": ["right", "down", "right"],
            "states": [[0, 0], [0, 1], [1, 1], [1, 2]],
        }
    ],
    "incorrect": [
        {"name": "h", "kind": "hit", "actions": ["up", "down"]},
        {"name": "d", "kind": "detour", "actions": ["down", "right", "right"]},
    ],
}


def edited(*changes: tuple[tuple[str | int, ...], Any]) -> dict[str, Any]:
    """Copy the example and set (or, for ..., delete) what stands at some places."""
    document = copy.deepcopy(EXAMPLE)
    for place, value in changes:
        holder: Any = document
        for key in place[:-1]:
            holder = holder[key]
        if value is ...:
            del holder[place[-1]]
        elif isinstance(holder, list) and place[-1] == len(holder):
            holder.append(value)
        else:
            holder[place[-1]] = value
    return document


def refusal(document: Any) -> str:
    """Return the one line with which a file is refused."""
    with pytest.raises(DemoError) as caught:
        read_fields(json.dumps(document).encode()).environment.build()
    message = str(caught.value)
    assert message.isprintable()
    assert len(message) < 400
    return message


def test_worked_example() -> None:
    """The fields are what stands in the file; what may be left out is None or empty."""
    fields = read_fields(json.dumps(EXAMPLE).encode())
    assert fields.task == "tiny"
    assert fields.description == "Käse\n"
    assert fields.environment.build() == Maze(("S.#", "..G"))
    assert isinstance(fields.environment, MazeFields)
    assert fields.environment.start is None
    assert fields.correct[0].states == EXAMPLE["correct"][0]["states"]
    assert fields.incorrect[1].actions == ["down", "right", "right"]
    assert fields.incorrect[1].states is None
    assert read_fields(json.dumps(edited((("incorrect",), ...))).encode()).incorrect == []


def test_environment_is_described_in_full() -> None:
    """A maze's description names its actions, start and goal, and builds the same maze."""
    described = Maze(("S.#", "..G")).describe()
    assert described == {
        "kind": "maze",
        "map": ["S.#", "..G"],
        "actions": list(ACTIONS),
        "start": [0, 0],
        "goal": [1, 2],
    }
    assert MazeFields(**described).build() == Maze(("S.#", "..G"))


REFUSALS: dict[str, tuple[list[tuple[tuple[str | int, ...], Any]], str]] = {
    "format": ([(("format",), "demos")], "unknown format 'demos'; this program reads"),
    "no format": ([(("format",), ...)], "'format' is missing; write \"format\": "),
    "version": ([(("version",), 2)], "unknown version 2; this program reads 1"),
    "true version": ([(("version",), True)], "unknown version true; this program reads 1"),
    "float version": ([(("version",), 1.0)], "unknown version 1.0; this program reads 1"),
    "no task": ([(("task",), ...)], "the field 'task' is missing; add it"),
    "path as task": ([(("task",), "../x")], "task: '../x' does not fit: use letters, digits, '-'"),
    "misspelt": (
        [(("correct", 0, "sates"), [])],
        "correct[0] (demo 'c'): unknown field 'sates'; did you mean 'states'? the fields are name",
    ),
    "misspelt on top": (
        [(("descriptoin",), "")],
        "field 'descriptoin'; did you mean 'description'?",
    ),
    "strange field": (
        [(("environment", "xyz\n"), 1)],
        r"environment: unknown field 'xyz\n'; the fie",
    ),
    "no kind": (
        [(("incorrect", 1, "kind"), ...)],
        "incorrect[1] (demo 'd'): the field 'kind' is missing; add it",
    ),
    "kind": (
        [(("incorrect", 0, "kind"), "Hit!")],
        "incorrect[0] (demo 'h').kind: 'Hit!' does not f",
    ),
    "kind of correct": (
        [(("correct", 0, "kind"), "correct")],
        "correct[0] (demo 'c'): unknown field",
    ),
    "environment": (
        [(("environment", "kind"), "tank")],
        "environment.kind: unknown kind 'tank'; the kinds are maze, soccer",
    ),
    "no environment": ([(("environment",), ...)], "the field 'environment' is missing"),
    "not rectangular": (
        [(("environment", "map"), ["S.#", "..G."])],
        "environment: map line 2 has 4 characters, but line 1 has 3; make all lines equally long",
    ),
    "two starts": (
        [(("environment", "map"), ["S.S", "..G"])],
        "environment: the map has 2 starts 'S'",
    ),
    "no goal": (
        [(("environment", "map"), ["S.#", "..."])],
        "environment: the map has no goal; mark",
    ),
    "closed": (
        [(("environment", "map"), ["S#.", "#.G"])],
        "environment: the goal at map line 2, colu",
    ),
    "no map": ([(("environment", "map"), [])], "environment: the map is empty"),
    "map as text": (
        [(("environment", "map"), "S.G")],
        "environment.map: 'S.G' does not fit: input s",
    ),
    "start": (
        [(("environment", "start"), [1, 0])],
        "environment: 'start' is [1, 0], but should be [0,0]; write that or leave it out",
    ),
    "goal": (
        [(("environment", "goal"), [1, 1])],
        "environment: 'goal' is [1, 1], but should be",
    ),
    "order of actions": (
        [(("environment", "actions"), ["down", "up", "right", "left"])],
        "environment: 'actions' is ['down', 'up', 'right', 'left'], but should be [\"up\"",
    ),
    "action as number": (
        [(("correct", 0, "actions", 1), 1)],
        "correct[0] (demo 'c').actions[1]: 1 do",
    ),
    "no name": (
        [(("correct", 0, "name"), "")],
        "correct[0] (demo '').name: '' does not fit: string",
    ),
    "name of two lines": (
        [(("correct", 0, "name"), "a\nb")],
        r"(demo 'a\nb').name: 'a\nb' does not f",
    ),
    "surrogate": ([(("correct", 0, "name"), "\ud800")], r"name: '\ud800' does not fit"),
    "surrogate field": ([(("\ud800",), 1)], r"'\ud800' does not fit"),
    "float state": (
        [(("correct", 0, "states", 1, 1), 1.0)],
        "correct[0] (demo 'c').states[1][1]: 1.0 does not fit: input should be a valid integer",
    ),
    "true state": (
        [(("correct", 0, "states", 1, 1), True)],
        "true does not fit: input should be a v",
    ),
    "negative state": (
        [(("correct", 0, "states", 1, 1), -1)],
        "-1 does not fit: input should be grea",
    ),
    "state of four": (
        [(("correct", 0, "states", 1), [0, 1, 0, 0])],
        "[0, 1, 0, 0] does not fit: list sho",
    ),
    "large": (
        [(("correct", 0, "states", 1, 1), 10**15)],
        "1000000000000000 does not fit: input shou",
    ),
    "huge": ([(("correct", 0, "states", 1, 1), 10**400)], "the number 1000000000000000000"),
    "NaN": (
        [(("correct", 0, "states", 1, 1), float("nan"))],
        "NaN is not a JSON number; write a fin",
    ),
    "infinity": ([(("x",), float("-inf"))], "-Infinity is not a JSON number"),
    "list for an object": (
        [(("correct", 0), ["right"])],
        "correct[0]: ['right'] does not fit: input",
    ),
    "object for a list": (
        [(("correct",), {"a": 1})],
        "correct: an object does not fit: input should",
    ),
    "many fields": ([((f"x{i}",), 1) for i in range(60)], "an object has 67 fields"),
}


@pytest.mark.parametrize("case", REFUSALS)
def test_refusals(case: str) -> None:
    """Each way to spoil the structure is refused in one line that names the place and the mend."""
    changes, message = REFUSALS[case]
    assert message in refusal(edited(*changes))


@pytest.mark.parametrize("document", [[], None, 1, "x"])
def test_only_an_object_is_a_file(document: Any) -> None:
    """JSON that is not an object is refused as such."""
    assert refusal(document).endswith("; a demonstration file is one JSON object")


def test_stored_schema_is_current() -> None:
    """The stored schema is the one that the program uses."""
    assert json.loads((DATA / "schema.json").read_text()) == json_schema()


def test_schema_agrees_with_the_program() -> None:
    """The schema takes the example and refuses files that are wrong in structure."""
    validator = jsonschema.Draft202012Validator(json_schema())
    validator.check_schema(json_schema())
    assert validator.is_valid(EXAMPLE)
    for case in ("misspelt", "no kind", "kind", "version", "state of four"):
        changes, _ = REFUSALS[case]
        assert not validator.is_valid(edited(*changes))
    assert not validator.is_valid(edited((("correct",), [])))


@pytest.mark.parametrize("path", STORED, ids=lambda path: path.stem)
def test_stored_files_keep_the_schema(path: Path) -> None:
    """Each stored file is valid by the stored schema."""
    schema = json.loads((DATA / "schema.json").read_text())
    jsonschema.validate(json.loads(path.read_text()), schema)


def test_docstring_example_is_sound() -> None:
    """The file that the module shows can be read."""
    shown = re.search(r"json\n\n(    \{.*?\n    \})\n", schema.__doc__ or "", re.DOTALL)
    assert shown is not None
    assert [demo.kind for demo in read_fields(shown[1].encode()).incorrect] == ["hit"]
