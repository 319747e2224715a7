"""The declared specifications: sets of choices under which the claims are evaluated again.

The file ``specifications.toml`` declares them; this module reads and checks it.
:mod:`replication.evidence.variations` makes conditions of them.
"""

from __future__ import annotations

import tomllib
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Annotated, Literal

import numpy as np
from pydantic import Field, ValidationError

from replication.demos.checks import DemoError
from replication.demos.files import load_demos
from replication.evidence.claims import ClaimError, Strict, load_claims
from replication.evidence.experiments import EXPERIMENTS
from replication.files import read_text
from replication.paper.register import ChoiceError, Value, load_choices

FILE = Path(__file__).with_name("specifications.toml")

MAPS = ("open", "obstacles", "random-1", "random-2", "random-3")
DEFAULT = "default"
"""The name of the specification that changes nothing."""

RANDOM = "random"
"""As a value of DEMO-SHAPE: a shortest path drawn at random (DEMO-PATH = random-1)."""

Count = Annotated[int, Field(ge=1)]
Seed = Annotated[int, Field(ge=0)]
Trials = Annotated[int, Field(ge=2)]
"""Intervals need two trials at least."""


class Single(Strict):
    """Specifications that change one choice each."""

    trials: Trials
    choices: Mapping[str, tuple[Value, ...]]


class Factorial(Single):
    """Specifications that set all choices at once: a balanced fraction of the full factorial."""

    size: Count
    seed: Seed


class Mazes(Strict):
    """What is declared for the mazes."""

    claims: tuple[str, ...]
    single: Single
    factorial: Factorial


class Soccer(Strict):
    """What is declared for robot soccer."""

    claims: tuple[str, ...]
    single: Single


class Ablations(Strict):
    """The method with parts of it switched off, and the number of incorrect demonstrations."""

    trials: Trials
    traces: tuple[Mapping[str, float], ...]
    seed: Seed
    numbers: tuple[Annotated[int, Field(ge=0)] | Literal["all"], ...]


class Declared(Strict):
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
        """The choices in words, see :func:`named_choices`."""
        return " ".join(f"{id}={value}" for id, value in self.choices) or DEFAULT


def named_choices(name: str) -> dict[str, str]:
    """Return the values, as text, that the name of a specification gives to its choices.

    Examples
    --------
    >>> named_choices("MAP=open TIES=first"), named_choices("default")
    ({'MAP': 'open', 'TIES': 'first'}, {})
    """
    return dict(word.split("=", 1) for word in name.split() if "=" in word)


def sort_key(value: object) -> tuple[bool, float, str]:
    """Return a key that sorts the values of a choice: numbers, also as text, before words."""
    try:
        return False, float(str(value)), ""
    except ValueError:
        return True, 0.0, str(value)


# --- reading ---------------------------------------------------------------------------------


@cache
def load_specifications() -> Declared:
    """Return the specifications of the package."""
    return parse_specifications(read_text(FILE))


def check_declared() -> None:
    """Run the fast checks of the package's specifications (half a second).

    Beside the file, these are the kinds of incorrect demonstrations, which the stored ones have to
    have. Making all conditions takes twenty seconds: random mazes and soccer worlds are made anew.

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
        demos = load_demos(EXPERIMENTS[task].demos)
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
        plan = Declared(**tomllib.loads(text))
    except tomllib.TOMLDecodeError as error:
        raise ChoiceError(f"specifications.toml is not TOML: {error}") from None
    except ValidationError as error:
        first = error.errors()[0]
        place = ".".join(map(str, first["loc"]))
        raise ChoiceError(f"specifications.toml, {place}: {first['msg']}") from None
    for place, ids, task in (
        ("mazes", plan.mazes.claims, "open-maze"),
        ("soccer", plan.soccer.claims, "soccer"),
    ):
        for id in ids:
            try:
                _check_claim(id, task)
            except ClaimError as error:
                raise ClaimError(f"specifications.toml, {place}.claims: {error}") from None
    tables = {
        "mazes.single": plan.mazes.single.choices,
        "mazes.factorial": plan.mazes.factorial.choices,
        "soccer.single": plan.soccer.single.choices,
        **{
            f"ablations.traces[{n}]": {id: (value,) for id, value in trace.items()}
            for n, trace in enumerate(plan.ablations.traces)
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
    if 0 not in plan.ablations.numbers:
        raise ChoiceError(
            "specifications.toml, ablations.numbers: add 0, against which savings are counted"
        )
    for id, values in plan.mazes.factorial.choices.items():
        if plan.mazes.factorial.size % len(values):
            raise ChoiceError(
                f"specifications.toml, mazes.factorial: {len(values)} values of {id} cannot be "
                f"balanced over {plan.mazes.factorial.size} specifications"
            )
    return plan


def _check_claim(id: str, task: str) -> None:
    """Refuse a claim of another task, or one that has no effect under a specification."""
    claim = load_claims().by_id(id)
    if claim.is_published:
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
        load_choices()["EPISODES"].registered(value)
    elif (id, value) != ("DEMO-SHAPE", RANDOM):
        if not load_choices()[id].field:
            raise ChoiceError(f"{id} has no parameter that could be changed")
        load_choices()[id].registered(value)


# --- the specifications ----------------------------------------------------------------------


def default_of(id: str) -> Value:
    """Return the default of a choice that a specification can change."""
    return "open" if id == "MAP" else load_choices()[id].default


def single_specifications(choices: Mapping[str, tuple[Value, ...]]) -> list[Specification]:
    """Return the default, and then one specification for each other value of each choice."""
    changed = [((id, value),) for id, values in choices.items() for value in values]
    return [Specification("single", choices) for choices in ((), *changed)]


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
