"""The choices that a specification can change, and their values, in words."""

from __future__ import annotations

import math

from replication.evidence.claims import load_claims
from replication.irl import METHODS
from replication.report.readable import F_LABELS

NAMES = {
    "MAP": "the map",
    "DEMO-SHAPE": "the legs of the expert",
    "DEMO-PATH": "the path of the expert",
    "INCORRECT-KINDS": "which mistakes are shown",
    "DETOUR-WIDTH": "the width of detours",
    "F-INDEX": "the reading of Eq. 9",
    "ALPHA": "the rate α of the trace",
    "F-START": "the start F₀ of the trace",
    "Q-START": "whether Q is kept",
    "TIES": "how ties are broken",
    "TIE-TOLERANCE": "what counts as a tie",
    "ARITHMETIC": "how sums are rounded",
    "ROLLOUT-TIES": "ties in trajectories",
    "W-START": "the first weights",
    "W-NORM": "the norm of the weights",
    "THRESHOLD": "the threshold for d",
    "ADABOOST-RULE": "the rule of AdaBoost-IRL",
    "ADABOOST-MARGIN": "the margin of AdaBoost-IRL",
    "GOAL-VALUE": "the value of the goal",
    "SOCCER-EPISODES": "the number of episodes",
    "SOCCER-INCORRECT": "where mistakes start",
    "SOCCER-MACRO": "how long an action lasts",
    "SOCCER-ARC": "the arc of the sensors",
    "SOCCER-DECISION": "the time of a decision",
}
"""The choices, as a part of a sentence."""

WORDS = {
    **{key: words for key, words in F_LABELS.items() if key},
    "open": "open maze",
    "hit": "hits",
    "detour": "detours",
    "near-detour": "near detours",
    "far-detour": "far detours",
    "overspeed": "too fast",
    "all": "all kinds",
    "cell": "for a whole cell",
    "every": "at every decision",
    "bootstrap": "looked up",
    "uniform-0.001": "up to 0.001",
    "unit": "1",
}
"""Values that are called otherwise than their keys."""

UNITS = {"SOCCER-ARC": "{}°", "SOCCER-DECISION": "{} s"}
SUPERSCRIPTS = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")


INCORRECT = ("INCORRECT-KINDS", "DETOUR-WIDTH", "SOCCER-INCORRECT")
"""The choices about incorrect demonstrations."""


def acts(id: str, claim: str) -> bool:
    """Return whether a choice can act on a claim: whether it has a method that reads it.

    Examples
    --------
    >>> acts("ADABOOST-RULE", "SAVES-OPEN"), acts("INCORRECT-KINDS", "FASTER")
    (False, False)
    >>> acts("ADABOOST-RULE", "FASTER"), acts("INCORRECT-KINDS", "SAVES-OPEN")
    (True, True)
    """
    judged = load_claims().by_id(claim)
    methods = {judged.x, judged.y} - {""}
    if id.startswith("ADABOOST"):
        return "adaboost" in methods
    return id not in INCORRECT or any(METHODS[name].uses_incorrect for name in methods)


def title(id: str) -> str:
    """Return a choice's name without its article; what is no choice keeps its own.

    Examples
    --------
    >>> title("F-INDEX"), title("TIES"), title("noise")
    ('reading of Eq. 9', 'how ties are broken', 'noise')
    """
    return NAMES.get(id, id).removeprefix("the ")


def value(id: str, key: str) -> str:
    """Return a value of a choice in words.

    Examples
    --------
    >>> value("DEMO-SHAPE", "4"), value("DEMO-SHAPE", "random")
    ('4 cells', 'a random path')
    >>> value("INCORRECT-KINDS", "hit+near-detour"), value("TIE-TOLERANCE", "1e-09")
    ('hits, near detours', '10⁻⁹')
    """
    if id in ("DEMO-SHAPE", "DETOUR-WIDTH"):
        return "a random path" if key == "random" else f"{key} cell{'s' * (key != '1')}"
    if id == "TIE-TOLERANCE":
        return power(float(key))
    words = ", ".join(WORDS.get(part, part.replace("-", " ")) for part in key.split("+"))
    return UNITS.get(id, "{}").format(words)


def power(number: float) -> str:
    """Return zero or a power of ten.

    Examples
    --------
    >>> power(0), power(1e-12)
    ('0', '10⁻¹²')
    """
    return f"10{str(round(math.log10(number))).translate(SUPERSCRIPTS)}" if number else "0"
