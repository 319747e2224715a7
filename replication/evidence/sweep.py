"""Run the declared specifications, and evaluate the claims under each of them."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import cache

import numpy as np
import pandas as pd

from replication.evidence.claims import load_claims
from replication.evidence.experiments import Key
from replication.evidence.sensitivity import effects_table
from replication.evidence.specifications import (
    Specification,
    factorial_specifications,
    load_specifications,
    single_specifications,
)
from replication.evidence.statistics import mean_interval
from replication.evidence.tables import pairs_near
from replication.evidence.variations import (
    Ablation,
    ablation_conditions,
    maze_conditions,
    numbered_conditions,
    soccer_conditions,
)
from replication.irl import get_method
from replication.trials.condition import Condition
from replication.trials.table import Group

PLAN = load_specifications()
CAP = PLAN.iteration_cap

Make = Callable[[Specification, int], dict[Key, Condition]]

SPECIFIED: dict[str, tuple[Callable[[], Sequence[Specification]], Make]] = {
    "mazes": (lambda: single_specifications(PLAN.mazes.single.choices), maze_conditions),
    "factorial": (lambda: factorial_specifications(PLAN.mazes.factorial), maze_conditions),
    "soccer": (lambda: single_specifications(PLAN.soccer.single.choices), soccer_conditions),
}
"""For each part of the sweep with specifications: those declared, and their conditions."""

TRIALS = {
    "mazes": PLAN.mazes.single.trials,
    "factorial": PLAN.mazes.factorial.trials,
    "soccer": PLAN.soccer.single.trials,
    "ablations": PLAN.ablations.trials,
    "numbers": PLAN.ablations.trials,
}
"""The parts of the sweep, and the number of trials of each condition."""

CLAIMS = {"mazes": PLAN.mazes.claims, "factorial": PLAN.mazes.claims, "soccer": PLAN.soccer.claims}


@cache
def specifications(part: str) -> Sequence[Specification]:
    """Return the declared specifications of a part, in their order."""
    return SPECIFIED[part][0]()


@cache
def _ablated() -> dict[Ablation, Condition]:
    return ablation_conditions(PLAN.ablations, CAP)


@cache
def _numbered() -> dict[tuple[int, str], Condition]:
    return numbered_conditions(PLAN.ablations, CAP)


@cache
def conditions_of(part: str, number: int) -> list[Condition]:
    """Return the conditions of the specification, ablation or number at a place in its part.

    Raises
    ------
    KeyError, IndexError
        If nothing is declared there.
    """
    if part in SPECIFIED:
        return list(SPECIFIED[part][1](specifications(part)[number], CAP).values())
    return [_single(part)[number]]


def _single(part: str) -> list[Condition]:
    """Return the conditions of a part that has one condition at each place."""
    if part == "ablations":
        return list(_ablated().values())
    return {"numbers": list(_numbered().values())}[part]


def plan(*, most_trials: int, most_specifications: int) -> list[Group]:
    """Return what is run: a group for each specification, ablation and number.

    Its columns `part` and `number` are the part of the sweep and the place in it. The limits serve
    a quick look: fewer trials of each condition, fewer specifications of a part.
    """
    places = {
        part: range(min(len(specifications(part)), most_specifications))
        if part in SPECIFIED
        else range(len(_single(part)))
        for part in TRIALS
    }
    return [
        Group(
            conditions_of(part, number),
            min(trials, most_trials),
            {"part": part, "number": number},
        )
        for part, trials in TRIALS.items()
        for number in places[part]
    ]


def effects(trials: pd.DataFrame, part: str) -> pd.DataFrame:
    """Return the claims' effects under each specification of a part."""
    claims = [load_claims().by_id(id) for id in CLAIMS[part]]
    return effects_table(trials[trials["part"] == part], specifications(part), claims)


def ablations(trials: pd.DataFrame) -> pd.DataFrame:
    """Return the method with its trace switched off, and other readings of AdaBoost-IRL."""
    names = [choices for _, _, choices in _ablated()]
    return ablations_table(trials[trials["part"] == "ablations"], names)


def numbers(trials: pd.DataFrame) -> pd.DataFrame:
    """Return what ever more incorrect demonstrations save."""
    paper = load_claims().by_id("SAVES-OPEN").paper_effect
    return numbers_table(trials[trials["part"] == "numbers"], _numbered(), paper=paper)


def ablations_table(trials: pd.DataFrame, names: Sequence[str]) -> pd.DataFrame:
    """Return one row a condition: a summary of its iterations, capped trials counting as the cap.

    `more` is the mean number of iterations more than in the first condition, over the same seeds,
    with its interval.

    Parameters
    ----------
    trials
        The trials of all conditions, by their `number`.
    names
        What each condition changes.
    """
    rows = []
    first = trials.loc[trials["number"] == 0, "iterations"].to_numpy(float)
    for (number, method, reading), own in trials.groupby(["number", "method", "reading"]):
        counts = own["iterations"].to_numpy(float)
        low, high = mean_interval(np.stack([counts, counts - first]))
        rows.append(
            {
                "method": method,
                "reading": reading,
                "choices": names[number],
                "n": len(counts),
                "capped": int((own["converged"] == 0).sum()),
                "mean": counts.mean(),
                "low": low[0],
                "high": high[0],
                "sd": counts.std(ddof=1),
                "median": float(np.median(counts)),
                "more": (counts - first).mean(),
                "more_low": low[1],
                "more_high": high[1],
            }
        )
    return pd.DataFrame(rows)


def numbers_table(
    trials: pd.DataFrame, conditions: Mapping[tuple[int, str], Condition], *, paper: float
) -> pd.DataFrame:
    """Return one row for each number of incorrect demonstrations and reading of Eq. 9.

    `saved` is the mean number of iterations fewer than without any, over the same seeds, with its
    interval; `paper` the published saving. `pairs` and `leaving` count the marked pairs, see
    :func:`replication.evidence.tables.pairs_near`.

    Parameters
    ----------
    trials
        The trials of all conditions; their column `number` is the place among the conditions.
    conditions
        By the number of incorrect demonstrations and the reading of Eq. 9.
    paper
        The published saving.
    """
    rows = []
    own = {
        key: trials[trials["number"] == place].reset_index() for place, key in enumerate(conditions)
    }
    for (number, reading), condition in conditions.items():
        counts = own[number, reading]["iterations"].astype(float)
        base = own[0, get_method("unified").under(reading)]
        saved = base["iterations"] - counts
        low, high = mean_interval(np.stack([counts, saved]))
        near = pairs_near(condition.selected)
        rows.append(
            {
                "reading": reading,
                "number": number,
                "pairs": near["pairs"],
                "leaving": near["leaving"],
                "capped": int((own[number, reading]["converged"] == 0).sum()),
                "mean": counts.mean(),
                "low": low[0],
                "high": high[0],
                "saved": saved.mean(),
                "saved_low": low[1],
                "saved_high": high[1],
                "paper": paper,
            }
        )
    return pd.DataFrame(rows)
