"""From trials to what the figures show: the plotted numbers, and each figure in words."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from replication.demos.model import Demos
from replication.envs.maze import Maze, as_maze
from replication.evidence.experiments import F_LABELS, Key
from replication.irl import READINGS, Trial, get_method
from replication.irl.expectations import visited
from replication.report.figures import COLOURS, Counts, Curves
from replication.trials.compute import TRACED_TRIAL
from replication.trials.condition import Condition
from replication.trials.measures import Report
from replication.trials.results import Results


def error_panels(
    results: Results,
    conditions: Mapping[Key, Condition],
    methods: Sequence[str],
    published: Mapping[str, int],
    *,
    median: bool = False,
) -> dict[str, list[Curves]]:
    """Return the errors of some methods, a panel for each reading of Eq. 9 (Figs. 5, 9 and 12).

    Parameters
    ----------
    results, conditions, methods
        What to draw.
    published
        The iteration at which the paper's own curve is zero.
    median
        Whether each curve is that of the median trial (FIG12-TRIAL), or of trial 0 (FIG5-TRIAL).
    """
    return {
        F_LABELS[f]: [
            Curves(
                get_method(name).label,
                COLOURS[name],
                results.errors(_condition(conditions, name, f)),
                median_trial(results.iterations(_condition(conditions, name, f)))
                if median
                else TRACED_TRIAL,
                published.get(name),
                dashed=name == "unified-incorrect",
            )
            for name in methods
        ]
        for f in READINGS
    }


def iteration_panels(
    results: Results,
    conditions: Mapping[Key, Condition],
    methods: Sequence[str],
    published: Mapping[str, float],
) -> dict[str, list[Counts]]:
    """Return the iterations of some methods, a panel for each reading of Eq. 9 (Figs. 6 and 9).

    `published` gives the paper's means.
    """
    return {
        F_LABELS[f]: [
            Counts(
                get_method(name).label,
                COLOURS[name],
                results.iterations(_condition(conditions, name, f)),
                published.get(name),
                dashed=name == "unified-incorrect",
            )
            for name in methods
        ]
        for f in READINGS
    }


def median_trial(iterations: NDArray[np.int64]) -> int:
    """Return the first trial with the (lower) median number of iterations.

    Examples
    --------
    >>> median_trial(np.array([9, 3, 5, 5]))
    2
    """
    middle = np.sort(iterations)[(len(iterations) - 1) // 2]
    return int(np.flatnonzero(iterations == middle)[0])


def surfaces(trial: Trial, report: Report) -> dict[str, NDArray[np.float64]]:
    """Return Q in the mid-term, Q at the end and the reward at the end, each [state] (Fig. 7).

    Parameters
    ----------
    trial
        A trial with snapshots.
    report
        What stands for a state's actions (FIG7-SURFACE), and when mid-term is (FIG7-MIDTERM).
    """
    assert trial.snapshots is not None, "surfaces need a trial that kept its snapshots"
    reduce = np.max if report.surface == "max" else np.mean
    middle = round(report.mid_term * trial.iterations)
    return {
        f"(a) Q after {middle} iterations": reduce(trial.snapshots.q[middle], axis=1),
        f"(b) Q at the end ({trial.iterations})": reduce(trial.q, axis=1),
        "(c) reward at the end": reduce(trial.weights, axis=1),
    }


def marked_pairs(results: Results, condition: Condition) -> pd.DataFrame:
    """Return how often Algorithm 2's special case applies in the traced trial, by iteration.

    `wrong` counts the pairs that the agent visits and the expert never does; `marked` those of them
    that an incorrect demonstration visits; `again` those that were marked and wrong before: under
    F_i as printed only these are moved with the largest trace.
    """
    trial = results.trial(condition, TRACED_TRIAL)
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


def set_panels(table: pd.DataFrame) -> dict[str, pd.DataFrame]:
    """Return what each set of incorrect demonstrations saves, a panel for each reading of Eq. 9.

    `table` is that of :func:`replication.evidence.tables.sets_table`, whose differences are negative where
    iterations are saved.
    """
    shown = table[table["set"] != "none"]
    saved = pd.DataFrame(
        {
            "F": shown["F"],
            "set": shown["set"],
            "leaving": shown["leaving"],
            "saved": 0 - shown["difference"],
            "low": 0 - shown["high"],
            "high": 0 - shown["low"],
        }
    )
    return {F_LABELS[f]: part for f, part in saved.groupby("F", sort=False)}


def set_numbers(panels: Mapping[str, pd.DataFrame]) -> pd.DataFrame:
    """Return what a figure of sets shows: one row a set and reading of Eq. 9."""
    return pd.concat(panels.values()) if panels else pd.DataFrame(columns=["F", "set", "saved"])


def demo_numbers(demos: Demos) -> pd.DataFrame:
    """Return demonstrations as rows: kind, demo, step, and x, y in cells from the lower left."""
    maze = as_maze(demos.environment)
    rows = []
    for demo in (*demos.correct, *demos.incorrect):
        for step, state in enumerate(demo.states):
            row, column = maze.cell(int(state))
            rows.append((demo.kind, demo.name, step, column, maze.shape[0] - 1 - row))
    return pd.DataFrame(rows, columns=["kind", "demo", "step", "x", "y"])


def error_numbers(panels: Mapping[str, Sequence[Curves]]) -> pd.DataFrame:
    """Return what an error figure shows: the traced trial and the quartiles at each iteration."""
    parts = []
    for title, curves in panels.items():
        for one in curves:
            low, middle, high = np.quantile(one.errors, [0.25, 0.5, 0.75], axis=0)
            columns = {
                "F": title,
                "method": one.label,
                "iteration": np.arange(len(low)),
                "drawn_trial": one.traced,
                "error": one.errors[one.traced],
                "quartile_1": low,
                "median": middle,
                "quartile_3": high,
            }
            parts.append(pd.DataFrame(columns))
    return pd.concat(parts)


def iteration_numbers(panels: Mapping[str, Sequence[Counts]]) -> pd.DataFrame:
    """Return what a figure of iterations shows: one row a trial."""
    parts = [
        pd.DataFrame(
            {
                "F": title,
                "method": one.label,
                "trial": np.arange(len(one.iterations)),
                "iterations": one.iterations,
            }
        )
        for title, counts in panels.items()
        for one in counts
    ]
    return pd.concat(parts)


def surface_numbers(maze: Maze, values: Mapping[str, NDArray[np.float64]]) -> pd.DataFrame:
    """Return what the surfaces show: one row a cell, x and y in cells from the lower left."""
    rows, columns = np.divmod(np.arange(maze.n_states), maze.shape[1])
    table = pd.DataFrame({"x": columns, "y": maze.shape[0] - 1 - rows, **values})
    return table[maze.free]


def describe_demos(demos: Demos) -> str:
    """Return a map of demonstrations in words."""
    moves = len(demos.correct[0].actions)
    counts = [f"{sum(d.kind == kind for d in demos.incorrect)} {kind}" for kind in demos.kinds]
    incorrect = f"; incorrect ones: {', '.join(counts)}" if counts else ""
    return f"Map of {demos.task} with a correct demonstration of {moves} moves{incorrect}."


def describe_errors(panels: Mapping[str, Sequence[Curves]]) -> str:
    """Return a figure of errors in words: when half of the trials have reached zero."""
    parts = [
        f"{one.label}, {title}: half of the trials are at zero after "
        f"{int((np.median(one.errors, axis=0) > 0).sum())} iterations"
        for title, curves in panels.items()
        for one in curves
    ]
    return f"Error d against iteration. {'; '.join(parts)}."


def describe_iterations(panels: Mapping[str, Sequence[Counts]]) -> str:
    """Return a figure of iterations in words: the means."""
    parts = [
        f"{one.label}, {title}: {one.iterations.mean():.1f} on average"
        for title, counts in panels.items()
        for one in counts
    ]
    return f"Iterations of each trial. {'; '.join(parts)}."


def describe_surfaces(values: Mapping[str, NDArray[np.float64]]) -> str:
    """Return the surfaces in words: the range of their values."""
    parts = [f"{title}: {one.min():.3g} to {one.max():.3g}" for title, one in values.items()]
    return f"Surfaces over the maze. {'; '.join(parts)}."


def describe_sets(panels: Mapping[str, pd.DataFrame]) -> str:
    """Return what sets of incorrect demonstrations save, in words."""
    parts = [
        f"{row.set}, {title}: {row.saved:.1f} ({row.low:.1f} to {row.high:.1f})"
        for title, table in panels.items()
        for row in table.itertuples()
    ]
    return f"Iterations saved by incorrect demonstrations, with 95 % intervals. {'; '.join(parts)}."


def _condition(conditions: Mapping[Key, Condition], method: str, f: str) -> Condition:
    """Return a method's condition under a reading of Eq. 9, or its only one if it has no trace."""
    return conditions[method, f] if (method, f) in conditions else conditions[method, ""]
