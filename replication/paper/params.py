"""Parameters of the replication: one frozen dataclass for each concern.

Every field is a choice in the register (:mod:`replication.paper.register`), which holds its default, the
reason for it and the values that are accepted. The id stands behind each field.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, fields
from typing import Any

from replication.errors import unknown
from replication.paper.register import ChoiceError, Chosen, Value, choice, load_choices


@dataclass(frozen=True)
class Demonstrations(Chosen):
    """Which of a file's incorrect demonstrations are used."""

    incorrect: str = choice("INCORRECT-KINDS")


@dataclass(frozen=True)
class Learner(Chosen):
    """Q-learning, Eq. 1: rates, episodes and the rules for ties and starts."""

    beta: float = choice("BETA")
    gamma: float = choice("GAMMA")
    epsilon: float = choice("EPSILON")
    epsilon_end: float = choice("EPSILON-END")
    episodes: int = choice("EPISODES")
    horizon: int = choice("HORIZON")
    q_start: str = choice("Q-START")
    ties: str = choice("TIES")
    goal_value: str = choice("GOAL-VALUE")


@dataclass(frozen=True)
class Loop(Chosen):
    """The outer loop of Algorithms 1 and 2, the same for all methods."""

    threshold: float = choice("THRESHOLD")
    max_iterations: int = choice("ITERATION-CAP")
    w_start: str = choice("W-START")
    w_norm: str = choice("W-NORM")
    rollout_ties: str = choice("ROLLOUT-TIES")


@dataclass(frozen=True)
class Update(Chosen):
    """The weight update, Eqs. 8-10, and that of the AdaBoost-IRL reconstruction."""

    f_index: str = choice("F-INDEX")
    alpha: float = choice("ALPHA")
    f_start: float = choice("F-START")
    adaboost_rule: str = choice("ADABOOST-RULE")
    adaboost_margin: float = choice("ADABOOST-MARGIN")


@dataclass(frozen=True)
class Params:
    """All that determines a trial, given the task, the method, the demos and the seed."""

    demonstrations: Demonstrations = field(default_factory=Demonstrations)
    learner: Learner = field(default_factory=Learner)
    loop: Loop = field(default_factory=Loop)
    update: Update = field(default_factory=Update)

    @classmethod
    def of(cls, **values: Any) -> Params:
        """Build parameters from field names alone, the others at their defaults.

        Raises
        ------
        ChoiceError
            If a name is unknown or a value is not registered.

        Examples
        --------
        >>> Params.of(alpha=0.1, q_start="reset").differences()
        {'Q-START': 'reset', 'ALPHA': 0.1}
        """
        owners = {name: part for part, kind in _PARTS.items() for name in _names(kind)}
        chosen: dict[str, dict[str, Any]] = {part: {} for part in _PARTS}
        for name, value in values.items():
            if name not in owners:
                raise ChoiceError(unknown(name, owners, "parameter"))
            chosen[owners[name]][name] = value
        return cls(**{part: _PARTS[part](**chosen[part]) for part in _PARTS})  # type: ignore[arg-type]

    def values(self) -> dict[str, Value]:
        """Return every value by its field name, in a fixed order."""
        return {
            name: getattr(getattr(self, part), name)
            for part, kind in _PARTS.items()
            for name in _names(kind)
        }

    def differences(self) -> dict[str, Value]:
        """Return the values that are not the registered defaults, by the id of their choice."""
        changed: dict[str, Value] = {}
        for part in _PARTS:
            concern = getattr(self, part)
            for item in fields(concern):
                entry = load_choices()[item.metadata["choice"]]
                if getattr(concern, item.name) != entry.default:
                    changed[entry.id] = getattr(concern, item.name)
        return changed


_PARTS: Mapping[str, type[Chosen]] = {
    "demonstrations": Demonstrations,
    "learner": Learner,
    "loop": Loop,
    "update": Update,
}


def _names(kind: type[Chosen]) -> list[str]:
    return [item.name for item in fields(kind)]  # type: ignore[arg-type]
