from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import pytest

from replication.evidence import sweep
from replication.evidence.sweep import PLAN, Sweep
from replication.trials.condition import Condition
from replication.trials.run import run_trials
from replication.trials.store import Store


def test_limits_reach_the_trials(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A quick look runs so many specifications of so many trials, from the given seed."""
    runs: list[tuple[int, dict[str, Any]]] = []

    def run(conditions: Sequence[Condition], **settings: Any) -> Any:
        runs.append((len(conditions), settings))
        return run_trials(conditions, **settings)

    monkeypatch.setattr(sweep, "run_trials", run)
    store = Store(tmp_path / "trials.sqlite")
    table = Sweep(store, jobs=1, seed=7, most_trials=3, most_specifications=1).single("mazes")
    ((conditions, settings),) = runs
    assert conditions == 3  # one reading of Eq. 9 of three methods
    assert (settings["trials"], settings["seed"], settings["store"]) == (3, 7, store)
    assert table["claim"].tolist() == list(PLAN.mazes.claims)
    assert set(table["specification"]) == {"default"}
    assert set(table["n"]) == {3}
