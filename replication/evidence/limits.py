"""Where Algorithm 1 breaks: correct demonstrations that differ or are noisy, and larger mazes.

Three designs in open mazes, with Q-learning inside the loop and the registered episodes, horizon
and cap. All numbers of the design are below and were fixed before the run:

``paths``
    Several correct demonstrations, each another shortest path of the paper's open maze. d = 0 is
    out of reach, see `nearest`, so a trial ends at a plateau; once with the one trajectory behind
    each expectation that Algorithm 1 prints, and once with many, which ties may spread.
``noise``
    One correct demonstration whose driver slips with some probability a step. Where it takes two
    actions in one state, no deterministic policy takes its way.
``sizes``
    Mazes with ever longer sides, from corner to corner, and what they cost.

In the first two each trial has its own demonstrations and the same stream to learn from. A size has
few trials, since they take longest.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, NamedTuple

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from replication.baselines import BaselineCondition
from replication.evidence.experiments import NONE
from replication.evidence.limit_demos import (
    LOOKED_AT,
    contradictory,
    nearest,
    nearest_demo,
    noisy_demos,
    open_demos,
    path_demos,
)
from replication.evidence.statistics import mean_interval, share_interval
from replication.paper.params import Params
from replication.trials.measures import numbers_in
from replication.trials.table import Group

Array = NDArray[np.float64]

PART = "limits"
"""What the column `part` of the table of trials has."""

SIZE_TRIALS = 5
"""The most trials of a size, which take longest; a draw of demonstrations has one trial."""

NUMBERS = (1, 2, 3, 5)
ROLLOUTS = (1, 100)
PLATEAU = 50
"""Correct demonstrations; trajectories behind an expectation; iterations that end a trial."""

PLAIN = 0.0
LEVELS = (0.05, 0.1, 0.2)
"""Probabilities of a slip at each step: none, whose demonstration is always the same, and some."""

SIDES = (5, 10, 20, 30, 50, 70, 100)
METHODS = ("one-line", "perceptron", "unified")
"""Cells along a side. On the longest path the last move counts gamma^197 = 1e-9, the threshold of
d: on longer ones the agent would be through before the goal."""

NEAR = 1e-9
"""Distances that differ by less are equal."""


class Setting(NamedTuple):
    """A point of a design: `value` is the number of demonstrations, the level or the side.

    `draw` tells demonstrations of one point apart.
    """

    design: str
    value: float
    method: str
    rollouts: int
    draw: int


def settings(draws: int) -> list[Setting]:
    """Return all points; with more draws those before keep their places."""
    found = [Setting("sizes", side, method, 1, 0) for side in SIDES for method in METHODS]
    found.append(Setting("noise", PLAIN, "unified", 1, 0))
    for draw in range(draws):
        found += [
            Setting("paths", number, "unified", rollouts, draw)
            for number in NUMBERS
            for rollouts in ROLLOUTS
        ]
        found += [Setting("noise", level, "unified", 1, draw) for level in LEVELS]
    return found


def condition_of(setting: Setting) -> BaselineCondition:
    """Return the condition of a point."""
    choices: dict[str, Any] = {"incorrect": NONE}
    if setting.design == "sizes":
        demos = open_demos(int(setting.value))
    elif setting.design == "noise":
        demos = noisy_demos(setting.value, setting.draw)
    else:
        demos = path_demos(int(setting.value), setting.draw)
        choices |= {"plateau": PLATEAU, "rollouts": setting.rollouts}
    return BaselineCondition(demos, setting.method, Params.of(**choices))


def plan(trials: int) -> list[Group]:
    """Return what is run: a group for each point, with its place as the column `number`.

    `trials` is the number of draws of demonstrations, each of which has one trial.
    """
    groups = []
    for number, setting in enumerate(settings(trials)):
        n = min(trials, SIZE_TRIALS) if setting.design == "sizes" else 1
        if setting.value == PLAIN:
            n = trials
        groups.append(Group([condition_of(setting)], n, {"part": PART, "number": number}))
    return groups


# --- tables --------------------------------------------------------------------------------------


def paths_table(trials: pd.DataFrame) -> pd.DataFrame:
    """Return how near the agent comes to demonstrations that differ.

    Returns
    -------
    DataFrame
        One row for each number of demonstrations and of rollouts: `n` trials; means with their 95 %
        intervals of `d`, the least of a trial, and of `learned`, the least after an update; `at`,
        the iteration of d, its median with the quartiles; `shortest` and `demo`, the means of
        :func:`nearest` and :func:`nearest_demo`; the shares of trials that
        come as near as `shortest` (`reached`), nearer (`nearer`), and to zero (`zero`), and that
        were nearest before they learned anything (`untrained`).
    """
    rows = []
    for (number, rollouts), own in _points(trials, "paths", ["value", "rollouts"]):
        demos = [path_demos(int(number), draw) for draw in own["draw"]]
        gamma = Params().learner.gamma
        shortest = np.array([nearest(one, gamma=gamma) for one in demos])
        histories = numbers_in(own["errors"])
        least = np.array([d.min() for d in histories])
        at = np.array([d.argmin() for d in histories], float)
        rows.append(
            {"number": int(number), "rollouts": int(rollouts), "n": len(own)}
            | _mean("d", least)
            | dict(
                zip(("at", "at_low", "at_high"), np.quantile(at, [0.5, 0.25, 0.75]), strict=True)
            )
            | _mean("learned", np.array([d[1:].min() for d in histories]))
            | {
                "shortest": shortest.mean(),
                "demo": np.mean([nearest_demo(one, gamma=gamma) for one in demos]),
                "reached": (least <= shortest + NEAR).mean(),
                "nearer": (least < shortest - NEAR).mean(),
                "zero": own["converged"].mean(),
                "untrained": (at == 0).mean(),
            }
        )
    return pd.DataFrame(rows)


def noise_table(trials: pd.DataFrame) -> pd.DataFrame:
    """Return how the paper's method bears slips of the demonstrator.

    Returns
    -------
    DataFrame
        One row for each level: `n` trials; `share` of them that end at d = 0 within the cap, with
        its 95 % interval; the median of `iterations`, with the cap for those that do not; the mean
        `d`, the least of a trial, with its interval; `against`, the trials whose
        demonstration contradicts itself, and `against_zero`, those of them at d = 0;
        `contradictory`, the share of LOOKED_AT demonstrations that do, with its interval.
    """
    rows = []
    for (level,), own in _points(trials, "noise", ["value"]):
        done = own["converged"].to_numpy(bool)
        against = np.array([bool(noisy_demos(level, draw).conflicts()) for draw in own["draw"]])
        least = np.array([d.min() for d in numbers_in(own["errors"])])
        rows.append(
            {"level": level, "n": len(own)}
            | _share("share", int(done.sum()), len(done))
            | {"iterations": own["iterations"].median()}
            | _mean("d", least)
            | {"against": int(against.sum()), "against_zero": int((against & done).sum())}
            | _share("contradictory", contradictory(level), LOOKED_AT)
        )
    return pd.DataFrame(rows)


def sizes_table(trials: pd.DataFrame) -> pd.DataFrame:
    """Return what larger mazes cost, one row for each side and method.

    Returns
    -------
    DataFrame
        `cells` of the maze and `moves` of the demonstration; `n` trials; `zero`, the share of them
        that end at d = 0 within the cap; the means with their 95 % intervals of `iterations` and of
        `steps` in the environment, in which those at the cap count as they are; `episode`, the mean
        number of steps in an episode.
    """
    rows = []
    for (side, method), own in _points(trials, "sizes", ["value", "method"]):
        iterations, steps = (own[name].to_numpy(float) for name in ("iterations", "steps"))
        side = int(side)
        rows.append(
            {"side": side, "cells": side**2, "moves": 2 * (side - 1), "method": method}
            | {"n": len(own), "zero": own["converged"].mean()}
            | _mean("iterations", iterations)
            | _mean("steps", steps)
            | {"episode": steps.sum() / iterations.sum() / Params().learner.episodes}
        )
    return pd.DataFrame(rows)


MEASURES = ("trial", "iterations", "steps", "converged", "errors")
"""What the tables follow from."""


def _points(
    trials: pd.DataFrame, design: str, names: list[str]
) -> Iterator[tuple[tuple[Any, ...], pd.DataFrame]]:
    """Yield the trials of each point of a design, with the columns of `Setting`."""
    own = trials[trials["part"] == PART]
    points = pd.DataFrame(settings(len(own)), columns=Setting._fields)
    joined = own[["number", *MEASURES]].merge(points, left_on="number", right_index=True)
    joined = joined[joined["design"] == design].sort_values([*names, "draw", "trial"])
    yield from joined.groupby(names, sort=False)


def _mean(name: str, values: Array) -> dict[str, float]:
    low, high = (values.mean(),) * 2 if len(values) == 1 else mean_interval(values)
    return {name: values.mean(), f"{name}_low": float(low), f"{name}_high": float(high)}


def _share(name: str, k: int, n: int) -> dict[str, float]:
    low, high = share_interval(k, n)
    return {name: k / n, f"{name}_low": low, f"{name}_high": high}
