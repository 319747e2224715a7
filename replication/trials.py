"""Many trials of many settings, in parallel, each computed once.

Trial k of every setting descends from child k of one root seed, so settings are compared trial by
trial. A trial's bits depend on its setting and seed alone: not on the number of workers, on the
trials that it is computed together with, or on whether it was computed now or read from the store.
"""

from __future__ import annotations

import hashlib
import os
import threading
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from typing import Any

import joblib
import numpy as np
import pandas as pd
from numpy.typing import NDArray

from replication.compute import TRACED_TRIAL, compute, trial_key
from replication.irl import Trial
from replication.progress import trial_meter
from replication.setting import Setting
from replication.store import DamagedTrialError, Store
from replication.tasks import Task

__all__ = [
    "TRACED_TRIAL",
    "Results",
    "WorkerError",
    "digest",
    "run_trials",
    "trial_key",
    "workers",
]

SCHEDULER = "REPLICATION_SCHEDULER"
"""Environment variable with the address of a Dask scheduler that trials are sent to."""


class WorkerError(RuntimeError):
    """A worker computed something else than it was asked for; the message is one line."""


class Results:
    """The trials of some settings, read from the store when they are asked for."""

    def __init__(
        self,
        store: Store,
        settings: Sequence[Setting],
        trials: int,
        root: int,
        *,
        traced: bool = True,
    ) -> None:
        self._store = store
        self._root = root
        self._traced = traced
        self.trials = trials
        self.settings = list(settings)

    def trial(self, setting: Setting, k: int, *, snapshots: bool = False) -> Trial:
        """Return trial `k` of a setting; one that was damaged in the store is computed again."""
        key = trial_key(setting, self._root, k, traced=self._traced)
        try:
            return self._store.get(key, snapshots=snapshots)
        except DamagedTrialError:
            self._store.drop(key)
            self._store.put(compute(setting.task, [(setting, k)], self._root, traced=self._traced))
            return self._store.get(key, snapshots=snapshots)

    def errors(self, setting: Setting) -> NDArray[np.float64]:
        """Return d of every trial, `[trial, iteration]`; after its end a trial keeps its last d."""
        curves = [self.trial(setting, k).errors for k in range(self.trials)]
        longest = max(map(len, curves))
        return np.array([np.pad(d, (0, longest - len(d)), mode="edge") for d in curves])

    def iterations(self, setting: Setting) -> NDArray[np.int64]:
        """Return the number of iterations of every trial, `[trial]`."""
        return np.array([self.trial(setting, k).iterations for k in range(self.trials)])

    def converged(self, setting: Setting) -> NDArray[np.bool_]:
        """Return whether each trial converged, `[trial]`."""
        return np.array([self.trial(setting, k).converged for k in range(self.trials)])

    def frame(self) -> pd.DataFrame:
        """Return tidy trials, one row for each trial of each setting."""
        rows = []
        for setting in self.settings:
            for k in range(self.trials):
                trial = self.trial(setting, k)
                rows.append(
                    {
                        "task": setting.demos.task,
                        "method": setting.method,
                        "trial": k,
                        "seed": self._root,
                        "iterations": trial.iterations,
                        "converged": trial.converged,
                        "steps": trial.steps,
                        "choices": setting.choices,
                        "digest": digest(trial),
                    }
                )
        return pd.DataFrame(rows)


def digest(trial: Trial) -> str:
    """Return a hash of every bit of a trial but its snapshots, which only the traced trial has."""
    parts: list[NDArray[Any]] = [trial.errors, trial.weights, trial.q, trial.values]
    parts += [part for episode in trial.episodes for part in episode]
    head = [bool(trial.converged), int(trial.steps), *(part.shape for part in parts)]
    found = hashlib.sha256(repr(head).encode())
    for part in parts:
        found.update(part.tobytes())
    # The prefix keeps readers of CSV from taking digits for a number.
    return f"sha256:{found.hexdigest()[:16]}"


def run_trials(
    settings: Sequence[Setting],
    *,
    trials: int,
    store: Store,
    jobs: int = 1,
    progress: bool | None = None,
    traced: bool = True,
    seed: int,
) -> Results:
    """Compute those trials that the store does not have yet, and return all of them.

    Parameters
    ----------
    settings
        What to run; each gets the same seeds, and equal ones are run once.
    trials
        Trials 0 ... trials - 1 of each setting.
    store
        Where finished trials go, a chunk at a time.
    jobs
        Worker processes. Where the environment variable REPLICATION_SCHEDULER has the address of a
        Dask scheduler, its workers compute instead.
    progress
        Whether to report progress, see :func:`replication.progress.trial_meter`.
    traced
        Whether the traced trial of each setting keeps its snapshots, which take half a megabyte.
    seed
        Root seed.

    Raises
    ------
    WorkerError
        If a worker has other code, or other versions of numpy or numba, than this process.
    """
    settings = list({trial_key(setting, seed, 0): setting for setting in settings}.values())
    missing: dict[Task, list[tuple[Setting, int]]] = {}
    for setting in settings:
        keys = {k: trial_key(setting, seed, k, traced=traced) for k in range(trials)}
        known = store.known(keys.values())
        wanted = [(setting, k) for k, key in keys.items() if key not in known]
        missing.setdefault(setting.task, []).extend(wanted)
    chunks = [
        (task, wanted[at : at + task.together])
        for task, wanted in missing.items()
        for at in range(0, len(wanted), task.together)
    ]
    expected = {
        trial_key(setting, seed, k, traced=traced) for _, wanted in chunks for setting, k in wanted
    }
    if expected:
        with workers(jobs) as n, trial_meter(len(expected), progress) as report:
            work = joblib.Parallel(n_jobs=n, return_as="generator_unordered")(
                joblib.delayed(compute)(task, wanted, seed, traced=traced)
                for task, wanted in chunks
            )
            for finished in work:
                if not expected.issuperset(key for key, _ in finished):
                    raise WorkerError(
                        "a worker runs other code, or other versions of numpy or numba, than this "
                        "process: install the same commit and environment.lock there, and restart "
                        "the workers"
                    )
                store.put(finished)
                report(len(finished), sum(trial.steps for _, trial in finished))
    return Results(store, settings, trials, seed, traced=traced)


@contextmanager
def workers(jobs: int) -> Iterator[int]:
    """Let joblib use processes that end with this one, or the Dask scheduler of the environment.

    Yields
    ------
    int
        The number of jobs for joblib.
    """
    address = os.environ.get(SCHEDULER)
    if not address:
        config = {"backend": "loky", "initializer": _end_with, "initargs": (os.getpid(),)}
        with joblib.parallel_config(**config):
            yield jobs
        return
    from distributed import Client

    with (
        Client(address, set_as_default=False) as client,  # type: ignore[no-untyped-call]
        joblib.parallel_config(backend="dask", client=client),
    ):
        yield -1


def _end_with(parent: int) -> None:
    """Let a worker end soon after the process that started it, even if that was killed."""

    def watch() -> None:
        while os.getppid() == parent:
            time.sleep(1)
        os._exit(1)

    threading.Thread(target=watch, daemon=True).start()
