from __future__ import annotations

import dataclasses
import math
from typing import Any

import pytest

from replication.demos.maze_expert import Expert
from replication.paper.params import Demonstrations, Learner, Loop, Params, Update
from replication.paper.register import Choice, ChoiceError, Chosen, load_choices
from replication.trials.measures import Report

KINDS: tuple[type[Chosen], ...] = (Demonstrations, Learner, Loop, Update, Expert, Report)
FIELDS = [
    (kind, field.name, load_choices()[field.metadata["choice"]])
    for kind in KINDS
    for field in dataclasses.fields(kind)  # type: ignore[arg-type] # they are dataclasses
]
NAMES = [f"{kind.__name__}.{name}" for kind, name, _ in FIELDS]
JUNK: list[Any] = [
    *(None, True, False, "", "zero ", "NaN", b"zero", [], [0.5], {}, 0.123456),
    *(math.nan, math.inf, -math.inf, -1, 10**400, -(10**400)),
]


@pytest.mark.parametrize(("kind", "name", "entry"), FIELDS, ids=NAMES)
def test_registered_values_are_accepted(kind: type[Chosen], name: str, entry: Choice) -> None:
    """The default, each alternative and the ends of a range are taken, as the default's type."""
    assert getattr(kind(), name) == entry.default
    for value in (entry.default, *entry.alternatives, *(entry.range or ())):
        held = getattr(kind(**{name: value}), name)
        assert held == value
        assert type(held) is type(entry.default)


@pytest.mark.parametrize(("kind", "name", "entry"), FIELDS, ids=NAMES)
def test_everything_else_is_refused(kind: type[Chosen], name: str, entry: Choice) -> None:
    """Flags, NaN, infinities, other types and unregistered numbers raise and name the field."""
    wrong = list(JUNK)
    if entry.range is not None:
        wrong += [entry.range[0] - 1, entry.range[1] + 1]
        if isinstance(entry.default, float):
            wrong.remove(0.123456)
    if isinstance(entry.default, int):
        wrong += [entry.default + 0.5, str(entry.default)]
    if isinstance(entry.default, str):
        wrong += [0, 1, 0.0]
    for value in wrong:
        with pytest.raises(ChoiceError, match=rf"^{kind.__name__}\.{name} = .*{entry.id}"):
            kind(**{name: value})


def test_values_make_the_same_parameters_again() -> None:
    """Values by name are complete: they build equal parameters, in an order that never changes."""
    chosen = Params.of(alpha=0.9, ties="first", incorrect="all", max_iterations=7)
    assert Params.of(**chosen.values()) == chosen
    assert list(chosen.values()) == list(Params().values())
    assert chosen.values()["max_iterations"] == 7


def test_names_are_unambiguous() -> None:
    """No two concerns share the name of a field, so that a name alone says which is meant."""
    parts = (Demonstrations, Learner, Loop, Update)
    names = [field.name for part in parts for field in dataclasses.fields(part)]
    assert len(set(names)) == len(names) == len(Params().values())


def test_unknown_name() -> None:
    """A misspelt name is refused with the nearest one and the list of all, one of ours as well."""
    for name, near in (("aplha", "alpha"), ("q-start", "q_start"), ("episode", "episodes")):
        with pytest.raises(ChoiceError, match=f"unknown parameter '{name}'.*mean '{near}'.*w_st"):
            Params.of(**{name: 1})
    for name in ("leg", "path", "trials", "early", "learner"):  # these determine no trial
        with pytest.raises(ChoiceError, match="unknown parameter"):
            Params.of(**{name: 4})


def test_parameters_are_frozen() -> None:
    """Parameters cannot be changed past their check, and equal ones have equal hashes."""
    chosen = Params.of(alpha=0.1)
    with pytest.raises(dataclasses.FrozenInstanceError):
        chosen.update.alpha = 2.0  # type: ignore[misc]
    assert hash(chosen) == hash(Params.of(alpha=0.1))
