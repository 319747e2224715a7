"""The rule "Calibrated" of the register: defaults from one published pair of numbers.

Four choices that every run behind Table I must have made are not in the text. Their defaults are
the point of a declared grid under which the unified method without incorrect demonstrations comes
nearest to its published mean and SD on the open maze. ``choices.toml`` states the rule.
"""

from __future__ import annotations

from itertools import product

import numpy as np
import pandas as pd

from replication.demos.maze_expert import Expert, demonstrate
from replication.envs.maze import Maze
from replication.evidence.statistics import mean_prediction, sd_interval, sd_prediction, summarise
from replication.paper.params import Params
from replication.paper.published import TABLE_1, Published
from replication.paper.register import Value, load_choices
from replication.trials.condition import Condition
from replication.trials.table import Group

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
    """Return all points: every registered value but the ablation ALPHA = 0."""
    choices = [load_choices()[id] for id in CALIBRATED]
    values = [(choice.default, *choice.alternatives) for choice in choices]
    return list(product(*(sorted(v for v in accepted if v != 0) for accepted in values)))


def chosen() -> Point:
    """Return the point of the register's defaults."""
    return tuple(load_choices()[id].default for id in CALIBRATED)


def grid_conditions(maze: Maze) -> dict[Point, Condition]:
    """Return the condition of each point: the unified method without incorrect demonstrations."""
    legs = {
        leg: demonstrate("open-maze", maze, params=Expert(leg=int(leg)))
        for leg in {leg for leg, *_ in grid()}
    }
    return {
        (leg, alpha, f_start, ties): Condition(
            legs[leg], "unified", Params.of(alpha=alpha, f_start=f_start, ties=ties)
        )
        for leg, alpha, f_start, ties in grid()
    }


def kl_divergence(mean: float, sd: float, published: Published) -> float:
    """Return the Kullback-Leibler divergence of the normal N(mean, sd) from the published one.

    It is zero where both have the same mean and SD, and the less the likelier the published sample
    is under the first. Infinite if `sd` is zero, or if either is NaN.

    Examples
    --------
    >>> kl_divergence(40.10, 4.73, PAIR)
    0.0
    >>> round(kl_divergence(44.83, 4.73, PAIR), 3)
    0.5
    """
    if not sd > 0 or np.isnan(mean):
        return float("inf")
    spread = published.sd**2 + (published.mean - mean) ** 2
    return float(np.log(sd / published.sd) + spread / (2 * sd**2) - 0.5)


def plan(maze: Maze, trials: int) -> list[Group]:
    """Return what is run: a group for each point, with "grid" and its place as columns."""
    return [
        Group([condition], trials, {"part": "grid", "number": number})
        for number, condition in enumerate(grid_conditions(maze).values())
    ]


def calibration_table(trials: pd.DataFrame) -> pd.DataFrame:
    """Return one row a point, the nearest first, with its mean, SD and divergence."""
    rows = []
    points = grid()
    for number, own in trials.groupby("number"):
        ours = summarise(own["iterations"], own["converged"])
        rows.append(
            {
                **dict(zip(CALIBRATED, points[number], strict=True)),
                "n": ours.n,
                "capped": ours.capped,
                "mean": ours.mean,
                "sd": ours.sd,
                "median": ours.median,
                "kl_divergence": kl_divergence(ours.mean, ours.sd, PAIR),
                "default": points[number] == chosen(),
                "paper_mean": PAIR.mean,
                "paper_sd": PAIR.sd,
            }
        )
    return pd.DataFrame(rows).sort_values("kl_divergence", kind="stable", ignore_index=True)


def check_table(grid_trials: pd.DataFrame, trials: pd.DataFrame) -> pd.DataFrame:
    """Return how near the chosen point comes to the pair: in the grid, and in new trials.

    One row for its trials in the grid, and one for the judged trials of the open maze
    under each reading of Eq. 9: mean and SD with their intervals, and where both would lie if the
    trials came from the published distribution, as for the claims about published numbers.
    """
    new = trials[trials["method"] == "unified"].groupby("reading", sort=False)["iterations"]
    own = grid_trials[grid_trials["number"] == grid().index(chosen())]
    runs = [("grid", "printed", own["iterations"].to_numpy(float))]
    runs += [("new", str(reading), rows.to_numpy(float)) for reading, rows in new]
    rows = []
    for source, reading, counts in runs:
        ours = summarise(counts, np.ones(len(counts)))
        sd_low, sd_high = sd_interval(counts)
        mean_from, mean_to = mean_prediction(PAIR.mean, PAIR.sd, PAIR.n, ours.n)
        sd_from, sd_to = sd_prediction(PAIR.sd, PAIR.n, counts)
        rows.append(
            {
                "trials": source,
                "reading": reading,
                "n": ours.n,
                "mean": ours.mean,
                "low": ours.low,
                "high": ours.high,
                "predicted_low": mean_from,
                "predicted_high": mean_to,
                "sd": ours.sd,
                "sd_low": sd_low,
                "sd_high": sd_high,
                "sd_predicted_low": sd_from,
                "sd_predicted_high": sd_to,
            }
        )
    return pd.DataFrame(rows)
