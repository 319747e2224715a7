"""The finished trials of some conditions, read from the store."""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from replication.irl import Trial
from replication.trials.compute import compute, trial_key
from replication.trials.condition import Condition
from replication.trials.store import DamagedTrialError, Store


class Results:
    """The trials of some conditions, read from the store when they are asked for."""

    def __init__(
        self,
        store: Store,
        conditions: Sequence[Condition],
        trials: int,
        root: int,
        *,
        traced: bool = True,
    ) -> None:
        self._store = store
        self._root = root
        self._traced = traced
        self.trials = trials
        self.conditions = list(conditions)

    def trial(self, condition: Condition, k: int, *, snapshots: bool = False) -> Trial:
        """Return trial `k` of a condition; one that was damaged in the store is computed again."""
        key = trial_key(condition, self._root, k, traced=self._traced)
        try:
            return self._store.get(key, snapshots=snapshots)
        except DamagedTrialError:
            self._store.drop(key)
            self._store.put(
                compute(condition.agent, [(condition, k)], self._root, traced=self._traced)
            )
            return self._store.get(key, snapshots=snapshots)

    def errors(self, condition: Condition) -> NDArray[np.float64]:
        """Return d of every trial, `[trial, iteration]`; after its end a trial keeps its last d."""
        curves = [self.trial(condition, k).errors for k in range(self.trials)]
        longest = max(map(len, curves))
        return np.array([np.pad(d, (0, longest - len(d)), mode="edge") for d in curves])

    def iterations(self, condition: Condition) -> NDArray[np.int64]:
        """Return the number of iterations of every trial, `[trial]`."""
        return np.array([self.trial(condition, k).iterations for k in range(self.trials)])

    def converged(self, condition: Condition) -> NDArray[np.bool_]:
        """Return whether each trial converged, `[trial]`."""
        return np.array([self.trial(condition, k).converged for k in range(self.trials)])

    def frame(self) -> pd.DataFrame:
        """Return tidy trials, one row for each trial of each condition."""
        rows = []
        for condition in self.conditions:
            for k in range(self.trials):
                trial = self.trial(condition, k)
                rows.append(
                    {
                        "task": condition.demos.task,
                        "method": condition.method,
                        "trial": k,
                        "seed": self._root,
                        "iterations": trial.iterations,
                        "converged": trial.converged,
                        "steps": trial.steps,
                        "choices": condition.choices,
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
