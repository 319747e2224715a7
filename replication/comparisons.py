"""What the maze notebooks compare: the settings of each table, and the claims judged from them."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any

from replication.choices import ChoiceError
from replication.demos import Demos
from replication.irl import METHODS
from replication.params import Params
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
TABLE_1_CLAIMS = (FASTER, STEADIER, INCORRECT_HELP)
TABLE_2_CLAIMS = (
    Claim(INCORRECT_HELP.text, "Table II, Fig. 9", "unified-incorrect", "unified", "fewer"),
    Claim(FASTER.text, "", "unified", "adaboost", "fewer"),
    Claim(STEADIER.text, "", "unified", "adaboost", "steadier"),
)


def method_settings(demos: Demos, choices: Mapping[str, Any]) -> dict[Key, Setting]:
    """Return a setting for each method, under both readings of Eq. 9 where it has a trace.

    Raises
    ------
    ChoiceError
        If a choice is unknown, its value is not registered, or it is the reading of Eq. 9.
    """
    if "f_index" in choices:
        raise ChoiceError("choices: f_index is run both ways; leave it out")
    keys = [("adaboost", "")]
    keys += [(name, f) for f in F_INDICES for name in METHODS if name != "adaboost"]
    return {
        (name, f): Setting(demos, name, Params.of(**choices, **({"f_index": f} if f else {})))
        for name, f in keys
    }


def set_settings(
    demos: Demos, choices: Mapping[str, Any], sets: Iterable[str] = SETS
) -> dict[Key, Setting]:
    """Return a setting for each set of incorrect demonstrations; keys are set and F index.

    Sets with a kind that the demonstrations lack are left out. The empty set is the unified method
    without incorrect demonstrations.
    """
    found = {}
    for kinds in sets:
        if kinds != "none" and not set(kinds.split("+")) <= set(demos.kinds):
            continue
        method = "unified" if kinds == "none" else "unified-incorrect"
        # The method without incorrect demonstrations keeps the default's name, and so its trials.
        chosen = {} if kinds == "none" else {"incorrect": kinds}
        for f in F_INDICES:
            params = Params.of(**{**choices, **chosen}, f_index=f)
            found[kinds, f] = Setting(demos, method, params)
    return found
