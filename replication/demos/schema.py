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

from pydantic import BaseModel, ConfigDict, Field, ValidationError

from replication.demos.checks import DemoError
from replication.demos.model import FIXES, KIND, NAME, TASK
from replication.demos.strict_json import read_json
from replication.envs.environment import Environment
from replication.envs.maze import MAX_SIDE, Maze, MazeError
from replication.envs.soccer.field import SoccerField
from replication.envs.soccer.rules import SoccerParams
from replication.envs.task import Task, TaskError
from replication.errors import compact, show, unknown

MAX_STATES = 2**27

FORMAT = "replication-demos"
VERSION = 1
OWN = "own"
"""The kind of an environment that only its own program can make."""


# --- what a file holds -----------------------------------------------------------------------

# Each kind of environment has a class of fields here, with its own `kind`, that can `build` the
# environment; the environment can `describe` itself. The schema does not take its descriptions from
# docstrings, since Python can be told to drop those.


class _Fields(BaseModel):
    model_config = ConfigDict(extra="forbid", strict=True, frozen=True)


_Name = Annotated[str, Field(min_length=1, max_length=100, pattern=NAME)]
_Cell = Annotated[list[Annotated[int, Field(ge=0, lt=MAX_SIDE)]], Field(min_length=2, max_length=2)]
_Numbers = Annotated[
    list[Annotated[int, Field(ge=0, lt=MAX_STATES)]], Field(min_length=1, max_length=3)
]  # of a state: row and column in a maze; column, row and detection in soccer; else its own
_Actions = Annotated[list[Annotated[str, Field(max_length=100)]], Field(fail_fast=True)]
_States = Annotated[list[_Numbers], Field(fail_fast=True)]


class MazeFields(
    _Fields,
    json_schema_extra={
        "description": "A maze; ``actions``, ``start`` and ``goal`` may be left out, "
        "as the map gives them."
    },
):
    """The fields of a maze."""

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
            raise DemoError(f"environment: {error}") from None
        derived = maze.describe()
        for field in ("actions", "start", "goal"):
            _check_given(field, getattr(self, field), derived[field])
        return maze


class SoccerFields(
    _Fields,
    json_schema_extra={
        "description": "The soccer field; whatever is left out has its registered default."
    },
):
    """The fields of the soccer field."""

    kind: Literal["soccer"]
    actions: _Actions | None = None
    drive_time: float | None = None
    speed: float | None = None
    slow_speed: float | None = None
    turn_rate: float | None = None
    rays: int | None = None
    ray_length: float | None = None
    ray_arc: int | None = None
    dt: float | None = None
    macro: str | None = None
    time_limit: float | None = None

    def build(self) -> SoccerField:
        """Make the environment; raises `DemoError` if what is given does not agree."""
        given = self.model_dump(exclude={"kind", "actions"}, exclude_none=True)
        try:
            field = SoccerField(SoccerParams(**given))
        except ValueError as error:
            raise DemoError(f"environment: {error}") from None
        _check_given("actions", self.actions, list(field.actions))
        return field


class GymnasiumFields(
    _Fields,
    json_schema_extra={
        "description": "A Gymnasium environment that is registered under its ``id``; ``actions`` "
        "names its actions."
    },
):
    """The fields of a Gymnasium environment."""

    kind: Literal["gymnasium"]
    id: _Name
    options: dict[str, Any] = {}
    reset_seed: Annotated[int, Field(ge=0)] | None = None
    actions: _Actions | None = None

    def build(self) -> Task:
        """Make the environment; raises `DemoError` if Gymnasium cannot."""
        import gymnasium

        from replication.envs.gym_task import GymTask

        if ":" in self.id:  # would import a module that the file names
            raise DemoError(
                f"environment.id: {show(self.id)} names a module; import it in Python and give the "
                "task itself: load_demos(path, task=...)"
            )
        try:
            env = gymnasium.make(self.id, **self.options)
            return GymTask(env, actions=self.actions, reset_seed=self.reset_seed)
        except (gymnasium.error.Error, TaskError, TypeError, ValueError, KeyError) as error:
            first = str(error).splitlines()[0] if str(error) else repr(error)
            raise DemoError(f"environment: Gymnasium cannot make it: {first}") from None


class OwnFields(
    _Fields,
    json_schema_extra={
        "description": "An environment that only its own program can make: whoever reads the "
        "file gives it."
    },
):
    """The fields of an environment that no file can make."""

    kind: Literal["own"]
    states: Annotated[int, Field(ge=1)]
    actions: _Actions
    digest: str | None = None

    def build(self) -> Environment:
        """Refuse: there is nothing to make it of."""
        raise DemoError(
            "environment: only its own program can make it; give it in Python: "
            "load_demos(path, task=...)"
        )


def _check_given(field: str, given: list[Any] | None, derived: list[Any]) -> None:
    if given is not None and given != derived:
        raise DemoError(
            f"environment: {field!r} is {show(given)}, but should be {compact(derived)}; "
            "write that or leave it out"
        )


class CorrectFields(
    _Fields,
    json_schema_extra={
        "description": "A trajectory from the start to the goal; ``states`` may be left out."
    },
):
    """The fields of a correct demonstration."""

    name: _Name
    actions: _Actions
    states: _States | None = None


class IncorrectFields(
    _Fields,
    json_schema_extra={
        "description": "A trajectory that shows a mistake of some ``kind``; ``states`` may be "
        "left out."
    },
):
    """The fields of an incorrect demonstration."""

    name: _Name
    kind: Annotated[str, Field(max_length=100, pattern=KIND)]
    actions: _Actions
    states: _States | None = None


class DemoFile(
    _Fields,
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
    incorrect: Annotated[list[IncorrectFields], Field(fail_fast=True, max_length=10_000)] = []


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


_ENVIRONMENTS: dict[str, type[BaseModel]] = {
    "maze": MazeFields,
    "soccer": SoccerFields,
    "gymnasium": GymnasiumFields,
    "own": OwnFields,
}
_MODELS: dict[str, type[BaseModel]] = {"correct": CorrectFields, "incorrect": IncorrectFields}


def _explain(error: ValidationError, data: dict[str, Any]) -> str:
    """Explain the first error that pydantic reports, in one line."""
    first = error.errors(include_url=False)[0]
    place, kind = first["loc"], first["type"]
    models = dict(_MODELS)
    if place[:1] == ("environment",) and len(place) > 1:  # pydantic names the kind as well
        models["environment"] = _ENVIRONMENTS[str(place[1])]
        place = ("environment", *place[2:])
    if kind == "union_tag_not_found":
        return "environment: the field 'kind' is missing; add it"
    if kind == "union_tag_invalid":
        tag = data["environment"]["kind"]
        return f"environment.kind: {unknown(str(tag), _ENVIRONMENTS, 'kind')}"
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
