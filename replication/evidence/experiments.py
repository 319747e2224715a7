"""The design of the experiments: the conditions that stand behind each figure and table."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any

import pandas as pd

from replication.demos.files import load_demos
from replication.demos.model import Demos
from replication.errors import unknown
from replication.files import resolve
from replication.irl import METHODS, READINGS, get_method
from replication.paper.params import Params
from replication.paper.published import SOCCER
from replication.paper.register import ChoiceError, load_choices
from replication.trials.condition import Condition
from replication.trials.measures import factors

SETS = (
    "none",
    "hit",
    "detour",
    "near-detour",
    "far-detour",
    "hit+near-detour",
    "hit+far-detour",
    "hit+detour",
    "opposite",
    "hit+detour+opposite",
)
"""The sets of incorrect demonstrations that stand beside the default (INCORRECT-KINDS)."""

SETS_METHOD = "unified-incorrect"
"""The method that is given each set; the empty set stands for its baseline."""

Key = tuple[str, str]
"""Method, and reading of Eq. 9; the reading is empty for a method without a trace."""


@dataclass(frozen=True)
class Experiment:
    """One of the paper's experiments: the file of its demonstrations, its choices, its methods."""

    demos: str
    choices: Mapping[str, Any]
    methods: tuple[str, ...]

    def conditions(self) -> dict[Key, Condition]:
        """Return the conditions that stand behind its figures and tables."""
        return method_conditions(load_demos(resolve(self.demos)), self.choices, self.methods)

    @property
    def set(self) -> str:
        """The set of incorrect demonstrations that its methods are given."""
        return Params.of(**self.choices).demonstrations.incorrect


EXPERIMENTS = {
    "open-maze": Experiment("data/demos/open_maze.json", {}, tuple(METHODS)),
    "obstacle-maze": Experiment("data/demos/obstacle_maze.json", {}, tuple(METHODS)),
    "soccer": Experiment(
        "data/demos/soccer.json",
        {**SOCCER, "incorrect": "all"},
        ("unified", "unified-incorrect"),
    ),
}
"""By task. The paper has no AdaBoost-IRL in the maze with obstacles: there it is an extension."""


def method_conditions(
    demos: Demos, choices: Mapping[str, Any], methods: Iterable[str] = tuple(METHODS)
) -> dict[Key, Condition]:
    """Return a condition for each method, under both readings of Eq. 9 where it has a trace.

    Raises
    ------
    ChoiceError
        If a choice is unknown, its value is not registered, or it is the reading of Eq. 9.
    """
    if "f_index" in choices:
        raise ChoiceError("choices: f_index is run both ways; leave it out")
    return {
        (name, reading): Condition(demos, name, _params(choices, reading))
        for reading in ("", *READINGS)
        for name in methods
        if reading in get_method(name).readings
    }


def rule_conditions(demos: Demos, choices: Mapping[str, Any]) -> dict[str, Condition]:
    """Return a condition for each registered reading of AdaBoost-IRL (ADABOOST-RULE)."""
    entry = load_choices()["ADABOOST-RULE"]
    return {
        str(rule): Condition(demos, "adaboost", Params.of(**{**choices, "adaboost_rule": rule}))
        for rule in (entry.default, *entry.alternatives)
    }


def set_conditions(
    demos: Demos, choices: Mapping[str, Any], sets: Iterable[str] = SETS
) -> dict[Key, Condition]:
    """Return a condition for each set of incorrect demonstrations, by set and reading of Eq. 9.

    Sets with a kind that the demonstrations lack are left out; demonstrations of other kinds than
    ours form one set.
    """
    names = [name for name in sets if name == "none" or {*name.split("+")} <= {*demos.kinds}]
    if names == ["none"] and demos.kinds:
        names.append("all")
    return {
        (name, reading): Condition(
            demos,
            get_method(SETS_METHOD).baseline if name == "none" else SETS_METHOD,
            _params(choices, reading, name),
        )
        for name in names
        for reading in READINGS
    }


def condition_of(task: str, method: str, reading: str, set: str) -> Condition:
    """Return the condition whose :func:`replication.trials.measures.factors` these are.

    Raises
    ------
    ChoiceError
        If the experiments have no such condition.
    """
    if task not in EXPERIMENTS:
        raise ChoiceError(unknown(task, EXPERIMENTS, "task"))
    experiment = EXPERIMENTS[task]
    params = _params(experiment.choices, reading, set)
    condition = Condition(load_demos(resolve(experiment.demos)), method, params)
    if factors(condition) != {"task": task, "method": method, "reading": reading, "set": set}:
        raise ChoiceError(f"{task}: {method} has no reading {reading!r} with the set {set!r}")
    return condition


def _params(choices: Mapping[str, Any], reading: str, set: str = "none") -> Params:
    # A method without incorrect demonstrations keeps the default, by which its errors are counted.
    chosen = {"f_index": reading} if reading else {}
    chosen |= {} if set == "none" else {"incorrect": set}
    return Params.of(**{**choices, **chosen})


def main_trials(trials: pd.DataFrame) -> pd.DataFrame:
    """Return the rows of the experiments' own conditions, without the other sets."""
    default = trials["task"].map({task: each.set for task, each in EXPERIMENTS.items()})
    return trials[(trials["set"] == "none") | (trials["set"] == default)]


def applies(own: str, reading: str) -> bool:
    """Return whether what has one reading of Eq. 9, or none, counts under another one.

    A method without a trace counts under both.

    Examples
    --------
    >>> [applies(own, "printed") for own in ("", "printed", "updated")]
    [True, True, False]
    """
    return own in ("", reading)


def under(rows: pd.DataFrame, reading: str) -> pd.DataFrame:
    """Return the rows that count under a reading of Eq. 9."""
    return rows[[applies(own, reading) for own in rows["reading"]]]
