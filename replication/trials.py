"""Many trials of many settings, in parallel, each computed once.

Trial k of every setting descends from child k of one root seed, so settings are compared trial by
trial. A trial's bits depend on its setting and seed alone: not on the number of workers, on the
trials that it is computed together with, or on whether it was computed now or read from the store.
"""

from __future__ import annotations

import hashlib
import json
import os
from collections.abc import Sequence
from typing import Any

import joblib
import numba
import numpy as np
import pandas as pd
from numpy.typing import NDArray
from tqdm import tqdm

from replication.irl import Trial, run
from replication.seeds import trial_seeds
from replication.setting import Setting
from replication.source import source_hash
from replication.store import Store
from replication.tasks import Task

TRACED_TRIAL = 0
"""The one trial of a setting that keeps every iteration, declared beforehand (FIG5-TRIAL)."""


class Results:
    """The trials of some settings, read from the store when they are asked for."""

    def __init__(self, store: Store, settings: Sequence[Setting], trials: int, root: int) -> None:
        self._store = store
        self._root = root
        self.trials = trials
        self.settings = list(settings)

    def trial(self, setting: Setting, k: int, *, snapshots: bool = False) -> Trial:
        """Return trial `k` of a setting."""
        return self._store.get(trial_key(setting, self._root, k), snapshots=snapshots)

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
                    }
                )
        return pd.DataFrame(rows)


def run_trials(
    settings: Sequence[Setting],
    *,
    trials: int,
    store: Store,
    jobs: int = 1,
    progress: bool | None = None,
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
        Worker processes.
    progress
        Whether to draw a bar; None draws it on a terminal, or as REPLICATION_PROGRESS (0 or 1)
        says, by which `replicate run` lets its own terminal decide.
    seed
        Root seed.
    """
    settings = list({trial_key(setting, seed, 0): setting for setting in settings}.values())
    missing: dict[Task, list[tuple[Setting, int]]] = {}
    for setting in settings:
        keys = {k: trial_key(setting, seed, k) for k in range(trials)}
        known = store.known(keys.values())
        wanted = [(setting, k) for k, key in keys.items() if key not in known]
        missing.setdefault(setting.task, []).extend(wanted)
    chunks = [
        (task, wanted[at : at + task.together])
        for task, wanted in missing.items()
        for at in range(0, len(wanted), task.together)
    ]
    work = joblib.Parallel(n_jobs=jobs, return_as="generator_unordered")(
        joblib.delayed(_compute)(task, wanted, seed) for task, wanted in chunks
    )
    total = sum(len(wanted) for _, wanted in chunks)
    if progress is None and "REPLICATION_PROGRESS" in os.environ:
        progress = os.environ["REPLICATION_PROGRESS"] == "1"
    disable = None if progress is None else not progress
    with tqdm(total=total, unit="trial", disable=disable, leave=False) as bar:
        steps = 0
        for finished in work:
            store.put((trial_key(setting, seed, k), trial) for setting, k, trial in finished)
            steps += sum(trial.steps for _, _, trial in finished)
            bar.update(len(finished))
            elapsed = max(bar.format_dict["elapsed"], 1e-9)
            bar.set_postfix_str(f"{steps / elapsed / 1e6:.0f} M steps/s")
    return Results(store, settings, trials, seed)


def _compute(
    task: Task, wanted: list[tuple[Setting, int]], root: int
) -> list[tuple[Setting, int, Trial]]:
    """Compute trials of settings that share a task side by side; runs in a worker."""
    seeds = trial_seeds(root, max(k for _, k in wanted) + 1)
    loops = [setting.trial(seed=seeds[k], keep=k == TRACED_TRIAL) for setting, k in wanted]
    return [(*wanted[at], trial) for at, trial in run(task, loops)]


def trial_key(setting: Setting, root: int, k: int) -> str:
    """Return the hash of all that determines a trial: demos, method, parameters, seed and code."""
    params: dict[str, Any] = setting.params.values()
    del params["incorrect"]  # the selected demonstrations stand for it
    content = {
        "demos": setting.selected_hash,
        "method": setting.method,
        "params": params,
        "seed": [root, k],
        "traced": k == TRACED_TRIAL,
        "source": source_hash("replication.trials"),
        "versions": {"numba": numba.__version__, "numpy": np.__version__},
    }
    return hashlib.sha256(json.dumps(content, sort_keys=True).encode()).hexdigest()
