"""What a notebook needs of one experiment: conditions, trials, and where to show them."""

from __future__ import annotations

from collections.abc import Mapping
from functools import cached_property
from typing import Any

import pandas as pd
from IPython.display import Markdown

from replication.demos.files import load_demos
from replication.evidence import experiments
from replication.evidence.experiments import EXPERIMENTS, Key
from replication.files import resolve
from replication.irl import Trial
from replication.paper.published import PUBLISHED, PUBLISHED_CURVES, Published
from replication.report.outputs import Outputs
from replication.report.readable import markdown
from replication.trials.compute import TRACED_TRIAL
from replication.trials.condition import Condition
from replication.trials.measures import Report, measure_trials
from replication.trials.results import Results
from replication.trials.run import run_trials
from replication.trials.store import Store


class Study(Outputs):
    """An experiment that is run, measured and shown; trials are run when they are first needed.

    Parameters
    ----------
    experiment
        The experiment whose methods and learning parameters are used.
    demos
        File of demonstrations. If they are of another task, nothing is published to compare with.
    choices
        Registered choices that differ from the experiment's.
    seed, jobs
        Root seed, and number of worker processes.
    store, out
        The file of finished trials, and the folder for the results.
    report
        Fields of :class:`replication.trials.measures.Report`, such as the number of trials.
    """

    def __init__(
        self,
        experiment: str,
        demos: str,
        choices: Mapping[str, Any],
        *,
        seed: int,
        jobs: int,
        store: str,
        out: str,
        **report: Any,
    ) -> None:
        super().__init__(resolve(out))
        design = EXPERIMENTS[experiment]
        self.demos = load_demos(resolve(demos))
        self.choices = {**design.choices, **choices}
        self.report = Report(**report)
        self.seed, self.jobs, self.store = seed, jobs, Store(resolve(store))
        self.conditions = experiments.method_conditions(self.demos, self.choices, design.methods)
        own = self.demos.task == experiment
        self.published: Mapping[str, Published] = PUBLISHED[experiment] if own else {}
        curves = PUBLISHED_CURVES.get(experiment, {})
        self.published_curves: Mapping[str, int] = curves if own else {}

    def of(self, *methods: str) -> dict[Key, Condition]:
        """Return the conditions of some methods."""
        return {key: each for key, each in self.conditions.items() if key[0] in methods}

    @cached_property
    def sets(self) -> dict[Key, Condition]:
        """The conditions of the sets of incorrect demonstrations, by set and reading of Eq. 9."""
        return experiments.set_conditions(self.demos, self.choices)

    @cached_property
    def results(self) -> Results:
        """The trials of all methods."""
        return self._run(self.conditions, self.report.trials)

    @cached_property
    def main(self) -> pd.DataFrame:
        """The table of the methods' trials."""
        return measure_trials(self.results, self.conditions.values(), self.report)

    @cached_property
    def trials(self) -> pd.DataFrame:
        """The table of all trials, those of the sets included."""
        results = self._run(self.sets, self.report.set_trials)
        others = measure_trials(results, self.sets.values(), self.report)
        return pd.concat([self.main, others]).drop_duplicates(ignore_index=True)

    def traced(self, reading: str) -> dict[Key, Trial]:
        """Return the trial of each method that kept every iteration, under a reading of Eq. 9."""
        return {
            key: self.results.trial(condition, TRACED_TRIAL, snapshots=True)
            for key, condition in self.conditions.items()
            if experiments.applies(key[1], reading)
        }

    def show(self, table: pd.DataFrame) -> Markdown:
        """Show a table that is not written."""
        return Markdown(markdown(table))

    def _run(self, conditions: Mapping[Key, Condition], trials: int) -> Results:
        every = list(conditions.values())
        return run_trials(every, trials=trials, store=self.store, jobs=self.jobs, seed=self.seed)
