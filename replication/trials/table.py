"""The table of trials that everything published follows from: as planned, and as computed."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import pandas as pd

from replication.trials.condition import Condition
from replication.trials.measures import Report, measure_trials, planned_trials


@dataclass(frozen=True)
class Group:
    """Conditions that are run with equally many trials, and columns that they have in common."""

    conditions: Sequence[Condition]
    trials: int
    labels: Mapping[str, Any] = field(default_factory=dict)


def planned_table(groups: Sequence[Group], seed: int) -> pd.DataFrame:
    """Return the columns that name the trials of all groups; nothing is computed."""
    return _table(groups, lambda group: planned_trials(group.conditions, group.trials, seed))


def computed_table(
    groups: Sequence[Group],
    report: Report | None = None,
    *,
    errors: bool = False,
    path: bool = False,
    **settings: Any,
) -> pd.DataFrame:
    """Compute the trials of all groups, and return them measured, in the same order.

    `report`, `errors` and `path` are those of :func:`replication.trials.measures.measure_trials`,
    `settings` those of :func:`replication.trials.run.run_trials`.
    """
    from replication.trials.run import run_trials  # needs an extra, as groups alone do not

    results = {
        trials: run_trials(
            [one for group in groups if group.trials == trials for one in group.conditions],
            trials=trials,
            **settings,
        )
        for trials in dict.fromkeys(group.trials for group in groups)
    }
    return _table(
        groups,
        lambda group: measure_trials(
            results[group.trials], group.conditions, report, errors=errors, path=path
        ),
    )


def _table(groups: Sequence[Group], make: Callable[[Group], pd.DataFrame]) -> pd.DataFrame:
    """Return the tables of some groups as one, with the labels first; each trial is there once."""
    tables = []
    for group in groups:
        table = make(group)
        for place, (name, label) in enumerate(group.labels.items()):
            table.insert(place, name, label)
        tables.append(table)
    return pd.concat(tables).drop_duplicates(ignore_index=True)
