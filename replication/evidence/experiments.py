"""What the notebooks compare: the conditions behind each figure and table."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any

from replication.demos.files import load_demos
from replication.demos.model import Demos
from replication.files import resolve
from replication.irl import METHODS, READINGS, get_method
from replication.paper.params import Params
from replication.paper.published import SOCCER
from replication.paper.register import ChoiceError, load_choices
from replication.trials.condition import Condition

F_LABELS = {"": "–", "printed": "Fᵢ (printed)", "updated": "Fᵢ₊₁ (updated)"}
"""How an F index reads in tables and figures; a method without a trace has none."""

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

Key = tuple[str, str]
"""Method, and F index; the F index is empty for a method without a trace."""


@dataclass(frozen=True)
class Experiment:
    """One of the paper's experiments: its demonstrations, its own parameters and its methods."""

    demos: str
    choices: Mapping[str, Any]
    methods: tuple[str, ...]

    def conditions(self) -> dict[Key, Condition]:
        """Return the conditions that stand behind its figures and tables."""
        return method_conditions(load_demos(resolve(self.demos)), self.choices, self.methods)


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
    names = list(methods)
    keys = [(name, f) for f in ("", *READINGS) for name in names if f in get_method(name).readings]
    return {
        (name, f): Condition(demos, name, Params.of(**choices, **({"f_index": f} if f else {})))
        for name, f in keys
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
    """Return a condition for each set of incorrect demonstrations; keys are set and F index.

    Sets with a kind that the demonstrations lack are left out; demonstrations of other kinds than
    ours form one set. The empty set is the unified method without incorrect demonstrations.
    """
    formed = [one for one in sets if one == "none" or set(one.split("+")) <= set(demos.kinds)]
    if formed == ["none"] and demos.kinds:
        formed.append("all")
    found = {}
    for kinds in formed:
        method = "unified" if kinds == "none" else "unified-incorrect"
        # The method without incorrect demonstrations keeps the default's name, and so its trials.
        chosen = {} if kinds == "none" else {"incorrect": kinds}
        for f in READINGS:
            params = Params.of(**{**choices, **chosen}, f_index=f)
            found[kinds, f] = Condition(demos, method, params)
    return found


def condition_of(task: str, method: str, reading: str, set: str) -> Condition:
    """Return the condition of a row of a table of trials.

    Raises
    ------
    KeyError, ValueError
        If there is no such task, or it has no such condition.
    """
    experiment = EXPERIMENTS[task]
    values = {**experiment.choices, **({"f_index": reading} if reading else {})}
    if set != "none":
        values["incorrect"] = set
    return Condition(load_demos(resolve(experiment.demos)), method, Params.of(**values))
