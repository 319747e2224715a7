"""Many trials of many conditions, in parallel, each computed once.

Trial k of every condition descends from child k of one root seed, so conditions are compared trial
by trial. A trial's bits depend on its condition and seed alone: not on the number of workers, on
the trials that it is computed with, or on whether it was computed now or read from the store.
"""

from __future__ import annotations

import logging
import os
import threading
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager

import joblib

from replication.progress import SCHEDULER, trial_meter
from replication.trials.compute import compute, trial_key
from replication.trials.condition import Condition
from replication.trials.results import Results
from replication.trials.store import Store


class WorkerError(RuntimeError):
    """A worker computed something else than it was asked for; the message is one line."""


def run_trials(
    conditions: Sequence[Condition],
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
    conditions
        What to run; each gets the same seeds, and equal ones are run once.
    trials
        Trials 0 ... trials - 1 of each condition.
    store
        Where each trial goes as soon as it is finished.
    jobs
        Worker processes. Where the environment variable REPLICATION_SCHEDULER has the address of a
        Dask scheduler, its workers compute instead.
    progress
        Whether to report progress, see :func:`replication.progress.trial_meter`.
    traced
        Whether the traced trial of each condition keeps its snapshots, which take half a megabyte.
    seed
        Root seed.

    Raises
    ------
    WorkerError
        If a worker has other code, or other versions of numpy or numba, than this process.
    """
    conditions = list(
        {trial_key(condition, seed, 0): condition for condition in conditions}.values()
    )
    wanted = {
        trial_key(condition, seed, k, traced=traced): (condition, k)
        for condition in conditions
        for k in range(trials)
    }
    missing = wanted.keys() - store.known(wanted)
    if missing:
        with workers(jobs) as n, trial_meter(len(missing), progress) as report:
            work = joblib.Parallel(n_jobs=n, return_as="generator_unordered")(
                joblib.delayed(compute)(*trial, seed, traced=traced)
                for key, trial in wanted.items()
                if key in missing
            )
            for key, trial in work:
                if key not in missing:
                    raise WorkerError(
                        "a worker runs other code, or other versions of numpy or numba, than this "
                        "process: install the same commit and environment.lock there, and restart "
                        "the workers"
                    )
                store.put([(key, trial)])
                report(1, trial.steps)
    return Results(store, conditions, trials, seed, traced=traced)


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

    # what it logs of workers that come and go would stand in a published notebook
    for name in ("distributed", "distributed.client"):
        logging.getLogger(name).setLevel(logging.ERROR)
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
