from __future__ import annotations

import pandas as pd
import pytest

from replication import Demos
from replication.demos.soccer_expert import demonstrate_soccer
from replication.envs.soccer.field import SoccerField
from replication.evidence.experiments import SETS, Key, conditions_of
from replication.trials.condition import Condition
from replication.trials.measures import measure_trials
from replication.trials.results import Results
from replication.trials.run import run_trials
from replication.trials.store import Store

FEW = {"episodes": 100, "horizon": 40}


@pytest.fixture(scope="session")
def soccer_demos() -> Demos:
    """Let the expert demonstrate robot soccer."""
    return demonstrate_soccer("soccer", SoccerField())


@pytest.fixture(scope="session")
def conditions(small_demos: Demos) -> dict[Key, Condition]:
    """Return the conditions of every method in a small maze, with few episodes."""
    return conditions_of(small_demos, FEW)


@pytest.fixture(scope="session")
def sets(small_demos: Demos) -> dict[Key, Condition]:
    """Return those of the sets of incorrect demonstrations."""
    return conditions_of(small_demos, FEW, sets=SETS)


@pytest.fixture(scope="session")
def results(
    conditions: dict[Key, Condition],
    sets: dict[Key, Condition],
    tmp_path_factory: pytest.TempPathFactory,
) -> Results:
    """Run a few trials of all of them."""
    store = Store(tmp_path_factory.mktemp("report") / "trials.sqlite")
    return run_trials([*conditions.values(), *sets.values()], trials=4, store=store, seed=2)


@pytest.fixture(scope="session")
def trials(conditions: dict[Key, Condition], results: Results) -> pd.DataFrame:
    """Return the table of the methods' trials, with their errors."""
    return measure_trials(results, conditions.values(), errors=True)
