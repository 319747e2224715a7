"""Parameters of the replication: one frozen dataclass for each concern.

Every field is a choice in the register, see :mod:`replication.paper.register`, which holds its
default, the reason for it and what else is accepted.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, fields
from typing import Any

from replication.errors import unknown
from replication.paper.register import ChoiceError, Chosen, Value, choice


@dataclass(frozen=True)
class Demonstrations(Chosen):
    """Which of the incorrect demonstrations in a file are used."""

    incorrect: str = choice("INCORRECT-KINDS")  # kinds joined by "+", or "all" or "none"


@dataclass(frozen=True)
class Learner(Chosen):
    """Q-learning, Eq. 1: rates, episodes and the rules for ties and starts."""

    beta: float = choice("BETA")  # learning rate
    gamma: float = choice("GAMMA")  # discount factor, also of feature expectations
    epsilon: float = choice("EPSILON")  # probability of exploring, in the first episode
    epsilon_end: float = choice("EPSILON-END")  # the same in the last episode; linear in between
    episodes: int = choice("EPISODES")  # in each iteration
    horizon: int = choice("HORIZON")  # steps after which an episode is cut
    solver: str = choice("SOLVER")  # what finds Q in each iteration
    q_start: str = choice("Q-START")  # whether Q is kept or reset in each iteration
    ties: str = choice("TIES")  # which of equally good actions is taken while learning
    tie_tolerance: float = choice("TIE-TOLERANCE")  # relative difference up to which values tie
    arithmetic: str = choice("ARITHMETIC")  # how Eq. 1 is rounded, in the mazes
    goal_value: str = choice("GOAL-VALUE")  # what the target expects beyond the goal


@dataclass(frozen=True)
class Loop(Chosen):
    """The outer loop of Algorithms 1 and 2, the same for all methods."""

    threshold: float = choice("THRESHOLD")  # converged if d is at most this
    max_iterations: int = choice("ITERATION-CAP")  # weight updates before giving up
    plateau: int = choice("PLATEAU")  # iterations without a smaller d that end a trial
    w_start: str = choice("W-START")  # reward weights before the first iteration
    w_norm: str = choice("W-NORM")  # whether their norm is kept at 1
    rollouts: int = choice("ROLLOUTS")  # trajectories behind each expectation (Eq. 7)
    rollout_ties: str = choice("ROLLOUT-TIES")  # which of equally good actions the trajectory takes


@dataclass(frozen=True)
class Update(Chosen):
    """The weight update, Eqs. 8-10, and that of the AdaBoost-IRL reconstruction."""

    f_index: str = choice("F-INDEX")  # reading of Eq. 9: by which trace the weights move
    alpha: float = choice("ALPHA")  # rate at which the trace F changes
    f_start: float = choice("F-START")  # F_0
    adaboost_rule: str = choice("ADABOOST-RULE")  # reading of AdaBoost-IRL
    adaboost_margin: float = choice("ADABOOST-MARGIN")  # how far its error stays below 1/2


@dataclass(frozen=True)
class Params:
    """All that determines a trial besides its demonstrations, its method and its seed."""

    demonstrations: Demonstrations = field(default_factory=Demonstrations)
    learner: Learner = field(default_factory=Learner)
    loop: Loop = field(default_factory=Loop)
    update: Update = field(default_factory=Update)

    @classmethod
    def of(cls, **values: Any) -> Params:
        """Build parameters from some fields by name, with all others at their defaults.

        Raises
        ------
        ChoiceError
            If a name is unknown or a value is not accepted.

        Examples
        --------
        >>> Params.of(alpha=0.2, q_start="reset").update.alpha
        0.2
        """
        owners = {name: part for part, kind in _PARTS.items() for name in _names(kind)}
        chosen: dict[str, dict[str, Any]] = {part: {} for part in _PARTS}
        for name, value in values.items():
            if name not in owners:
                raise ChoiceError(unknown(name, owners, "parameter"))
            chosen[owners[name]][name] = value
        return cls(**{part: _PARTS[part](**chosen[part]) for part in _PARTS})  # type: ignore[arg-type]

    def values(self) -> dict[str, Value]:
        """Return all values by field name, in a fixed order."""
        return {
            name: getattr(getattr(self, part), name)
            for part, kind in _PARTS.items()
            for name in _names(kind)
        }


_PARTS: Mapping[str, type[Chosen]] = {
    "demonstrations": Demonstrations,
    "learner": Learner,
    "loop": Loop,
    "update": Update,
}


def _names(kind: type[Chosen]) -> list[str]:
    return [item.name for item in fields(kind)]  # type: ignore[arg-type]
