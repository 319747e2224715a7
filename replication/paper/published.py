"""The numbers that the paper publishes, each with its place."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Published:
    """Iterations of one method: mean and standard deviation over `n` trials."""

    place: str
    mean: float
    sd: float
    n: int = 100


TABLE_1 = {
    "adaboost": Published("Table I", 44.94, 10.27),
    "unified": Published("Table I", 40.10, 4.73),
    "unified-incorrect": Published("Table I", 36.48, 3.58),
}
"""Open maze. That there are 100 trials is said of Fig. 6."""

TABLE_2 = {
    "unified": Published("Table II", 40.82, 5.74),
    "unified-incorrect": Published("Table II", 35.84, 5.54),
}
"""Maze with obstacles. The scan breaks the rows: 10.02 and 33.04 in it are debris."""

FIGURE_5 = {"adaboost": 73, "unified": 47}
"""Iterations after which the errors drawn for the open maze are zero."""

FIGURE_12 = {"unified": 15, "unified-incorrect": 7}
"""Iterations after which the errors drawn for robot soccer are zero: one curve each."""

SOCCER = {"beta": 0.6, "gamma": 0.9, "epsilon": 0.3, "epsilon_end": 0.05, "episodes": 100}
"""Learning parameters of section IV-C; see SOCCER-EPISODES for what the episodes are."""

SOCCER_CURVES = {
    name: Published("Fig. 12", float(iterations), float("nan"), n=1)
    for name, iterations in FIGURE_12.items()
}
"""The same as means of a single trial each."""

MOVES = {"open-maze": 31, "obstacle-maze": 33}
"""Steps of the correct demonstration (sections IV-A and IV-B)."""

PUBLISHED = {"open-maze": TABLE_1, "obstacle-maze": TABLE_2, "soccer": SOCCER_CURVES}
"""Iterations by task and method."""

PUBLISHED_CURVES = {"open-maze": FIGURE_5, "soccer": FIGURE_12}
"""Iterations after which a drawn error is zero, by task and method."""
