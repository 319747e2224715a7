"""The design of the experiments: the conditions that stand behind each figure and table."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from replication.demos.files import load_demos
from replication.demos.model import Demos
from replication.errors import unknown
from replication.files import stored
from replication.irl import METHODS, get_method
from replication.paper.params import Params
from replication.paper.published import SOCCER
from replication.paper.register import ChoiceError, load_choices
from replication.trials.condition import Condition
from replication.trials.measures import factors

NAMED = "hit+detour"
"""The kinds that the text names for the mazes (sections IV-A and IV-B)."""

GENERAL = "hit+detour+opposite"
"""The general list of section III-B, as far as it makes sense in a maze."""

SETS = (
    "none",
    "hit",
    "detour",
    "near-detour",
    "far-detour",
    "hit+near-detour",
    "hit+far-detour",
    NAMED,
    "opposite",
    GENERAL,
)
"""The sets of incorrect demonstrations of the mazes that are compared (INCORRECT-KINDS)."""

NONE = "none"
"""The set of a method that is not given incorrect demonstrations."""

Key = tuple[str, str, str]
"""Method, reading of Eq. 9, and set of incorrect demonstrations, as in a table of trials.

The reading is empty for a method without a trace.
"""


@dataclass(frozen=True)
class Experiment:
    """One of the paper's experiments: the file of its demonstrations, its choices, its methods.

    `sets` are the sets of incorrect demonstrations by which it is judged.
    """

    demos: Path
    choices: Mapping[str, Any]
    methods: tuple[str, ...]
    sets: tuple[str, ...]

    def conditions(self) -> dict[Key, Condition]:
        """Return the conditions that stand behind its figures and tables."""
        demos = load_demos(self.demos)
        return conditions_of(demos, self.choices, self.methods, self.sets)


EXPERIMENTS = {
    "open-maze": Experiment(stored("open_maze"), {}, tuple(METHODS), (NAMED, GENERAL)),
    "obstacle-maze": Experiment(stored("obstacle_maze"), {}, tuple(METHODS), (NAMED, GENERAL)),
    "soccer": Experiment(stored("soccer"), SOCCER, ("unified", "unified-incorrect"), ("all",)),
}
"""By task. The paper has no AdaBoost-IRL in the maze with obstacles: there it is an extension.

:meta hide-value:
"""


def conditions_of(
    demos: Demos,
    choices: Mapping[str, Any],
    methods: Iterable[str] = tuple(METHODS),
    sets: Iterable[str] = (NAMED, GENERAL),
) -> dict[Key, Condition]:
    """Return a condition for each method, reading of Eq. 9 and set of incorrect demonstrations.

    Sets with a kind that the demonstrations lack are left out; if nothing is left, all of the
    incorrect demonstrations are one set, even if there are none.

    Raises
    ------
    ChoiceError
        If a choice is unknown, its value is not registered, or it is a reading or a set.
    """
    for name in ("f_index", "incorrect"):
        if name in choices:
            raise ChoiceError(f"choices: {name} is run in every way; leave it out")
    shown = [
        name
        for name in sets
        if name != NONE and (name == "all" or {*name.split("+")} <= {*demos.kinds})
    ]
    shown = shown or ["all"]
    return {
        (name, reading, set): Condition(demos, name, _params(choices, reading, set))
        for name in methods
        for set in (shown if get_method(name).uses_incorrect else [NONE])
        for reading in get_method(name).readings
    }


def rule_conditions(demos: Demos, choices: Mapping[str, Any]) -> dict[str, Condition]:
    """Return a condition for each registered reading of AdaBoost-IRL (ADABOOST-RULE)."""
    entry = load_choices()["ADABOOST-RULE"]
    return {
        str(rule): Condition(demos, "adaboost", Params.of(**{**choices, "adaboost_rule": rule}))
        for rule in (entry.default, *entry.alternatives)
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
    condition = Condition(load_demos(experiment.demos), method, params)
    if factors(condition) != {"task": task, "method": method, "reading": reading, "set": set}:
        raise ChoiceError(f"{task}: {method} has no reading {reading!r} with the set {set!r}")
    return condition


def _params(choices: Mapping[str, Any], reading: str, set: str) -> Params:
    chosen = {"f_index": reading} if reading else {}
    return Params.of(**{**chosen, **choices, "incorrect": set})


def main_trials(trials: pd.DataFrame) -> pd.DataFrame:
    """Return the rows of the experiments' own conditions, without the other sets."""
    judged = {(task, set) for task, each in EXPERIMENTS.items() for set in (NONE, *each.sets)}
    return trials[[key in judged for key in zip(trials["task"], trials["set"], strict=True)]]


def under(rows: pd.DataFrame, reading: str) -> pd.DataFrame:
    """Return the rows that count under a reading of Eq. 9, see :meth:`Method.under`."""
    pairs = zip(rows["method"], rows["reading"], strict=True)
    counts = [get_method(method).under(reading) == own for method, own in pairs]
    return rows[np.array(counts, dtype=bool)]
