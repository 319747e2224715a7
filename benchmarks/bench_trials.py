"""Trials in parallel: what a second worker brings, and the memory that many trials take."""

from __future__ import annotations

import resource
import time
from pathlib import Path

from replication import Params, load_demos
from replication.files import PROJECT
from replication.trials.condition import Condition
from replication.trials.run import run_trials
from replication.trials.store import Store


def test_workers_and_memory(tmp_path: Path) -> None:
    """Print steps per second of one and two workers, and peak memory after 50 and 200 trials."""
    demos = load_demos(PROJECT / "data" / "demos" / "open_maze.json")
    condition = Condition(demos, "unified", Params())

    def run(trials: int, jobs: int, name: str) -> tuple[float, float]:
        began = time.perf_counter()
        store = Store(tmp_path / name)
        results = run_trials([condition], trials=trials, store=store, jobs=jobs, seed=1)
        seconds = time.perf_counter() - began
        steps = sum(results.trial(condition, k).steps for k in range(trials))
        peak = max(
            resource.getrusage(who).ru_maxrss / 1024
            for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)
        )
        return steps / seconds / 1e6, peak

    run(2, 2, "warm")
    one, _ = run(100, 1, "one")
    two, small = run(100, 2, "two")
    _, large = run(300, 2, "many")
    print(
        f"\none worker  {one:6.0f} M steps/s\ntwo workers {two:6.0f} M steps/s ({two / one:.2f} x)"
    )
    print(f"peak memory {small:.0f} MB after 100 trials, {large:.0f} MB after 300")
