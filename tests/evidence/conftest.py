from __future__ import annotations

import pandas as pd
import pytest

from replication import Demos
from replication.evidence.experiments import NAMED, Key, conditions_of
from replication.evidence.specifications import Specification
from replication.trials.condition import Condition
from replication.trials.measures import measure_trials
from replication.trials.results import Results
from replication.trials.run import run_trials
from replication.trials.store import Store

FEW = {"episodes": 100, "horizon": 40}

Run = tuple[Results, dict[Specification, dict[Key, Condition]]]


def table_of(run: Run) -> pd.DataFrame:
    """Return the table of the trials of a run, numbered by specification."""
    results, conditions = run
    return pd.concat(
        [
            measure_trials(results, own.values()).assign(number=number)
            for number, own in enumerate(conditions.values())
        ],
        ignore_index=True,
    )


@pytest.fixture(scope="session")
def tiny(small_demos: Demos, tmp_path_factory: pytest.TempPathFactory) -> Run:
    """Run two specifications, the second with a cap that most trials reach, and one method less."""
    usual = conditions_of(small_demos, FEW, sets=[NAMED])
    capped = conditions_of(small_demos, {**FEW, "max_iterations": 5}, sets=[NAMED])
    conditions = {
        Specification("single", ()): {
            key: one for key, one in usual.items() if one.rule.under("printed") == key[1]
        },
        Specification("single", (("ITERATION-CAP", 5),)): {
            key: one
            for key, one in capped.items()
            if one.rule.under("updated") == key[1] and one.method != "adaboost"
        },
    }
    store = Store(tmp_path_factory.mktemp("sensitivity") / "trials.sqlite")
    every = [*usual.values(), *capped.values()]
    return run_trials(every, trials=6, store=store, seed=2), conditions
