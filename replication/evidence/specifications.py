"""The declared specifications: sets of choices under which the claims are evaluated again.

The file ``specifications.toml`` declares them; this module reads it and makes conditions of them.
"""

from __future__ import annotations

import tomllib
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from functools import cache
from importlib import resources
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, ValidationError

from replication.demos.checks import DemoError
from replication.demos.files import load_demos
from replication.demos.maze_expert import Expert, demonstrate
from replication.demos.model import Demo, Demos
from replication.demos.soccer_expert import SoccerExpert, demonstrate_soccer
from replication.envs.maze import Maze, as_maze
from replication.envs.soccer.field import SoccerField
from replication.evidence.claims import ClaimError, load_claims
from replication.evidence.experiments import (
    EXPERIMENTS,
    F_LABELS,
    Key,
    method_conditions,
)
from replication.files import resolve
from replication.irl import METHODS, READINGS
from replication.irl.expectations import visited
from replication.paper.params import Params
from replication.paper.register import ChoiceError, Value, load_choices
from replication.trials.condition import Condition

MAPS = ("open", "obstacles", "random-1", "random-2", "random-3")
RANDOM = "random"
"""As a value of DEMO-SHAPE: a shortest path drawn at random (DEMO-PATH = random-1)."""

OBSTACLES = 30
MOVES = 33
"""Obstacle cells of a random maze, and the length of its shortest path."""


Count = Annotated[int, Field(ge=1)]
Seed = Annotated[int, Field(ge=0)]
Trials = Annotated[int, Field(ge=2)]
"""Intervals need two trials at least."""


class _Strict(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True)


class Single(_Strict):
    """Specifications that change one choice each."""

    trials: Trials
    choices: Mapping[str, tuple[Value, ...]]


class Factorial(Single):
    """Specifications that set all choices at once: a balanced fraction of the full factorial."""

    size: Count
    seed: Seed


class Mazes(_Strict):
    """What is declared for the mazes."""

    claims: tuple[str, ...]
    single: Single
    factorial: Factorial


class Soccer(_Strict):
    """What is declared for robot soccer."""

    claims: tuple[str, ...]
    single: Single


class Ablations(_Strict):
    """The method with parts of it switched off, and the number of incorrect demonstrations."""

    trials: Trials
    traces: tuple[Mapping[str, float], ...]
    seed: Seed
    numbers: tuple[Annotated[int, Field(ge=0)] | Literal["all"], ...]


class Declared(_Strict):
    """The whole file."""

    root_seed: Seed
    iteration_cap: Count
    mazes: Mazes
    soccer: Soccer
    ablations: Ablations


@dataclass(frozen=True)
class Specification:
    """Choices by their ids; those that are not named have their defaults."""

    group: str
    choices: tuple[tuple[str, Value], ...]

    @property
    def name(self) -> str:
        """The choices in words: `ID=value`, parted by blanks."""
        return " ".join(f"{id}={value}" for id, value in self.choices) or "default"


# --- reading ---------------------------------------------------------------------------------


@cache
def load_specifications() -> Declared:
    """Return the specifications of the package."""
    return parse_specifications(_text())


def check_declared() -> None:
    """Check the package's specifications as far as half a second goes, before anything runs.

    Beside the file, these are the kinds of incorrect demonstrations, which the stored ones have to
    have. To make all conditions takes twenty seconds: random mazes and soccer worlds are made anew.

    Raises
    ------
    ChoiceError, ClaimError
        As :func:`parse_specifications`, and for a kind that a task does not have.
    """
    plan = load_specifications()
    for place, table, task in (
        ("mazes.single", plan.mazes.single.choices, "open-maze"),
        ("mazes.factorial", plan.mazes.factorial.choices, "open-maze"),
        ("soccer.single", plan.soccer.single.choices, "soccer"),
    ):
        demos = load_demos(resolve(EXPERIMENTS[task].demos))
        for kinds in table.get("INCORRECT-KINDS", ()):
            try:
                demos.select(str(kinds))
            except DemoError as error:
                raise ChoiceError(f"specifications.toml, {place}: {error}") from None


def parse_specifications(text: str) -> Declared:
    """Read and check a file of specifications.

    Raises
    ------
    ChoiceError, ClaimError
        In one line that names the place, for what is unknown, missing or not accepted.
    """
    try:
        found = Declared(**tomllib.loads(text))
    except tomllib.TOMLDecodeError as error:
        raise ChoiceError(f"specifications.toml is not TOML: {error}") from None
    except ValidationError as error:
        first = error.errors()[0]
        place = ".".join(map(str, first["loc"]))
        raise ChoiceError(f"specifications.toml, {place}: {first['msg']}") from None
    for place, ids, task in (
        ("mazes", found.mazes.claims, "open-maze"),
        ("soccer", found.soccer.claims, "soccer"),
    ):
        for id in ids:
            try:
                _check_claim(id, task)
            except ClaimError as error:
                raise ClaimError(f"specifications.toml, {place}.claims: {error}") from None
    tables = {
        "mazes.single": found.mazes.single.choices,
        "mazes.factorial": found.mazes.factorial.choices,
        "soccer.single": found.soccer.single.choices,
        **{
            f"ablations.traces[{n}]": {id: (value,) for id, value in one.items()}
            for n, one in enumerate(found.ablations.traces)
        },
    }
    for place, table in tables.items():
        for id, values in table.items():
            for value in values:
                try:
                    _check(id, value)
                    _check_task(id, soccer=place == "soccer.single")
                except ChoiceError as error:
                    raise ChoiceError(f"specifications.toml, {place}: {error}") from None
    if 0 not in found.ablations.numbers:
        raise ChoiceError("specifications.toml, ablations.numbers: add 0, which saving is against")
    for id, values in found.mazes.factorial.choices.items():
        if found.mazes.factorial.size % len(values):
            raise ChoiceError(
                f"specifications.toml, mazes.factorial: {len(values)} values of {id} cannot be "
                f"balanced over {found.mazes.factorial.size} specifications"
            )
    return found


def _text() -> str:
    return (
        resources.files("replication.evidence").joinpath("specifications.toml").read_text("utf-8")
    )


def _check_claim(id: str, task: str) -> None:
    """Refuse a claim of another task, or one that has no effect under a specification."""
    claim = load_claims().by_id(id)
    if claim.direction == "inside":
        raise ClaimError(f"{id} is about a published number; name claims that compare")
    if claim.task != task:
        raise ClaimError(f"{id} is about the task {claim.task!r}; name claims about {task!r}")


def _check_task(id: str, *, soccer: bool) -> None:
    """Refuse a choice that nothing in the task depends on."""
    of_mazes = id == "MAP" or id.startswith("ADABOOST")
    of_mazes = of_mazes or (id in load_choices() and load_choices()[id].field.startswith("Expert."))
    if of_mazes if soccer else id.startswith("SOCCER"):
        here, there = ("soccer", "the mazes") if soccer else ("the mazes", "soccer")
        raise ChoiceError(f"{id} changes nothing in {here}; it belongs to {there}")


def _check(id: str, value: Value) -> None:
    """Refuse a choice or a value that the register does not have."""
    if id == "MAP":
        if value not in MAPS:
            raise ChoiceError(f"MAP = {value!r} is not accepted: use {', '.join(MAPS)}")
    elif id not in load_choices():
        raise ChoiceError(f"there is no choice {id!r}")
    elif id == "SOCCER-EPISODES":
        load_choices()["EPISODES"].check(value)
    elif (id, value) != ("DEMO-SHAPE", RANDOM):
        if not load_choices()[id].field:
            raise ChoiceError(f"{id} has no parameter that could be changed")
        load_choices()[id].check(value)


# --- the specifications ----------------------------------------------------------------------


def default_of(id: str) -> Value:
    """Return the default of a choice that a specification can change."""
    return "open" if id == "MAP" else load_choices()[id].default


def single_specifications(choices: Mapping[str, tuple[Value, ...]]) -> list[Specification]:
    """Return the default, and then one specification for each other value of each choice."""
    changed = [((id, value),) for id, values in choices.items() for value in values]
    return [Specification("single", one) for one in ((), *changed)]


def factorial_specifications(factorial: Factorial) -> list[Specification]:
    """Return a balanced fraction of the full factorial.

    Each value of a choice stands in equally many specifications; the order of each choice is a
    random permutation of its own, so that choices are nearly uncorrelated.
    """
    seeds = np.random.SeedSequence(factorial.seed).spawn(len(factorial.choices))
    columns = {}
    for seed, (id, values) in zip(seeds, factorial.choices.items(), strict=True):
        order = np.random.default_rng(seed).permutation(factorial.size)
        columns[id] = [values[at % len(values)] for at in order.tolist()]
    return [
        Specification("factorial", tuple(zip(columns, row, strict=True)))
        for row in zip(*columns.values(), strict=True)
    ]


def maze_conditions(specification: Specification, cap: int) -> dict[Key, Condition]:
    """Return the conditions of all methods in a maze, under the reading of Eq. 9 it chooses."""
    choices = dict(specification.choices)
    world = str(choices.pop("MAP", "open"))
    expert: dict[str, Any] = {}
    if choices.get("DEMO-SHAPE") == RANDOM:
        del choices["DEMO-SHAPE"]
        expert["path"] = "random-1"
    for id in ("DEMO-SHAPE", "DEMO-PATH", "DETOUR-WIDTH"):
        if id in choices:
            expert[_name(id)] = choices.pop(id)
    demos = _maze_demos(world, Expert(**expert))
    return _chosen_reading(
        demos, {"max_iterations": cap}, choices, EXPERIMENTS["open-maze"].methods
    )


def soccer_conditions(specification: Specification, cap: int) -> dict[Key, Condition]:
    """Return the conditions of both methods in robot soccer; the world is made anew if it changes."""
    choices = dict(specification.choices)
    experiment = EXPERIMENTS["soccer"]
    demos = load_demos(resolve(experiment.demos))
    assert isinstance(demos.environment, SoccerField)
    if "SOCCER-EPISODES" in choices:
        choices["EPISODES"] = choices.pop("SOCCER-EPISODES")
    world: dict[str, Any] = {}
    for id in list(choices):
        if load_choices()[id].field.startswith("SoccerParams."):
            world[_name(id)] = choices.pop(id)
    leave = choices.pop("SOCCER-INCORRECT", None)
    if world or leave:
        field = SoccerField(replace(demos.environment.params, **world))
        params = SoccerExpert(leave=str(leave)) if leave else SoccerExpert()
        demos = demonstrate_soccer(demos.task, field, params=params)
    base = {**experiment.choices, "max_iterations": cap}
    return _chosen_reading(demos, base, choices, experiment.methods)


def _chosen_reading(
    demos: Demos, base: Mapping[str, Any], choices: Mapping[str, Value], methods: tuple[str, ...]
) -> dict[Key, Condition]:
    values = {**base, **{_name(id): value for id, value in choices.items()}}
    reading = values.pop("f_index", default_of("F-INDEX"))
    conditions = method_conditions(demos, values, methods)
    return {(name, f): one for (name, f), one in conditions.items() if f in ("", reading)}


def _name(id: str) -> str:
    """Return the name of the parameter that holds a choice."""
    return load_choices()[id].field.split(".")[1]


# --- mazes and demonstrations that are not stored ------------------------------------------------


@cache
def _maze_demos(world: str, expert: Expert) -> Demos:
    task, maze = _world(world)
    return demonstrate(task, maze, params=expert)


@cache
def _world(world: str) -> tuple[str, Maze]:
    """Return the name of a maze's task, and the maze."""
    stored = {"open": "open-maze", "obstacles": "obstacle-maze"}
    if world in stored:
        return stored[world], as_maze(
            load_demos(resolve(EXPERIMENTS[stored[world]].demos)).environment
        )
    task = f"{world}-maze"
    template = load_demos(resolve(EXPERIMENTS["open-maze"].demos))
    shapes = load_choices()["DEMO-SHAPE"]
    experts = [Expert(leg=int(leg)) for leg in (shapes.default, *shapes.alternatives)]
    experts.append(Expert(path="random-1"))
    seed = np.random.SeedSequence(int(world.removeprefix("random-")))
    for maze in random_mazes(as_maze(template.environment), seed=seed):
        kinds = (demonstrate(task, maze, params=one).kinds for one in experts)
        if all(set(one) == set(template.kinds) for one in kinds):
            return task, maze
    raise AssertionError("random mazes do not end")


def random_mazes(
    template: Maze, *, obstacles: int = OBSTACLES, moves: int = MOVES, seed: np.random.SeedSequence
) -> Iterator[Maze]:
    """Yield random mazes whose shortest path has the given number of moves, without end.

    Parameters
    ----------
    template
        Gives the size, the start and the goal; its obstacles are not kept.
    obstacles
        Number of obstacle cells, drawn without replacement from all others.
    moves
        Length of the shortest path.
    seed
        Of the draws.
    """
    rng = np.random.default_rng(seed)
    rows, columns = template.shape
    free = [cell for cell in range(rows * columns) if cell not in (template.start, template.goal)]
    while True:
        cells = np.full(rows * columns, ".")
        cells[rng.choice(free, size=obstacles, replace=False)] = "#"
        cells[[template.start, template.goal]] = "S", "G"
        try:
            maze = Maze(tuple("".join(row) for row in cells.reshape(rows, columns)))
        except ValueError:  # the goal cannot be reached
            continue
        if maze.distances()[maze.start] == moves:
            yield maze


def trace_conditions(ablations: Ablations, cap: int) -> dict[str, Condition]:
    """Return the default and the ablations of the trace, by what they are.

    They are those of the unified method without and with incorrect demonstrations, under both
    readings of Eq. 9. While the trace stays as it is, the readings differ in marked pairs alone.
    """
    found = {}
    for changed in ({}, *ablations.traces):
        choices = tuple(changed.items())
        for reading in READINGS:
            one = Specification("ablation", (*choices, ("F-INDEX", reading)))
            for (method, _), condition in maze_conditions(one, cap).items():
                if method != "adaboost":
                    name = Specification("ablation", choices).name
                    label = METHODS[method].label
                    found[f"{label}, {F_LABELS[reading]}, {name}"] = condition
    return found


def numbered_conditions(ablations: Ablations, cap: int) -> dict[tuple[int, str], Condition]:
    """Return conditions with ever more incorrect demonstrations, from none to all pairs.

    Keys are the number of demonstrations and the reading of Eq. 9.
    """
    demos = _maze_demos("open", Expert())
    every = _each_wrong_pair(demos, np.random.SeedSequence(ablations.seed))
    found = {}
    for number in ablations.numbers:
        n = len(every) if number == "all" else number
        some = replace(demos, incorrect=tuple(every[:n]))
        method = "unified-incorrect" if n else "unified"
        for f in READINGS:
            params = Params.of(f_index=f, max_iterations=cap, incorrect="all" if n else "none")
            found[n, f] = Condition(some, method, params)
    return found


def _each_wrong_pair(demos: Demos, seed: np.random.SeedSequence) -> list[Demo]:
    """Return a demonstration of each pair that the expert does not take, in random order.

    It is a shortest path from the start to the pair's state, and then the pair's action.
    """
    maze = as_maze(demos.environment)
    right = visited(demos.correct, shape=(maze.n_states, maze.n_actions))
    ways: dict[int, list[int]] = {maze.start: []}
    waiting = [maze.start]
    for state in waiting:  # grows while it is read
        for action, there in enumerate(maze.next_state[state].tolist()):
            if there not in ways and state != maze.goal:
                ways[there] = [*ways[state], action]
                waiting.append(there)
    pairs = [
        (state, action)
        for state in ways
        if state != maze.goal
        for action in range(maze.n_actions)
        if not right[state, action]
    ]
    order = np.random.default_rng(seed).permutation(len(pairs))
    found = []
    for number, (state, action) in enumerate(pairs[at] for at in order.tolist()):
        actions = [*ways[state], action]
        found.append(Demo(f"pair-{number}", "pair", maze.replay(actions), np.array(actions)))
    return found
