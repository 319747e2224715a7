from __future__ import annotations

import json
import os
import re
import subprocess
import sys
from pathlib import Path
from typing import Any

import jsonschema  # type: ignore[import-untyped] # it ships no types
import pytest

from replication.demos import schema
from replication.demos.checks import DemoError
from replication.demos.environments import MazeFields
from replication.demos.schema import json_schema, read_fields
from replication.files import PROJECT
from tests.demos.example import DATA, EXAMPLE, MAZE, STORED, Changes, edited


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
    changes = {"environment.start": ..., "incorrect.1.states": ...}
    fields = read_fields(json.dumps(edited(changes)).encode())
    assert fields.task == "tiny"
    assert fields.description == "Käse\n"
    assert fields.environment.build() == MAZE
    assert isinstance(fields.environment, MazeFields)
    assert fields.environment.start is None
    assert fields.environment.goal == [1, 2]
    assert fields.correct[0].states == EXAMPLE["correct"][0]["states"]
    assert fields.incorrect[1].actions == ["down", "right", "right"]
    assert fields.incorrect[1].states is None
    assert read_fields(json.dumps(edited({"incorrect": ...})).encode()).incorrect == []


REFUSALS: list[tuple[Changes, str]] = [
    ({"format": "demos"}, "unknown format 'demos'; this program reads"),
    ({"format": ...}, "'format' is missing; write \"format\": "),
    ({"version": 2}, "unknown version 2; this program reads 1"),
    ({"version": True}, "unknown version true; this program reads 1"),
    ({"version": 1.0}, "unknown version 1.0; this program reads 1"),
    ({"task": ...}, "the field 'task' is missing; add it"),
    ({"task": "../x"}, "task: '../x' does not fit: use letters, digits, '-'"),
    (
        {"correct.0.sates": []},
        "correct[0] (demo 'c'): unknown field 'sates' (did you mean 'states'?); known: name, act",
    ),
    ({"descriptoin": ""}, "field 'descriptoin' (did you mean 'description'?"),
    ({"environment.xyz\n": 1}, "environment: unknown field 'xyz\\n'; known: "),
    ({"incorrect.1.kind": ...}, "incorrect[1] (demo 'd'): the field 'kind' is missing; add it"),
    ({"incorrect.0.kind": "Hit!"}, "incorrect[0] (demo 'h').kind: 'Hit!' does not f"),
    ({"correct.0.kind": "correct"}, "correct[0] (demo 'c'): unknown field"),
    ({"environment.kind": "tank"}, "environment.kind: unknown kind 'tank'; known: maze, soccer"),
    ({"environment": ...}, "the field 'environment' is missing"),
    (
        {"environment.map": ["S.#", "..G."]},
        "environment: map line 2 has 4 characters, but line 1 has 3; make all lines equally long",
    ),
    ({"environment.map": ["S.S", "..G"]}, "environment: the map has 2 starts 'S'"),
    ({"environment.map": ["S.#", "..."]}, "environment: the map has no goal; mark"),
    ({"environment.map": ["S#.", "#.G"]}, "environment: the goal at map line 2, colu"),
    ({"environment.map": []}, "environment: the map is empty"),
    ({"environment.map": "S.G"}, "environment.map: 'S.G' does not fit: input s"),
    (
        {"environment.start": [1, 0]},
        "environment: 'start' is [1, 0], but should be [0,0]; write that or leave it out",
    ),
    ({"environment.goal": [1, 1]}, "environment: 'goal' is [1, 1], but should be"),
    (
        {"environment.actions": ["down", "up", "right", "left"]},
        "environment: 'actions' is ['down', 'up', 'right', 'left'], but should be [\"up\"",
    ),
    ({"correct.0.actions.1": 1}, "correct[0] (demo 'c').actions[1]: 1 do"),
    ({"correct.0.name": ""}, "correct[0] (demo '').name: '' does not fit: string"),
    ({"correct.0.name": "a\nb"}, "(demo 'a\\nb').name: 'a\\nb' does not f"),
    ({"correct.0.name": "\ud800"}, "name: '\\ud800' does not fit"),
    ({"\ud800": 1}, "'\\ud800' does not fit"),
    (
        {"correct.0.states.1.1": 1.0},
        "correct[0] (demo 'c').states[1][1]: 1.0 does not fit: input should be a valid integer",
    ),
    ({"correct.0.states.1.1": True}, "true does not fit: input should be a v"),
    ({"correct.0.states.1.1": -1}, "-1 does not fit: input should be grea"),
    ({"correct.0.states.1": [0, 1, 0, 0]}, "[0, 1, 0, 0] does not fit: list sho"),
    ({"correct.0.states.1.1": 10**15}, "1000000000000000 does not fit: input shou"),
    ({"correct.0.states.1.1": 10**400}, "the number 1000000000000000000"),
    ({"correct.0.states.1.1": float("nan")}, "the number NaN is too large or not"),
    ({"x": float("-inf")}, "the number -Infinity is"),
    ({"correct.0": ["right"]}, "correct[0]: ['right'] does not fit: input"),
    ({"correct": {"a": 1}}, "correct: an object does not fit: input should"),
    ({f"x{i}": 1 for i in range(60)}, "an object has 67 fields"),
]


@pytest.mark.parametrize(("changes", "message"), REFUSALS)
def test_refusals(changes: Changes, message: str) -> None:
    """Each way to spoil the structure is refused in one line that names the place and the fix."""
    assert message in refusal(edited(changes))


@pytest.mark.parametrize("document", [[], None, 1, "x"])
def test_only_an_object_is_a_file(document: Any) -> None:
    """JSON that is not an object is refused as such."""
    assert refusal(document).endswith("; a demonstration file is one JSON object")


def test_stored_schema_is_current() -> None:
    """The stored schema is the one that the program uses."""
    assert json.loads((DATA / "schema.json").read_text()) == json_schema()


@pytest.mark.parametrize("level", ["0", "2"])
def test_printed_schema_is_the_stored_one(level: str) -> None:
    """Its bytes do not depend on whether Python keeps docstrings."""
    words = [sys.executable, "-m", "replication", "demos", "schema"]
    environment = os.environ | {"PYTHONOPTIMIZE": level}
    done = subprocess.run(words, cwd=PROJECT, env=environment, capture_output=True, check=True)
    assert done.stdout == (DATA / "schema.json").read_bytes()


def test_schema_agrees_with_the_program() -> None:
    """The schema takes the example and refuses files that are wrong in structure."""
    validator = jsonschema.Draft202012Validator(json_schema())
    validator.check_schema(json_schema())
    assert validator.is_valid(EXAMPLE)
    wrongs: tuple[Changes, ...] = (
        {"version": 2},
        {"correct": []},
        {"correct.0.sates": []},
        {"correct.0.states.1": [0, 1, 0, 0]},
        {"incorrect.0.kind": "Hit!"},
        {"incorrect.0.kind": ...},
    )
    for wrong in wrongs:
        assert not validator.is_valid(edited(wrong))


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
