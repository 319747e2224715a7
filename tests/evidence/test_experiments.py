from __future__ import annotations

from dataclasses import replace

import pandas as pd
import pytest

from replication import Demos
from replication.errors import UserError
from replication.evidence.experiments import (
    EXPERIMENTS,
    GENERAL,
    NAMED,
    NONE,
    SETS,
    condition_of,
    conditions_of,
    main_trials,
    rule_conditions,
    under,
)
from replication.irl import METHODS, READINGS
from replication.paper.register import ChoiceError, load_choices
from replication.trials.compute import trial_key
from replication.trials.measures import factors

BOTH = ("printed", "updated")


def test_every_reading_and_set_stands_side_by_side(small_demos: Demos) -> None:
    """AdaBoost-IRL once, the method without incorrect ones under both traces, with them in all."""
    keys = list(conditions_of(small_demos, {}))
    assert keys == [
        ("adaboost", "", NONE),
        *(("unified", f, NONE) for f in BOTH),
        *(("unified-incorrect", f, set) for set in (NAMED, GENERAL) for f in READINGS),
    ]


def test_key_says_what_a_condition_is(small_demos: Demos) -> None:
    """The key has the method, reading and set that the condition runs with and is given."""
    for (method, reading, set), condition in conditions_of(small_demos, {}, sets=SETS).items():
        assert condition.method == method
        assert condition.params.update.f_index == (reading or "printed")
        shown = {demo.kind for demo in condition.selected.incorrect}
        assert shown == ({*set.split("+")} if set != NONE else {*()})
        own = {"task": "small", "method": method, "reading": reading, "set": set}
        assert factors(condition) == own


def test_named_kinds_and_general_list_are_those_of_the_paper() -> None:
    """IV-A names hits and detours; III-B's list adds the opposite direction; soccer has all."""
    assert load_choices()["INCORRECT-KINDS"].default == NAMED == "hit+detour"
    assert GENERAL == "hit+detour+opposite"
    assert {task: one.sets for task, one in EXPERIMENTS.items()} == {
        "open-maze": (NAMED, GENERAL),
        "obstacle-maze": (NAMED, GENERAL),
        "soccer": ("all",),
    }
    assert {NONE, NAMED, GENERAL} < {*SETS}


def test_cells_of_each_experiment() -> None:
    """In the mazes nine conditions; in soccer, without AdaBoost-IRL and with one set, five."""
    sizes = {task: len(one.conditions()) for task, one in EXPERIMENTS.items()}
    assert sizes == {"open-maze": 9, "obstacle-maze": 9, "soccer": 5}
    for task, one in EXPERIMENTS.items():
        for (_, _, set), condition in one.conditions().items():
            assert condition.demos.task == task
            assert set in (NONE, *one.sets)


def test_choices_reach_every_setting(small_demos: Demos) -> None:
    """A notebook's choices apply to all conditions; reading and set are none of them."""
    conditions = conditions_of(small_demos, {"alpha": 0.1})
    assert {condition.params.update.alpha for condition in conditions.values()} == {0.1}
    for name, value in (("f_index", "updated"), ("incorrect", "hit")):
        with pytest.raises(ChoiceError, match=f"choices: {name} is run in every way"):
            conditions_of(small_demos, {name: value})


def test_sets_without_their_kinds_are_left_out(small_demos: Demos) -> None:
    """A user's file with fewer kinds gets the sets that it can form, or else all of them as one."""

    def sets(demos: Demos, among: tuple[str, ...] = (NAMED, GENERAL)) -> list[str]:
        found = conditions_of(demos, {}, ["unified", "unified-incorrect"], among)
        assert {key for key in found if key[0] == "unified"} == {("unified", f, NONE) for f in BOTH}
        return list(dict.fromkeys(set for method, _, set in found if method != "unified"))

    assert sets(small_demos) == [NAMED, GENERAL]
    assert sets(small_demos, SETS) == [set for set in SETS if set != NONE]
    assert sets(small_demos, ("all", NONE)) == ["all"]
    assert sets(small_demos.select("hit+detour")) == [NAMED]
    assert sets(small_demos.select("hit")) == ["all"]
    assert sets(small_demos.select("hit"), SETS) == ["hit"]
    own = replace(small_demos, incorrect=(replace(small_demos.incorrect[0], kind="late"),))
    assert sets(own) == ["all"]
    assert sets(small_demos.select("none")) == ["all"]


def test_every_reading_of_adaboost_is_a_setting(small_demos: Demos) -> None:
    """The registered readings are all there, the default among them, and differ only in that."""
    rules = rule_conditions(small_demos, {"alpha": 0.1})
    own = conditions_of(small_demos, {"alpha": 0.1})["adaboost", "", NONE]
    assert trial_key(rules["mismatch"], 1, 2) == trial_key(own, 1, 2)
    assert {name: condition.params.update.adaboost_rule for name, condition in rules.items()} == {
        name: name for name in rules
    }
    assert len(rules) == 5


@pytest.mark.parametrize("task", list(EXPERIMENTS))
def test_a_condition_is_rebuilt_from_its_row(task: str) -> None:
    """What a published row says of its condition is enough to compute the same trial again."""
    conditions = EXPERIMENTS[task].conditions()
    if task != "soccer":
        demos = next(iter(conditions.values())).demos
        conditions |= conditions_of(demos, EXPERIMENTS[task].choices, METHODS, SETS)
    for key, condition in conditions.items():
        again = condition_of(task, *key)
        assert trial_key(again, 1, 2) == trial_key(condition, 1, 2)
        assert factors(again) == factors(condition)


@pytest.mark.parametrize(
    "row",
    [
        ("openmaze", "unified", "printed", "none"),
        ("open-maze", "unifed", "printed", "none"),
        ("open-maze", "unified", "", "none"),
        ("open-maze", "unified", "both", "none"),
        ("open-maze", "unified", "printed", "hit"),
        ("open-maze", "unified", "at-once", "none"),
        ("open-maze", "adaboost", "printed", "none"),
        ("open-maze", "unified-incorrect", "printed", "hits"),
        ("soccer", "adaboost", "printed", "none"),
    ],
)
def test_rows_of_no_condition_are_refused(row: tuple[str, str, str, str]) -> None:
    """A misspelt row, or one that no condition gives, is refused in one line."""
    with pytest.raises(UserError) as caught:
        condition_of(*row)
    assert "\n" not in str(caught.value)


def test_main_trials_are_those_of_the_judged_sets() -> None:
    """The rows of other sets are left out, each task by its own."""
    trials = pd.DataFrame(
        {
            "task": ["open-maze"] * 5 + ["soccer"] * 3 + ["elsewhere"],
            "set": ["none", NAMED, "hit", GENERAL, "all", "none", "all", NAMED, "none"],
        }
    )
    assert main_trials(trials).index.tolist() == [0, 1, 3, 5, 6]


def test_each_method_counts_once_under_a_reading() -> None:
    """AdaBoost-IRL beside each; without incorrect ones the printed trials beside at-once."""
    rows = pd.DataFrame(
        [(method.name, f) for method in METHODS.values() for f in method.readings],
        columns=["method", "reading"],
    )
    expected = {
        "printed": [("adaboost", ""), ("unified", "printed"), ("unified-incorrect", "printed")],
        "updated": [("adaboost", ""), ("unified", "updated"), ("unified-incorrect", "updated")],
        "at-once": [("adaboost", ""), ("unified", "printed"), ("unified-incorrect", "at-once")],
    }
    for reading, pairs in expected.items():
        found = under(rows, reading)
        assert list(zip(found["method"], found["reading"], strict=True)) == pairs
    assert under(rows.iloc[:0], "printed").empty
