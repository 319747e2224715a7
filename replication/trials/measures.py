"""The measures of each trial on which claims are judged; ``claims.toml`` explains them."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import Any

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


def planned_trials(conditions: Iterable[Condition], trials: int, seed: int) -> pd.DataFrame:
    """Return the columns that name each trial: those of :func:`factors`, `trial` and `seed`."""
    rows = [
        factors(condition) | {"trial": k, "seed": seed}
        for condition in conditions
        for k in range(trials)
    ]
    return pd.DataFrame(rows)


def measure_trials(
    results: Results,
    conditions: Iterable[Condition],
    report: Report | None = None,
    *,
    errors: bool = False,
) -> pd.DataFrame:
    """Return the table of some conditions' trials, with a :func:`trial_row` for each."""
    rows = []
    for condition in conditions:
        row = trial_row(condition, report or Report(), errors=errors)
        rows += [row(results.trial(condition, k), k, results.seed) for k in range(results.trials)]
    return pd.DataFrame(rows)


def trial_row(
    condition: Condition, report: Report, *, errors: bool
) -> Callable[[Trial, int, int], dict[str, Any]]:
    """Return a function of a trial, its number and its root seed: its row in ``trials.csv``.

    The columns are those of :func:`planned_trials` and :func:`measure`, `steps` (of the
    environment), `digest` and, if asked for, `errors`: d before each iteration and after the last
    one, separated by blanks.
    """
    marked = marked_pairs(shown_demos(condition))

    def row(trial: Trial, k: int, seed: int) -> dict[str, Any]:
        return (
            factors(condition)
            | {"trial": k, "seed": seed}
            | measure(trial, condition.demos, marked, report)
            | {"steps": trial.steps, "digest": digest(trial)}
            | ({"errors": " ".join(f"{d:.10g}" for d in trial.errors)} if errors else {})
        )

    return row


def error_histories(trials: pd.DataFrame) -> NDArray[np.float64]:
    """Return d of every row of a table of trials, `[trial, iteration]`.

    After its end a trial keeps its last d.
    """
    curves = [np.array(text.split(), dtype=float) for text in trials["errors"]]
    longest = max(map(len, curves))
    return np.array([np.pad(d, (0, longest - len(d)), mode="edge") for d in curves])


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
