"""Recompute a sample of the published trials from nothing, and hold every number against the files.

A row of a table of trials says which condition it belongs to, its seed and its number. From these
the trial is computed again and measured, and the row that comes out must have the same text.
"""

from __future__ import annotations

import io
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path

import joblib
import numpy as np
import pandas as pd
from numpy.typing import NDArray

from replication.baselines import find_method
from replication.baselines.baseline import Baseline
from replication.evidence import bound, calibration, comparison, limits, rounding, sweep
from replication.evidence.experiments import condition_of
from replication.evidence.tables import csv_text
from replication.files import read_file
from replication.irl import Trial
from replication.trials.compute import compute, trial_key
from replication.trials.condition import Condition
from replication.trials.measures import ALONG, Report, factors, trial_row
from replication.trials.results import digest
from replication.trials.run import workers
from replication.trials.store import DamagedTrialError, Store

DESIGNS: Mapping[str, Callable[[int], Condition]] = {
    rounding.PART: lambda number: list(rounding.conditions().values())[number],
    comparison.PART: lambda number: list(comparison.conditions().values())[number],
    bound.PART: lambda number: list(bound.conditions())[number],
    limits.PART: lambda number: limits.condition_of(limits.settings(number + 1)[number]),
}
"""Returns the condition of a part of a table of trials that has a number there."""


def recompute_trials(
    tables: Mapping[str, Path],
    store: Path,
    *,
    seed: int,
    every: int,
    jobs: int = 1,
    report: Callable[[int], object] = lambda _: None,
) -> Iterator[str]:
    """Recompute a random sample of the trials in each table, and yield what differs.

    A trial is also held against the one in the store, where that has it.

    Parameters
    ----------
    tables
        Files of trials, by what they are called.
    store
        The store's file; it need not exist.
    seed
        Of the sample. Who forges a table must not know it beforehand.
    every
        One trial in so many is recomputed, and at least one of each table.
    jobs
        Worker processes.
    report
        Told how many trials are recomputed.
    """
    read: dict[str, pd.DataFrame] = {}
    for file, path in tables.items():
        try:
            read[file] = _read(path)
        except (OSError, ValueError) as error:
            reason = (str(error).strip().splitlines() or [type(error).__name__])[0]
            yield f"{file} cannot be read: {reason}"
    rows: list[tuple[str, Condition, dict[str, str]]] = []
    samples = sampled([len(trials) for trials in read.values()], seed, every)
    for (file, trials), sample in zip(read.items(), samples, strict=True):
        for at in sample:
            row = dict(zip(trials.columns, trials.iloc[at], strict=True))
            name = f"{file}, row {at + 1}"
            try:
                k, root = _number(row)
                if not 0 <= k < len(trials) or root < 0:
                    raise ValueError("its trial or seed has an impossible number")
                rows.append((name, declared_condition(row), row))
            except (ValueError, LookupError) as error:
                yield f"{name}: no such trial: {error}"
    report(len(rows))
    stored = Store(store) if store.exists() else None
    computed = _compute([(one, *_number(row)) for _, one, row in rows], jobs)
    for name, condition, row in rows:
        k, root = _number(row)
        key = trial_key(condition, root, k, traced=False)
        asked = {"errors": "errors" in row, "path": ALONG[0] in row}
        now = trial_row(condition, Report(), **asked)(computed[key], k, root)
        (text,) = _as_text(pd.DataFrame([now])).to_dict("records")
        columns = {*row, *text} - {"part", "number"}
        if _depends_on_the_processor(condition):
            columns &= {*factors(condition), "trial", "seed", "iterations", "converged"}
        if wrong := sorted(column for column in columns if row.get(column) != text.get(column, "")):
            yield f"{name}: its trial gives another {', '.join(wrong)}"
        if stored is not None and not _agrees(stored, condition, root, k, computed[key]):
            yield f"{store.name}: {name}: the stored trial has other bits"


def _depends_on_the_processor(condition: Condition) -> bool:
    """Return whether another processor may give other bits.

    A method without a loop finds its weights by libraries whose exponentials and sums differ in the
    last bits there, and MWAL multiplies by exponentials. Most measures show it, but hardly the
    number of iterations.
    """
    method = find_method(condition.method)
    return isinstance(method, Baseline) and (method.find is not None or method.name == "mwal")


def sampled(lengths: Sequence[int], seed: int, every: int) -> list[NDArray[np.int64]]:
    """Return the places of one row in so many, drawn at random in each of some tables."""
    return [
        np.sort(np.random.default_rng(child).choice(n, -(-n // every), replace=False))
        for n, child in zip(lengths, np.random.SeedSequence(seed).spawn(len(lengths)), strict=True)
    ]


def _number(row: Mapping[str, str]) -> tuple[int, int]:
    """Return the number and the root seed of a trial."""
    return int(row["trial"]), int(row["seed"])


def _compute(wanted: Sequence[tuple[Condition, int, int]], jobs: int) -> dict[str, Trial]:
    """Compute trials, given as condition, number and root seed; return them by their keys."""
    with workers(jobs) as n:
        # as a list: nobody may use a condition while it is sent to a worker
        return dict(
            joblib.Parallel(n_jobs=n)(
                joblib.delayed(compute)(*trial, traced=False) for trial in wanted
            )
        )


def declared_condition(row: Mapping[str, str]) -> Condition:
    """Return the condition that a row of a table of trials belongs to.

    Raises
    ------
    ValueError, LookupError
        If there is none.
    """
    own = {name: row[name] for name in ("task", "method", "reading", "set")}
    if "part" not in row:
        return condition_of(**own)
    if int(row["number"]) < 0:
        raise LookupError(f"there is no number {row['number']}")
    if row["part"] in calibration.PARTS:
        conditions = [calibration.condition(calibration.points()[int(row["number"])])]
    elif row["part"] in DESIGNS:
        conditions = [DESIGNS[row["part"]](int(row["number"]))]
    else:
        conditions = sweep.conditions_of(row["part"], int(row["number"]))
    for condition in conditions:
        if factors(condition) == own:
            return condition
    raise LookupError(f"{row['part']} {row['number']} has no {' '.join(own.values())}")


def _read(path: Path) -> pd.DataFrame:
    """Return a table of trials as the text that is in it.

    Raises
    ------
    OSError, ValueError
        If it cannot be read, or has no trials.
    """
    trials = pd.read_csv(io.BytesIO(read_file(path)), dtype=str, keep_default_na=False)
    if missing := {"task", "method", "reading", "set", "trial", "seed"} - {*trials.columns}:
        raise ValueError(f"it has no column {min(missing)}")
    if trials.empty:
        raise ValueError("it has no trials")
    return trials


def _as_text(table: pd.DataFrame) -> pd.DataFrame:
    """Return a table as it is read back as text."""
    return pd.read_csv(io.BytesIO(csv_text(table).encode()), dtype=str, keep_default_na=False)


def _agrees(stored: Store, condition: Condition, root: int, k: int, trial: Trial) -> bool:
    """Return whether a store has no such trial, or only one with the same bits."""
    keys = {trial_key(condition, root, k, traced=traced) for traced in (True, False)}
    try:
        return all(digest(stored.get(key)) == digest(trial) for key in stored.known(keys))
    except DamagedTrialError:
        return False
