"""What the columns of a table of trials mean, and their types."""

from __future__ import annotations

import re

from replication.export.about import ExportError

TEXT, WHOLE, NUMBER = "sc:Text", "sc:Integer", "sc:Float"

COLUMNS = {
    "part": (TEXT, "Part of the experiment"),
    "number": (WHOLE, "Number of the specification, point or build within its part"),
    "task": (TEXT, "Task: open-maze, obstacle-maze or soccer, or another map of the sweep"),
    "method": (TEXT, "Method: adaboost, unified or unified-incorrect"),
    "reading": (TEXT, "Reading of Eq. 9 (choice F-INDEX); empty for a method without a trace"),
    "set": (TEXT, "Kinds of incorrect demonstrations that the method is given, joined by +"),
    "trial": (WHOLE, "Number of the trial; it descends from this child of the root seed"),
    "seed": (WHOLE, "Root seed of numpy.random.SeedSequence"),
    "iterations": (WHOLE, "Weight updates until d = 0, or until the iteration cap"),
    "converged": (WHOLE, "1 if the trial reached d = 0 below the iteration cap, else 0"),
    "early_collisions": (
        WHOLE,
        "Steps that ran into a wall or an obstacle while the agent learned, in the initial phase "
        "(choice EARLY)",
    ),
    "early_errors": (
        WHOLE,
        "Steps of the greedy trajectories of the initial phase that ran into something, or took "
        "a pair of state and action that only incorrect demonstrations show",
    ),
    "q_growth": (
        NUMBER,
        "Mean of max_a Q(s, a) over the states of the correct demonstration at the end, minus "
        "the same in the mid-term (choice FIG7-MIDTERM)",
    ),
    "reward_growth": (NUMBER, "The same for max_a w(s, a)"),
    "acted": (WHOLE, "Greedy trajectories' uses of pairs that the given incorrect ones mark"),
    "acted_at_first": (WHOLE, "The same for the first trajectory, a random walk"),
    "wrong_pairs": (WHOLE, "Greedy trajectories' uses of pairs that no correct one shows"),
    "wrong_visits": (NUMBER, "Discounted visits of these pairs"),
    "steps": (WHOLE, "Steps of the environment in the whole trial"),
    "digest": (TEXT, "Digest of all bits of the trial: errors, weights, Q, trajectories"),
    "errors": (TEXT, "d before each iteration and after the last one, separated by blanks"),
    "path_q": (TEXT, "Q in the mid-term at each step of the expert, separated by blanks"),
    "path_q_growth": (TEXT, "Its growth from then to the end, separated by blanks"),
}

KINDS = {
    "with": (WHOLE, "Greedy trajectories with a pair that demonstrations of the kind {} mark"),
    "visits": (NUMBER, "Discounted visits of the pairs that demonstrations of the kind {} mark"),
}
"""Columns that are there for each kind of incorrect demonstrations, as with_hit."""


def column(name: str) -> tuple[str, str]:
    """Return the type and the meaning of a column.

    Raises
    ------
    ExportError
        If nobody has described it.

    Examples
    --------
    >>> column("with_hit")[0], column("visits_hit")[0]
    ('sc:Integer', 'sc:Float')
    """
    if name in COLUMNS:
        return COLUMNS[name]
    match = re.fullmatch(r"(with|visits)_(\w+)", name)
    if match is None:
        raise ExportError(f"trials.csv: describe {name!r} in replication/export/columns.py first")
    kind, words = KINDS[match[1]]
    return kind, words.format(match[2])
