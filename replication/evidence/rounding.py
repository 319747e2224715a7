"""Does rounding decide? The rule "Rounding" of the register, by which TIE-TOLERANCE was chosen.

Along the correct path many values are equal on paper. The first update gives its pairs the weights
c, c gamma, c gamma^2 and so on, a constant times the expert's discounted visits. From a state of
the path an agent may walk to the next one and back for ever, or to the one before and back. The
first way earns c gamma^t now; the second earns gamma c gamma^(t-1) a step later, which is the same.
As long as neighbouring pairs have this ratio, every such loop along the path is worth as much as
the next, and which of them a greedy agent walks is left to ties, or to rounding.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache
from itertools import product

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from replication.demos.files import load_demos
from replication.demos.maze_expert import Expert, demonstrate
from replication.demos.model import Demos
from replication.envs.maze import as_maze
from replication.evidence.experiments import EXPERIMENTS, NONE, conditions_of
from replication.evidence.statistics import holm, mean_interval, sign_flip_p
from replication.irl import METHODS
from replication.learning.seeds import child
from replication.paper.register import Value, load_choices
from replication.trials.condition import Condition
from replication.trials.table import Group

ROOT = 13
TRIALS = 100
"""Root seed and number of trials of each setting, tolerance and arithmetic."""

LEVEL = 0.05

CHOICES = {"alpha": 0.3, "f_start": 0.5, "ties": "random", "q_start": "kept"}
LEG = 2
"""The defaults at the time of the choice, DEMO-SHAPE last: so it can be checked later on."""

PART = "rounding"
"""What the column `part` of the table of trials has."""

TASKS = ("open-maze", "obstacle-maze")
METHOD_NAMES = ("adaboost", "unified")

Setting = tuple[str, str, str]
"""Task, method and reading of Eq. 9."""


def settings() -> list[Setting]:
    """Return the settings in which the iterations are compared: no incorrect demonstrations."""
    return [
        (task, method, reading)
        for task in TASKS
        for method in METHOD_NAMES
        for reading in METHODS[method].readings
    ]


def variants() -> list[tuple[Value, Value]]:
    """Return all registered tolerances, each with all arithmetics, the default ones first."""
    tolerance, arithmetic = (load_choices()[id] for id in ("TIE-TOLERANCE", "ARITHMETIC"))
    tolerances = sorted((tolerance.default, *tolerance.alternatives), key=float)
    return list(product(tolerances, (arithmetic.default, *arithmetic.alternatives)))


def conditions() -> dict[tuple[Setting, Value, Value], Condition]:
    """Return the condition of each setting, tolerance and arithmetic."""
    found = {}
    for setting, (tolerance, arithmetic) in product(settings(), variants()):
        task, method, reading = setting
        choices = {**CHOICES, "tie_tolerance": tolerance, "arithmetic": arithmetic}
        own = conditions_of(_demos(task), choices, [method])
        found[setting, tolerance, arithmetic] = own[method, reading, NONE]
    return found


@cache
def _demos(task: str) -> Demos:
    stored = load_demos(EXPERIMENTS[task].demos)
    return demonstrate(task, as_maze(stored.environment), params=Expert(leg=LEG))


def plan(trials: int) -> list[Group]:
    """Return what is run: a group for each condition, with its place as the column `number`."""
    return [
        Group([condition], trials, {"part": PART, "number": number})
        for number, condition in enumerate(conditions().values())
    ]


def rounding_table(trials: pd.DataFrame) -> pd.DataFrame:
    """Return how the iterations depend on arithmetic, one row a setting, tolerance and arithmetic.

    Returns
    -------
    DataFrame
        `difference` is the mean number of iterations more than in double precision over the same
        seeds, with its 95 % interval `low` to `high`; `p` that of a sign-flip test, and `p_holm`
        adjusted over all rows of the tolerance; `equal` the share of trials with the same number;
        `wrong` the mean number of wrong pairs that a wrong trajectory takes after the first one.
    """
    table_rows = []
    keys = list(conditions())
    for (setting, tolerance), own in _grouped(trials, keys).items():
        task, method, reading = setting
        for arithmetic, rows in own.items():
            counts = rows["iterations"].to_numpy(float)
            d = counts - own["double"]["iterations"].to_numpy(float)
            low, high = mean_interval(d)
            table_rows.append(
                {
                    "task": task,
                    "method": method,
                    "reading": reading,
                    "tolerance": tolerance,
                    "arithmetic": arithmetic,
                    "n": len(counts),
                    "mean": counts.mean(),
                    "sd": counts.std(ddof=1),
                    "difference": d.mean(),
                    "low": float(low),
                    "high": float(high),
                    "equal": float((d == 0).mean()),
                    "wrong": rows["wrong_pairs"].sum() / (counts - 1).sum(),
                    "p": sign_flip_p(d) if arithmetic != "double" else float("nan"),
                }
            )
    table = pd.DataFrame(table_rows)
    table["p_holm"] = float("nan")
    for _, part in table[table["p"].notna()].groupby("tolerance"):
        table.loc[part.index, "p_holm"] = holm(part["p"].tolist())
    return table


def chosen_tolerance(table: pd.DataFrame) -> float | None:
    """Return the least tolerance with which no difference is shown, or None."""
    least = table.groupby("tolerance")["p_holm"].min()
    passing = least.index[least >= LEVEL]
    return float(min(passing)) if len(passing) else None


def _grouped(
    trials: pd.DataFrame, keys: Sequence[tuple[Setting, Value, Value]]
) -> dict[tuple[Setting, Value], dict[Value, pd.DataFrame]]:
    """Return the trials in their order, by setting and tolerance, and then by arithmetic."""
    grouped: dict[tuple[Setting, Value], dict[Value, pd.DataFrame]] = {}
    for number, own in trials.groupby("number"):
        setting, tolerance, arithmetic = keys[int(number)]
        grouped.setdefault((setting, tolerance), {})[arithmetic] = own.sort_values("trial")
    return grouped


# --- where rounding decides ----------------------------------------------------------------------

PROFILED = 20
"""Trials of which every Q-table is looked at."""

NEAR = 1e-12
"""Relative difference below which two values that are not equal differ by rounding alone."""


def profile_table() -> pd.DataFrame:
    """Return where along the open maze's path the greedy choice is left to a tie or to rounding.

    Without a tolerance, over the Q-tables after each update of some trials.

    Returns
    -------
    DataFrame
        One row for each method and reading of Eq. 9, and each step of the path: `tied` is the share
        of Q-tables in which its two best actions have equal values, `rounded` that in which they
        differ by rounding alone.
    """
    rows = []
    for task, method, reading in settings():
        if task != "open-maze":
            continue
        condition = conditions()[(task, method, reading), 0.0, "double"]
        path = condition.demos.correct[0].states[:-1]
        gaps = np.concatenate([_gaps(condition, k, path) for k in range(PROFILED)])
        for step, gap in enumerate(gaps.T):
            rows.append(
                {
                    "method": method,
                    "reading": reading,
                    "step": step,
                    "tables": len(gap),
                    "tied": float((gap == 0).mean()),
                    "rounded": float(((gap > 0) & (gap <= NEAR)).mean()),
                }
            )
    return pd.DataFrame(rows)


def _gaps(condition: Condition, k: int, states: NDArray[np.int64]) -> NDArray[np.float64]:
    """Return the relative gap between the two best values, [update, state], in trial k."""
    trial = condition.trial(seed=child(np.random.SeedSequence(ROOT), k), keep=True)
    assert trial.snapshots is not None
    ordered = np.sort(trial.snapshots.q[1:, states], axis=2)
    best, second = ordered[..., -1], ordered[..., -2]
    return (best - second) / np.maximum(np.abs(best), np.finfo(float).tiny)
