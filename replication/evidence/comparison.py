"""The methods of the paper beside all baselines: what each reaches, and what it costs.

Iterations of the paper's loop are one currency among others: a method without a loop is run for one
iteration, and may have planned some hundred times before. So each method is held to d at the end,
to iterations, to the steps that it learned from and to its plans; with Q-learning inside, as the
paper has it, and with exact planning.
"""

from __future__ import annotations

from collections.abc import Iterator
from functools import cache
from typing import Any, NamedTuple

import numpy as np
import pandas as pd

from replication.baselines import BASELINES, BaselineCondition, find_method
from replication.baselines.baseline import Baseline
from replication.demos.files import load_demos
from replication.demos.maze_expert import Expert
from replication.demos.model import Demos
from replication.evidence.experiments import EXPERIMENTS, GENERAL, NONE
from replication.evidence.specifications import MAPS
from replication.evidence.statistics import mean_interval
from replication.evidence.variations import maze_demos
from replication.irl import METHODS, Method
from replication.irl.methods import TRACES
from replication.paper.params import Params
from replication.paper.published import SOCCER
from replication.trials.measures import error_histories, numbers_in
from replication.trials.table import Group

PART = "comparison"
"""What the column `part` of the table of trials has."""

SOLVERS = ("q-learning", "planning")

IN_SOCCER = (
    *("cloning", "one-line", "perceptron", "projection"),
    *("unified", "unified-incorrect", "wary"),
)
"""Methods that are run in robot soccer, whose trials take longest."""


class Setting(NamedTuple):
    """What is compared: a method with some demonstrations in a task, and what is inside its loop.

    `set` is "none" or the general list of incorrect demonstrations, in soccer all of them.
    """

    task: str
    method: str
    reading: str
    set: str
    solver: str


@cache
def conditions() -> dict[Setting, BaselineCondition]:
    """Return the condition of each setting."""
    found = {}
    for world in MAPS:
        demos = maze_demos(world, Expert())
        for solver in SOLVERS:
            for condition in _each(demos, [*METHODS, *BASELINES], GENERAL, {"solver": solver}):
                found[_setting(condition)] = condition
    soccer = load_demos(EXPERIMENTS["soccer"].demos)
    for condition in _each(soccer, IN_SOCCER, "all", SOCCER):
        if condition.params.update.f_index == TRACES[0]:
            found[_setting(condition)] = condition
    return found


def _each(
    demos: Demos, methods: Any, incorrect: str, choices: dict[str, Any]
) -> Iterator[BaselineCondition]:
    """Yield each method under each trace, with and without the incorrect demonstrations."""
    for name in methods:
        method = find_method(name)
        for reading in method.readings:
            if reading == "at-once":
                continue
            given = {**choices, **({"f_index": reading} if reading else {})}
            needs = isinstance(method, Baseline) and method.needs_incorrect
            if _without(method) == name and not needs:
                yield BaselineCondition(demos, name, Params.of(**given, incorrect=NONE))
            if method.uses_incorrect:
                yield BaselineCondition(demos, name, Params.of(**given, incorrect=incorrect))


def _without(method: Method) -> str:
    """Return the name of the method that this one is without incorrect demonstrations."""
    if method.uses_incorrect and method.baseline:
        return method.baseline
    return method.name


def _setting(condition: BaselineCondition) -> Setting:
    params = condition.params
    reading = params.update.f_index if condition.named.readings != ("",) else ""
    set = params.demonstrations.incorrect if condition.named.uses_incorrect else NONE
    return Setting(condition.demos.task, condition.method, reading, set, params.learner.solver)


def plan(trials: int) -> list[Group]:
    """Return what is run: a group for each condition, with its place as the column `number`."""
    return [
        Group([condition], trials, {"part": PART, "number": number})
        for number, condition in enumerate(conditions().values())
    ]


def comparison_table(trials: pd.DataFrame) -> pd.DataFrame:
    """Return what each setting came to, one row each.

    Returns
    -------
    DataFrame
        The columns of `Setting`; `use`, what the method makes of incorrect demonstrations; `n`
        trials; `reached`, the share of them with d = 0; means with their 95 % intervals of `d` at
        the end, `iterations` and `steps` of learning; `plans`, how often a method without a loop
        planned, beside the iterations of one that plans inside; `saved`, the mean number of
        iterations that it took fewer than without incorrect demonstrations, over the same seeds;
        `over_printed` and `over_updated`, how many more than the unified method without them.
    """
    own_trials = trials[trials["part"] == PART].sort_values(["number", "trial"])
    of = dict(zip(conditions(), (own for _, own in own_trials.groupby("number")), strict=True))
    counts = {setting: own["iterations"].to_numpy(float) for setting, own in of.items()}
    rows = []
    for setting, condition in conditions().items():
        own = of[setting]
        d = np.array([history[-1] for history in numbers_in(own["errors"])])
        row = {
            **setting._asdict(),
            "use": condition.named.use,
            "n": len(own),
            "reached": float(own["converged"].mean()),
        }
        for name, values in (("d", d), ("iterations", counts[setting]), ("steps", own["steps"])):
            row |= _mean(name, np.asarray(values, float))
        has_loop = not isinstance(condition.named, Baseline) or condition.named.find is None
        row["plans"] = 0.0 if has_loop else condition.found.plans
        if setting.solver == "planning":
            row["plans"] += counts[setting].mean()
        without = setting._replace(method=_without(condition.named), set=NONE)
        if setting.set != NONE and without in counts:
            row |= _mean("saved", counts[without] - counts[setting])
        for trace in TRACES:
            unified = setting._replace(method="unified", reading=trace, set=NONE)
            if unified in counts:
                row |= _mean(f"over_{trace}", counts[setting] - counts[unified])
        rows.append(row)
    return pd.DataFrame(rows)


PAPER_MAZES = ("open-maze", "obstacle-maze")


def noise_table(trials: pd.DataFrame) -> pd.DataFrame:
    """Return how the iterations of the paper's methods divide into method and learner.

    Returns
    -------
    DataFrame
        One row for each maze of the paper, method and reading, with the general list where the
        method takes any: `learned` and `planned`, the mean iterations with Q-learning and with
        exact planning inside, and their SDs; `noise` the mean difference over the same seeds, with
        its 95 % interval; `iterations_learned` and `iterations_planned`, those of each trial,
        separated by blanks.
    """
    counts = {}
    for number, setting in enumerate(conditions()):
        if setting.task in PAPER_MAZES and setting.method in METHODS:
            own = trials[(trials["part"] == PART) & (trials["number"] == number)]
            counts[setting] = own.sort_values("trial")["iterations"].to_numpy(float)
    rows = []
    for setting, learned in counts.items():
        if setting.solver != "q-learning":
            continue
        planned = counts[setting._replace(solver="planning")]
        row = {**setting._asdict(), "n": len(learned)}
        del row["solver"]
        for name, values in (("learned", learned), ("planned", planned)):
            row |= {name: values.mean(), f"{name}_sd": values.std(ddof=1)}
        row |= _mean("noise", learned - planned)
        for name, values in (("learned", learned), ("planned", planned)):
            row[f"iterations_{name}"] = " ".join(f"{value:.0f}" for value in values)
        rows.append(row)
    return pd.DataFrame(rows)


START = ("perceptron", "unified", "unified-incorrect", "wary")
"""The methods whose first iterations are looked at."""


def start_table(trials: pd.DataFrame) -> pd.DataFrame:
    """Return how trials with Q-learning begin on the paper's mazes, under the printed reading.

    Returns
    -------
    DataFrame
        One row for each maze and method, with the general list where it takes any: mean
        `collisions` while learning and `errors` of greedy trajectories in the initial phase
        (EARLY), with 95 % intervals; `d`, the median error before each iteration, separated by
        blanks; a trial that has ended keeps its last.
    """
    rows = []
    for number, setting in enumerate(conditions()):
        printed = setting.reading in ("", TRACES[0])
        wanted = setting.task in PAPER_MAZES and setting.method in START
        if not (wanted and printed and setting.solver == "q-learning"):
            continue
        own = trials[(trials["part"] == PART) & (trials["number"] == number)]
        row = {**setting._asdict(), "n": len(own)}
        for name in ("collisions", "errors"):
            row |= _mean(name, own[f"early_{name}"].to_numpy(float))
        median = np.median(error_histories(own), axis=0)
        rows.append(row | {"d": " ".join(f"{d:.4g}" for d in median)})
    return pd.DataFrame(rows)


def _mean(name: str, values: np.ndarray[Any, np.dtype[np.float64]]) -> dict[str, float]:
    """Return a mean and its interval, as three columns."""
    low, high = mean_interval(values)
    return {name: float(values.mean()), f"{name}_low": float(low), f"{name}_high": float(high)}
