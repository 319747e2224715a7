"""Prove published results: the files, the environment, and a sample of the trials, recomputed."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Sequence
from importlib import metadata
from pathlib import Path

import joblib
import pandas as pd
from packaging.requirements import Requirement
from packaging.utils import canonicalize_name

from replication.demos.files import load_demos
from replication.evidence.experiments import EXPERIMENTS
from replication.files import PROJECT, resolve
from replication.paper.params import Params
from replication.paper.register import Value, load_choices
from replication.pipeline import cleaning, provenance
from replication.pipeline.notebook import first_line
from replication.pipeline.plan import Run
from replication.trials.compute import compute, trial_key
from replication.trials.condition import Condition
from replication.trials.results import digest
from replication.trials.run import workers
from replication.trials.store import DamagedTrialError, Store

EVERY = 20
"""One trial in so many is recomputed: 5 %."""

COLUMNS = (
    *("task", "method", "trial", "seed"),
    *("iterations", "converged", "steps", "choices", "digest"),
)
"""What a row of trials.csv says."""


def verify_outputs(out: Path) -> Iterator[str]:
    """Yield what is wrong with the outputs of a folder, held against its manifest."""
    manifest = provenance.read_manifest(out)
    if not manifest:
        yield f"{out / provenance.MANIFEST} is missing or cannot be read: nothing can be proved"
    for name, entry in manifest.items():
        for output, how in provenance.damaged(out, entry).items():
            yield f"{output} is {how} since {name} made it"


def verify_inputs(runs: Sequence[Run], out: Path) -> Iterator[str]:
    """Yield what has changed, since they were made, of what the outputs of a folder depend on."""
    manifest = provenance.read_manifest(out)
    for run in runs:
        name = run.notebook.name
        if name in manifest:
            for change in provenance.changes(manifest[name]["inputs"], run.inputs):
                yield f"{name} is stale: {change}"
    for name in cleaning.gone(runs, out):
        yield f"{name} made outputs, and is no notebook of this project any more"


def verify_packages(lock: Path) -> Iterator[str]:
    """Yield how the installed packages differ from those that are pinned in a lock file."""
    for line in lock.read_text(encoding="utf-8").splitlines():
        if not re.match(r"[A-Za-z0-9]", line):
            continue
        pin = Requirement(line.split("\\")[0].strip())
        if pin.marker is not None and not pin.marker.evaluate():
            continue
        name = canonicalize_name(pin.name)
        try:
            installed = metadata.version(name)
        except metadata.PackageNotFoundError:
            yield f"{name} is not installed; the lock pins {pin.specifier}"
            continue
        if not pin.specifier.contains(installed, prereleases=True):
            yield f"{name} {installed} is installed; the lock pins {pin.specifier}"


def verify_trials(
    out: Path,
    store: Path,
    *,
    jobs: int = 1,
    report: Callable[[int], object] = lambda _: None,
) -> Iterator[str]:
    """Recompute every 20th trial of trials.csv from nothing, and yield what differs.

    Every bit of a trial counts: it is held against the digest in the file, and against the trial in
    the store where that has it.

    Parameters
    ----------
    out
        Folder with trials.csv.
    store
        The store's file; it need not exist.
    jobs
        Worker processes.
    report
        Told how many trials are recomputed.
    """
    try:
        sample = sampled_trials(out)
    except (OSError, ValueError, KeyError) as error:
        yield f"trials.csv cannot be read: {first_line(error)}"
        return
    report(len(sample))
    stored = Store(store) if store.exists() else None
    rows = []
    for row in sample.itertuples():
        try:
            rows.append((setting_of(row.task, row.method, row.choices), row))
        except (ValueError, KeyError, IndexError) as error:
            yield f"trials.csv: {row.task}, {row.method}, {row.choices}: no such setting: {error}"
    with workers(jobs) as n:
        work = joblib.Parallel(n_jobs=n, return_as="generator")(
            joblib.delayed(compute)(condition.agent, [(condition, row.trial)], row.seed)
            for condition, row in rows
        )
        for (condition, row), ((key, trial),) in zip(rows, work, strict=True):
            name = f"{row.task}, {row.method}, {row.choices or 'defaults'}, trial {row.trial}"
            ours = (trial.iterations, trial.converged, trial.steps)
            if ours != (row.iterations, row.converged, row.steps):
                yield (
                    f"trials.csv: {name}: {ours[0]} iterations and {ours[2]} steps, not those there"
                )
            elif digest(trial) != row.digest:
                yield f"trials.csv: {name}: other bits than those there"
            assert key == trial_key(condition, row.seed, row.trial), "a trial has one key"
            if stored is not None and not _agrees(stored, key, digest(trial)):
                yield f"{store.name}: {name}: the stored trial has other bits"


def _agrees(stored: Store, key: str, due: str) -> bool:
    """Return whether a store has nothing under a key, or a trial with the digest that is due."""
    try:
        return key not in stored or digest(stored.get(key)) == due
    except DamagedTrialError:
        return False


def sampled_trials(out: Path) -> pd.DataFrame:
    """Return every 20th row of trials.csv that belongs to one of the paper's experiments.

    Raises
    ------
    OSError, ValueError, KeyError
        If the file cannot be read, or does not hold numbered trials.
    """
    trials = pd.read_csv(out / "trials.csv", keep_default_na=False)[list(COLUMNS)]
    sample = trials[trials["task"].isin(list(EXPERIMENTS))].iloc[::EVERY]
    sample = sample.astype({"trial": int, "seed": int})
    if not (sample["trial"].between(0, len(trials) - 1) & (sample["seed"] >= 0)).all():
        raise ValueError("it has a trial or a seed of an impossible number")
    return sample


def setting_of(task: str, method: str, choices: str) -> Condition:
    """Return the condition of a row of trials.csv."""
    values: dict[str, Value] = {}
    for choice in choices.split():
        id, _, value = choice.partition("=")
        entry = load_choices()[id]
        values[entry.field.split(".")[1]] = type(entry.default)(value)
    return Condition(load_demos(resolve(EXPERIMENTS[task].demos)), method, Params.of(**values))


def verify(
    runs: Sequence[Run], out: Path, store: Path, *, jobs: int, echo: Callable[[str], object]
) -> Sequence[str]:
    """Check everything; say what is being done, and return what is wrong."""
    echo(f"hashing the outputs in {out.name} and what they depend on")
    wrong = [*verify_outputs(out), *verify_inputs(runs, out)]
    echo("comparing the installed packages with environment.lock")
    wrong += verify_packages(PROJECT / "environment.lock")
    if (out / "trials.csv").exists():
        wrong += verify_trials(
            out,
            store,
            jobs=jobs,
            report=lambda n: echo(f"recomputing {n} trials, one in {EVERY}"),
        )
    return wrong
