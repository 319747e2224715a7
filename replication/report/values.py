"""Fig. 7: Q and the reward over the maze in one trial, and Q along the expert's path in all."""

from __future__ import annotations

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from replication.demos.model import Demos
from replication.envs.maze import Maze, as_maze
from replication.evidence.statistics import mean_interval
from replication.irl import Trial
from replication.report.drawing import number
from replication.report.maze import places
from replication.report.picture import Picture
from replication.report.readable import F_LABELS
from replication.report.value_panels import draw_values, grid_of
from replication.trials.measures import ALONG, Report, numbers_in

DUST = 1e-9
"""What is smaller, compared with the largest value, comes from rounding."""


def values(trial: Trial, demos: Demos, report: Report, trials: pd.DataFrame) -> Picture:
    """Show Q and the reward over the maze, and Q along the path, in the mid-term and at the end.

    Parameters
    ----------
    trial
        A trial with its snapshots, whose Q and reward are shown over the maze.
    demos
        Its demonstrations.
    report
        What stands for a state's actions (FIG7-SURFACE), and when mid-term is (FIG7-MIDTERM).
    trials
        The rows of the unified method, with the columns :data:`ALONG`, for each reading.
    """
    maze = as_maze(demos.environment)
    numbers = pd.concat(
        [
            map_values(trial, maze, report),
            _path(maze, demos),
            *(_along(rows, str(reading)) for reading, rows in trials.groupby("reading")),
        ],
        ignore_index=True,
    )
    return Picture(numbers, draw_values, _words(numbers))


def map_values(trial: Trial, maze: Maze, report: Report) -> pd.DataFrame:
    """Return Q in the mid-term, Q at the end and the reward at the end; obstacles have none."""
    assert trial.snapshots is not None, "surfaces need a trial that kept its snapshots"
    reduce = np.max if report.surface == "max" else np.mean
    middle = round(report.mid_term * trial.iterations)
    tables = {
        ("q_mid", middle): trial.snapshots.q[middle],
        ("q_end", trial.iterations): trial.q,
        ("reward_end", trial.iterations): trial.weights,
    }
    x, y = places(maze, np.arange(maze.n_states))
    parts = []
    for (surface, iteration), table in tables.items():
        value = reduce(table, axis=1)
        value[np.abs(value) < DUST * np.abs(value).max()] = 0
        value = np.where(maze.free, value, np.nan)
        columns = {"surface": surface, "iteration": iteration, "x": x, "y": y, "value": value}
        parts.append(pd.DataFrame(columns))
    return pd.concat(parts, ignore_index=True)


def _path(maze: Maze, demos: Demos) -> pd.DataFrame:
    x, y = places(maze, demos.correct[0].states)
    return pd.DataFrame({"surface": "path", "x": x, "y": y, "step": np.arange(len(x))})


def _along(trials: pd.DataFrame, reading: str) -> pd.DataFrame:
    """Return what is drawn along the path: means over trials, and what lies about them."""
    middle, growth = (np.array(numbers_in(trials[name])) for name in ALONG)
    parts = {"along_mid": _halves(middle), "along_end": _halves(middle + growth)}
    parts["along_growth"] = _means(growth.T)
    parts["growth"] = _means(growth.mean(axis=1)[None])
    for surface, part in parts.items():
        part["surface"] = surface
        part["step"] = np.arange(len(part)) if surface != "growth" else np.nan
    return pd.concat(parts.values()).assign(reading=reading, n=len(trials))


def _halves(rows: NDArray[np.float64]) -> pd.DataFrame:
    """Return the mean and the middle half of values, `[trial, step]`."""
    low, high = np.quantile(rows, [0.25, 0.75], axis=0)
    return pd.DataFrame({"value": rows.mean(axis=0), "low": low, "high": high})


def _means(rows: NDArray[np.float64]) -> pd.DataFrame:
    """Return the mean of values, `[step, trial]`, and its 95 % interval, which one trial lacks."""
    mean = rows.mean(axis=1)
    low, high = mean_interval(rows) if rows.shape[1] > 1 else (mean, mean)
    return pd.DataFrame({"value": mean, "low": low, "high": high})


def _words(numbers: pd.DataFrame) -> str:
    middle, end = (
        numbers.loc[numbers["surface"] == name, "iteration"].iloc[0] for name in ("q_mid", "q_end")
    )
    texts = {
        "q_mid": f"Q after {middle:.0f} of {end:.0f} iterations",
        "q_end": "at the end",
        "reward_end": "the reward at the end",
    }
    ranges = []
    for name, text in texts.items():
        value = numbers.loc[numbers["surface"] == name, "value"]
        ranges.append(f"{text} from {number(value.min())} to {number(value.max())}")
    change = grid_of(numbers, "q_end") - grid_of(numbers, "q_mid")
    ranges.insert(
        2, f"the change in between from {number(np.nanmin(change))} to {number(np.nanmax(change))}"
    )
    growth = [
        f"{number(row.value)} ({number(row.low)} to {number(row.high)}) under "
        f"{F_LABELS[row.reading]}"
        for row in numbers[numbers["surface"] == "growth"].itertuples()
    ]
    n = numbers["n"].max()
    return (
        f"Maps of one trial: {'; '.join(ranges)}. Growth of Q from the mid-term to the end, mean "
        f"over the expert's path and {n:.0f} trials with its 95 % interval: {'; '.join(growth)}."
    )
