"""The finished trials of some conditions, read from the store."""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from typing import Any

from numpy.typing import NDArray

from replication.irl import Trial
from replication.trials.compute import compute, trial_key
from replication.trials.condition import Condition
from replication.trials.store import DamagedTrialError, Store


class Results:
    """The trials of some conditions, read from the store when they are asked for.

    Attributes
    ----------
    conditions, trials, seed
        Trials 0 ... `trials` - 1 of each condition, from this root seed.
    """

    def __init__(
        self,
        store: Store,
        conditions: Sequence[Condition],
        trials: int,
        seed: int,
        *,
        traced: bool = True,
    ) -> None:
        self._store = store
        self._traced = traced
        self.seed = seed
        self.trials = trials
        self.conditions = list(conditions)

    def trial(self, condition: Condition, k: int, *, snapshots: bool = False) -> Trial:
        """Return trial `k` of a condition; one that was damaged in the store is computed again."""
        key = trial_key(condition, self.seed, k, traced=self._traced)
        try:
            return self._store.get(key, snapshots=snapshots)
        except DamagedTrialError:
            self._store.drop(key)
            self._store.put([compute(condition, k, self.seed, traced=self._traced)])
            return self._store.get(key, snapshots=snapshots)


def digest(trial: Trial) -> str:
    """Return a hash of every bit of a trial but its snapshots, which only the traced trial has."""
    parts: list[NDArray[Any]] = [trial.errors, trial.weights, trial.q]
    parts += [trial.collisions, trial.values, trial.rewards]
    parts += [part for episode in trial.episodes for part in episode]
    head = [bool(trial.converged), int(trial.steps), *(part.shape for part in parts)]
    sha256 = hashlib.sha256(repr(head).encode())
    for part in parts:
        sha256.update(part.tobytes())
    # The prefix keeps readers of CSV from taking digits for a number.
    return f"sha256:{sha256.hexdigest()[:16]}"
