"""From the table of trials to the tables of the paper, and tables as files: computing only."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict
from io import BytesIO
from pathlib import Path

import numpy as np
import pandas as pd
from scipy import stats

from replication.demos.model import Demos
from replication.envs.maze import Maze
from replication.evidence.experiments import Key, under
from replication.evidence.statistics import Comparison, compare, holm, mean_prediction, summarise
from replication.files import read_file, write_file
from replication.irl import METHODS, Trial
from replication.irl.expectations import visited
from replication.paper.published import Published
from replication.trials.condition import Condition
from replication.trials.measures import factors


def rows_of(trials: pd.DataFrame, condition: Condition) -> pd.DataFrame:
    """Return the rows of one condition in a table of trials, in the order of the trials.

    Raises
    ------
    KeyError
        If there are none.
    """
    own = factors(condition)
    rows = trials[(trials[list(own)] == list(own.values())).all(axis=1)]
    if rows.empty:
        raise KeyError(f"no trials of {' '.join(own.values())}")
    return rows.sort_values("trial")


def comparison(x: pd.DataFrame, y: pd.DataFrame) -> Comparison:
    """Compare the iterations of two conditions, given their rows, over the trials of both."""
    both = x.merge(y, on="trial").sort_values("trial")
    capped = not both[["converged_x", "converged_y"]].all(axis=None)
    return compare(both["iterations_x"], both["iterations_y"], capped=capped)


def means_table(trials: pd.DataFrame) -> pd.DataFrame:
    """Return the means of some conditions' trials at a glance, one row a condition."""
    groups = trials.groupby(["method", "reading", "set"], sort=False)
    means = groups[["iterations", "converged", "steps"]].mean()
    return means.round(2).astype({"steps": int}).reset_index()


def summary_table(trials: pd.DataFrame, published: Mapping[str, Published]) -> pd.DataFrame:
    """Return our iterations beside the published ones (Tables I and II).

    The prediction interval says where the mean of a replication with as many trials as ours should
    lie if it drew from the paper's distribution; `p_paper` is Welch's test of equal means.

    Parameters
    ----------
    trials
        The trials of one condition for each method and reading of Eq. 9: each gets a row.
    published
        By method.
    """
    rows = []
    for (method, reading), own in trials.groupby(["method", "reading"], sort=False):
        ours = summarise(own["iterations"], own["converged"])
        row = {"method": method, "reading": reading, **asdict(ours)}
        if method in published:
            paper = published[method]
            row |= {"paper_mean": paper.mean, "paper_sd": paper.sd}
            if paper.n > 1:
                low, high = mean_prediction(paper.mean, paper.sd, paper.n, ours.n)
                test = stats.ttest_ind_from_stats(
                    ours.mean, ours.sd, ours.n, paper.mean, paper.sd, paper.n, equal_var=False
                )
                row |= {"predicted_low": low, "predicted_high": high, "p_paper": test.pvalue}
        rows.append(row)
    return pd.DataFrame(rows)


def contrasts_table(trials: pd.DataFrame) -> pd.DataFrame:
    """Return each method compared with its baseline, trial by trial, under each reading of Eq. 9.

    One row a pair and reading, with everything in
    :class:`replication.evidence.statistics.Comparison`. These are effects with their intervals; the
    verdicts on the paper's claims are those of :mod:`replication.evidence.verdicts`, which also
    adjusts for the number of tests.

    Parameters
    ----------
    trials
        The trials of one condition for each method and reading; a method that is not there is not
        compared.
    """
    rows = []
    for method in METHODS.values():
        for reading in method.readings:
            own = trials[(trials["method"] == method.name) & (trials["reading"] == reading)]
            other = under(trials[trials["method"] == method.baseline], reading)
            if len(own) and len(other):
                numbers = asdict(comparison(own, other))
                rows.append({"x": method.name, "y": method.baseline, "reading": reading, **numbers})
    return pd.DataFrame(rows)


def sets_table(trials: pd.DataFrame, conditions: Mapping[Key, Condition]) -> pd.DataFrame:
    """Return one row for each set of incorrect demonstrations and reading of Eq. 9.

    Beside the difference from no incorrect demonstrations stand the numbers of pairs by their
    distance from the correct path, see :func:`pairs_near`. Only trials that were run with every
    set count; p-values are adjusted over all rows.

    Parameters
    ----------
    trials
        A table with the trials of all conditions.
    conditions
        Those of :func:`replication.evidence.experiments.set_conditions`.
    """
    rows_by_key = {key: rows_of(trials, condition) for key, condition in conditions.items()}
    n = min(map(len, rows_by_key.values()))
    rows = []
    for (kinds, reading), condition in conditions.items():
        own = rows_by_key[kinds, reading].head(n)
        effect = comparison(own, rows_by_key["none", reading])
        ours = summarise(own["iterations"], own["converged"])
        rows.append(
            {
                "set": kinds,
                "reading": reading,
                "method": condition.method,
                "demonstrations": len(condition.selected.incorrect),
                **pairs_near(condition.selected),
                "n": n,
                "mean": ours.mean,
                "sd": ours.sd,
                "difference": effect.difference,
                "low": effect.low,
                "high": effect.high,
                "p": np.nan if kinds == "none" else effect.p,
            }
        )
    table = pd.DataFrame(rows)
    table["p_holm"] = np.nan
    judged = table["set"] != "none"
    table.loc[judged, "p_holm"] = holm(table.loc[judged, "p"].tolist())
    return table


def pairs_near(demos: Demos) -> dict[str, int]:
    """Count the pairs that incorrect demonstrations mark, by distance from the correct path.

    A pair that a correct demonstration visits as well is not marked (Algorithm 2, line 11).

    Returns
    -------
    dict
        `pairs`: all marked pairs; `leaving`: those whose state lies on the correct path, so that
        the pair leaves it; in a maze also `beside`: those one move away from it.
    """
    world = demos.environment
    shape = world.n_states, world.n_actions
    marked = visited(demos.incorrect, shape=shape) & ~visited(demos.correct, shape=shape)
    on_path = np.zeros(world.n_states, dtype=bool)
    for demo in demos.correct:
        on_path[demo.states] = True
    counts = {"pairs": int(marked.sum()), "leaving": int(marked[on_path].sum())}
    if isinstance(world, Maze):
        beside = on_path[world.next_state].any(axis=1) & ~on_path
        counts["beside"] = int(marked[beside].sum())
    return counts


def marked_table(trial: Trial, condition: Condition) -> pd.DataFrame:
    """Return how often Algorithm 2's special case applies in a trial, by iteration.

    `wrong` counts the pairs that the agent visits and the expert never does; `marked` those of them
    that an incorrect demonstration visits; `again` those that were marked and wrong before: under
    F_i as printed only these are moved with the largest trace.
    """
    shape = condition.agent.shape
    incorrect = visited(condition.selected.incorrect, shape=shape)
    expert = visited(condition.selected.correct, shape=shape)
    before = np.zeros(shape, dtype=bool)
    rows = []
    for i, (states, actions, _) in enumerate(trial.episodes):
        seen = np.zeros(shape, dtype=bool)
        seen[states[: len(actions)], actions] = True
        wrong = seen & ~expert
        marked = wrong & incorrect
        rows.append(
            {
                "iteration": i,
                "error": round(float(trial.errors[i]), 4),
                "decisions": len(actions),
                "wrong": int(wrong.sum()),
                "marked": int(marked.sum()),
                "again": int((marked & before).sum()),
            }
        )
        before |= marked
    return pd.DataFrame(rows)


def write_csv(table: pd.DataFrame, path: Path) -> Path:
    """Write a table as CSV: ten significant digits, the same on every platform."""
    return write_file(path, csv_text(table))


def csv_text(table: pd.DataFrame) -> str:
    """Return the text of a table's file."""
    return str(table.to_csv(index=False, float_format="%.10g", lineterminator="\n"))


def read_table(path: Path) -> pd.DataFrame:
    """Read a table that was written as CSV; what is empty is NaN in columns of numbers only."""
    table = pd.read_csv(BytesIO(read_file(path)), keep_default_na=False, na_values=[""])
    for name in table:
        if table[name].dtype.kind not in "fiub" or name == "reading":
            table[name] = table[name].astype(object).where(table[name].notna(), "")
    return table
