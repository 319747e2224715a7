"""The environments that demonstration files describe.

Each kind has a class of fields here, with its own `kind`, that can `build` the environment; the
environment can `describe` itself. The schema does not take its descriptions from docstrings, since
Python can be told to drop those.
"""

from __future__ import annotations

from typing import Annotated, Any, Literal

from pydantic import BaseModel, ConfigDict, Field

from replication.demos.checks import DemoError
from replication.demos.model import NAME
from replication.envs.environment import Environment
from replication.envs.maze import MAX_SIDE, Maze, MazeError
from replication.envs.soccer.field import SoccerField
from replication.envs.soccer.rules import SoccerParams
from replication.envs.tasks.base import Task, TaskError
from replication.errors import compact, show

OWN = "own"
"""The kind of an environment that only its own program can make."""


class Fields(BaseModel):
    """The base of all fields: nothing unknown, nothing of another type."""

    model_config = ConfigDict(extra="forbid", strict=True, frozen=True)


Name = Annotated[str, Field(min_length=1, max_length=100, pattern=NAME)]
_Cell = Annotated[list[Annotated[int, Field(ge=0, lt=MAX_SIDE)]], Field(min_length=2, max_length=2)]
Actions = Annotated[list[Annotated[str, Field(max_length=100)]], Field(fail_fast=True)]


class MazeFields(
    Fields,
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
    actions: Actions | None = None
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
    Fields,
    json_schema_extra={
        "description": "The soccer field; whatever is left out has its registered default."
    },
):
    """The fields of the soccer field."""

    kind: Literal["soccer"]
    actions: Actions | None = None
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
    Fields,
    json_schema_extra={
        "description": "A Gymnasium environment that is registered under its ``id``; ``actions`` "
        "names its actions."
    },
):
    """The fields of a Gymnasium environment."""

    kind: Literal["gymnasium"]
    id: Name
    options: dict[str, Any] = {}
    reset_seed: Annotated[int, Field(ge=0)] | None = None
    actions: Actions | None = None

    def build(self) -> Task:
        """Make the environment; raises `DemoError` if Gymnasium cannot."""
        import gymnasium

        from replication.envs.tasks.gymnasium import GymTask

        if ":" in self.id:  # would import a module that the file names
            raise DemoError(
                f"environment.id: {show(self.id)} names a module; import it in Python, and use "
                "record(task, path) or load_demos(path, task=...)"
            )
        try:
            env = gymnasium.make(self.id, **self.options)
            return GymTask(env, actions=self.actions, reset_seed=self.reset_seed)
        except TaskError as error:
            raise DemoError(f"environment: {error}") from None
        except (gymnasium.error.Error, TypeError, ValueError, KeyError) as error:
            first = str(error).splitlines()[0] if str(error) else repr(error)
            raise DemoError(f"environment: Gymnasium cannot make it: {first}") from None


class OwnFields(
    Fields,
    json_schema_extra={
        "description": "An environment that only its own program can make: whoever reads the "
        "file gives it."
    },
):
    """The fields of an environment that no file can make."""

    kind: Literal["own"]
    states: Annotated[int, Field(ge=1)]
    actions: Actions
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


ENVIRONMENTS: dict[str, type[BaseModel]] = {
    "maze": MazeFields,
    "soccer": SoccerFields,
    "gymnasium": GymnasiumFields,
    OWN: OwnFields,
}
