"""The rule "Calibrated" of the register: defaults from one published pair of numbers.

Where the text is silent on what every run behind Table I must have fixed, the defaults are the
point of a declared grid under which the unified method without incorrect demonstrations comes
nearest to its published mean and SD on the open maze. ``choices.toml`` states the rule.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from itertools import product

import numpy as np
import pandas as pd
from numpy.typing import NDArray
from scipy import stats

from replication.demos.maze_expert import Expert, demonstrate
from replication.envs.maze import Maze
from replication.evidence.experiments import F_LABELS
from replication.evidence.statistics import mean_prediction, sd_interval, sd_prediction, summarise
from replication.paper.params import Params
from replication.paper.published import TABLE_1, Published
from replication.paper.register import Value, load_choices
from replication.trials.condition import Condition
from replication.trials.results import Results

CALIBRATED = ("DEMO-SHAPE", "ALPHA", "F-START", "TIES")
"""The choices that were calibrated."""

ROOT = 1
TRIALS = 30
"""Root seed and number of trials of each point."""

PAIR = TABLE_1["unified"]
"""The published numbers that were used up by the calibration."""

Point = tuple[Value, ...]
"""A value for each of CALIBRATED."""


def grid() -> list[Point]:
    """Return all points: the registered values, but for the ablation ALPHA = 0."""
    entries = [load_choices()[id] for id in CALIBRATED]
    return list(
        product(
            *(
                sorted(value for value in (one.default, *one.alternatives) if value != 0)
                for one in entries
            )
        )
    )


def chosen() -> Point:
    """Return the point that the register's defaults are."""
    return tuple(load_choices()[id].default for id in CALIBRATED)


def grid_conditions(maze: Maze) -> dict[Point, Condition]:
    """Return the condition of each point: the unified method without incorrect demonstrations."""
    legs = {
        leg: demonstrate("open-maze", maze, params=Expert(leg=int(leg)))
        for leg in dict.fromkeys(leg for leg, *_ in grid())
    }
    return {
        (leg, alpha, f_start, ties): Condition(
            legs[leg], "unified", Params.of(alpha=alpha, f_start=f_start, ties=ties)
        )
        for leg, alpha, f_start, ties in grid()
    }


def divergence(mean: float, sd: float, published: Published) -> float:
    """Return the Kullback-Leibler divergence of the normal N(mean, sd) from the published one.

    It is zero where both have the same mean and SD, and the less the likelier the published sample
    is under the first. Infinite if `sd` is zero, or if either is NaN.

    Examples
    --------
    >>> divergence(40.10, 4.73, PAIR)
    0.0
    >>> round(divergence(44.83, 4.73, PAIR), 3)
    0.5
    """
    if not sd > 0 or np.isnan(mean):
        return float("inf")
    spread = published.sd**2 + (published.mean - mean) ** 2
    return float(np.log(sd / published.sd) + spread / (2 * sd**2) - 0.5)


def findings(table: pd.DataFrame) -> str:
    """Return in words how well the pair is met, and how little it decides."""
    best = table.iloc[0]
    n = int(best["n"])
    low, high = mean_prediction(PAIR.mean, PAIR.sd, PAIR.n, n)
    least, most = PAIR.sd * np.sqrt(stats.f.ppf([0.025, 0.975], n - 1, PAIR.n - 1))
    near = table[
        table["mean"].between(low, high) & table["sd"].between(least, most) & (table["capped"] == 0)
    ]
    values = "; ".join(
        f"{id}: {', '.join(map(str, sorted(near[id].unique())))}" for id in CALIBRATED
    )
    ours = "our default" if best["default"] else "NOT our default"
    return (
        f"The nearest point is {ours}: {_named(best)}, with a mean of {best['mean']:.2f} "
        f"(SD {best['sd']:.2f}) in {n} trials, where the paper has {PAIR.mean:.2f} ({PAIR.sd:.2f})."
        f" But {len(near)} of the {len(table)} points have a mean and an SD where those of {n} "
        f"trials from the published distribution would lie with 95 % each ({low:.1f} to "
        f"{high:.1f}, and {least:.1f} to {most:.1f}). They have these values: {values}. So the "
        "pair narrows the choices down and does not decide them."
    )


def _named(row: pd.Series) -> str:
    return ", ".join(f"{id} = {row[id]}" for id in CALIBRATED)


def calibration_table(results: Results, conditions: Mapping[Point, Condition]) -> pd.DataFrame:
    """Return one row a point, the nearest first, with its mean, SD and divergence."""
    rows = []
    for point, condition in conditions.items():
        own = summarise(results.iterations(condition), results.converged(condition))
        rows.append(
            {
                **dict(zip(CALIBRATED, point, strict=True)),
                "n": own.n,
                "capped": own.capped,
                "mean": own.mean,
                "sd": own.sd,
                "median": own.median,
                "divergence": divergence(own.mean, own.sd, PAIR),
                "default": point == chosen(),
            }
        )
    return pd.DataFrame(rows).sort_values("divergence", kind="stable", ignore_index=True)


def check_table(runs: Iterable[tuple[str, str, NDArray[np.float64]]]) -> pd.DataFrame:
    """Return how near the chosen point comes to the pair in each of some runs.

    Parameters
    ----------
    runs
        What the trials are, the reading of Eq. 9, and the iterations of each trial.

    Returns
    -------
    DataFrame
        Mean and SD with their intervals, and where both would lie if the trials came from the
        published distribution, as for the claims about published numbers.
    """
    rows = []
    for what, f, counts in runs:
        own = summarise(counts, np.ones(len(counts)))
        sd_low, sd_high = sd_interval(counts)
        mean_from, mean_to = mean_prediction(PAIR.mean, PAIR.sd, PAIR.n, own.n)
        sd_from, sd_to = sd_prediction(PAIR.sd, PAIR.n, counts)
        rows.append(
            {
                "trials": what,
                "F": f,
                "n": own.n,
                "mean": own.mean,
                "low": own.low,
                "high": own.high,
                "predicted_low": mean_from,
                "predicted_high": mean_to,
                "sd": own.sd,
                "sd_low": sd_low,
                "sd_high": sd_high,
                "sd_predicted_low": sd_from,
                "sd_predicted_high": sd_to,
            }
        )
    return pd.DataFrame(rows)


def readable_check(check: pd.DataFrame) -> pd.DataFrame:
    """Return a table of :func:`check_table` as a reader wants it."""
    rows = []
    for row in check.itertuples():
        rows.append(
            {
                "Trials": f"{row.n}, {row.trials}",
                "F": F_LABELS[row.F],
                "Mean [95 %]": f"{row.mean:.2f} [{row.low:.2f}, {row.high:.2f}]",
                "Due": f"{row.predicted_low:.2f} to {row.predicted_high:.2f}",
                "SD [95 %]": f"{row.sd:.2f} [{row.sd_low:.2f}, {row.sd_high:.2f}]",
                "SD due": f"{row.sd_predicted_low:.2f} to {row.sd_predicted_high:.2f}",
            }
        )
    return pd.DataFrame(rows)


def check_findings(check: pd.DataFrame) -> str:
    """Return in words whether the chosen point keeps its nearness in new trials.

    Parameters
    ----------
    check
        Of :func:`check_table`: the grid's own trials, new ones, and new ones of the other reading.
    """
    old, new, other = check.itertuples()
    mean = new.predicted_low <= new.mean <= new.predicted_high
    sd = new.sd_predicted_low <= new.sd <= new.sd_predicted_high
    lie = {
        (True, True): "both lie where those of the published distribution would",
        (True, False): "the mean lies where it would come from the published distribution, "
        "the SD does not",
        (False, True): "the SD lies where it would come from the published distribution, "
        "the mean does not",
        (False, False): "neither lies where it would come from the published distribution",
    }[mean, sd]
    return (
        f"In the {old.n} trials of the grid the chosen point has a mean of {old.mean:.2f} "
        f"(SD {old.sd:.2f}); in {new.n} new ones, {new.mean:.2f} ({new.sd:.2f}): {lie}. To take "
        f"the best of {len(grid())} points, each known from {old.n} trials only, is to take a "
        f"lucky one, and luck does not last. Only {F_LABELS[new.F]} was calibrated. "
        f"{F_LABELS[other.F]} inherits the point, and has {other.mean:.2f} ({other.sd:.2f})."
    )
