"""The format of demonstration files: a task, its environment and its demonstrations, in JSON.

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

What can be derived from the rest may be left out: ``states``, the environment's ``actions``,
``start`` and ``goal``, ``description`` and ``incorrect``. What is given is checked: its structure
here, the moves in :mod:`replication.demos.checks`.
"""

from __future__ import annotations

from typing import Annotated, Any, Literal

from pydantic import BaseModel, Field, ValidationError

from replication.demos.checks import DemoError
from replication.demos.environments import (
    ENVIRONMENTS,
    Actions,
    Fields,
    GymnasiumFields,
    MazeFields,
    Name,
    OwnFields,
    SoccerFields,
)
from replication.demos.model import FIXES, KIND, TASK
from replication.demos.strict_json import read_json
from replication.errors import compact, show, unknown

MAX_STATES = 2**27

FORMAT = "replication-demos"
VERSION = 1


# --- what a file holds -----------------------------------------------------------------------

_Numbers = Annotated[
    list[Annotated[int, Field(ge=0, lt=MAX_STATES)]], Field(min_length=1, max_length=3)
]  # of a state: row and column in a maze; column, row and detection in soccer; else its own
_States = Annotated[list[_Numbers], Field(fail_fast=True)]


class CorrectFields(
    Fields,
    json_schema_extra={
        "description": "A trajectory from the start to the goal; ``states`` may be left out."
    },
):
    """The fields of a correct demonstration."""

    name: Name
    actions: Actions
    states: _States | None = None


class IncorrectFields(
    Fields,
    json_schema_extra={
        "description": "A trajectory that shows a mistake of some ``kind``; ``states`` may be "
        "left out."
    },
):
    """The fields of an incorrect demonstration."""

    name: Name
    kind: Annotated[str, Field(max_length=100, pattern=KIND)]
    actions: Actions
    states: _States | None = None


class DemoFile(
    Fields,
    json_schema_extra={"description": "A task with its environment and its demonstrations."},
):
    """The fields of a whole file."""

    format: Literal["replication-demos"]
    version: Literal[1]
    task: Annotated[str, Field(max_length=100, pattern=TASK)]
    description: Annotated[str, Field(max_length=10_000)] = ""
    environment: Annotated[
        MazeFields | SoccerFields | GymnasiumFields | OwnFields, Field(discriminator="kind")
    ]
    # `Demos` checks that there is at least one, with a clearer message.
    correct: Annotated[
        list[CorrectFields],
        Field(fail_fast=True, max_length=10_000, json_schema_extra={"minItems": 1}),
    ]
    incorrect: Annotated[list[IncorrectFields], Field(fail_fast=True, max_length=10_000)] = []  # noqa: RUF012


def json_schema() -> dict[str, Any]:
    """JSON schema of the file's structure (no schema can state that the moves are right)."""
    return {"$schema": "https://json-schema.org/draft/2020-12/schema"} | (
        DemoFile.model_json_schema()
    )


def read_fields(content: bytes) -> DemoFile:
    """Read the content of a file and check its structure.

    Raises
    ------
    DemoError
        On the first thing that is wrong, in one line that names the place and the fix.
    """
    data = read_json(content)
    if not isinstance(data, dict):
        raise DemoError(f"holds {show(data)}; a demonstration file is one JSON object")
    for field, expected in (("format", FORMAT), ("version", VERSION)):
        if field not in data:
            raise DemoError(f'{field!r} is missing; write "{field}": {compact(expected)}')
        if type(data[field]) is not type(expected) or data[field] != expected:
            raise DemoError(
                f"unknown {field} {show(data[field])}; this program reads {compact(expected)}"
            )
    try:
        return DemoFile.model_validate(data)
    except ValidationError as error:
        raise DemoError(_explain(error, data)) from None


_MODELS: dict[str, type[BaseModel]] = {"correct": CorrectFields, "incorrect": IncorrectFields}


def _explain(error: ValidationError, data: dict[str, Any]) -> str:
    """Explain the first error that pydantic reports, in one line."""
    first = error.errors(include_url=False)[0]
    place, kind = first["loc"], first["type"]
    models = dict(_MODELS)
    if place[:1] == ("environment",) and len(place) > 1:  # pydantic names the kind as well
        models["environment"] = ENVIRONMENTS[str(place[1])]
        place = ("environment", *place[2:])
    if kind == "union_tag_not_found":
        return "environment: the field 'kind' is missing; add it"
    if kind == "union_tag_invalid":
        tag = data["environment"]["kind"]
        return f"environment.kind: {unknown(str(tag), ENVIRONMENTS, 'kind')}"
    if kind == "missing":
        return f"{_where(place[:-1], data)}the field {place[-1]!r} is missing; add it"
    if kind == "extra_forbidden":
        key, model = str(place[-1]), DemoFile if len(place) == 1 else models[str(place[0])]
        return _where(place[:-1], data) + unknown(key, model.model_fields, "field")
    message = first["msg"][:1].lower() + first["msg"][1:]
    fix = FIXES.get(first.get("ctx", {}).get("pattern", ""), message)
    return f"{_where(place, data)}{show(first['input'])} does not fit: {fix}"


def _where(place: tuple[int | str, ...], data: Any) -> str:
    """Path of a field, such as ``correct[0] (demo 'name').actions[3]: ``."""
    text, value = "", data
    for key in place:
        text += f"[{key}]" if isinstance(key, int) else f".{key}"
        try:
            value = value[key]
        except (KeyError, IndexError, TypeError):
            break
        if isinstance(key, int) and isinstance(value, dict) and isinstance(value.get("name"), str):
            text += f" (demo {show(value['name'])})"
    return f"{text.removeprefix('.')}: " if text else ""
