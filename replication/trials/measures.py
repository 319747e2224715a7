"""The measures of each trial on which claims are judged; ``claims.toml`` explains them."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from replication.demos.model import Demos
from replication.envs.soccer.field import SoccerField
from replication.irl import Trial
from replication.irl.agent import Episode
from replication.irl.expectations import feature_expectations, visited
from replication.paper.published import FIGURE_12, TABLE_1
from replication.paper.register import Chosen, choice
from replication.trials.condition import Condition
from replication.trials.results import Results, digest


@dataclass(frozen=True)
class Report(Chosen):
    """What the tables and figures show of the trials."""

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
    path: bool = False,
) -> pd.DataFrame:
    """Return the table of some conditions' trials, with a :func:`trial_row` for each."""
    rows = []
    for condition in conditions:
        row = trial_row(condition, report or Report(), errors=errors, path=path)
        rows += [row(results.trial(condition, k), k, results.seed) for k in range(results.trials)]
    return pd.DataFrame(rows)


def trial_row(
    condition: Condition, report: Report, *, errors: bool, path: bool = False
) -> Callable[[Trial, int, int], dict[str, Any]]:
    """Return a function of a trial, its number and its root seed: its row in ``trials.csv``.

    The columns are those of :func:`planned_trials` and :func:`measure`, `steps` (of the
    environment), `digest` and, if asked for, `errors`: d before each iteration and after the last
    one, separated by blanks; and those of :func:`along_path`, which are empty but for the unified
    method, whose growth is judged.
    """
    kinds = kind_pairs(condition.demos)
    shown = marked_pairs(condition.selected)
    gamma = condition.params.learner.gamma

    def along(trial: Trial) -> dict[str, str]:
        if condition.method != "unified":
            return dict.fromkeys(ALONG, "")
        return along_path(trial, condition.demos, report)

    def row(trial: Trial, k: int, seed: int) -> dict[str, Any]:
        return (
            factors(condition)
            | {"trial": k, "seed": seed}
            | measure(trial, condition.demos, kinds, shown, report, gamma=gamma)
            | {"steps": trial.steps, "digest": digest(trial)}
            | ({"errors": " ".join(f"{d:.10g}" for d in trial.errors)} if errors else {})
            | (along(trial) if path else {})
        )

    return row


def error_histories(trials: pd.DataFrame) -> NDArray[np.float64]:
    """Return d of every row of a table of trials, `[trial, iteration]`.

    After its end a trial keeps its last d.
    """
    curves = numbers_in(trials["errors"])
    longest = max(map(len, curves))
    return np.array([np.pad(d, (0, longest - len(d)), mode="edge") for d in curves])


def numbers_in(texts: Iterable[str]) -> list[NDArray[np.float64]]:
    """Return the numbers of texts that have them separated by blanks."""
    return [np.array(text.split(), dtype=float) for text in texts]


ALONG = ("path_q", "path_q_growth")
"""The columns of :func:`along_path`."""


def along_path(trial: Trial, demos: Demos, report: Report) -> dict[str, str]:
    """Return Q in the mid-term, and its growth from then to the end, at each step of the expert.

    The path is that of the first correct demonstration, without the goal, where nobody acts. Three
    digits of each number, separated by blanks: a figure shows no more.
    """
    states = np.unique(np.concatenate([demo.states[:-1] for demo in demos.correct]))
    steps = np.searchsorted(states, demos.correct[0].states[:-1])
    middle = trial.values[_middle(trial, report), steps].astype(float)
    growth = trial.values[-1, steps] - middle
    return {
        name: " ".join(f"{value:.3g}" for value in values)
        for name, values in zip(ALONG, (middle, growth), strict=True)
    }


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
    trial: Trial,
    demos: Demos,
    kinds: Mapping[str, NDArray[np.bool_]],
    shown: NDArray[np.bool_],
    report: Report,
    *,
    gamma: float,
) -> dict[str, float]:
    """Return every measure of one trial, by name.

    Parameters
    ----------
    trial
        The trial.
    demos
        All demonstrations of its task.
    kinds
        The pairs that each kind of incorrect demonstration marks, see :func:`kind_pairs`.
    shown
        The pairs that those mark which the method was given, `[state, action]`.
    report
        How long the initial phase is (EARLY), and when mid-term is (FIG7-MIDTERM).
    gamma
        The discount of visits.
    """
    early = early_iterations(demos, report)
    middle = _middle(trial, report)
    wrong = marked_pairs(demos)
    right = visited(demos.correct, shape=wrong.shape)
    first, *later = (
        feature_expectations(episode.states, episode.actions, gamma=gamma, shape=wrong.shape)
        for episode in trial.episodes
    )  # the first trajectory is a random walk
    visits = np.array(later).reshape(-1, *wrong.shape)
    return {
        "iterations": trial.iterations,
        "converged": int(trial.converged),
        "early_collisions": int(trial.collisions[:early].sum()),
        "early_errors": sum(_errors(episode, wrong) for episode in trial.episodes[1 : early + 1]),
        "q_growth": _growth(trial.values, middle),
        "reward_growth": _growth(trial.rewards, middle),
        "acted": int((visits[:, shown] > 0).sum()),
        "acted_at_first": int((first[shown] > 0).sum()),
        "wrong_pairs": int((visits[:, ~right] > 0).sum()),
        "wrong_visits": round(float(visits[:, ~right].sum()), DIGITS),
        **{
            f"with_{kind}": int((visits[:, pairs] > 0).any(axis=1).sum())
            for kind, pairs in kinds.items()
        },
        **{
            f"visits_{kind}": round(float(visits[:, pairs].sum()), DIGITS)
            for kind, pairs in kinds.items()
        },
    }


KINDS = ("hit", "detour", "opposite", "overspeed")
"""The kinds of incorrect demonstrations that section III-B lists."""


def kind_pairs(demos: Demos) -> dict[str, NDArray[np.bool_]]:
    """Return the pairs that each kind of III-B's list marks, `[state, action]`."""
    return {kind: marked_pairs(demos.select(kind)) for kind in KINDS if kind in demos.kinds}


def marked_pairs(demos: Demos) -> NDArray[np.bool_]:
    """Return the pairs that an incorrect demonstration shows and no correct one."""
    shape = demos.environment.n_states, demos.environment.n_actions
    return visited(demos.incorrect, shape=shape) & ~visited(demos.correct, shape=shape)


def _errors(episode: Episode, wrong: NDArray[np.bool_]) -> int:
    """Return how many motions of an episode run into something, or take one of some pairs."""
    return int((episode.hits | wrong[episode.states[:-1], episode.actions]).sum())


def _middle(trial: Trial, report: Report) -> int:
    """Return after how many iterations mid-term is (choice FIG7-MIDTERM)."""
    return round(report.mid_term * trial.iterations)


def _growth(values: NDArray[np.float32], middle: int) -> float:
    """Return the mean growth since an iteration, given values [iteration, state]."""
    return round(float((values[-1].astype(float) - values[middle]).mean()), DIGITS)


def early_iterations(demos: Demos, report: Report) -> int:
    """Return how many iterations the initial phase lasts (choice EARLY)."""
    soccer = isinstance(demos.environment, SoccerField)
    reported = FIGURE_12["unified"] if soccer else TABLE_1["unified"].mean
    return round(report.early * reported)
