"""The rule "Calibrated" of the register: defaults from one published pair of numbers.

Where the text is silent on what every run behind Table I must have fixed, the defaults are the
point of a declared grid under which the unified method without incorrect demonstrations comes
nearest to its published mean and SD on the open maze. ``choices.toml`` states the rule.
"""

from __future__ import annotations

from collections.abc import Mapping
from itertools import product

import numpy as np
import pandas as pd
from scipy import stats

from replication.choices import Value, register
from replication.envs.maze import Maze
from replication.expert import demonstrate
from replication.paper import TABLE_1, Published
from replication.params import Expert, Params
from replication.setting import Setting
from replication.statistics import mean_prediction, summarise
from replication.trials import Results

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
    entries = [register()[id] for id in CALIBRATED]
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
    return tuple(register()[id].default for id in CALIBRATED)


def grid_settings(maze: Maze) -> dict[Point, Setting]:
    """Return the setting of each point: the unified method without incorrect demonstrations."""
    legs = {
        leg: demonstrate("open-maze", maze, params=Expert(leg=int(leg)))
        for leg in dict.fromkeys(leg for leg, *_ in grid())
    }
    return {
        (leg, alpha, f_start, ties): Setting(
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


def calibration_table(results: Results, settings: Mapping[Point, Setting]) -> pd.DataFrame:
    """Return one row a point, the nearest first, with its mean, SD and divergence."""
    rows = []
    for point, setting in settings.items():
        own = summarise(results.iterations(setting), results.converged(setting))
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
