"""The measures of each trial on which claims are judged; ``claims.toml`` explains them."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
import pandas as pd
from numpy.typing import NDArray
from scipy import stats

from replication.demos.model import Demos
from replication.envs.soccer.field import SoccerField
from replication.irl import Trial
from replication.irl.expectations import visited
from replication.paper.published import FIGURE_12, TABLE_1
from replication.paper.register import Chosen, choice
from replication.trials.condition import Condition
from replication.trials.results import Results, digest


@dataclass(frozen=True)
class Report(Chosen):
    """What the tables and figures show of the trials."""

    trials: int = choice("TABLE2-TRIALS")
    set_trials: int = choice("SET-TRIALS")
    early: float = choice("EARLY")
    surface: str = choice("FIG7-SURFACE")
    mid_term: float = choice("FIG7-MIDTERM")


DIGITS = 8
"""Decimals of a measure, so that a file with ten significant digits holds it exactly."""


def measure_trials(
    results: Results, conditions: Iterable[Condition], report: Report | None = None
) -> pd.DataFrame:
    """Return the table of some conditions' trials, one row a trial: what ``trials.csv`` holds.

    The columns are those of :func:`factors`, `trial`, `seed`, those of :func:`measure`, `steps` (of
    the environment) and `digest`. A condition that is given twice has its rows once.
    """
    report = report or Report()
    rows = []
    for condition in conditions:
        marked = marked_pairs(shown_demos(condition))
        for k in range(results.trials):
            trial = results.trial(condition, k)
            rows.append(
                factors(condition)
                | {"trial": k, "seed": results.seed}
                | measure(trial, condition.demos, marked, report)
                | {"steps": trial.steps, "digest": digest(trial)}
            )
    return pd.DataFrame(rows).drop_duplicates(ignore_index=True)


def factors(condition: Condition) -> dict[str, str]:
    """Return what tells a condition from the others of its experiment.

    Returns
    -------
    dict
        `task`; `method`; `reading` of Eq. 9, empty for a method without a trace; `set` of incorrect
        demonstrations that the method is given, "none" if it uses none.
    """
    method, params = condition.rule, condition.params
    return {
        "task": condition.demos.task,
        "method": condition.method,
        "reading": params.update.f_index if params.update.f_index in method.readings else "",
        "set": params.demonstrations.incorrect if method.uses_incorrect else "none",
    }


def measure(
    trial: Trial, demos: Demos, marked: NDArray[np.bool_], report: Report
) -> dict[str, float]:
    """Return every measure of one trial, by name.

    Parameters
    ----------
    trial
        The trial.
    demos
        The demonstrations that it learned from.
    marked
        Pairs that count as erroneous, `[state, action]`, see :func:`marked_pairs`.
    report
        How long the initial phase is (EARLY), and when mid-term is (FIG7-MIDTERM).
    """
    early = early_iterations(demos, report)
    path = demos.correct[0].states[:-1]
    known = np.unique(np.concatenate([demo.states[:-1] for demo in demos.correct]))
    values = trial.values[:, np.searchsorted(known, path)].astype(float)
    middle = round(report.mid_term * trial.iterations)
    return {
        "iterations": trial.iterations,
        "converged": int(trial.converged),
        "early_errors": early_errors(trial, marked, early),
        "q_growth": round(float((values[-1] - values[middle]).mean()), DIGITS),
        "q_slope": round(slope(values[-1]), DIGITS),
        "reward_slope": round(slope(trial.weights[path].max(axis=1)), DIGITS),
    }


def shown_demos(condition: Condition) -> Demos:
    """Return the demonstrations whose incorrect ones a condition's own method may not be shown."""
    return condition.demos.select(condition.params.demonstrations.incorrect)


def marked_pairs(demos: Demos) -> NDArray[np.bool_]:
    """Return the pairs that an incorrect demonstration shows and no correct one."""
    shape = demos.environment.n_states, demos.environment.n_actions
    return visited(demos.incorrect, shape=shape) & ~visited(demos.correct, shape=shape)


def early_iterations(demos: Demos, report: Report) -> int:
    """Return how many iterations the initial phase lasts (choice EARLY)."""
    soccer = isinstance(demos.environment, SoccerField)
    reported = FIGURE_12["unified"] if soccer else TABLE_1["unified"].mean
    return round(report.early * reported)


def early_errors(trial: Trial, marked: NDArray[np.bool_], early: int) -> int:
    """Count the erroneous motions in the trajectories after updates 1 ... `early`.

    A motion is erroneous if it runs into a wall or an obstacle or takes a marked pair. A trial that
    has converged by then makes no more.
    """
    return sum(
        int((episode.hits | marked[episode.states[:-1], episode.actions]).sum())
        for episode in trial.episodes[1 : early + 1]
    )


def slope(values: NDArray[np.float64]) -> float:
    """Return Spearman's correlation of values with their position; 0 if all are equal."""
    if np.ptp(values) == 0 or len(values) < 2:
        return 0.0
    return float(np.corrcoef(np.arange(len(values)), stats.rankdata(values))[0, 1])
