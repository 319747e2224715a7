"""What the notebooks compare: the settings behind each figure and table."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any

from replication.choices import ChoiceError, register
from replication.demos import Demos, load_demos
from replication.irl import METHODS
from replication.paper import SOCCER
from replication.params import Params
from replication.paths import resolve
from replication.setting import Setting

F_INDICES = ("printed", "updated")
"""Both readings of Eq. 9 (choice F-INDEX), reported side by side everywhere."""

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

    def settings(self) -> dict[Key, Setting]:
        """Return the settings that stand behind its figures and tables."""
        return method_settings(load_demos(resolve(self.demos)), self.choices, self.methods)


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


def method_settings(
    demos: Demos, choices: Mapping[str, Any], methods: Iterable[str] = tuple(METHODS)
) -> dict[Key, Setting]:
    """Return a setting for each method, under both readings of Eq. 9 where it has a trace.

    Raises
    ------
    ChoiceError
        If a choice is unknown, its value is not registered, or it is the reading of Eq. 9.
    """
    if "f_index" in choices:
        raise ChoiceError("choices: f_index is run both ways; leave it out")
    names = list(methods)
    keys = [("adaboost", "")] if "adaboost" in names else []
    keys += [(name, f) for f in F_INDICES for name in names if name != "adaboost"]
    return {
        (name, f): Setting(demos, name, Params.of(**choices, **({"f_index": f} if f else {})))
        for name, f in keys
    }


def rule_settings(demos: Demos, choices: Mapping[str, Any]) -> dict[str, Setting]:
    """Return a setting for each registered reading of AdaBoost-IRL (ADABOOST-RULE)."""
    entry = register()["ADABOOST-RULE"]
    return {
        str(rule): Setting(demos, "adaboost", Params.of(**{**choices, "adaboost_rule": rule}))
        for rule in (entry.default, *entry.alternatives)
    }


def set_settings(
    demos: Demos, choices: Mapping[str, Any], sets: Iterable[str] = SETS
) -> dict[Key, Setting]:
    """Return a setting for each set of incorrect demonstrations; keys are set and F index.

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
        for f in F_INDICES:
            params = Params.of(**{**choices, **chosen}, f_index=f)
            found[kinds, f] = Setting(demos, method, params)
    return found
