"""Trials on a Dask cluster, and into the store: what a second worker brings, what storing costs."""

from __future__ import annotations

import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from replication.evidence.experiments import EXPERIMENTS
from replication.progress import SCHEDULER
from replication.trials.condition import Condition
from replication.trials.run import run_trials
from replication.trials.store import Store

# distributed leaves sockets to the garbage collector
pytestmark = pytest.mark.filterwarnings("ignore")

TRIALS = 40

CLUSTER = """
import sys
from distributed import LocalCluster

if __name__ == "__main__":
    with LocalCluster(
        n_workers=int(sys.argv[1]), processes=True, threads_per_worker=1, host="127.0.0.1",
        dashboard_address="127.0.0.1:0", worker_dashboard_address="127.0.0.1:0",
    ) as cluster:
        print(cluster.scheduler_address, flush=True)
        sys.stdin.read()
"""


@contextmanager
def cluster(workers: int) -> Iterator[str]:
    """Start a scheduler with some worker processes; yield its address."""
    command = [sys.executable, "-c", CLUSTER, str(workers)]
    process = subprocess.Popen(
        command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True
    )
    assert process.stdout is not None
    yield process.stdout.readline().strip()
    process.communicate(timeout=60)  # closes its input, at which it ends


def mazes() -> list[Condition]:
    """Return the conditions of both mazes."""
    return [
        condition
        for task in ("open-maze", "obstacle-maze")
        for condition in EXPERIMENTS[task].conditions().values()
    ]


def seconds(path: Path, trials: int, *, jobs: int = 1) -> float:
    """Return how long trials of every condition take, from an empty store."""
    began = time.perf_counter()
    run_trials(mazes(), trials=trials, store=Store(path), jobs=jobs, seed=1)
    return time.perf_counter() - began


def test_dask_workers(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Print the time that the mazes' trials take one and two Dask workers."""
    found = []
    for workers in (1, 2):
        with cluster(workers) as address:
            monkeypatch.setenv(SCHEDULER, address)
            seconds(tmp_path / f"warm-{workers}.sqlite", 2)
            found.append(seconds(tmp_path / f"{workers}.sqlite", TRIALS))
    one, two = found
    print(f"\none Dask worker {one:.1f} s, two {two:.1f} s ({one / two:.2f} x)")


def test_store(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Print the share of a run of the mazes that is spent in the store."""
    spent = [0.0]

    def timed(name: str) -> None:
        method = getattr(Store, name)

        def call(*given: object) -> object:
            began = time.perf_counter()
            found = method(*given)
            spent[0] += time.perf_counter() - began
            return found

        monkeypatch.setattr(Store, name, call)

    seconds(tmp_path / "warm.sqlite", 2)
    for name in ("__init__", "known", "put"):
        timed(name)
    whole = seconds(tmp_path / "timed.sqlite", TRIALS)
    print(f"\nthe store takes {spent[0]:.2f} s of {whole:.1f} s ({spent[0] / whole:.2%})")
