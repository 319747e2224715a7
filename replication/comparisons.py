"""What the notebooks compare: the settings of each table, and the claims judged from them."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from typing import Any

from replication.choices import Choice, ChoiceError, register
from replication.demos import DemoError, Demos
from replication.envs.field import SoccerField
from replication.irl import METHODS
from replication.params import Params, SoccerExpert
from replication.setting import Setting
from replication.soccer_expert import demonstrate_soccer

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
class Claim:
    """A claim that compares the methods `x` and `y` in the statistic `judged`.

    `judged` is "fewer" (the mean of the iterations) or "steadier" (their spread); the criteria are
    those of :mod:`replication.statistics`. `place` is empty for an extension of ours.
    """

    text: str
    place: str
    x: str
    y: str
    judged: str


FASTER = Claim(
    "the unified method needs fewer iterations than AdaBoost-IRL (R1)",
    "Table I, Fig. 6",
    "unified",
    "adaboost",
    "fewer",
)
STEADIER = Claim(
    "its iterations spread less than those of AdaBoost-IRL (R1)",
    "Table I, Fig. 6",
    "unified",
    "adaboost",
    "steadier",
)
INCORRECT_HELP = Claim(
    "incorrect demonstrations save iterations",
    "Table I",
    "unified-incorrect",
    "unified",
    "fewer",
)
SOCCER_CLAIMS = (Claim(INCORRECT_HELP.text, "Fig. 12", "unified-incorrect", "unified", "fewer"),)
TABLE_1_CLAIMS = (FASTER, STEADIER, INCORRECT_HELP)
TABLE_2_CLAIMS = (
    Claim(INCORRECT_HELP.text, "Table II, Fig. 9", "unified-incorrect", "unified", "fewer"),
    Claim(FASTER.text, "", "unified", "adaboost", "fewer"),
    Claim(STEADIER.text, "", "unified", "adaboost", "steadier"),
)


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


def soccer_readings(demos: Demos, choices: Mapping[str, Any]) -> dict[str, tuple[Setting, Setting]]:
    """Return settings without and with incorrect demonstrations, one registered choice changed.

    The world, and with it the demonstrations, is made anew where the choice is one of the world.
    """
    field = demos.environment
    if not isinstance(field, SoccerField):
        raise DemoError(f"task {demos.task} is not robot soccer")
    entries = register()
    learning = [
        ("F-INDEX", "updated"),
        ("GOAL-VALUE", "bootstrap"),
        ("TIES", "first"),
        ("Q-START", "reset"),
        ("EPISODES", 10),
    ]
    learning += [("INCORRECT-KINDS", kind) for kind in demos.kinds]
    worlds = [("SOCCER-MACRO", "cell"), ("SOCCER-ARC", 180), ("SOCCER-DECISION", 0.4)]
    tried = {"default": (demos, dict(choices))}
    for id, value in learning:
        tried[f"{id}={value}"] = demos, {**choices, _name(entries[id]): value}
    for id, value in worlds:
        changed: dict[str, Any] = {_name(entries[id]): value}
        other = SoccerField(replace(field.params, **changed))
        tried[f"{id}={value}"] = demonstrate_soccer(demos.task, other), dict(choices)
    every = demonstrate_soccer(demos.task, field, params=SoccerExpert(leave="every"))
    tried["SOCCER-INCORRECT=every"] = every, dict(choices)
    return {
        name: (Setting(one, "unified", params), Setting(one, "unified-incorrect", params))
        for name, (one, values) in tried.items()
        for params in [Params.of(**values)]
    }


def _name(entry: Choice) -> str:
    """Return the name of the parameter that holds a choice."""
    return entry.field.split(".")[1]


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
