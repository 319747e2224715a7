"""The rule "Calibrated" of the register: defaults from one published pair, in two stages.

Five choices that every run behind Table I must have made are not in the text. Their defaults are
the values under which the unified method without incorrect demonstrations comes nearest to its
published mean and SD on the open maze. ``choices.toml`` states the rule. Three of the choices make
the world in which all methods learn; alpha and F_0 belong to a trace, and each trace (F_i and
F_(i+1), choice F-INDEX) would get its own. But no point fits, so all have the plainest one's. One
file because the rule can only be checked as a whole.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from itertools import product

import numpy as np
import pandas as pd

from replication.demos.files import load_demos
from replication.demos.maze_expert import Expert, demonstrate
from replication.demos.model import Demos
from replication.envs.maze import as_maze
from replication.evidence.experiments import EXPERIMENTS
from replication.evidence.statistics import (
    mean_prediction,
    sd_interval,
    sd_prediction,
    summarise,
)
from replication.irl.methods import TRACES
from replication.paper.params import Params
from replication.paper.published import TABLE_1, Published
from replication.paper.register import Value, load_choices
from replication.trials.condition import Condition
from replication.trials.table import Group

WORLD = ("DEMO-SHAPE", "TIES", "Q-START")
TRACE = ("ALPHA", "F-START")
"""The choices that were calibrated: for all readings together, and for each trace."""

SCREEN_TRIALS, FINAL_TRIALS = 10, 200
"""Trials of each point in the first stage, and of each finalist in the second."""

SCREEN_SEED, FINAL_SEED = 21, 22
"""Their root seeds."""

WORLDS, POINTS = 5, 4
"""How many worlds go on to the second stage, and how many points of each trace in each of them."""

PLAINEST = (4, "random", "kept", 0.5, 0.5)
"""The point that is taken if no finalist fits: the middle of each range, nothing preferred."""

PAIR = TABLE_1["unified"]
"""The published numbers that were used up by the calibration."""

Point = tuple[Value, ...]
"""A value for each choice of WORLD and TRACE, and the trace (F-INDEX)."""


@cache
def points() -> list[Point]:
    """Return all points: every registered value but the ablation ALPHA = 0, under each trace."""
    choices = [load_choices()[id] for id in (*WORLD, *TRACE)]
    values = [sorted({choice.default, *choice.alternatives} - {0}, key=str) for choice in choices]
    return list(product(*values, TRACES))


def chosen(trace: str) -> Point:
    """Return the point of the register's defaults under a trace."""
    return (*(load_choices()[id].default for id in (*WORLD, *TRACE)), trace)


@cache
def _demos(leg: int) -> Demos:
    template = load_demos(EXPERIMENTS["open-maze"].demos)
    return demonstrate("open-maze", as_maze(template.environment), params=Expert(leg=leg))


def condition(point: Point) -> Condition:
    """Return the condition of a point: the unified method without incorrect demonstrations."""
    leg, ties, q_start, alpha, f_start, trace = point
    params = Params.of(ties=ties, q_start=q_start, alpha=alpha, f_start=f_start, f_index=trace)
    return Condition(_demos(int(leg)), "unified", params)


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


# --- what is run ---------------------------------------------------------------------------------

PARTS = ("screen", "final")
"""The stages, as the column `part` of the table of trials names them."""


JUDGED = "judged"
"""What stands for the judging run there."""


def stages(
    *, screen_trials: int = SCREEN_TRIALS, final_trials: int = FINAL_TRIALS
) -> list[tuple[int, Callable[[pd.DataFrame], list[Group]]]]:
    """Return the root seed of each stage, and what is run in it, given the trials before.

    First all points, then the finalists. A row's `number` is the point's place among all.
    """

    def group(part: str, point: Point, trials: int) -> Group:
        return Group([condition(point)], trials, {"part": part, "number": points().index(point)})

    def screen(_: pd.DataFrame) -> list[Group]:
        return [group("screen", point, screen_trials) for point in points()]

    def final(trials: pd.DataFrame) -> list[Group]:
        best = finalists(calibration_table(trials, "screen"))
        return [group("final", point, final_trials) for point in best]

    return [(SCREEN_SEED, screen), (FINAL_SEED, final)]


def calibration_table(trials: pd.DataFrame, stage: str) -> pd.DataFrame:
    """Return one row a point of a stage, the nearest first, with its mean, SD and divergence.

    `fits` says whether mean and SD both lie where those of as many trials from the published
    distribution would, each with 95 %.
    """
    rows = []
    for number, own in trials[trials["part"] == stage].groupby("number"):
        counts = own["iterations"].to_numpy(float)
        ours = summarise(counts, own["converged"])
        mean_from, mean_to = mean_prediction(PAIR.mean, PAIR.sd, PAIR.n, ours.n)
        sd_from, sd_to = sd_prediction(PAIR.sd, PAIR.n, counts)
        point = points()[int(number)]
        fits = mean_from <= ours.mean <= mean_to and sd_from <= ours.sd <= sd_to
        sd_low, sd_high = sd_interval(counts)
        rows.append(
            {
                **dict(zip((*WORLD, *TRACE, "F-INDEX"), point, strict=True)),
                "n": ours.n,
                "capped": ours.capped,
                "mean": ours.mean,
                "low": ours.low,
                "high": ours.high,
                "sd": ours.sd,
                "sd_low": sd_low,
                "sd_high": sd_high,
                "kl_divergence": kl_divergence(ours.mean, ours.sd, PAIR),
                "fits": bool(fits),
                "default": point == chosen(str(point[-1])),
                "paper_mean": PAIR.mean,
                "paper_sd": PAIR.sd,
            }
        )
    return pd.DataFrame(rows).sort_values("kl_divergence", kind="stable", ignore_index=True)


def judged_table(trials: pd.DataFrame) -> pd.DataFrame:
    """Return the same for the judging run: one row a trace, given the open maze's trials."""
    own = trials[(trials["method"] == "unified") & trials["reading"].isin(TRACES)]
    number = own["reading"].map({trace: points().index(chosen(trace)) for trace in TRACES})
    return calibration_table(own.assign(part=JUDGED, number=number), JUDGED)


def worlds(table: pd.DataFrame) -> pd.Series:
    """Return the divergence of each world, the nearest first: the sum of the traces' least ones."""
    least = table.groupby([*WORLD, "F-INDEX"])["kl_divergence"].min().unstack("F-INDEX")
    return least.reindex(columns=list(TRACES)).sum(axis=1, skipna=False).sort_values(kind="stable")


def finalists(table: pd.DataFrame) -> list[Point]:
    """Return the points that go on to the second stage, given the table of the first."""
    found: list[Point] = []
    for world in worlds(table).index[:WORLDS]:
        own = table[(table[list(WORLD)] == list(world)).all(axis=1)]
        for trace in TRACES:
            best = own[own["F-INDEX"] == trace].head(POINTS)
            found += [_point(row) for _, row in best.iterrows()]
    return found


def left_out(table: pd.DataFrame) -> int:
    """Return how many points fit in the first stage, given its table, and do not go on."""
    best = finalists(table)
    return sum(_point(row) not in best for _, row in table[table["fits"]].iterrows())


def nearest(table: pd.DataFrame) -> dict[str, Point]:
    """Return the point of each trace that the rule takes, given the table of the second stage."""
    if not table["fits"].any():
        return {trace: (*PLAINEST, trace) for trace in TRACES}
    world = worlds(table).index[0]
    own = table[(table[list(WORLD)] == list(world)).all(axis=1)]
    return {trace: _point(own[own["F-INDEX"] == trace].iloc[0]) for trace in TRACES}


def _point(row: pd.Series) -> Point:
    values = tuple(row[[*WORLD, *TRACE, "F-INDEX"]])
    return next(point for point in points() if point == values)


def rule_follows(table: pd.DataFrame) -> bool:
    """Return whether the register's defaults are what the rule takes from the second stage."""
    return nearest(table) == {trace: chosen(trace) for trace in TRACES}
