from __future__ import annotations

import dataclasses
import inspect
import math
import pydoc
from collections.abc import Collection
from pathlib import Path
from typing import Any

import pytest

from replication.demos.maze_expert import Expert
from replication.demos.soccer_expert import SoccerExpert
from replication.envs.soccer.rules import SoccerParams
from replication.files import PROJECT
from replication.irl import READINGS
from replication.learning import reference
from replication.paper import params, register
from replication.paper.register import Choice, ChoiceError, Chosen, load_choices
from replication.trials.measures import Report

ENTRIES = list(load_choices().values())
IDS = [entry.id for entry in ENTRIES]
CLASSES = [
    kind
    for _, kind in inspect.getmembers(params, inspect.isclass)
    if issubclass(kind, Chosen) and kind is not Chosen
]

WHOLE = Choice("N", "p", "o", 5, "r", range=(1, 9), field="Some.n")
REAL = Choice("X", "p", "o", 0.5, "r", range=(0.0, 1.0), field="Some.x")
WORD = Choice("WORD", "p", "o", "new", "r", alternatives=("kept", "reset"), field="Some.word")
STEP = Choice("STEP", "p", "o", 4, "r", alternatives=(1, 2), range=(1, 9), field="Some.step")


@pytest.mark.parametrize("entry", ENTRIES, ids=IDS)
def test_entry_is_whole(entry: Choice) -> None:
    """Each entry says where, what, why and which, and has its place in one kind of locus."""
    assert all([entry.id, entry.place, entry.open, entry.rule, entry.default != ""])
    assert [bool(locus) for locus in (entry.field, entry.data, entry.code)].count(True) == 1
    assert entry.id == entry.id.upper()


@pytest.mark.parametrize("entry", ENTRIES, ids=IDS)
def test_values_are_distinct_and_of_one_type(entry: Choice) -> None:
    """A number has a range, a word alternatives, and what is no parameter neither."""
    values = (entry.default, *entry.alternatives)
    assert len(set(values)) == len(values)
    assert {type(value) for value in values} == {type(entry.default)}
    number = isinstance(entry.default, int | float)
    assert (entry.range is not None) == (bool(entry.field) and number)
    assert bool(entry.alternatives) or entry.range or not entry.field
    if entry.range is not None:
        assert all(entry.range[0] <= float(value) <= entry.range[1] for value in values)


def test_what_is_registered_is_told_from_what_is_accepted() -> None:
    """The default and the alternatives are registered; without alternatives, the whole range is."""
    assert [STEP.registered(value) for value in (4, 1, 2.0)] == [4, 1, 2]
    assert (WHOLE.registered(7), WORD.registered("kept"), STEP.check(3)) == (7, "kept", 3)
    message = r"^Some\.step = 3 is not registered \(STEP\): use 4 or 1, 2$"
    with pytest.raises(ChoiceError, match=message):
        STEP.registered(3)
    assert (WHOLE.others, WORD.others, STEP.others) == ("", "kept, reset", "1, 2")


def test_fields_and_entries_match() -> None:
    """Each field of a parameter dataclass is one entry's field, and the other way round."""
    declared = {
        f"{kind.__name__}.{field.name}": field.metadata.get("choice")
        for kind in (*CLASSES, SoccerParams, Expert, SoccerExpert, Report)
        for field in dataclasses.fields(kind)
    }
    assert declared == {entry.field: entry.id for entry in ENTRIES if entry.field}


def test_words_of_the_register_are_those_of_the_code() -> None:
    """What a choice accepts is what the code that acts on it knows: no more and no less."""
    known: dict[str, Collection[object]] = {
        "ARITHMETIC": reference.ROUNDED,
        "F-INDEX": READINGS,
        "TIES": ("random", "first"),
        "ROLLOUT-TIES": ("random", "first"),
        "Q-START": ("kept", "reset"),
        "W-START": ("zero", "uniform-0.001"),
        "W-NORM": ("free", "unit"),
        "GOAL-VALUE": ("zero", "bootstrap"),
    }
    for id, values in known.items():
        entry = load_choices()[id]
        assert {entry.default, *entry.alternatives} == {*values}, id
    assert READINGS[0] == load_choices()["F-INDEX"].default
    tolerances = load_choices()["TIE-TOLERANCE"]
    assert all(0 <= float(value) < 1 for value in (tolerances.default, *tolerances.alternatives))


def test_every_parameter_dataclass_is_checked() -> None:
    """No dataclass of the module has fields that the register does not see."""
    kinds = {kind for _, kind in inspect.getmembers(params, dataclasses.is_dataclass)}
    assert kinds == {*CLASSES, params.Params}


@pytest.mark.parametrize("entry", [e for e in ENTRIES if not e.field], ids=lambda e: e.id)
def test_data_and_code_exist(entry: Choice) -> None:
    """Any other choice is embodied by a file of the project, or by an object of the package."""
    if entry.data:
        assert (PROJECT / entry.data).is_file()
    else:
        assert entry.code.startswith("replication.")
        assert pydoc.locate(entry.code) is not None


def test_accepted_values_are_named() -> None:
    """A choice without a range names its default among the accepted values."""
    for entry in ENTRIES:
        assert not entry.field or entry.range or repr(entry.default) in entry.accepted


@pytest.mark.parametrize("wrong", ["Kept", "kept ", "", 1, 0.5, True, None, ["kept"], b"kept"])
def test_wrong_words_are_refused_with_the_list(wrong: Any) -> None:
    """A word that is not registered is refused; the error names field, id and accepted values."""
    with pytest.raises(ChoiceError) as caught:
        WORD.check(wrong)
    assert str(caught.value) == (
        f"Some.word = {wrong!r} is not accepted (choice WORD): use 'new', 'kept', 'reset'"
    )


@pytest.mark.parametrize(
    "wrong",
    ["5", True, False, None, [5], 2.5, 0, 10, 1 + 1e-15, math.nan, math.inf, -math.inf, 10**400],
)
def test_wrong_numbers_are_refused(wrong: Any) -> None:
    """A value of the wrong type, a fraction, and what is outside the range are refused."""
    with pytest.raises(ChoiceError, match=r"Some\.n = .* \(choice N\): use a whole number from 1 "):
        WHOLE.check(wrong)
    if wrong not in (0, 5):
        with pytest.raises(ChoiceError, match=r"choice X\): use a number from 0\.0 to 1\.0$"):
            REAL.check(wrong)
    with pytest.raises(ChoiceError, match=r"\(choice STEP\): use a whole number from 1 to 9$"):
        STEP.check(wrong)


def test_numbers_take_the_type_of_the_default() -> None:
    """A whole float counts as an integer where one is due, an integer as a float."""
    for entry, value, due in ((WHOLE, 7.0, 7), (STEP, 2.0, 2), (REAL, 1, 1.0)):
        checked = entry.check(value)
        assert checked == due
        assert type(checked) is type(due)


@pytest.mark.parametrize(
    ("more", "message"),
    [('id = "A"', "has the id 'A' twice"), ('id = "B"\ntypo = 1', "entry 'B': .*'typo'")],
)
def test_register_with_a_slip_is_refused(
    more: str, message: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """An id that stands twice, and a key that does not exist, stop the program."""
    rest = '\nplace = "p"\nopen = "o"\ndefault = 1\nrule = "r"\n'
    text = f'[[choice]]\nid = "A"{rest}[[choice]]\n{more}{rest}'
    (tmp_path / "choices.toml").write_text(text)
    monkeypatch.setattr(register, "__file__", str(tmp_path / "register.py"))
    with pytest.raises(ChoiceError, match=message):
        load_choices.__wrapped__()
