from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from replication import Demos
from replication.evidence import sweep
from replication.evidence.experiments import method_conditions
from replication.evidence.sweep import PLAN, Sweep, ablations_table, numbers_table
from replication.evidence.tables import pairs_near
from replication.trials.condition import Condition
from replication.trials.run import run_trials
from replication.trials.store import Store
from tests.evidence.conftest import FEW, Run


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


def test_ablations_are_summaries_of_the_trials(tiny: Run) -> None:
    """Each row has the mean, SD and median of its own trials, and counts those at the cap."""
    results, conditions = tiny
    named = {
        (*key, str(n)): condition
        for n, run in enumerate(conditions.values())
        for key, condition in run.items()
    }
    table = ablations_table(results, named)
    keys = table[["method", "reading", "choices"]].itertuples(index=False, name=None)
    assert list(keys) == list(named)
    for row, condition in zip(table.itertuples(), named.values(), strict=True):
        counts = results.iterations(condition)
        assert (row.n, row.capped) == (6, (~results.converged(condition)).sum())
        assert (row.mean, row.median) == (counts.mean(), np.median(counts))
        assert row.sd == pytest.approx(counts.std(ddof=1))
        assert row.low <= row.mean <= row.high
        more = counts - results.iterations(next(iter(named.values())))
        assert row.more == pytest.approx(more.mean())
        assert row.more_low <= row.more <= row.more_high
    assert (table.loc[0, ["more", "more_low", "more_high"]] == 0).all()
    assert table["capped"].iloc[-1] > 0


def test_numbers_save_against_none(small_demos: Demos, tiny: Run) -> None:
    """What n incorrect demonstrations save is against none, over the same seeds and reading."""
    results, _ = tiny
    usual = method_conditions(small_demos, FEW)
    conditions = {
        (n, f): usual["unified-incorrect" if n else "unified", f]
        for n in (0, 9)
        for f in ("printed", "updated")
    }
    table = numbers_table(results, conditions, paper=3.62)
    assert set(table["paper"]) == {3.62}
    assert list(zip(table["number"], table["reading"], strict=True)) == list(conditions)
    for row in table.itertuples():
        counts = results.iterations(conditions[row.number, row.reading])
        saved = results.iterations(conditions[0, row.reading]) - counts
        assert (row.mean, row.saved) == (counts.mean(), saved.mean())
        assert row.low <= row.mean <= row.high
        assert row.saved_low <= row.saved <= row.saved_high
        near = pairs_near(conditions[row.number, row.reading].selected)
        assert (row.pairs, row.leaving) == (near["pairs"], near["leaving"])
    none = table[table["number"] == 0]
    assert (none[["pairs", "saved", "saved_low", "saved_high"]] == 0).all(axis=None)
