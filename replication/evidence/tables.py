"""From the table of trials to the tables of the paper, and tables as files: computing only.

One file because all of them begin from the same table of trials.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from replication.demos.model import Demos
from replication.envs.maze import Maze
from replication.evidence.experiments import Key, under
from replication.evidence.statistics import Comparison, compare, mean_prediction, summarise
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


FIRST = 100
"""As many trials as the paper has: they are shown beside all of ours."""


def summary_table(trials: pd.DataFrame, published: Mapping[str, Published]) -> pd.DataFrame:
    """Return our iterations beside the published ones (Tables I and II).

    The prediction interval says where the mean of a replication with as many trials as ours should
    lie if it drew from the paper's distribution. `first_mean` and `first_sd` are those of the first
    trials alone, as many as the paper has.

    Parameters
    ----------
    trials
        The trials of one condition for each method, reading of Eq. 9 and set: each gets a row.
    published
        By method.
    """
    rows = []
    for (method, reading, set), own in trials.groupby(["method", "reading", "set"], sort=False):
        ours = summarise(own["iterations"], own["converged"])
        first = own[own["trial"] < FIRST]
        few = summarise(first["iterations"], first["converged"])
        row = {"method": method, "reading": reading, "set": set, **asdict(ours)}
        row |= {"first_mean": few.mean, "first_sd": few.sd}
        if method in published:
            paper = published[method]
            row |= {"paper_mean": paper.mean, "paper_sd": paper.sd}
            if paper.n > 1:
                low, high = mean_prediction(paper.mean, paper.sd, paper.n, ours.n)
                row |= {"predicted_low": low, "predicted_high": high}
        rows.append(row)
    return pd.DataFrame(rows)


def contrasts_table(trials: pd.DataFrame) -> pd.DataFrame:
    """Return what each method saves against its baseline, trial by trial.

    One row a pair, reading of Eq. 9 and set: everything in
    :class:`replication.evidence.statistics.Comparison`, `saved` being what the first method needs
    less, and `steps_saved`, the steps in the environment that it saves as a share of the other's.
    The verdicts on the paper's claims are those of :mod:`replication.evidence.verdicts`.

    Parameters
    ----------
    trials
        The trials of one condition for each method, reading and set; a method that is not there is
        not compared.
    """
    rows = []
    for method in METHODS.values():
        own = trials[trials["method"] == method.name]
        for (reading, set), x in own.groupby(["reading", "set"], sort=False):
            y = under(trials[trials["method"] == method.baseline], str(reading))
            if len(y):
                names = {"x": method.name, "y": method.baseline, "reading": reading, "set": set}
                rows.append(names | _saved(x, y))
    return pd.DataFrame(rows)


def _saved(x: pd.DataFrame, y: pd.DataFrame) -> dict[str, Any]:
    """Return what the first of two conditions saves, over the trials of both."""
    both = x.merge(y, on="trial").sort_values("trial")
    effect = asdict(comparison(x, y))
    low, high = 0 - effect.pop("high"), 0 - effect.pop("low")
    steps = 1 - both["steps_x"].sum() / both["steps_y"].sum()
    saved = 0 - effect.pop("difference")
    return {"saved": saved, "low": low, "high": high, "steps_saved": steps, **effect}


def sets_table(trials: pd.DataFrame, conditions: Mapping[Key, Condition]) -> pd.DataFrame:
    """Return one row for each set of incorrect demonstrations and reading of Eq. 9.

    Beside what the set saves stand the numbers of pairs by their distance from the correct path,
    see :func:`pairs_near`, and how often line 12 of Algorithm 2 acts in a trial: in the first
    trajectory, which is a random walk, and in all later ones.

    Parameters
    ----------
    trials
        A table with the trials of all conditions.
    conditions
        By method, reading and set; only those with incorrect demonstrations get a row.
    """
    shown = {key: each for key, each in conditions.items() if each.rule.uses_incorrect}
    order = {key: len(each.selected.incorrect) for key, each in shown.items()}
    rows = []
    for key in sorted(shown, key=lambda key: (order[key], key[2])):
        condition, (_, reading, set) = shown[key], key
        own = rows_of(trials, condition)
        base = under(trials[trials["method"] == condition.rule.baseline], reading)
        rows.append(
            {
                "set": set,
                "reading": reading,
                "demonstrations": order[key],
                **pairs_near(condition.selected),
                "acted_at_first": own["acted_at_first"].mean(),
                "acted": own["acted"].mean(),
                **_saved(own, base),
            }
        )
    return pd.DataFrame(rows)


def kinds_table(trials: pd.DataFrame) -> pd.DataFrame:
    """Return how much of what goes wrong each kind of incorrect demonstration marks.

    One row for each kind and reading of Eq. 9, over all wrong trajectories but the first ones,
    which are random walks, of the method that is given no incorrect demonstrations. `share` is that
    of the trajectories that take a pair of the kind, `weight` that of such pairs in the discounted
    visits of wrong pairs, by which weights move.
    """
    kinds = [str(name).removeprefix("with_") for name in trials if str(name).startswith("with_")]
    own = trials[(trials["method"] == "unified") & (trials["converged"] == 1)]
    rows = []
    for reading, part in own.groupby("reading", sort=False):
        wrong, visits = int((part["iterations"] - 1).sum()), part["wrong_visits"].sum()
        for kind in kinds:
            rows.append(
                {
                    "reading": reading,
                    "kind": kind,
                    "trajectories": wrong,
                    "share": part[f"with_{kind}"].sum() / wrong if wrong else np.nan,
                    "weight": part[f"visits_{kind}"].sum() / visits if visits else np.nan,
                }
            )
    return pd.DataFrame(rows, columns=["reading", "kind", "trajectories", "share", "weight"])


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
