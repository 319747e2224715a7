"""Recompute a sample of the published trials from nothing, and hold every bit against the files."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from io import BytesIO
from pathlib import Path

import joblib
import pandas as pd

from replication.evidence.experiments import EXPERIMENTS, condition_of
from replication.files import read_file
from replication.trials.compute import compute, trial_key
from replication.trials.results import digest
from replication.trials.run import workers
from replication.trials.store import DamagedTrialError, Store

EVERY = 20
"""One trial in so many is recomputed: 5 %."""

COLUMNS = (
    *("task", "method", "reading", "set", "trial", "seed"),
    *("iterations", "converged", "steps", "digest"),
)
"""The columns of a table of trials that name a trial and what came out."""


def recompute_trials(
    out: Path, store: Path, *, jobs: int = 1, report: Callable[[int], object] = lambda _: None
) -> Iterator[str]:
    """Recompute every 20th trial of each table of trials, and yield what differs.

    A trial is held against the digest of all its bits in the table, and against the trial in the
    store where that has it.

    Parameters
    ----------
    out
        Folder with the folders of the notebooks, some of which hold a trials.csv.
    store
        The store's file; it need not exist.
    jobs
        Worker processes.
    report
        Told how many trials are recomputed.
    """
    rows = []
    for table in sorted(out.glob("*/trials.csv")):
        file = f"{table.parent.name}/{table.name}"
        try:
            sample = sampled_trials(table)
        except (OSError, ValueError, KeyError) as error:
            reason = (str(error).strip().splitlines() or [type(error).__name__])[0]
            yield f"{file} cannot be read: {reason}"
            continue
        for row in sample.itertuples():
            name = f"{file}: {row.method}, {row.reading or '-'}, {row.set}, trial {row.trial}"
            try:
                rows.append((condition_of(row.task, row.method, row.reading, row.set), row, name))
            except (ValueError, KeyError) as error:
                yield f"{name}: no such condition: {error}"
    report(len(rows))
    stored = Store(store) if store.exists() else None
    with workers(jobs) as n:
        work = joblib.Parallel(n_jobs=n, return_as="generator")(
            joblib.delayed(compute)(condition.agent, [(condition, row.trial)], row.seed)
            for condition, row, _ in rows
        )
        for (condition, row, name), ((key, trial),) in zip(rows, work, strict=True):
            now = (trial.iterations, trial.converged, trial.steps)
            if now != (row.iterations, bool(row.converged), row.steps):
                yield f"{name}: {now[0]} iterations and {now[2]} steps, not those there"
            elif digest(trial) != row.digest:
                yield f"{name}: other bits than those there"
            assert key == trial_key(condition, row.seed, row.trial), "a trial has one key"
            if stored is not None and not _agrees(stored, key, digest(trial)):
                yield f"{store.name}: {name}: the stored trial has other bits"


def sampled_trials(table: Path) -> pd.DataFrame:
    """Return every 20th row of a table that belongs to one of the paper's experiments.

    Raises
    ------
    OSError, ValueError, KeyError
        If the file cannot be read, or does not hold numbered trials.
    """
    trials = pd.read_csv(BytesIO(read_file(table)), keep_default_na=False)[list(COLUMNS)]
    trials = trials[trials["task"].isin(list(EXPERIMENTS))]
    sample = trials.iloc[::EVERY].astype({"trial": int, "seed": int})
    if not (sample["trial"].between(0, len(trials) - 1) & (sample["seed"] >= 0)).all():
        raise ValueError("it has a trial or a seed of an impossible number")
    return sample


def _agrees(stored: Store, key: str, expected: str) -> bool:
    """Return whether a store has nothing under a key, or a trial with the expected digest."""
    try:
        return key not in stored or digest(stored.get(key)) == expected
    except DamagedTrialError:
        return False
