from __future__ import annotations

from dataclasses import replace

import pandas as pd
import pytest

from replication import Demos
from replication.errors import UserError
from replication.evidence.experiments import (
    EXPERIMENTS,
    SETS,
    condition_of,
    main_trials,
    method_conditions,
    rule_conditions,
    set_conditions,
    under,
)
from replication.irl import READINGS
from replication.paper.register import ChoiceError
from replication.trials.compute import trial_key
from replication.trials.measures import factors


def test_both_readings_stand_side_by_side(small_demos: Demos) -> None:
    """Every method with a trace is there under F_i and F_(i+1), AdaBoost-IRL once."""
    keys = set(method_conditions(small_demos, {}))
    assert keys == {("adaboost", "")} | {
        (method, f) for method in ("unified", "unified-incorrect") for f in READINGS
    }


def test_choices_reach_every_setting(small_demos: Demos) -> None:
    """A notebook's choices apply to all methods; the reading of Eq. 9 is not one of them."""
    conditions = method_conditions(small_demos, {"alpha": 0.1})
    assert {condition.params.update.alpha for condition in conditions.values()} == {0.1}
    with pytest.raises(ChoiceError, match="f_index"):
        method_conditions(small_demos, {"f_index": "updated"})


def test_sets_without_their_kinds_are_left_out(small_demos: Demos) -> None:
    """A user's file with fewer kinds gets the sets that it can form, the empty one always."""
    names = {kinds for kinds, _ in set_conditions(small_demos.select("hit"), {})}
    assert names == {"none", "hit"}
    assert {kinds for kinds, _ in set_conditions(small_demos, {})} == set(SETS)
    own = replace(small_demos, incorrect=(replace(small_demos.incorrect[0], kind="late"),))
    assert {kinds for kinds, _ in set_conditions(own, {})} == {"none", "all"}
    assert {kinds for kinds, _ in set_conditions(small_demos.select("none"), {})} == {"none"}


def test_default_set_shares_its_trials_with_the_table(small_demos: Demos) -> None:
    """The default set and the empty set are the table's own conditions, not computed twice."""
    conditions, sets = method_conditions(small_demos, {}), set_conditions(small_demos, {})
    for f in READINGS:
        assert sets["hit+detour", f] == conditions["unified-incorrect", f]
        assert sets["none", f] == conditions["unified", f]


def test_every_reading_of_adaboost_is_a_setting(small_demos: Demos) -> None:
    """The registered readings are all there, the default among them, and differ only in that."""
    rules = rule_conditions(small_demos, {"alpha": 0.1})
    assert rules["mismatch"] == method_conditions(small_demos, {"alpha": 0.1})["adaboost", ""]
    assert {name: condition.params.update.adaboost_rule for name, condition in rules.items()} == {
        name: name for name in rules
    }
    assert len(rules) == 5


@pytest.mark.parametrize("task", list(EXPERIMENTS))
def test_a_condition_is_rebuilt_from_its_row(task: str) -> None:
    """What a published row says of its condition is enough to compute the same trial again."""
    conditions = list(EXPERIMENTS[task].conditions().values())
    if task != "soccer":
        demos, choices = conditions[0].demos, EXPERIMENTS[task].choices
        conditions += set_conditions(demos, choices).values()
    for condition in conditions:
        again = condition_of(**factors(condition))
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
        ("open-maze", "unified-incorrect", "printed", "hits"),
        ("soccer", "adaboost", "printed", "none"),
    ],
)
def test_rows_of_no_condition_are_refused(row: tuple[str, str, str, str]) -> None:
    """A misspelt row, or one that no condition gives, is refused in one line."""
    with pytest.raises(UserError) as caught:
        condition_of(*row)
    assert "\n" not in str(caught.value)


def test_main_trials_are_those_of_the_default_sets() -> None:
    """The rows of other sets are left out, each task by its own default."""
    trials = pd.DataFrame(
        {
            "task": ["open-maze"] * 3 + ["soccer"] * 2,
            "set": ["none", "hit+detour", "hit", "none", "all"],
        }
    )
    assert main_trials(trials).index.tolist() == [0, 1, 3, 4]


def test_a_method_without_a_trace_counts_under_both_readings() -> None:
    """Rows are taken by their reading; an empty one fits each."""
    rows = pd.DataFrame({"reading": ["", "printed", "updated"]})
    assert under(rows, "printed").index.tolist() == [0, 1]
    assert under(rows, "updated").index.tolist() == [0, 2]
