"""What a notebook needs of one experiment: conditions, trials, and where to show them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import cached_property
from typing import Any

import numpy as np
import pandas as pd
from IPython.display import Markdown

from replication.demos.files import load_demos
from replication.errors import UserError, show
from replication.evidence import experiments, tables
from replication.evidence.experiments import EXPERIMENTS, Key
from replication.files import parse_json, resolve
from replication.irl import Trial
from replication.learning.seeds import child
from replication.paper.published import PUBLISHED, PUBLISHED_CURVES, Published
from replication.report.outputs import Outputs
from replication.report.readable import markdown, readable_means
from replication.trials.compute import TRACED_TRIAL
from replication.trials.measures import Report
from replication.trials.run import run_trials
from replication.trials.store import Store
from replication.trials.table import Group


class Study(Outputs):
    """An experiment that is run, measured and shown; trials are run when they are first needed.

    Parameters
    ----------
    experiment
        The experiment whose methods and learning parameters are used.
    demos
        File of demonstrations. If they are of another task, nothing is published to compare with.
    choices
        Registered choices that differ from the experiment's; also as JSON text, which is what
        `papermill -p` makes of them.
    seed, jobs
        Root seed, and number of worker processes.
    store, out
        The file of finished trials, and the folder for the results.
    trials
        Number of trials of each condition.
    sets, set_trials
        Sets of incorrect demonstrations that are run beside those by which the paper is judged, and
        the number of their trials.
    path
        Whether the table of trials has Q along the expert's path.
    report
        Fields of :class:`replication.trials.measures.Report`.
    """

    def __init__(
        self,
        experiment: str,
        demos: str,
        choices: Mapping[str, Any] | str,
        *,
        seed: int,
        jobs: int,
        store: str,
        out: str,
        trials: int,
        sets: Sequence[str] = (),
        set_trials: int = 0,
        path: bool = False,
        **report: Any,
    ) -> None:
        super().__init__(resolve(out))
        design = EXPERIMENTS[experiment]
        self.demos = load_demos(resolve(demos))
        self.choices = {**design.choices, **_given(choices)}
        self.report = Report(**report)
        self.number, self.set_number, self.path = trials, set_trials, path
        self.settings: dict[str, Any] = {"store": Store(resolve(store)), "jobs": jobs, "seed": seed}
        given = self.demos, self.choices, design.methods
        self.conditions = experiments.conditions_of(*given, design.sets)
        self.sets = experiments.conditions_of(*given, sets) if sets else {}
        own = self.demos.task == experiment
        self.published: Mapping[str, Published] = PUBLISHED[experiment] if own else {}
        curves = PUBLISHED_CURVES.get(experiment, {})
        self.published_curves: Mapping[str, int] = curves if own else {}

    @cached_property
    def trials(self) -> pd.DataFrame:
        """The table of all trials, those of the sets included; it is written."""
        groups = [
            Group(list(self.conditions.values()), self.number),
            Group(list(self.sets.values()), self.set_number),
        ]
        settings = {**self.settings}
        stage = settings.pop("seed"), lambda _: groups
        columns: dict[str, Any] = {"report": self.report, "errors": True, "path": self.path}
        return self.computed(stage, **columns, **settings)

    @cached_property
    def main(self) -> pd.DataFrame:
        """The rows of the methods' own trials."""
        own = [tables.rows_of(self.trials, each) for each in self.conditions.values()]
        return pd.concat([rows.head(self.number) for rows in own], ignore_index=True)

    @property
    def widest(self) -> str:
        """The last of the judged sets of incorrect demonstrations that the file has."""
        return [set for _, _, set in self.conditions][-1]

    def of(self, *methods: str) -> pd.DataFrame:
        """Return the rows of some methods' own trials."""
        return self.main[self.main["method"].isin(methods)].reset_index(drop=True)

    def traced(self, reading: str, set: str) -> dict[Key, Trial]:
        """Return the trial of each method that kept every iteration.

        `reading` is that of Eq. 9, `set` that of incorrect demonstrations, for methods that have
        one.
        """
        shown = {
            key: condition
            for key, condition in self.conditions.items()
            if key[1] == condition.rule.under(reading) and key[2] in (experiments.NONE, set)
        }
        results = run_trials(list(shown.values()), trials=TRACED_TRIAL + 1, **self.settings)
        return {
            key: results.trial(condition, TRACED_TRIAL, snapshots=True)
            for key, condition in shown.items()
        }

    def replayed(self, key: Key, k: int) -> Trial:
        """Return trial `k` of a condition with all that happened in it, computed again."""
        seed = child(np.random.SeedSequence(self.settings["seed"]), k)
        return self.conditions[key].trial(seed=seed, keep=True)

    def show(self, table: pd.DataFrame) -> Markdown:
        """Show a table of means, which is not written."""
        return Markdown(markdown(readable_means(table)))


def _given(choices: Mapping[str, Any] | str) -> dict[str, Any]:
    """Return choices; refuse what names none."""
    try:
        given = parse_json(choices) if isinstance(choices, str) else choices
    except ValueError:
        given = None
    if not isinstance(given, Mapping):
        raise UserError(f'choices = {show(choices)} is no JSON object such as {{"alpha": 0.1}}')
    return dict(given)
